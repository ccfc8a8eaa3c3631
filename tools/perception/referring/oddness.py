"""Finds the odd one out: what differs in one way from things that are alike in the others.

The picture may hold other things as well, so each thing is compared with those it resembles; an
odd one must lie well outside the spread of its group.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...geometry.outline import FloatArray
from .attributes import Attributes, ShapeName
from .filters import IntArray, Things, listed
from .query import Oddness
from .ranking import Ranked

BoolArray = NDArray[np.bool_]
Aspect = Literal["colour", "size", "shape", "orientation"]


@dataclass(frozen=True)
class Limits:
    """When things count as different in an aspect, in the aspect's unit.

    Attributes:
        differs: least distance that is a difference at all.
        spreads: least ratio of that distance to the group's own spread.
        spread: greatest distance of a group's members from its most typical one.
    """

    differs: float
    spreads: float
    spread: float


LIMITS: dict[Aspect, Limits] = {
    "colour": Limits(18.0, 2.5, 25.0),  # CIE76; 18 is red to orange-red; leaves spread by 15
    "size": Limits(float(np.log(1.5)), 2.5, float(np.log(1.4))),  # log ratio of areas
    "shape": Limits(1.0, 2.5, 0.6),  # in the units below
    "orientation": Limits(12.0, 3.0, 15.0),  # degrees; things set down by hand differ by a few
}
ALIKE_SIZE = float(np.log(1.7))
"""Log ratio of areas up to which things are alike, as some are farther from the camera."""
UNITS = {"roundness": 0.12, "elongation": float(np.log(1.3)), "fits": 0.12, "hole": 0.12}
"""Differences that each alone make another shape; a disc and a hexagon differ by half of each."""
OTHER_SHAPE, SHAPE_LEAD = 0.5, 0.03
"""Distance added if both fit their own best shape better than the other's by more than noise."""
ROUND, ROUND_ELONGATION = 0.88, 1.15
"""Something as round as this has no orientation."""
ELONGATED = 1.25
"""Elongation below which any side of the rectangle may be its long one."""
TURNS: dict[ShapeName, float] = {"triangle": 60.0, "hexagon": 60.0, "pentagon": 36.0, "star": 36.0}
"""Degrees after which the rectangle around a regular shape may look the same; 90 for others."""
SURE_GROUP, LEAST_GROUP = 3, 2
"""Least size of a group for a sure and a possible odd one: with two others, either may be odd."""
SURE_SHARE = 0.2
"""Least share of all things in a group that is sure: among many, some are alike by chance."""
GAP = 1.25
"""The gap between the group and the odd one reaches up to the odd one's distance over this."""
BLURRED = (0.05, 0.25)
"""Others in that gap, as a share of the group: sure up to the first, possible to the second."""
KIND = 4
"""With two or more others like it, a thing is of a kind of its own, unless the group is more than
this many times larger."""
SIMILAR = 1.5
"""Groups whose sizes differ by a smaller ratio are not preferred to each other."""


@dataclass(frozen=True)
class Odd:
    """A thing that stands out from a group.

    Attributes:
        index: its index among the members that are compared.
        aspect: what it differs in.
        group: size of the group.
        distance: its distance from the group's typical member, in the aspect's unit.
        spread: greatest distance of the group's members from the typical one.
        sure: whether it surely stands out.
        typical: index of the typical member.
    """

    index: int
    aspect: Aspect
    group: int
    distance: float
    spread: float
    sure: bool
    typical: int


def odd_one_out(things: Things, members: IntArray, by: Oddness) -> Ranked:
    """Find the thing that differs from those like it, in one aspect or (odd) in any of the four."""
    kinds: dict[Oddness, tuple[Aspect, ...]] = {
        "odd": ("colour", "size", "shape", "orientation"),
        "odd_colour": ("colour",),
        "odd_size": ("size",),
        "odd_shape": ("shape",),
        "askew": ("orientation",),
    }
    apart = _aspect_distances(things, members)
    best: dict[int, Odd] = {}
    for aspect in kinds[by]:
        for alike in _comparable(apart, aspect):
            for odd in _outliers(apart[aspect], alike, aspect):
                held = best.get(odd.index)
                if held is None or _strength(odd) > _strength(held):
                    best[odd.index] = odd
    ranking = sorted(best.values(), key=lambda o: (*(-s for s in _strength(o)), o.index))
    return _ranked_oddities(things, members, ranking, by)


