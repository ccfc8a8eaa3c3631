"""Adds the candidates that a noun phrase names to those found before, with a network.

Nothing is chosen here: all come back with ids, and are compared like all other candidates.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from .contours import outline_of_mask
from .detection import Detection, Finder
from .image import Picture
from .referring.attributes import Candidate, Naming
from .referring.measure_attributes import candidate_of
from .segmenters.mask_scores import MOST
from .segmenters.protocol import Segmenter
from .target_prompt import TargetPrompt, box_problems

SAME = 0.7
"""Least overlap (intersection over union) of two masks of the same thing."""
MOST_NAMED = 60
"""The most things that one phrase can name, the surest first; a question shows fewer."""


def with_named(
    candidates: Sequence[Candidate],
    picture: Picture,
    phrase: str,
    finder: Finder,
    segmenter: Segmenter,
) -> tuple[Candidate, ...]:
    """Return the candidates and, under the next ids, the further things that a phrase names.

    Something that is already among the candidates keeps its id and outline, and gets the naming.

    Args:
        candidates: those found so far.
        picture: the picture to search.
        phrase: see `Finder.find`.
        finder: finds the things.
        segmenter: makes the masks where the finder makes none.
    """
    if not np.ptp(picture.pixels, axis=(0, 1)).any():
        return tuple(candidates)  # a blank picture shows nothing, whatever a network says
    known = list(candidates)
    for detection in finder.find(picture.pixels, phrase)[:MOST_NAMED]:
        naming = _naming(picture, phrase, detection, segmenter)
        if naming is None:
            continue
        overlaps = [_overlap(c, naming) for c in known]
        same = int(np.argmax(overlaps)) if overlaps else 0
        if not overlaps or overlaps[same] < SAME:
            new = candidate_of(f"c{len(known) + 1}", naming.outline, picture, naming.score)
            known.append(replace(new, named=(naming,)))
        elif not known[same].as_named(phrase):  # otherwise the same thing was found twice
            known[same] = replace(known[same], named=(*known[same].named, naming))
    return tuple(known)


def _naming(
    picture: Picture, phrase: str, detection: Detection, segmenter: Segmenter
) -> Naming | None:
    """Return a detection with its outline; None if it has none, or covers nearly the picture."""
    mask = detection.mask
    if mask is None:
        if box_problems(detection.box, *picture.size) or _covers(detection, picture):
            return None
        mask = segmenter.segment(picture.pixels, TargetPrompt(box=detection.box))
    try:
        outline = outline_of_mask(mask.mask)
    except InputError:
        return None
    confidence = min(mask.confidence, detection.most)
    return Naming(phrase, detection.score, outline, confidence, mask.parts)


def _covers(detection: Detection, picture: Picture) -> bool:
    x0, y0, x1, y1 = detection.box
    return (x1 - x0) * (y1 - y0) > MOST * picture.width * picture.height


def _overlap(candidate: Candidate, naming: Naming) -> float:
    regions = [candidate.outline.polygon, *(n.outline.polygon for n in candidate.named)]
    mine = naming.outline.polygon
    return max(r.intersection(mine).area / r.union(mine).area for r in regions)
