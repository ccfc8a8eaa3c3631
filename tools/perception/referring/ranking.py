"""Ranks things by a superlative: the winner, the numbers behind it, and those too close to call."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.outline import FloatArray
from .filters import IntArray, Things
from .query import Pick

BoolArray = NDArray[np.bool_]

AREA_RATIO = 1.15
"""Least ratio of areas that counts: outlines of equal things differ by a tenth in area."""
LENGTH_RATIO = 1.15
"""Least ratio of lengths that counts, as for areas; and part of a stick is easily hidden."""
LONGISH, LONGER_BUILT = 1.5, 1.5
"""A thing less elongated than LONGISH is not clearly longer than one that is LONGER_BUILT times as
elongated."""
ROUNDER = 0.05
"""Least difference in roundness that counts: that of a traced disc varies by as much."""
LIGHTER = 8.0
"""Least difference in L* that counts: people see it in things that are not side by side."""
APART = 0.02
"""Least distance of two places that people tell apart, as a share of the width or height."""
EDGE_APART = 0.01
"""The same for edges: the winner's outline must be ahead too, not its centre alone."""
CORNER_APART = 0.04
"""The same as a share of the diagonal: people judge distances to a corner or centre loosely."""
MIDDLE_REACH = 0.1
"""Share of the diagonal within which a thing is in the picture's middle wherever others are."""
NEARER = 1.2
"""Least ratio of two distances that people tell apart."""
ALONE = (1.6, 1.25)
"""Ratios of distances to the nearest neighbour: clearly alone, and below which nothing is alone."""
GAP_NOISE = 0.003
"""Error of distances between outlines, as a share of the picture's longer side."""

CORNERS = {
    "upper_left": (0, 0),
    "upper_right": (1, 0),
    "lower_left": (0, 1),
    "lower_right": (1, 1),
}
SIDES = {"leftmost": (0, 1), "rightmost": (0, -1), "topmost": (1, 1), "bottommost": (1, -1)}


@dataclass(frozen=True)
class Ranked:
    """The outcome of a pick.

    Attributes:
        contenders: indices of things, the winner first, then all that are not clearly behind or
            ahead of it; empty if nothing qualifies.
        reasons: each contender's numbers, as a short sentence.
        doubt: why the winner does not win clearly; empty if it does.
    """

    contenders: tuple[int, ...]
    reasons: dict[int, str]
    doubt: str


@dataclass(frozen=True)
class Measure:
    """Numbers of m things on one scale.

    Attributes:
        values: (m,), larger ranks first.
        ahead: (m, m), whether the row's thing is clearly ahead of the column's.
        noun: what is measured: "area".
        adjective: the word for "almost equally ...".
        shown: the numbers with their units.
    """

    values: FloatArray
    ahead: BoolArray
    noun: str
    adjective: str
    shown: list[str]


def rank(things: Things, members: IntArray, pick: Pick) -> Ranked:
    """Decide a pick among members (ascending indices of things), except for oddness."""
    return _ranked_at(things, members, _measure(things, members, pick.by), pick.place)


def rank_nearest(things: Things, members: IntArray, other: int) -> Ranked:
    """Decide which member is nearest to another thing, by the distance of their edges."""
    gaps, name = things.gaps(other)[members], things.candidates[other].id
    ahead = _clearly_nearer(gaps, _distance_noise(things), NEARER)
    measure = Measure(-gaps, ahead, f"distance to {name}", f"near to {name}", _pixels(gaps))
    return _ranked_at(things, members, measure, 1)