def _strength(odd: Odd) -> tuple[float, float, float]:
    limits = LIMITS[odd.aspect]
    return float(odd.group), float(odd.sure), odd.distance / limits.differs


def _ranked_oddities(things: Things, members: IntArray, ranking: list[Odd], by: Oddness) -> Ranked:
    way = "" if by == "odd" else " by " + by.replace("odd_", "").replace("askew", "its turn")
    if not ranking:
        return Ranked((), {}, f"none of {len(members)} things stands out{way}")
    rivals = [o for o in ranking if o.group * SIMILAR > ranking[0].group]
    reasons = {int(members[o.index]): _oddity_reason(things, members, o) for o in rivals}
    contenders = tuple(int(members[o.index]) for o in rivals)
    doubt = ""
    if len(rivals) > 1:
        ids = listed(things.candidates, np.array(contenders))
        doubt = f"{len(rivals)} things stand out{way}: {ids}"
    elif not rivals[0].sure:
        name = things.candidates[contenders[0]].id
        doubt = f"{name} may stand out{way}, not clearly: {reasons[contenders[0]]}"
    return Ranked(contenders, reasons, doubt)


def _oddity_reason(things: Things, members: IntArray, odd: Odd) -> str:
    others = f"the {odd.group} things like it"
    if odd.aspect == "orientation":
        apart = f"those by {odd.spread:.0f} degrees at most"
        return f"turned {odd.distance:.0f} degrees from {others}, {apart}"
    if odd.aspect == "colour":
        return (
            f"its colour is {odd.distance:.0f} CIE76 units from {others}, "
            f"theirs up to {odd.spread:.0f} apart"
        )
    own, typical = int(members[odd.index]), int(members[odd.typical])
    if odd.aspect == "size":
        ratio = things.areas[own] / things.areas[typical]
        return (
            f"its area is {ratio:.2f} times that of {others}, theirs up to {np.exp(odd.spread):.2f}"
        )
    mine, theirs = (things.candidates[i].attributes for i in (own, typical))
    return (
        f"its shape ({mine.shape}, roundness {mine.roundness:.2f}, long over short side "
        f"{mine.elongation:.2f}) is not that of {others} ({theirs.shape}, "
        f"{theirs.roundness:.2f}, {theirs.elongation:.2f})"
    )


def _comparable(apart: dict[Aspect, FloatArray], aspect: Aspect) -> list[BoolArray]:
    """Return which pairs may be compared in an aspect, as they agree in others.

    There is one matrix (m, m) for each way to read that.
    """
    colour = apart["colour"] < LIMITS["colour"].differs
    size = apart["size"] <= ALIKE_SIZE
    shape = apart["shape"] < LIMITS["shape"].differs
    ways: dict[Aspect, list[BoolArray]] = {
        "colour": [size & shape],
        "size": [shape, shape & colour],
        "shape": [size, size & colour],
        # A thing without an orientation has no finite distance to any other.
        "orientation": [size & shape & np.isfinite(apart["orientation"])],
    }
    for alike in ways[aspect]:
        np.fill_diagonal(alike, False)
    return ways[aspect]


def _outliers(apart: FloatArray, alike: BoolArray, aspect: Aspect) -> list[Odd]:
    """Return all things that lie well outside the largest group of those like them."""
    limits = LIMITS[aspect]
    found: list[Odd] = []
    for index in range(len(apart)):
        others = np.flatnonzero(alike[index])
        away = apart[index, others]
        # No group can reach this near to it: these are its own kind, whatever the group.
        kind = int((away < limits.differs * (1 - 1 / limits.spreads) - 1e-9).sum())
        crowded = kind > 1 and kind * KIND >= len(others) - kind
        if crowded or (away >= limits.differs - 1e-9).sum() < LEAST_GROUP:
            continue
        odd = _against_groups(apart[np.ix_(others, others)], away, limits)
        if odd is None:
            continue
        seed, members, blurred, spread = odd
        group = int(members.sum())
        own = int(((away < limits.differs - 1e-9) & ~members).sum())
        if (own <= 1 or own * KIND < group) and own < group - 1 and blurred <= BLURRED[1] * group:
            many = group >= max(SURE_GROUP, SURE_SHARE * len(apart))
            sure = many and blurred <= BLURRED[0] * group
            at = int(others[seed])
            found.append(Odd(index, aspect, group, float(away[seed]), spread, sure, at))
    return found


