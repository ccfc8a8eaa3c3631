"""Schedules robots one after the other, each around the times of those before it.

Safe intervals (Phillips and Likhachev 2011) along a fixed path (Kant and Zucker 1986). Cells that
are too near are never used at once, so the times give an order of passage without a cycle.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.outline import FloatArray
from .cells import Cells
from .motion import Indices, Passages

FOREVER = float("inf")


class NoTimeError(Exception):
    """A robot cannot get through: its goal or its way is taken for good.

    Attributes:
        robot: index of the robot.
    """

    def __init__(self, robot: int) -> None:
        super().__init__(f"Robot {robot} cannot get through.")
        self.robot = robot


@dataclass(frozen=True)
class Schedule:
    """When robots enter and leave their cells, (c,) s each; a goal is never left."""

    enter: FloatArray
    leave: FloatArray


@dataclass(frozen=True)
class Near:
    """For each cell the cells that are too near to it, as one table.

    Attributes:
        first: (c + 1,) where the rows of each cell begin.
        cell: (2 p,) the other cell.
    """

    first: Indices
    cell: Indices

    @classmethod
    def of(cls, pairs: Indices, count: int) -> "Near":
        """Make the table from pairs, (p, 2), of `count` cells."""
        both = np.concatenate([pairs, pairs[:, ::-1]])
        both = both[np.argsort(both[:, 0], kind="stable")]
        first = np.searchsorted(both[:, 0], np.arange(count + 1))
        return cls(first.astype(np.intp), np.ascontiguousarray(both[:, 1]))


def schedule(
    cells: Cells, near: Near, order: Sequence[int], speed: float, legs: Mapping[int, int]
) -> Schedule:
    """Return the earliest times for paths, each of which gives way to those before it in `order`.

    Args:
        speed: greatest speed, px/s.
        legs: by the path of a robot that steps aside, the path of its first leg.

    Raises:
        NoTimeError: a robot cannot get through.
    """
    enter = np.full(len(cells.robot), FOREVER)
    leave = np.full(len(cells.robot), FOREVER)
    seconds = (cells.leave - cells.enter) / speed
    for path in order:
        mine = cells.of(path)
        blocked = _blocked(mine, near, enter, leave)
        before = cells.goals[legs[path]] if path in legs else None
        times = _earliest(seconds[mine], blocked, 0.0 if before is None else float(enter[before]))
        if times is None:
            raise NoTimeError(int(cells.robot[mine.start]))
        enter[mine], leave[mine] = times, np.append(times[1:], FOREVER)
        if before is not None:
            leave[before] = leave[mine.start]
    return Schedule(enter, leave)


Span = tuple[float, float]


def _blocked(
    mine: slice, near: Near, enter: FloatArray, leave: FloatArray
) -> dict[int, list[Span]]:
    """Return when others are too near to each cell, by its index on its path; merged, in order."""
    rows = slice(int(near.first[mine.start]), int(near.first[mine.stop]))
    counts = np.diff(near.first[mine.start : mine.stop + 1])
    place = np.repeat(np.arange(len(counts)), counts)
    others = near.cell[rows]
    known = np.isfinite(enter[others])
    place, others = place[known], others[known]
    if not len(others):
        return {}
    begin, end = enter[others], leave[others]
    rank = np.lexsort((begin, place))
    place, begin, end = place[rank], begin[rank], end[rank]
    spans: dict[int, list[Span]] = {}
    for k, lo, hi in zip(place.tolist(), begin.tolist(), end.tolist(), strict=True):
        mine_spans = spans.setdefault(k, [])
        if mine_spans and lo <= mine_spans[-1][1]:
            if hi > mine_spans[-1][1]:
                mine_spans[-1] = (mine_spans[-1][0], hi)
        else:
            mine_spans.append((lo, hi))
    return spans


ALWAYS: list[Span] = [(0.0, FOREVER)]


def _free(blocked: list[Span] | None) -> list[Span]:
    """Return the spans between the blocked ones."""
    if not blocked:
        return ALWAYS
    edges = [0.0, *(t for span in blocked for t in span), FOREVER]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a or a == 0.0]


@dataclass(frozen=True)
class _Arrival:
    """A stay in a cell from a time on, at most until another, by way of an earlier arrival."""

    time: float
    until: float
    before: "_Arrival | None"


def _earliest(
    seconds: FloatArray, blocked: dict[int, list[Span]], begun: float
) -> FloatArray | None:
    """Return when a robot enters each of its cells, (k,) s, or None if it cannot get through.

    It comes to stay in the last one as soon as it can.
    """
    free = [end for begin, end in _free(blocked.get(0)) if begin <= begun <= end]
    reached = [_Arrival(begun, end, None) for end in free]
    for k in range(1, len(seconds)):
        takes = float(seconds[k - 1])
        free = _free(blocked.get(k))
        onward: list[_Arrival] = []
        for begin, end in free:
            best: _Arrival | None = None
            for arrival in reached:
                time = max(arrival.time + takes, begin)
                if time > min(arrival.until, end):
                    continue
                if best is None or time < best.time:
                    best = _Arrival(time, end, arrival)
            if best is not None:
                onward.append(best)
        reached = onward
    last = next((a for a in reached if a.until == FOREVER), None)
    times: list[float] = []
    while last is not None:
        times.append(last.time)
        last = last.before
    return np.array(times[::-1]) if times else None


def passages(cells: Cells, pairs: Indices, times: Schedule) -> Passages:
    """Return who waits for whom so that no two are ever too near, however late any of them is.

    Args:
        pairs: (p, 2) cells that are too near.
    """
    one, other = pairs.T
    forward = times.leave[one] <= times.enter[other]
    first = np.asarray(np.where(forward, one, other), dtype=np.intp)
    waiting = np.asarray(np.where(forward, other, one), dtype=np.intp)
    rank = np.lexsort((cells.enter[waiting], cells.robot[first], cells.robot[waiting]))
    first, waiting = first[rank], waiting[rank]
    who, whom = cells.robot[waiting], cells.robot[first]
    at, past = cells.enter[waiting], cells.leave[first]
    kept = _growing(who * (whom.max(initial=0) + 1) + whom, past)
    rank = kept[np.lexsort((at[kept], who[kept]))]
    return Passages(who[rank], at[rank], whom[rank], past[rank])


def _growing(group: Indices, values: FloatArray) -> Indices:
    """Return rows whose value is greater than all before it in its group; groups are contiguous."""
    if not len(group):
        return np.empty(0, dtype=np.intp)
    number = np.cumsum(np.diff(group, prepend=group[0]) != 0)
    lift = number * (float(np.ptp(values)) + 1.0)  # so that one running maximum serves all groups
    highest = np.maximum.accumulate(values + lift)
    before = np.concatenate([[-np.inf], highest[:-1]])
    return np.flatnonzero(values + lift > before)
