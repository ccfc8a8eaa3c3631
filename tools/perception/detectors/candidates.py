"""Finds the things that stand out in a picture, without trained weights or labels.

Of many proposals, those that look most like a thing are kept; a part of a thing, or several things
merged into one, give way to the thing itself.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ...errors import InputError
from ...geometry.outline import Outline, outline_of
from ..contours import outline_of_mask
from ..image import Picture
from ..referring.attributes import Candidate
from ..referring.measure_attributes import SIDE, measure_attributes
from ..segmenters.grabcut import Bytes, Floats, Mask, Window, open_window, pieces, resampled
from ..segmenters.protocol import Segmentation
from ..target_prompt import TargetPrompt
from .objectness import Region, scored_regions
from .proposals import CELLS, IN_CELL, proposals

# The score of a thing of full salience, and the least score that is shown to a person.
SURE, LEAST = 1.5, 0.4
# Words are resolved among things at least this salient, or this share as salient as the first.
CLEAR, CLEAR_SHARE = 0.6, 0.62
# Something seen three times or more is likelier to be a thing: its score rises by this factor.
# Sizes are alike up to this logarithm of their ratio, colours up to this distance in the features.
REPEATED, ALIKE_SIZE, ALIKE_COLOUR = 1.15, 0.2, 15.0
# Overlaps (intersection over union) from which two regions show the same thing, likely or surely.
SAME, VERY_SAME = 0.5, 0.85
# A region of which this share lies in another may be a part of it, if they overlap less than this.
NESTED, SAME_NESTED = 0.95, 0.7
# The most regions that are kept: more than a person or a model can look through.
MOST = 80
# A thing that fills this share of a hole is the hole.
FILLS = 0.6
# This share of a part lies in its whole, and its score is at most this many times the whole's.
WITHIN, PART = 0.85, 1.3
# Merged things: each has ground of its own around this share of its edge, together they cover this
# share of the whole, and their mean score is more than this share of the whole's.
OWN_GROUND, COVERED, AS_GOOD = 0.6, 0.6, 0.7
GROUND = 4.0
# A colour is everywhere if this share of the cells holds enough of it, colours within this distance
# being alike. It is met again within a region's size beyond it along this share of the outline.
EVERYWHERE, ALIKE, AGAIN = 0.4, 9.0, 0.6
COARSE, BEYOND = 3, 12
# An outline that is measured again is taken if it overlaps this far with the candidate's.
REFINED = 0.92
# A rough outline has at most 30 vertices, and closes with the first.
MOST_VERTICES = 31
# Masks are smoothed at this many times their size, so that outlines show no staircase.
FINER = 3
# Holes count from this share of the thing if they show the ground: colours within this distance of
# the ground's in more than this share of the hole.
HOLE, SHOWS_GROUND, SHOWN = 0.1, 16.0, 0.4


class StandoutDetector:
    """Detector of things that stand out from their surroundings; it knows no words."""

    name = "standout"

    def detect(self, picture: Picture) -> tuple[Candidate, ...]:
        """See `Detector.detect`."""
        return find_candidates(picture.pixels)


def find_candidates(pixels: Bytes) -> tuple[Candidate, ...]:
    """Find the things in a picture (H, W, 3) RGB, numbered c1, c2, ... by falling salience."""
    height, width = pixels.shape[:2]
    window = open_window(pixels, (0, 0, width, height), SIDE)
    least = LEAST / REPEATED
    regions = [
        r for r in scored_regions(proposals(window.features), window.features) if r.score >= least
    ]
    small = resampled(pixels, (window.shape[1], window.shape[0]))
    found: list[Candidate] = []
    for thing in _whole_objects(_distinct_regions(regions, window.features), window.features):
        outline = _thing_outline(thing, window)
        if outline is not None:
            name = f"c{len(found) + 1}"
            salience = min(thing.score / SURE, 1.0)
            mask, (x, y) = thing.solid, thing.region.proposal.origin
            attributes = measure_attributes(
                outline,
                small[y : y + mask.shape[0], x : x + mask.shape[1]],
                mask,
                area=thing.region.area,
                touches_border=thing.region.borders > 0,
            )
            found.append(Candidate(name, outline, attributes, salience))
    return tuple(found)


def salient_candidates(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return the candidates that words can mean.

    These were found by words, or stand out more than a texture does.
    """
    most = max((c.salience for c in candidates if not c.named), default=0.0)
    least = min(CLEAR, CLEAR_SHARE * most)
    return tuple(c for c in candidates if c.named or c.salience >= least)