def _ranked_at(things: Things, members: IntArray, measure: Measure, place: int) -> Ranked:
    if place > len(members):
        count = (
            f"is only {len(members)} thing" if len(members) == 1 else f"are {len(members)} things"
        )
        return Ranked((), {}, f"there {count} to pick from, so there is no place {place}")
    order = np.lexsort((np.arange(len(members)), -measure.values))
    winner = int(order[place - 1])
    apart = measure.ahead[winner] | measure.ahead[:, winner]
    close = [int(j) for j in order if not apart[j] and j != winner]
    contenders = (winner, *close)
    ids = [things.candidates[int(members[i])].id for i in range(len(members))]
    reasons = {
        int(members[i]): _rank_reason(measure, order, place, i, winner, ids[winner])
        for i in contenders
    }
    doubt = ""
    if close:
        shown = ", ".join(f"{ids[i]} {measure.shown[i]}" for i in contenders[:4])
        more = f" and {len(contenders) - 4} more" if len(contenders) > 4 else ""
        number = "two" if len(contenders) == 2 else len(contenders)
        doubt = f"{number} things are almost equally {measure.adjective}: {shown}{more}"
    return Ranked(tuple(int(members[i]) for i in contenders), reasons, doubt)


def _rank_reason(
    measure: Measure, order: IntArray, place: int, index: int, winner: int, winner_id: str
) -> str:
    own = f"{measure.noun} {measure.shown[index]}"
    if index != winner:
        return f"{own}, {winner_id} {measure.shown[winner]}"
    before = f", the one before {measure.shown[int(order[place - 2])]}" if place > 1 else ""
    after = f", the next {measure.shown[int(order[place])]}" if place < len(order) else ""
    return f"{own}{before}{after}"


def _measure(things: Things, members: IntArray, by: str) -> Measure:
    if by in SIDES:
        return _side_measure(things, members, by)
    if by in CORNERS:
        return _corner_measure(things, members, by)
    other: dict[str, Callable[[Things, IntArray], Measure]] = {
        "largest": lambda t, m: _area_measure(t, m, 1),
        "smallest": lambda t, m: _area_measure(t, m, -1),
        "longest": _length_measure,
        "roundest": _roundest,
        "lightest": lambda t, m: _lightness(t, m, 1),
        "darkest": lambda t, m: _lightness(t, m, -1),
        "middle": _centrality,
        "farthest_from_border": lambda t, m: _border_distance(t, m, 1),
        "nearest_to_border": lambda t, m: _border_distance(t, m, -1),
        "alone": _isolation,
    }
    return other[by](things, members)


def _ahead_by(values: FloatArray, margin: float) -> BoolArray:
    """Return whether each row is ahead of each column by a margin, up to rounding, (m, m)."""
    return values[:, None] - values[None] >= margin - 1e-9


def _pixels(values: FloatArray) -> list[str]:
    return [f"{v:,.0f} px" for v in values]


def _distance_noise(things: Things) -> float:
    return GAP_NOISE * max(things.width, things.height)


def _clearly_nearer(gaps: FloatArray, noise: float, ratio: float) -> BoolArray:
    """Return whether each row's distance is clearly less than each column's, (m, m)."""
    return (gaps[None] >= ratio * gaps[:, None] - 1e-9) & (gaps[None] - gaps[:, None] >= noise)


def _area_measure(things: Things, members: IntArray, sign: int) -> Measure:
    areas = things.areas[members]
    ahead = _ahead_by(sign * np.log(areas), np.log(AREA_RATIO))
    return Measure(sign * areas, ahead, "area", "large" if sign > 0 else "small", _pixels(areas))


def _length_measure(things: Things, members: IntArray) -> Measure:
    lengths = np.array([things.candidates[int(i)].outline.long_axis[1] for i in members])
    built = things.each(lambda a: a.elongation)[members]
    ahead = _ahead_by(np.log(lengths), np.log(LENGTH_RATIO))
    # A plate may be longer than a pencil, yet the pencil be meant.
    ahead &= (built[:, None] >= LONGISH) | (built[None] < LONGER_BUILT * built[:, None])
    return Measure(lengths, ahead, "length", "long", _pixels(lengths))


def _roundest(things: Things, members: IntArray) -> Measure:
    values = things.each(lambda a: a.roundness)[members]
    shown = [f"{v:.2f}" for v in values]
    return Measure(values, _ahead_by(values, ROUNDER), "roundness", "round", shown)


