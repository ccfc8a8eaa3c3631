"""Measures the outline of what a prompt points at, and its confidence, with any segmenter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import MultiPoint
from shapely.geometry.base import BaseGeometry

from ..errors import ToolError
from ..geometry.outline import Outline, distances, outline_of
from .contours import outline_of_mask
from .detectors.candidates import segment_candidate
from .image import Picture
from .referring.attributes import Candidate
from .segmenters.drawn_outline import clipped_to_picture, with_straight_sides
from .segmenters.grabcut_segmenter import visible_vertices
from .segmenters.protocol import PromptKind, Segmenter
from .target_prompt import Point, TargetPrompt

FEW_PX, FEW_SHARE = 4.0, 0.03
"""Deviations from a drawn outline are reported beyond these px and this share of the size."""
MOST_NAMED = 3
"""The most parts that are reported of each kind."""


Deviation = tuple[float, float, float]
"""A point x, y, and its distance from an outline, px."""


@dataclass(frozen=True)
class Measured:
    """An outline in image px, its confidence in [0, 1], and the cues behind that, by name."""

    outline: Outline
    confidence: float
    parts: Mapping[str, float]


def measure_outline(
    picture: Picture, prompt: TargetPrompt, segmenter: Segmenter, candidate: Candidate | None = None
) -> Measured:
    """Measure the outline of the thing pointed at.

    Args:
        picture: the picture on which the prompt was checked.
        prompt: what is pointed at.
        segmenter: makes the mask.
        candidate: the candidate that the prompt names, if it names one.

    Raises:
        ToolError: the segmenter does not take such a prompt; the message says which it takes.
        InputError: the mask is empty or in pieces.
    """
    if prompt.mask is not None:
        return Measured(outline_of(prompt.mask.region), 1.0, {})
    if candidate is not None and candidate.named:
        named = max(candidate.named, key=lambda n: n.score)
        parts = {**named.parts, "detector_score": named.score}
        return Measured(named.outline, named.confidence, parts)
    kinds = _prompt_kinds(prompt, segmenter)
    refused = kinds - segmenter.takes
    if refused:
        takes = _joined_kinds(segmenter.takes, "and")
        raise ToolError(
            f"The segmenter {segmenter.name!r} cannot be pointed with "
            f"{_joined_kinds(refused, 'or')}. It takes {takes}: use that, or another segmenter."
        )
    pixels = picture.pixels
    if candidate is not None:
        by_box = "box" in kinds
        found = segment_candidate(lambda p: segmenter.segment(pixels, p), candidate, by_box=by_box)
        return Measured(*found)
    mask = segmenter.segment(pixels, prompt)
    outline = outline_of_mask(mask.mask)
    if prompt.straight and prompt.outline is not None:
        seen = visible_vertices(prompt.outline, *picture.size)
        outline = clipped_to_picture(with_straight_sides(outline, seen), *picture.size)
    return Measured(outline, mask.confidence, mask.parts)


def unlike_drawn(
    outline: Outline, prompt: TargetPrompt, width: int, height: int
) -> tuple[tuple[Deviation, ...], tuple[Deviation, ...]]:
    """Find where the measured outline differs from the drawn one, in a picture of a size in px.

    Returns:
        What was drawn but not measured, and what was measured but not drawn, the farthest first.
        Parts that a correcting point asked for are not among them. Both are empty if no outline
        was drawn.
    """
    if prompt.outline is None:
        return (), ()
    drawn = shapely.Polygon(prompt.outline) & shapely.box(0, 0, width - 1, height - 1)
    few = max(FEW_PX, FEW_SHARE * outline.size)
    missed = _parts_off(drawn, outline.filled, few, prompt.negative)
    return missed, _parts_off(outline.filled, drawn, few, prompt.points or ())


def _parts_off(
    region: BaseGeometry, other: BaseGeometry, few: float, meant: Sequence[Point]
) -> tuple[Deviation, ...]:
    """Return the farthest point of each part of a region more than `few` px outside another.

    Parts near one of the `meant` points are left out.
    """
    found: list[Deviation] = []
    for part in shapely.get_parts(region - other.buffer(few)):
        corners = shapely.get_coordinates(part)
        if len(corners) and not part.buffer(few).intersects(MultiPoint(meant)):
            away = distances(other, corners)
            k = int(np.argmax(away))
            found.append((float(corners[k, 0]), float(corners[k, 1]), float(away[k])))
    return tuple(sorted(found, key=lambda d: -d[2])[:MOST_NAMED])


def _prompt_kinds(prompt: TargetPrompt, segmenter: Segmenter) -> set[PromptKind]:
    """Return the kinds of prompt it is made of; a candidate counts as an outline, or else a box."""
    kinds: set[PromptKind] = set()
    if prompt.candidate is not None:
        by_box = "box" in segmenter.takes and "outline" not in segmenter.takes
        kinds.add("box" if by_box else "outline")
    if prompt.outline is not None:
        kinds.add("outline")
    if prompt.text is not None:
        kinds.add("text")
    if prompt.box is not None:
        kinds.add("box")
    if prompt.points or prompt.negative:
        kinds.add("points")
    return kinds


def _joined_kinds(kinds: frozenset[PromptKind] | set[PromptKind], last: str) -> str:
    *most, one = sorted(kinds)
    return f"{', '.join(most)} {last} {one}" if most else one