def _against_groups(
    apart: FloatArray, away: FloatArray, limits: Limits
) -> tuple[int, BoolArray, int, float] | None:
    """Return the group that a thing differs from most plainly, None if there is none.

    Args:
        apart: distances between the things like it, (m, m).
        away: its distances to them, (m,).

    Returns:
        Index of the typical member, mask (m,) of the members, number of others in the gap between
        the group and the thing, and the group's spread.
    """
    seeds = np.flatnonzero(away >= limits.differs - 1e-9)
    reach = np.minimum(away[seeds] / limits.spreads, limits.spread)[:, None]
    near = apart[seeds] <= reach + 1e-9
    within = apart[seeds] < away[seeds][:, None] / GAP
    size, blurred = near.sum(axis=1), (within & ~near).sum(axis=1)
    spread = np.where(near, apart[seeds], 0.0).max(axis=1)
    best = int(np.lexsort((spread, -away[seeds], blurred, -size))[0])
    if size[best] < LEAST_GROUP:
        return None
    return int(seeds[best]), near[best], int(blurred[best]), float(spread[best])


def _aspect_distances(things: Things, members: IntArray) -> dict[Aspect, FloatArray]:
    """Return the distances of all pairs of members in each aspect, (m, m) each."""
    attributes = [things.candidates[int(i)].attributes for i in members]
    labs, sizes = things.labs[members], np.log(things.areas[members])
    return {
        "colour": np.linalg.norm(labs[:, None] - labs[None], axis=2),
        "size": np.abs(sizes[:, None] - sizes[None]),
        "shape": _shape_distances(attributes),
        "orientation": _orientation_differences(attributes),
    }


def _shape_distances(attributes: list[Attributes]) -> FloatArray:
    """Return the distances of all pairs in shape, (m, m); 1 or more means different shapes."""
    roundness = np.array([a.roundness for a in attributes], dtype=float)
    elongation = np.log([a.elongation for a in attributes])
    hole = np.array([a.hole for a in attributes], dtype=float)
    of_each: list[dict[ShapeName, float]] = [dict(a.shapes) for a in attributes]
    names: list[ShapeName] = list(dict.fromkeys(name for each in of_each for name in each))
    rows = [[each.get(name, 0.0) for name in names] for each in of_each]
    fits = np.array(rows, dtype=float).reshape(len(attributes), len(names))
    between = np.abs(fits[:, None] - fits[None]).max(axis=2, initial=0.0)
    found = between / UNITS["fits"]
    for values, unit in ((roundness, "roundness"), (elongation, "elongation"), (hole, "hole")):
        found = np.maximum(found, np.abs(values[:, None] - values[None]) / UNITS[unit])
    best = [names.index(a.shape) for a in attributes]
    lead = fits.max(axis=1, initial=0.0)[:, None] - fits[:, best]
    return found + OTHER_SHAPE * ((lead >= SHAPE_LEAD) & (lead.T >= SHAPE_LEAD))


def _orientation_differences(attributes: list[Attributes]) -> FloatArray:
    """Return the degrees between all pairs of orientations, (m, m); infinite if one has none."""
    angles = np.array([a.orientation for a in attributes], dtype=float)
    period = np.array([_period(a) for a in attributes], dtype=float)
    shared = np.minimum(period[:, None], period[None])
    with np.errstate(invalid="ignore"):
        turn = np.abs(angles[:, None] - angles[None]) % shared
        turn = np.minimum(turn, shared - turn)
    return np.where(shared > 0, turn, np.inf)


def _period(attributes: Attributes) -> float:
    """Return the degrees after which a turned thing looks the same; 0 if it has no orientation."""
    if attributes.elongation >= ELONGATED:
        return 180.0
    round_enough = attributes.roundness > ROUND or attributes.shape == "circle"
    if round_enough and attributes.elongation < ROUND_ELONGATION:
        return 0.0
    return TURNS.get(attributes.shape, 90.0)
