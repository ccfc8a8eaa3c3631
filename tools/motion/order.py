"""Who has to go before whom: off its start before others pass it, past goals before they are taken.

Where that makes a cycle, interchangeable robots are matched anew: those that leave first take the
places that are filled first. After Turpin et al. (2014), for robots with bodies.
"""

import heapq
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from ..geometry.outline import FloatArray, distances
from .motion import Indices, arc_lengths, as_line
from .routes import NOBODY, NoRouteError

REACHES, SPOKES, SPOTS = (1.2, 2.0, 3.0, 4.5, 7.0, 10.0), 12, 8
"""Robots wait at these multiples of the distance they keep, away from their starts, in so many
directions; at most so many of those spots are tried."""
PARKED, REROUTED, ASIDE = 100, 12, 40
"""Most robots whose starts and goals others are led around, most such ways that are tried, and most
robots that are asked to step aside."""
ROUNDS, SWAPS = 12, 200
"""Most times that robots in cycles are matched anew, and most pairs whose exchange is tried."""

Ways = Callable[[FloatArray, FloatArray, FloatArray], list[FloatArray]]
"""Finds paths from starts, (n, 2), to goals, (n, 2), past parked robots, (m, 2), or raises
NoRouteError."""


@dataclass(frozen=True)
class Matched:
    """Robots with their goals, and the order their paths demand.

    Attributes:
        robots: (n,) the robot that goes to each goal, by its row among the starts.
        paths: one for each goal; then first legs of robots that step aside, whose paths lead on
            from there.
        aside: the goal whose robot drives each first leg.
        leaving: (k, 2) paths, the first of which has to leave its start before the second passes
            there.
        arriving: (k, 2) paths, the first of which has to pass the second one's goal before that is
            taken.
    """

    robots: Indices
    paths: list[FloatArray]
    leaving: Indices
    arriving: Indices
    aside: tuple[int, ...] = ()

    @property
    def before(self) -> Indices:
        """All pairs of paths of which the first has to be driven before the second, (k, 2)."""
        count = len(self.robots)
        legs = [(count + k, goal) for k, goal in enumerate(self.aside)]
        then = np.array(legs, dtype=np.intp).reshape(-1, 2)
        return np.unique(np.concatenate([self.leaving, self.arriving, then]), axis=0)

    @property
    def owners(self) -> Indices:
        """The goal whose robot drives each path, (k,)."""
        return np.array([*range(len(self.robots)), *self.aside], dtype=np.intp)

    @property
    def cycles(self) -> list[Indices]:
        """Groups of paths each of which would have to be driven before the others."""
        return cycles(self.before, len(self.paths))


def match(
    robots: Indices, paths: list[FloatArray], apart: float, aside: tuple[int, ...] = ()
) -> Matched:
    """Return robots on paths, with the order these demand of robots that stay `apart` px apart."""
    lines = shapely.STRtree([as_line(path) for path in paths])
    starts = shapely.points(np.stack([path[0] for path in paths]))
    goals = shapely.points(np.stack([path[-1] for path in paths]))
    leaving = lines.query(starts, predicate="dwithin", distance=apart).T
    arriving = lines.query(goals, predicate="dwithin", distance=apart).T[:, ::-1]
    owner = np.array([*range(len(robots)), *aside])
    leaving, arriving = (p[owner[p[:, 0]] != owner[p[:, 1]]] for p in (leaving, arriving))
    return Matched(robots, paths, leaving, arriving, aside)