def segment_candidate(
    segment: Callable[[TargetPrompt], Segmentation], candidate: Candidate, *, by_box: bool = False
) -> tuple[Outline, float, dict[str, float]]:
    """Measure a candidate's outline again up close.

    The segmenter is prompted with the candidate's outline, or with its box alone; its confidence
    is capped by how far the two agree. If it finds something else, the candidate's own outline
    stays, with the mean of that overlap and the candidate's salience as confidence.

    Returns:
        The outline, its confidence and the cues that it is made of; confidence 0 where the
        segmenter's mask has no outline.
    """
    outline = candidate.outline
    rough = {"box": outline.bounds} if by_box else {"outline": _rough_outline(outline.filled)}
    found = segment(TargetPrompt.model_validate(rough))
    try:
        outline = outline_of_mask(found.mask)
    except InputError:
        return candidate.outline, 0.0, {**found.parts, "candidate_fit": 0.0}
    one, other = outline.polygon, candidate.outline.polygon
    fit = float(one.intersection(other).area / one.union(other).area)
    parts = {**found.parts, "candidate_fit": fit}
    if fit >= REFINED:
        return outline, min(found.confidence, fit), parts
    return candidate.outline, (fit + candidate.salience) / 2, parts


def _rough_outline(polygon: Polygon) -> tuple[tuple[float, float], ...]:
    rough: BaseGeometry = polygon
    tolerance = 0.5
    while shapely.get_num_coordinates(rough) > MOST_VERTICES:
        rough = rough.simplify(tolerance)
        tolerance *= 1.3
    return tuple((float(x), float(y)) for x, y in shapely.get_coordinates(rough)[:-1])


class Thing(NamedTuple):
    """A region, its holes (where the ground shows through), the rest without them, and a score.

    Masks are (h, w), in the region's box.
    """

    region: Region
    holes: tuple[Mask, ...]
    solid: Mask
    score: float


def _shows_ground(region: Region, features: Bytes) -> bool:
    """Return whether a region has the ground's colour: found across the picture and nearby too.

    Bays between lines, squares of a tablecloth and the holes of rings are such regions.
    """
    x, y = region.proposal.origin
    mask = region.proposal.raw
    inside = features[y : y + mask.shape[0], x : x + mask.shape[1]][mask]
    own = np.asarray(np.median(inside, axis=0))
    coarse = features[::COARSE, ::COARSE].astype(np.float32)
    alike = np.asarray(np.linalg.norm(coarse - own, axis=2) < ALIKE, dtype=np.float32)
    cells = cv2.resize(alike, (CELLS, CELLS), interpolation=cv2.INTER_AREA)
    if np.mean(np.asarray(cells) > IN_CELL) < EVERYWHERE:
        return False
    far = (features.shape[1] - 1, features.shape[0] - 1)
    steps = np.linspace(GROUND, 2 * GROUND + math.sqrt(region.area), BEYOND)
    points = region.points + steps[:, None, None] * region.normals
    at = np.rint(points).astype(np.int64).clip(0, far)
    met = np.asarray(features[at[..., 1], at[..., 0]], dtype=np.float64)
    again = np.linalg.norm(met - own, axis=2).min(axis=0) < ALIKE
    # What lies beyond the picture may have any colour, so it does not count.
    seen = np.asarray(((points[-1] >= 0) & (points[-1] <= far)).all(axis=1))
    return bool(seen.any()) and float(np.mean(np.asarray(again)[seen])) > AGAIN


def _distinct_regions(regions: Sequence[Region], features: Bytes) -> list[Region]:
    """Keep the best of the regions that show the same thing, with all their gaps; drop ground."""
    chosen: list[Region] = []
    for region in regions:
        shared = [region.overlap(other) for other in chosen]
        most = max(shared, default=0.0)
        if most >= VERY_SAME:
            k = shared.index(most)
            chosen[k] = chosen[k].with_gaps_of(region)
        elif len(chosen) < MOST and not _shows_ground(region, features):
            close = [c for c, s in zip(chosen, shared, strict=True) if s >= SAME]
            if most < SAME_NESTED and all(_nested(region, c) for c in close):
                chosen.append(region.with_gaps_of(region))
    return chosen


def _nested(one: Region, other: Region) -> bool:
    """Return whether one of two regions lies in the other."""
    return one.shared(other) >= NESTED * min(one.area, other.area)


def _whole_objects(regions: Sequence[Region], features: Bytes) -> list[Thing]:
    """Return the regions that are neither parts of others nor several things merged into one."""
    things: list[Thing] = []
    for region in regions:
        if not _is_merged(region, regions):
            holes = _ground_holes(region, features)
            solid = region.proposal.mask.copy()
            for hole in holes:
                solid &= ~hole
            share = int(np.count_nonzero(solid)) / region.area
            things.append(Thing(region, holes, solid, region.score * share**0.5))
    things = [t._replace(score=t.score * _repetition_factor(t, things, features)) for t in things]
    clear = [t for t in things if t.score >= LEAST]
    filled = [t for t in clear if not any(_is_hole(t, w) for w in clear)]
    kept = [t for t in filled if not any(_is_part(t, w) for w in filled)]
    return sorted(kept, key=lambda t: -t.score)


