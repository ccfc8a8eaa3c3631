"""Finds the things that stand out in a picture, without trained weights or labels.

Of many proposals those that look most like a thing are kept; a part of a thing, or several things
run together, give way to the thing itself.
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

# The score of a thing as clear as can be, and the least that is shown to a person.
SURE, LEAST = 1.5, 0.4
# Words are decided among things at least this salient, or this share of the most salient one.
CLEAR, CLEAR_SHARE = 0.6, 0.62
# What comes three times or more is likelier a thing: so much its score rises. Alike are sizes to
# this logarithm of their ratio, and colours to this distance in the features.
REPEATED, ALIKE_SIZE, ALIKE_COLOUR = 1.15, 0.2, 15.0
# Regions that share more than this are the same thing.
SAME, VERY_SAME = 0.5, 0.85
# One in another may be a part of it, if it is no more than this much the same.
NESTED, SAME_NESTED = 0.95, 0.7
# More than a person or a model can look through.
MOST = 80
# What fills this share of a hole is the hole.
FILLS = 0.6
# A part lies in its thing by this share, and looks no more like a thing than this many times it.
WITHIN, PART = 0.85, 1.3
# Things run together: each has its own ground around this share of its edge, together they cover
# so much of the whole, and none of them looks much worse than it.
OWN_GROUND, COVERED, AS_GOOD = 0.6, 0.6, 0.7
GROUND = 4.0
# A colour is everywhere where it fills so much of a cell in this share of the cells; it is met
# again within a side's length of a region at this share of its outline.
EVERYWHERE, ALIKE, AGAIN = 0.4, 9.0, 0.6
COARSE, BEYOND = 3, 12
# Measured again, an outline is taken if it overlaps so far with the candidate's.
REFINED = 0.92
# A rough outline has 30 vertices at most, and closes with the first.
MOST_VERTICES = 31
# Masks are smoothed at this many times their size, so that outlines show no stairs.
FINER = 3
# Holes count from this share of the thing, when they show the ground: its colours or nearly.
HOLE, SHOWS_GROUND, SHOWN = 0.1, 16.0, 0.4


class StandoutDetector:
    """What stands out from its surroundings; knows no words."""

    name = "standout"

    def detect(self, picture: Picture) -> tuple[Candidate, ...]:
        """See `Detector.detect`."""
        return find_candidates(picture.pixels)


def find_candidates(pixels: Bytes) -> tuple[Candidate, ...]:
    """The things in a picture (H, W, 3) RGB, numbered c1, c2, ... from the most salient one."""
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
    """Those that words can mean: what was found by words, or stands out more than a texture."""
    most = max((c.salience for c in candidates if not c.named), default=0.0)
    least = min(CLEAR, CLEAR_SHARE * most)
    return tuple(c for c in candidates if c.named or c.salience >= least)


def segment_candidate(
    segment: Callable[[TargetPrompt], Segmentation], candidate: Candidate, *, by_box: bool = False
) -> tuple[Outline, float, dict[str, float]]:
    """Measure a candidate's outline again up close: outline, confidence and the cues it is made of.

    The segmenter is pointed at the candidate's outline, or only its box. Where it finds something
    else, the candidate stays as it was found; its confidence is half how far the two agree, half
    how clearly it stands out.
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
    """A region with its holes (where the ground shows), what is left without them, and a score.

    Masks are (h, w), in the region's box.
    """

    region: Region
    holes: tuple[Mask, ...]
    solid: Mask
    score: float


def _shows_ground(region: Region, features: Bytes) -> bool:
    """Whether a region has the ground's colour: that of most of the picture, also just beyond.

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
    # What lies beyond the picture may be the same colour or not: it does not count.
    seen = np.asarray(((points[-1] >= 0) & (points[-1] <= far)).all(axis=1))
    return bool(seen.any()) and float(np.mean(np.asarray(again)[seen])) > AGAIN


def _distinct_regions(regions: Sequence[Region], features: Bytes) -> list[Region]:
    """The best of all that show the same, with the gaps any of them shows; none that is ground."""
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
    """Whether one of two regions lies in the other."""
    return one.shared(other) >= NESTED * min(one.area, other.area)


def _whole_objects(regions: Sequence[Region], features: Bytes) -> list[Thing]:
    """The regions that are neither parts of others nor several things run together."""
    things: list[Thing] = []
    for region in regions:
        if not _run_together(region, regions):
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
    """REPEATED where two others or more have its size, proportions and colour, else 1."""
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
    """The median colour of a thing, in features."""
    x, y = thing.region.proposal.origin
    height, width = thing.solid.shape
    inside = features[y : y + height, x : x + width][thing.solid]
    return np.median(inside.astype(np.float32), axis=0)


def _is_hole(thing: Thing, other: Thing) -> bool:
    """Whether a thing is as good as a hole of another one."""
    if thing is other:  # a hole may be nearly all that there is of a wire frame
        return False
    return any(
        _lies_within(thing.region, other.region, hole)
        and thing.region.shared(other.region, hole) >= FILLS * int(np.count_nonzero(hole))
        for hole in other.holes
    )


def _is_part(part: Thing, whole: Thing) -> bool:
    """Whether a thing lies in the body of another that looks as good or nearly so."""
    if PART * whole.score < part.score or part.region.area >= whole.region.area:
        return False
    return _lies_within(part.region, whole.region, whole.solid)


def _lies_within(part: Region, whole: Region, body: Mask) -> bool:
    return part.shared(whole, body) >= WITHIN * part.area


def _run_together(whole: Region, regions: Sequence[Region]) -> bool:
    """Whether a region is several things that each stand on the ground themselves."""
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
    """The share of a part's surroundings that does not belong to the whole."""
    return 1 - float(np.mean(whole.holds(part.points + GROUND * part.normals)))


def _thing_outline(thing: Thing, window: Window) -> Outline | None:
    """The thing's outline in image px, holes kept; None for a speck."""
    margin = 2
    padded = np.pad(thing.solid, margin).astype(np.float32)
    fine = cv2.resize(padded, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR)
    smooth = np.asarray(cv2.GaussianBlur(fine, (0, 0), 0.8 * FINER)) > 0.5
    contours, _ = cv2.findContours(smooth.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    # A smoothed picture's pixel centres lie between those it was made of; a contour runs through
    # the outermost centres, half a fine pixel within the edge.
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
    """The holes (h, w) in a region that show the ground around it."""
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
    # Of the ways to see a hole first that which shows most ground, and little else.
    for evidence, hole in sorted(holes, key=lambda h: -h[0]):
        if evidence > 0 and not any((hole & other).any() for other in kept):
            kept.append(hole)
    return tuple(kept)
