"""Whether annotations are of their picture, in its frame: px as it is shown, x right, y down.

Outlines of another frame are refused with the frame that fits. Which one does is seen in the
picture: across a true outline colours differ more than across the same one somewhere else.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageFilter
from shapely.geometry import Polygon, box

from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray
from ...tools.perception.image import load_picture

BETTER = 1.6
"""Times the contrast across outlines by which another frame fits; on photographs none had 1.2."""
SEEN = 0.75
"""Least share of an outline that lies in the picture; what its border cuts may be drawn whole."""
REACH = 4.0
"""How far to either side of an outline colours are compared, px."""
SMALLEST = 100.0
"""Square px of an outline that says anything of another frame."""
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
"""Frames that other programs write, and what takes (n, 2) points and the picture's size to ours."""


def check_frame(entry: dict[str, Any], folder: Path) -> None:
    """Hold an entry of annotations against its picture.

    Raises:
        InputError: another picture or size, an outline that crosses itself, or another frame.
    """
    name, things = entry["image"], entry["objects"]
    picture = load_picture(folder / name)
    if entry.get("sha256", picture.sha256) != picture.sha256:
        raise InputError(f"{name} is another picture than the annotated one: its sha256 differs.")
    if (annotated := (entry["width"], entry["height"])) != picture.size:
        raise InputError(
            f"{name} is annotated as {annotated[0]} x {annotated[1]} px, but is shown with "
            f"{picture.width} x {picture.height} px (EXIF orientation applied); annotate that."
        )
    rings = [np.asarray(thing["polygon"], dtype=float) for thing in things]
    for thing, ring in zip(things, rings, strict=True):
        if not all(Polygon(r).is_valid for r in (ring, *thing.get("holes", ()))):
            raise InputError(
                f"The outline of {thing['id']} in {name} crosses itself; give its points in order "
                "around the thing."
            )
    size = np.asarray(picture.size, dtype=float)
    soft = Image.fromarray(picture.pixels).filter(ImageFilter.GaussianBlur(1.5))
    pixels = np.asarray(soft, dtype=float)
    fit = {n: _contrast(pixels, [f(r, size) for r in rings], SMALLEST) for n, f in FRAMES.items()}
    best = max(fit, key=fit.__getitem__)
    fits = fit[best] > BETTER * max(_contrast(pixels, rings, 0.0), float(pixels.std()) / 2)
    outside = [t["id"] for t, ring in zip(things, rings, strict=True) if not _is_seen(ring, size)]
    if outside or fits:
        what = f"of {', '.join(outside)} lie outside" if outside else "do not follow things in"
        raise InputError(
            f"Outlines {what} {name}, {picture.width} x {picture.height} px"
            f"{f'; they would fit {best}' if fits else ''}. Give x, y in px as it is shown."
        )


def _is_seen(ring: FloatArray, size: FloatArray) -> bool:
    region = Polygon(ring)
    return region.intersection(box(0, 0, *size)).area >= SEEN * region.area


def _contrast(pixels: NDArray[np.floating], rings: Sequence[FloatArray], smallest: float) -> float:
    """Mean difference of colour across outlines; 0 where one is not seen, or smaller, px^2."""
    size = np.array(pixels.shape[1::-1], dtype=float)
    if not all(_is_seen(ring, size) and Polygon(ring).area >= smallest for ring in rings):
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