def _repetition_factor(thing: Thing, things: Sequence[Thing], features: Bytes) -> float:
    """Return REPEATED if two or more others have its size, proportions and colour, else 1."""
    area, colour = np.count_nonzero(thing.solid), _median_colour(thing, features)
    height, width = thing.solid.shape
    alike = 0
    for other in things:
        sizes = np.count_nonzero(other.solid) / area
        sides = np.sort(other.solid.shape) / np.sort((height, width))
        near = np.abs(np.log([sizes, *sides])).max() < ALIKE_SIZE
        if other is not thing and near:
            alike += float(np.linalg.norm(_median_colour(other, features) - colour)) < ALIKE_COLOUR
    return REPEATED if alike >= 2 else 1.0


def _median_colour(thing: Thing, features: Bytes) -> Floats:
    """Return the median colour (3,) of a thing, in features."""
    x, y = thing.region.proposal.origin
    height, width = thing.solid.shape
    inside = features[y : y + height, x : x + width][thing.solid]
    return np.median(inside.astype(np.float32), axis=0)


def _is_hole(thing: Thing, other: Thing) -> bool:
    """Return whether a thing is in fact a hole of another one."""
    if thing is other:  # a wire frame may be nearly all hole
        return False
    return any(
        _lies_within(thing.region, other.region, hole)
        and thing.region.shared(other.region, hole) >= FILLS * int(np.count_nonzero(hole))
        for hole in other.holes
    )


def _is_part(part: Thing, whole: Thing) -> bool:
    """Return whether a thing lies in the body of a larger one with as good a score, or nearly."""
    if PART * whole.score < part.score or part.region.area >= whole.region.area:
        return False
    return _lies_within(part.region, whole.region, whole.solid)


def _lies_within(part: Region, whole: Region, body: Mask) -> bool:
    return part.shared(whole, body) >= WITHIN * part.area


def _is_merged(whole: Region, regions: Sequence[Region]) -> bool:
    """Return whether a region is several things, each with ground of its own around it."""
    parts: list[Region] = []
    for region in sorted(regions, key=lambda r: -r.area):
        smaller = region.area < whole.area
        apart = all(region.shared(p) < (1 - WITHIN) * region.area for p in parts)
        part = smaller and apart and _lies_within(region, whole, whole.proposal.mask)
        if part and _own_ground(region, whole) > OWN_GROUND:
            parts.append(region)
    covered = sum(p.area for p in parts) / whole.area
    if len(parts) < 2 or covered <= COVERED:
        return False
    return float(np.mean([p.score for p in parts])) > AS_GOOD * whole.score


def _own_ground(part: Region, whole: Region) -> float:
    """Return the share of a part's surroundings that does not belong to the whole."""
    return 1 - float(np.mean(whole.holds(part.points + GROUND * part.normals)))


def _thing_outline(thing: Thing, window: Window) -> Outline | None:
    """Return the thing's outline in image px, with its holes; None for a speck."""
    margin = 2
    padded = np.pad(thing.solid, margin).astype(np.float32)
    fine = cv2.resize(padded, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR)
    smooth = np.asarray(cv2.GaussianBlur(fine, (0, 0), 0.8 * FINER)) > 0.5
    contours, _ = cv2.findContours(smooth.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    # The fine mask's pixel centres lie between those of the original; a contour runs through the
    # outermost centres, half a fine pixel inside the edge.
    at = thing.region.proposal.origin
    rings = [
        window.to_picture_points((c[:, 0] + 0.5) / FINER - 0.5 - margin + at) for c in contours
    ]
    shapes = sorted((Polygon(r) for r in rings if len(r) >= 3), key=lambda p: -p.area)
    if not shapes:
        return None
    whole = shapes[0].buffer(0)
    for hole in shapes[1:]:
        whole = whole.difference(hole.buffer(0))
    try:
        return outline_of(whole)
    except InputError:
        return None


def _ground_holes(region: Region, features: Bytes) -> tuple[Mask, ...]:
    """Return the holes, (h, w) each, in a region that show the ground around it."""
    mask, (x, y) = region.proposal.mask, region.proposal.origin
    if not region.gaps:
        return ()
    colours = features[y : y + mask.shape[0], x : x + mask.shape[1]].astype(np.float32)
    far = (features.shape[1] - 1, features.shape[0] - 1)
    beyond = np.rint(region.points + GROUND * region.normals).astype(np.int64).clip(0, far)
    ground = np.median(features[beyond[:, 1], beyond[:, 0]].astype(np.float32), axis=0)
    alike = np.asarray(np.linalg.norm(colours - ground, axis=2) < SHOWS_GROUND)
    holes: list[tuple[float, Mask]] = []
    for gaps in region.gaps:
        labels, areas = pieces(gaps, connectivity=4)
        for i in 1 + np.flatnonzero(areas[1:] >= HOLE * region.area):
            hole = labels == i
            holes.append((float(np.sum(alike[hole] - SHOWN)), hole))
    kept: list[Mask] = []
    # Of alternative holes, prefer the one that shows most ground and little else.
    for evidence, hole in sorted(holes, key=lambda h: -h[0]):
        if evidence > 0 and not any((hole & other).any() for other in kept):
            kept.append(hole)
    return tuple(kept)