def _lightness(things: Things, members: IntArray, sign: int) -> Measure:
    light = things.labs[members, 0]
    shown = [f"L* {v:.0f}" for v in light]
    adjective = "light" if sign > 0 else "dark"
    return Measure(sign * light, _ahead_by(sign * light, LIGHTER), "lightness", adjective, shown)


def _side_measure(things: Things, members: IntArray, by: str) -> Measure:
    axis, sign = SIDES[by]
    side = (things.width, things.height)[axis]
    centre = things.centres[members, axis]
    edge = things.boxes[members, axis if sign > 0 else axis + 2]
    ahead = _ahead_by(-sign * centre, APART * side) & _ahead_by(-sign * edge, EDGE_APART * side)
    name = "xy"[axis]
    shown = [f"{name} {v:,.0f} px" for v in centre]
    adjective = "far to the " + by.removesuffix("most")
    return Measure(-sign * centre, ahead, "centre at", adjective, shown)


def _corner_measure(things: Things, members: IntArray, by: str) -> Measure:
    at = np.array(CORNERS[by]) * (things.width - 1, things.height - 1)
    name = f"the {by.replace('_', ' ')} corner"
    far = np.linalg.norm(things.centres[members] - at, axis=1)
    ahead = _ahead_by(-far, CORNER_APART * float(np.hypot(things.width, things.height)))
    return Measure(-far, ahead, f"distance to {name}", f"near to {name}", _pixels(far))


def _centrality(things: Things, members: IntArray) -> Measure:
    at = np.array([things.width - 1, things.height - 1]) / 2
    diagonal = float(np.hypot(things.width, things.height))
    centres = things.centres[members]
    far = np.linalg.norm(centres - at, axis=1)
    ahead = _ahead_by(-far, CORNER_APART * diagonal)
    if len(members) >= 3:
        # The middle one of a row at one side of the picture may be meant as well.
        among = np.linalg.norm(centres - centres.mean(axis=0), axis=1)
        off = (far > MIDDLE_REACH * diagonal)[:, None]
        ahead &= ~(off & _ahead_by(among, 1e-6))
    noun = "distance to the picture's centre"
    return Measure(-far, ahead, noun, "near to the middle", _pixels(far))


def _border_distance(things: Things, members: IntArray, sign: int) -> Measure:
    boxes = things.boxes[members]
    beyond = np.array([things.width - 1, things.height - 1]) - boxes[:, 2:]
    gaps = np.maximum(np.minimum(boxes[:, :2], beyond).min(axis=1), 0)
    ahead = _ahead_by(sign * gaps, APART * min(things.width, things.height))
    adjective = "far from the border" if sign > 0 else "near to the border"
    return Measure(sign * gaps, ahead, "distance to the border", adjective, _pixels(gaps))


def _isolation(things: Things, members: IntArray) -> Measure:
    gaps = np.array([_neighbour_distance(things, members, int(i)) for i in members], dtype=float)
    ahead = _clearly_nearer(gaps, _distance_noise(things), ALONE[0]).T
    clear = np.sort(gaps)[::-1]
    nobody = len(clear) > 1 and clear[0] < ALONE[1] * clear[1]
    adjective = "far from the others, so none stands alone" if nobody else "far from the others"
    return Measure(gaps, ahead, "nearest neighbour at", adjective, _pixels(gaps))


def _neighbour_distance(things: Things, members: IntArray, index: int) -> float:
    """Return the edge-to-edge distance to the nearest other member, px; the diagonal if none."""
    others = members[members != index]
    box, boxes = things.boxes[index], things.boxes[others]
    apart = np.maximum(0, np.maximum(boxes[:, :2] - box[2:], box[:2] - boxes[:, 2:]))
    least = np.hypot(apart[:, 0], apart[:, 1])  # no two outlines are nearer than their boxes
    nearest = float(np.hypot(things.width, things.height))
    for k in np.argsort(least, kind="stable"):
        if least[k] >= nearest:
            break
        nearest = min(nearest, things.gap(index, int(others[k])))
    return nearest
