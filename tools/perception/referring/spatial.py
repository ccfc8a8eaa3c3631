"""Judges where things are, seen from other things: left of, inside, between, beside.

It uses outlines and centres in image pixels (x right, y down), and three values: sure, possible,
no. Pairs of limits are for sure and for possible.
"""

import numpy as np
import shapely
from numpy.typing import NDArray

from ...geometry.outline import FloatArray
from .filters import NO, POSSIBLE, SURE, Filter, IntArray, Things, graded
from .query import RelationKind

APART = 0.02
"""Share of the picture's width or height below which two centres count as level."""
INSIDE = (0.9, 0.5)
"""Share of a thing's area inside the other; outlines are off by a tenth at most."""
ON_MATERIAL = 0.1
"""Share of a thing on a ring's own material above which it is on the ring rather than in it."""
RING = 0.1
"""Share of holes from which a thing is a ring; smaller holes are gaps in an outline."""
AS_LARGE = 0.9
"""A thing larger than this share of the other is the other seen twice, or its frame."""
HELD = 2
"""A thing around this many of the others may be the ground they lie on; one may be its part."""
BESIDE = (1.0, 1.5)
"""Gap in multiples of the other's size (root of its area)."""
ANGLE = (110.0, 90.0)
"""Angle between the two others as seen from a thing, degrees: it is off the line between them by
0.35 of the line's length, and by half of it."""
MIDDLE = 0.1
"""Share of the gap at either end that is beside that end rather than between."""

AXIS: dict[RelationKind, tuple[int, float, str]] = {
    "left_of": (0, -1.0, "left of"),
    "right_of": (0, 1.0, "right of"),
    "above": (1, -1.0, "above"),
    "below": (1, 1.0, "below"),
}
"""By relation: axis of the picture, direction along it, words."""


def relation_filter(things: Things, kind: RelationKind, others: tuple[int, ...]) -> Filter:
    """Judge which things are in a relation to the others (indices).

    The others themselves never are. For nearest, which is a ranking, only they are excluded.
    """
    names = " and ".join(things.candidates[i].id for i in others)
    if kind in AXIS:
        found = _direction_filter(things, kind, others[0], names)
    elif kind == "inside":
        found = _inside_filter(things, others[0], names)
    elif kind == "beside":
        found = _beside_filter(things, others[0], names)
    elif kind == "between":
        found = _between_filter(things, others, names)
    else:
        everything = np.full(len(things.candidates), SURE, dtype=np.int64)
        found = Filter(f"other than {names}", everything, lambda i: "")
    found.degrees[list(others)] = NO
    return found


def ground_filter(things: Things, members: IntArray) -> Filter:
    """Judge whether each thing is one among the members (indices) rather than what they lie on.

    The largest or the middle one of them may or may not be the tray that holds them.
    """
    held = np.zeros(len(things.candidates), dtype=np.int64)
    for i in map(int, members):
        x, y = things.centres[members].T
        x0, y0, x1, y1 = things.boxes[i]
        near = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1) & (members != i)
        if near.sum() >= HELD:
            filled = things.candidates[i].outline.filled
            held[i] = shapely.contains_xy(filled, x[near], y[near]).sum()
    degrees = np.where(held >= HELD, POSSIBLE, SURE).astype(np.int64)
    return Filter(
        "meant",
        degrees,
        lambda i: f"{held[i]} of the others lie within its outline" if degrees[i] < SURE else "",
    )


def _direction_filter(things: Things, kind: RelationKind, other: int, names: str) -> Filter:
    axis, sign, words = AXIS[kind]
    away = things.centres - things.centres[other]
    along, across = sign * away[:, axis], np.abs(away[:, 1 - axis])
    edge = things.boxes[other][axis + 2 if sign > 0 else axis]
    past = sign * (things.centres[:, axis] - edge)
    clear = APART * (things.width, things.height)[axis]
    sure = (past > 0) & (along >= clear) & (along >= across)
    degrees = np.where(sure, SURE, np.where(along > 0, POSSIBLE, NO)).astype(np.int64)

    def explain(i: int) -> str:
        aside = f", but {across[i]:,.0f} px {'up or down' if axis == 0 else 'to a side'}"
        far = f"its centre is {along[i]:,.0f} px {words} that of {names}"
        return far if along[i] >= across[i] else far + aside

    return Filter(f"{words} {names}", degrees, explain)


def _inside_filter(things: Things, other: int, names: str) -> Filter:
    outline = things.candidates[other].outline
    material, filled = things.regions[other], outline.filled
    areas = np.asarray(shapely.area(things.regions), dtype=float)
    share = np.asarray(shapely.area(shapely.intersection(things.regions, filled))) / areas
    degrees = graded(share, INSIDE)
    if things.candidates[other].attributes.hole >= RING:
        on = np.asarray(shapely.area(shapely.intersection(things.regions, material))) / areas
        degrees = np.where(on > ON_MATERIAL, np.minimum(degrees, POSSIBLE), degrees)
    degrees = np.where(areas > AS_LARGE * filled.area, NO, degrees).astype(np.int64)
    return Filter(
        f"inside {names}",
        degrees,
        lambda i: f"{min(share[i], 1.0):.0%} of its area is inside {names}".replace("%", " %"),
    )


def _beside_filter(things: Things, other: int, names: str) -> Filter:
    gaps, size = things.gaps(other), things.candidates[other].outline.size
    filled = things.candidates[other].outline.filled
    inside = shapely.contains(filled, shapely.points(things.centres))
    degrees = np.where(inside, NO, graded(gaps / size, BESIDE)).astype(np.int64)
    return Filter(
        f"beside {names}",
        degrees,
        lambda i: f"{gaps[i]:,.0f} px from {names}, whose size is {size:,.0f} px",
    )


def _between_filter(things: Things, others: tuple[int, ...], names: str) -> Filter:
    points = np.asarray(shapely.points(things.centres), dtype=object)
    to = [_nearest_offsets(points, things.candidates[i].outline.filled) for i in others]
    far = [np.linalg.norm(way, axis=1) for way in to]
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (to[0] * to[1]).sum(axis=1) / (far[0] * far[1])
        share = far[0] / (far[0] + far[1])
    angle = np.degrees(np.arccos(np.clip(np.nan_to_num(cosine, nan=1.0), -1, 1)))
    in_middle = np.abs(np.nan_to_num(share) - 0.5) <= 0.5 - MIDDLE
    degrees: IntArray = graded(angle + 1e-9, ANGLE)
    degrees = np.where(in_middle, degrees, np.minimum(degrees, POSSIBLE)).astype(np.int64)

    def explain(i: int) -> str:
        return (
            f"{far[0][i]:,.0f} and {far[1][i]:,.0f} px from {names}, {angle[i]:.0f} degrees apart"
        )

    return Filter(f"between {names}", degrees, explain)


def _nearest_offsets(points: NDArray[np.object_], region: shapely.Polygon) -> FloatArray:
    """Return the vectors (n, 2) from points (n,) to the nearest point of a region; 0 inside it."""
    lines = shapely.shortest_line(points, region)
    ends = shapely.get_coordinates(lines).reshape(-1, 2, 2)
    return ends[:, 1] - ends[:, 0]
