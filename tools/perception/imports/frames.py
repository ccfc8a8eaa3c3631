"""Detects outlines from other programs that are not in the frame of the picture as it is shown.

The picture shows which frame fits: colours differ more across a true outline than across the same
outline in another place.
"""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageFilter
from shapely.geometry import box
from shapely.geometry.base import BaseGeometry

from ...geometry.outline import FloatArray
from ..image import Picture

BETTER = 1.6
"""Ratio of contrasts beyond which another frame fits better; on photographs, none had 1.2."""
SURE = 2.5
"""Ratio beyond which it surely does: of outlines drawn where there is no edge, 1 in 30 had more."""
SEEN = 0.75
"""Least share of an outline inside the picture; a thing cut by the border may be drawn whole."""
REACH = 4.0
"""Distance to either side of an outline at which colours are compared, px."""
LONG = 1500
"""Longer side to which a larger picture is about reduced before comparing, px."""
SMALLEST = 100.0
"""Least area of an outline that says anything about another frame, square px."""
FRAMES: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "with rows before columns": lambda p, size: p[:, ::-1],
    "in the picture turned left": lambda p, size: p[:, ::-1] * (-1, 1) + (size[0] - 1, 0),
    "in the picture turned right": lambda p, size: p[:, ::-1] * (1, -1) + (0, size[1] - 1),
    "in the picture upside down": lambda p, size: size - 1 - p,
    "with y upwards": lambda p, size: p * (1, -1) + (0, size[1] - 1),
    "in the picture mirrored": lambda p, size: p * (-1, 1) + (size[0] - 1, 0),
    "normalised, from 0 to 1": lambda p, size: p * size,
    "in percent": lambda p, size: p * size / 100,
    "in a picture twice as large": lambda p, size: p / 2,
    "in a picture half as large": lambda p, size: p * 2,
}
"""Frames that other programs write, and the maps of points (n, 2) to ours, given the size, px."""


def likeliest_frame(picture: Picture, rings: Sequence[FloatArray]) -> tuple[str, float]:
    """Return the other frame that outlines would fit best, and how many times better than ours.

    Args:
        picture: the picture that the outlines are for.
        rings: the outlines, (n, 2) each, that do not cross themselves.
    """
    step = max(max(picture.size) // LONG, 1)
    shown = Image.fromarray(np.ascontiguousarray(picture.pixels[::step, ::step]))
    pixels = np.asarray(shown.filter(ImageFilter.GaussianBlur(1.5)), dtype=float)
    size = np.asarray(picture.size, dtype=float)
    fit = {
        name: _contrast(pixels, [move(r, size) / step for r in rings], SMALLEST)
        for name, move in FRAMES.items()
    }
    best = max(fit, key=fit.__getitem__)
    here = _contrast(pixels, [r / step for r in rings], 0.0)
    return best, fit[best] / max(here, float(pixels.std()) / 2, 1e-9)


def is_seen(region: BaseGeometry, size: FloatArray) -> bool:
    """Return whether a region lies in a picture of a size, apart from what the border may cut."""
    return region.intersection(box(0, 0, *size)).area >= SEEN * region.area


def _contrast(pixels: NDArray[np.floating], rings: Sequence[FloatArray], smallest: float) -> float:
    """Return the mean colour difference across outlines.

    It is 0 if one of them is not in the picture, or has less than `smallest` square px.
    """
    size = np.array(pixels.shape[1::-1], dtype=float)
    if not all(is_seen(p, size) and p.area >= smallest for p in map(shapely.Polygon, rings)):
        return 0.0
    found = [0.0]
    for line in map(shapely.LinearRing, rings):
        along = np.arange(0, line.length, 3.0)
        here, there = (
            shapely.get_coordinates(shapely.line_interpolate_point(line, (along + d) % line.length))
            for d in (0, 0.5)
        )
        across = (there - here)[:, ::-1] * (-1, 1)
        across *= REACH / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        sides = (np.clip(np.rint(here + w * across), 0, size - 1).astype(int) for w in (1, -1))
        one, other = (pixels[side[:, 1], side[:, 0]] for side in sides)
        found += np.linalg.norm(one - other, axis=1).tolist()
    return float(np.mean(found))
