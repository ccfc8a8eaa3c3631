"""The odd one out: what differs in one way from things that are alike in the others.

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
    """When things count as different in an aspect, in its unit.

    Attributes:
        differs: least distance that is a difference at all.
        spreads: and how many times the group's own spread it must be.
        spread: a group spreads no farther than this from its most typical member.
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
"""Things alike may be nearer to or farther from the camera."""
UNITS = {"roundness": 0.12, "elongation": float(np.log(1.3)), "fits": 0.12, "hole": 0.12}
"""What alone makes another shape; a disc and a hexagon differ by half of each."""
OTHER_SHAPE, SHAPE_LEAD = 0.5, 0.03
"""Added where both fit their own best shape better than the other's by more than noise."""
ROUND, ROUND_ELONGATION = 0.88, 1.15
"""What is as round as this has no orientation."""
ELONGATED = 1.25
"""Below this the long side of the rectangle may be any of its sides."""
TURNS: dict[ShapeName, float] = {"triangle": 60.0, "hexagon": 60.0, "pentagon": 36.0, "star": 36.0}
"""Degrees after which the rectangle around a regular one may look the same; else 90."""
SURE_GROUP, LEAST_GROUP = 3, 2
"""With two others, either may be the odd one."""
SURE_SHARE = 0.2
"""Of many things of every kind some are alike by chance: a group is at least this share of them."""
GAP = 1.25
"""Between its group and the odd one others leave a gap down to its distance over this."""
BLURRED = (0.05, 0.25)
"""Others in the gap, as a share of the group: sure up to the first, possible to the second."""
KIND = 4
"""Two or more others like it are a kind of their own, unless the group is so many times larger."""
SIMILAR = 1.5
"""Groups whose sizes have a smaller ratio give no preference."""


@dataclass(frozen=True)
class Odd:
    """One thing that stands out from a group: by how much, and whether that is sure."""

    index: int
    aspect: Aspect
    group: int
    distance: float
    spread: float
    sure: bool
    typical: int


def odd_one_out(things: Things, members: IntArray, by: Oddness) -> Ranked:
    """The thing that differs from those like it, in one aspect or (odd) in any of the four."""
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
    """Which pairs may be compared in an aspect as they agree in others; one matrix per reading."""
    colour = apart["colour"] < LIMITS["colour"].differs
    size = apart["size"] <= ALIKE_SIZE
    shape = apart["shape"] < LIMITS["shape"].differs
    ways: dict[Aspect, list[BoolArray]] = {
        "colour": [size & shape],
        "size": [shape, shape & colour],
        "shape": [size, size & colour],
        # What has no orientation is at no distance from anything.
        "orientation": [size & shape & np.isfinite(apart["orientation"])],
    }
    for alike in ways[aspect]:
        np.fill_diagonal(alike, False)
    return ways[aspect]


def _outliers(apart: FloatArray, alike: BoolArray, aspect: Aspect) -> list[Odd]:
    """All that lie well outside the largest group of those alike to them."""
    limits = LIMITS[aspect]
    found: list[Odd] = []
    for index in range(len(apart)):
        others = np.flatnonzero(alike[index])
        away = apart[index, others]
        # No group reaches so near to it: these are its own kind, whatever the group.
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
    """The group it differs from most plainly: typical member, members, others in the gap, spread.

    Args:
        apart: distances of those alike to it, (m, m).
        away: its distances to them, (m,).
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
    """Distances of all pairs of members in each aspect, (m, m)."""
    attributes = [things.candidates[int(i)].attributes for i in members]
    labs, sizes = things.labs[members], np.log(things.areas[members])
    return {
        "colour": np.linalg.norm(labs[:, None] - labs[None], axis=2),
        "size": np.abs(sizes[:, None] - sizes[None]),
        "shape": _shape_distances(attributes),
        "orientation": _orientation_differences(attributes),
    }


def _shape_distances(attributes: list[Attributes]) -> FloatArray:
    """1 and more where two are of different shape."""
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
    """Degrees between orientations; infinite where one of the two has none."""
    angles = np.array([a.orientation for a in attributes], dtype=float)
    period = np.array([_period(a) for a in attributes], dtype=float)
    shared = np.minimum(period[:, None], period[None])
    with np.errstate(invalid="ignore"):
        turn = np.abs(angles[:, None] - angles[None]) % shared
        turn = np.minimum(turn, shared - turn)
    return np.where(shared > 0, turn, np.inf)


def _period(attributes: Attributes) -> float:
    """Degrees after which it looks as if it had not been turned; 0 for what has no orientation."""
    if attributes.elongation >= ELONGATED:
        return 180.0
    round_enough = attributes.roundness > ROUND or attributes.shape == "circle"
    if round_enough and attributes.elongation < ROUND_ELONGATION:
        return 0.0
    return TURNS.get(attributes.shape, 90.0)
