"""Measures the outline of what a prompt points at, with its confidence, by any segmenter."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import ToolError
from ..geometry.outline import Outline, distances
from .contours import outline_of_mask
from .detectors.candidates import segment_candidate
from .image import Picture
from .referring.attributes import Candidate
from .segmenters.drawn_outline import clipped_to_picture, with_straight_sides
from .segmenters.grabcut_segmenter import visible_vertices
from .segmenters.protocol import PromptKind, Segmenter
from .target_prompt import Point, TargetPrompt

MISSED = 0.06
"""Rough outlines are off by up to this share of the thing's size."""


@dataclass(frozen=True)
class Measured:
    """An outline in image px, its confidence in [0, 1], and the cues it is made of, by name."""

    outline: Outline
    confidence: float
    parts: Mapping[str, float]


def measure_outline(
    picture: Picture, prompt: TargetPrompt, segmenter: Segmenter, candidate: Candidate | None = None
) -> Measured:
    """The outline of the thing pointed at.

    Args:
        picture: the prompt was checked on.
        candidate: the one that the prompt names, if it names one.

    Raises:
        ToolError: the segmenter does not take such a prompt; the text says which it takes.
        InputError: the mask is empty or in pieces.
    """
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


def missed_vertices(outline: Outline, prompt: TargetPrompt) -> tuple[Point, ...]:
    """Vertices drawn that what was measured leaves out by more than a rough outline is off."""
    drawn = np.asarray(prompt.outline or (), dtype=float).reshape(-1, 2)
    away = distances(outline.filled, drawn) > MISSED * outline.size
    return tuple((float(x), float(y)) for x, y in drawn[away])


def _prompt_kinds(prompt: TargetPrompt, segmenter: Segmenter) -> set[PromptKind]:
    """The kinds of prompt it is made of; a candidate is pointed at by outline, or else by box."""
    kinds: set[PromptKind] = set()
    if prompt.candidate is not None:
        by_box = "box" in segmenter.takes and "outline" not in segmenter.takes
        kinds.add("box" if by_box else "outline")
    if prompt.outline is not None:
        kinds.add("outline")
    if prompt.box is not None:
        kinds.add("box")
    if prompt.points or prompt.negative:
        kinds.add("points")
    return kinds


def _joined_kinds(kinds: frozenset[PromptKind] | set[PromptKind], last: str) -> str:
    *most, one = sorted(kinds)
    return f"{', '.join(most)} {last} {one}" if most else one
