"""The segmenters by name: a prompt and a picture go in, a mask and its confidence come out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from ...errors import InputError
from ...geometry.outline import largest_part
from ..target_prompt import Point, TargetPrompt
from .drawn_outline import segment_mended
from .segment import Segmentation, segment_box, segment_points

Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class Segmenter:
    """A way to make masks, with the confidence below which it is not believed.

    Attributes:
        thresholds: t per way of pointing (point, box, outline, candidate). Points mean parts as
            often as wholes, so only the clearest are taken; drawn outlines are mostly right.
    """

    name: str
    run: Callable[[Pixels, TargetPrompt], Segmentation]
    thresholds: dict[str, float]


def segmenter_named(name: str) -> Segmenter:
    """Look a segmenter up.

    Raises:
        InputError: there is none of that name; the text lists those there are.
    """
    if name not in SEGMENTERS:
        raise InputError(f"Unknown segmenter {name!r}. There are: {', '.join(SEGMENTERS)}.")
    return SEGMENTERS[name]


def visible_vertices(outline: Sequence[Point], width: int, height: int) -> list[Point]:
    """The vertices of what lies in the picture of an outline that was drawn."""
    frame = Polygon([(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)])
    visible = largest_part(Polygon(outline).intersection(frame))
    assert visible is not None  # TargetPrompt.problems was asked before
    return [(float(x), float(y)) for x, y in visible.exterior.coords[:-1]]


def _grabcut(pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
    height, width = pixels.shape[:2]
    positive, negative = prompt.points or (), prompt.negative
    if prompt.outline is not None:
        vertices = visible_vertices(prompt.outline, width, height)
        return segment_mended(pixels, vertices, positive=positive, negative=negative)
    if prompt.box is not None:
        x0, y0, x1, y1 = prompt.box
        box = (max(x0, 0.0), max(y0, 0.0), min(x1, width - 1.0), min(y1, height - 1.0))
        return segment_box(pixels, box, positive=positive, negative=negative)
    return segment_points(pixels, positive, negative=negative)


SEGMENTERS = {
    "grabcut": Segmenter(
        "grabcut", _grabcut, {"point": 0.82, "box": 0.6, "outline": 0.55, "candidate": 0.55}
    )
}