def cycles(before: Indices, count: int) -> list[Indices]:
    """Return the strongly connected components, of more than one node each, among `count` nodes."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(before)), before.T), shape=(count, count))
    label = connected_components(graph, connection="strong")[1]
    return [np.flatnonzero(label == k) for k in np.flatnonzero(np.bincount(label) > 1)]


def ordered(before: Indices, lengths: Sequence[float]) -> list[int]:
    """Return all paths, each after those that go before it; of those free the longest first."""
    waits: Counter[int] = Counter(before[:, 1].tolist())
    after: defaultdict[int, list[int]] = defaultdict(list)
    for one, other in before.tolist():
        after[one].append(other)
    free = [(-length, robot) for robot, length in enumerate(lengths) if not waits[robot]]
    heapq.heapify(free)
    order: list[int] = []
    while free:
        robot = heapq.heappop(free)[1]
        order.append(robot)
        for other in after[robot]:
            waits[other] -= 1
            if not waits[other]:
                heapq.heappush(free, (-lengths[other], other))
    return order


def rematched(found: Matched, starts: FloatArray, ways: Ways, apart: float) -> Matched:
    """Match interchangeable robots to other goals, where that leaves fewer demands in cycles.

    Args:
        starts: (n, 2) of all robots.
    """
    for _ in range(ROUNDS):
        better = found
        for cycle in found.cycles:
            goals = _by_order(better, cycle)
            better = _best(better, _exchanged(better, *goals, starts, ways, apart))
        if better is found:
            break
        found = better
    return _pairs_exchanged(found, starts, ways, apart)


def rerouted(found: Matched, ways: Ways, apart: float) -> Matched:
    """Lead robots in cycles around the starts and goals of the others, where that helps."""
    everyone, left = list(range(len(found.paths))), REROUTED
    for _ in range(ROUNDS):
        better = found
        for cycle in found.cycles:
            for i in map(int, cycle):
                for others in (everyone, [int(j) for j in cycle]):
                    if len(others) > PARKED or not left:
                        continue
                    left -= 1
                    ends = [found.paths[j][[0, -1]] for j in others if j != i]
                    other = _past(better, i, np.concatenate(ends), ways, apart)
                    if other is not None:
                        better = _best(better, other)
                        break
        if better is found or not better.cycles:
            return better
        found = better
    return found


def stepped_aside(
    found: Matched, ways: Ways, apart: float, free: Callable[[FloatArray], NDArray[np.bool_]]
) -> Matched:
    """Let some robots in cycles wait beside the ways of the others and go on when those have gone.

    Args:
        free: tells at which of some points, (k, 2), robots can wait, (k,).
    """
    tried: set[int] = set()
    while found.cycles:
        inside = Counter(int(i) for cycle in found.cycles for i in cycle)
        demands = Counter(found.before.ravel().tolist())
        left = [i for i in inside if i < len(found.robots) and i not in {*tried, *found.aside}]
        if not left or len(tried) == ASIDE:
            break
        robot = max(left, key=lambda i: demands[i])
        tried.add(robot)
        for spot in _spots(found, robot, apart, free):
            better = _best(found, _by_way_of(found, robot, spot, ways, apart))
            if better is not found:
                found = better
                break
    return found


def _spots(
    found: Matched, robot: int, apart: float, free: Callable[[FloatArray], NDArray[np.bool_]]
) -> FloatArray:
    """Return spots to wait at off all other paths, (k, 2), the nearest to the start first."""
    angle = np.linspace(0, 2 * np.pi, SPOKES, endpoint=False)
    reach = apart * np.array(REACHES)[:, None, None]
    around = reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    spots = (found.paths[robot][0] + around).reshape(-1, 2)
    others = [as_line(path) for i, path in enumerate(found.paths) if i != robot]
    near = np.min([distances(other, spots) for other in others], axis=0)
    return spots[(near >= apart) & free(spots)][:SPOTS]


def _by_way_of(
    found: Matched, robot: int, spot: FloatArray, ways: Ways, apart: float
) -> Matched | None:
    """Return the match with one robot first driving to a spot, or None if it cannot."""
    begin, end = found.paths[robot][[0, -1]]
    try:
        first, second = ways(np.stack([begin, spot]), np.stack([spot, end]), NOBODY)
    except NoRouteError:
        return None
    paths = [second if i == robot else path for i, path in enumerate(found.paths)]
    return match(found.robots, [*paths, first], apart, (*found.aside, robot))


def _best(found: Matched, other: Matched | None) -> Matched:
    """Return the one that leaves fewer demands in cycles."""
    return found if other is None or _cyclic_demands(other) >= _cyclic_demands(found) else other


def _cyclic_demands(found: Matched) -> int:
    """Return how many demands lie in cycles: the fewer the better."""
    number = np.full(len(found.paths), -1)
    for k, cycle in enumerate(found.cycles):
        number[cycle] = k
    one, other = number[found.before].T
    return int(((one == other) & (one >= 0)).sum())


def _by_order(found: Matched, cycle: Indices) -> tuple[list[int], list[int]]:
    """Return the goals of a cycle in the order they are filled, and in the order robots leave.

    The first to leave takes the goal that is filled first, and so on.
    """
    length = {i: float(arc_lengths(found.paths[i])[-1]) for i in map(int, cycle)}
    leaving = _sorted(found.leaving, length)
    filled = _sorted(found.arriving, {i: -way for i, way in length.items()})
    return filled, leaving


def _sorted(before: Indices, value: dict[int, float]) -> list[int]:
    """Order nodes greedily to break few demands; of the free the one of least value comes first."""
    demands = [(one, other) for one, other in before.tolist() if one in value and other in value]
    left, order = set(value), list[int]()
    while left:
        waits = Counter(other for one, other in demands if one in left and other in left)
        order.append(min(left, key=lambda node: (waits[node], value[node])))
        left.remove(order[-1])
    return order


def _exchanged(
    found: Matched,
    goals: Sequence[int],
    taken: Sequence[int],
    starts: FloatArray,
    ways: Ways,
    apart: float,
) -> Matched | None:
    """Return the match with the robots of `taken` going to `goals`, or None if they cannot."""
    robots, paths = found.robots.copy(), list(found.paths)
    robots[list(goals)] = found.robots[list(taken)]
    ends = np.stack([found.paths[i][-1] for i in goals])
    try:
        onto = ways(starts[robots[list(goals)]], ends, NOBODY)
    except NoRouteError:
        return None
    for i, path in zip(goals, onto, strict=True):
        paths[i] = path
    return match(robots, paths, apart, found.aside)


def _past(
    found: Matched, robot: int, parked: FloatArray, ways: Ways, apart: float
) -> Matched | None:
    """Return the match with one robot's way past parked ones, or None if there is none."""
    begin, end = found.paths[robot][[0, -1]]
    try:
        (path,) = ways(begin[None], end[None], parked)
    except NoRouteError:
        return None
    paths = [path if i == robot else old for i, old in enumerate(found.paths)]
    return match(found.robots, paths, apart, found.aside)


def _pairs_exchanged(found: Matched, starts: FloatArray, ways: Ways, apart: float) -> Matched:
    """Exchange the goals of pairs in cycles, wherever that leaves fewer demands in cycles."""
    tried: set[tuple[int, ...]] = set()
    while len(tried) < SWAPS:
        inside = {int(i): k for k, cycle in enumerate(found.cycles) for i in cycle}
        pairs = (
            tuple(sorted(pair))
            for pair in found.before.tolist()
            if pair[0] in inside and inside[pair[0]] == inside.get(pair[1])
        )
        pair = next((p for p in pairs if p not in tried), None)
        if pair is None:
            break
        tried.add(pair)
        found = _best(found, _exchanged(found, pair, pair[::-1], starts, ways, apart))
    return found
