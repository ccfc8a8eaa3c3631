"""Approximate assignment of robots to places, for teams too large for an exact one.

A multilevel scheme with prices: blocks of robots are assigned first, then the robots within.
Prices (the linear program's dual) bound what a better assignment could save. Memory is linear.
Least sums of squared distances; coordinates are image pixels, any common shift cancels.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .outline import FloatArray

IntArray = NDArray[np.intp]

BASE = 600
"""Robots up to which a level is solved exactly: a few hundredths of a second."""
FINER = 4
"""Robots to a block of the next coarser level."""
LEAF = 64
"""Robots to a block that is solved exactly when improving; time grows faster than blocks do."""
PASSES = 4
"""Times the blocks are laid anew, turned by the golden angle so that none keeps its borders."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
NEAR, CHEAP = 8, 8
"""Robots a place may change to: nearest ones of its own, and those cheapest at the prices."""
SWEEPS, STEPS = 12, 8
"""Searches for cycles of exchanges a round, and relaxations of the prices before each."""
ROUNDING = 1e-12
"""Share of the largest cost that counts as nothing."""


@dataclass(frozen=True)
class Matching:
    """Which robot each goal takes, (n,), and a price for every robot, (n,), px^2."""

    robots: IntArray
    prices: FloatArray


def sum_of_squares(goals: FloatArray, starts: FloatArray, robots: IntArray) -> float:
    """The sum of squared distances, px^2."""
    return float(_squared(goals, starts[robots]).sum())


def lower_bound(goals: FloatArray, starts: FloatArray, prices: FloatArray) -> float:
    """What every assignment costs at least, px^2: weak duality, valid for any prices.

    Each goal pays its cheapest robot's squared distance less its price. That robot is the nearest
    one in a space with a third coordinate that holds the prices (power diagram, Aurenhammer 1987).
    """
    cheapest, _ = _cheapest(goals, starts, prices, 1)
    return float((cheapest[:, 0] + prices).sum())


def multilevel_matching(goals: FloatArray, starts: FloatArray) -> Matching:
    """Nearly the least sum of squared distances, (n, 2) each, by levels."""
    n = len(goals)
    if n <= BASE:
        return Matching(_least_squares(goals, starts)[1], np.zeros(n))
    goal_blocks = _median_blocks(goals, goals, FINER)[0]
    start_blocks = _median_blocks(starts, starts, FINER)[0]
    here, there = _centres(goals, goal_blocks), _centres(starts, start_blocks)
    coarse = improved_by_cycles(here, there, multilevel_matching(here, there))
    robots = _spread_out(goals, starts, goal_blocks, start_blocks, coarse.robots)
    prices = _interpolated_prices(starts, start_blocks, there, here, coarse)
    return _blockwise(goals, starts, Matching(robots, prices))


def _least_squares(goals: FloatArray, starts: FloatArray) -> tuple[IntArray, IntArray]:
    """The exact assignment: goals and their robots, as many as the smaller of the two sets has."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    rows, columns = linear_sum_assignment(cdist(goals, starts, "sqeuclidean"))
    return np.asarray(rows, dtype=np.intp), np.asarray(columns, dtype=np.intp)


def _blockwise(goals: FloatArray, starts: FloatArray, matching: Matching) -> Matching:
    """Exact reassignments within blocks of neighbours, laid anew a few times."""
    robots = matching.robots.copy()
    for k in range(PASSES):
        by = starts[robots] if k % 2 else goals
        turned = by @ _rotation(k * GOLDEN_ANGLE)
        for block in _median_blocks(turned, turned, LEAF)[0]:
            robots[block] = robots[block][_least_squares(goals[block], starts[robots[block]])[1]]
    return replace(matching, robots=robots)


def improved_by_cycles(goals: FloatArray, starts: FloatArray, matching: Matching) -> Matching:
    """A round of cycles of exchanges that save (Klein 1967), and prices nearer to the dual's.

    Prices fall by Bellman-Ford: a robot is worth no more than the price at which another goal
    would rather take it. Where they fall in a circle, exchanging robots around it saves.
    """
    goal, robot, cost = _candidate_pairs(goals, starts, matching)
    nothing = ROUNDING * float(cost.max())
    first = np.flatnonzero(np.diff(robot, prepend=-1))
    robots, prices = matching.robots.copy(), matching.prices.copy()
    for _ in range(SWEEPS):
        rival = robots[goal]
        more = cost - _squared(goals, starts[robots])[goal]
        more[rival == robot] = np.inf
        falling = False
        for _ in range(STEPS):
            best = np.minimum.reduceat(prices[rival] + more, first)
            lower = best < prices[robot[first]] - nothing
            falling = bool(lower.any())
            prices[robot[first][lower]] = best[lower]
        if not falling:
            break
        offers = prices[rival] + more
        best = np.minimum.reduceat(offers, first)
        best[best > prices[robot[first]]] = np.nan
        edges = np.flatnonzero(offers == np.repeat(best, np.diff(first, append=len(robot))))
        robots = _exchange(robots, robot[edges], rival[edges], more[edges], nothing)
    return Matching(robots, prices)


def _exchange(
    robots: IntArray, robot: IntArray, rival: IntArray, more: FloatArray, nothing: float
) -> IntArray:
    """Hand robots on around the cycles of a graph in which each has one rival at most.

    Args:
        robots: (n,) for each goal its robot.
        robot, rival: (m,) edges: the rival's goal would rather have the robot.
        more: (m,) what the rival's goal would pay more for it, px^2.
        nothing: what is no saving, px^2.
    """
    n = len(robots)
    before, extra = np.arange(n), np.zeros(n)
    before[robot], extra[robot] = rival, more
    far, name = before, np.arange(n)
    for _ in range(n.bit_length()):  # pointer jumping: all end on a cycle, named by its least
        name, far = np.minimum(name, name[far]), far[far]
    on_cycle = np.zeros(n, dtype=bool)
    on_cycle[far] = True
    saving = np.bincount(name[on_cycle], weights=extra[on_cycle], minlength=n)
    taken = np.flatnonzero(on_cycle & (saving[name] < -nothing))
    goal_of = np.empty(n, dtype=np.intp)
    goal_of[robots] = np.arange(n)
    changed = robots.copy()
    changed[goal_of[before[taken]]] = taken
    return changed


def _candidate_pairs(
    goals: FloatArray, starts: FloatArray, matching: Matching
) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs worth considering, ordered by robot: goal, robot, squared distance, (m,) each."""
    from scipy.spatial import cKDTree

    n = len(goals)
    around = np.asarray(cKDTree(starts).query(starts, k=range(1, min(NEAR, n) + 1))[1])
    _, cheap = _cheapest(goals, starts, matching.prices, min(CHEAP, n))
    options = np.concatenate([around[matching.robots], cheap], axis=1)
    pairs = np.unique(options * n + np.arange(n)[:, None])
    robot, goal = pairs // n, pairs % n
    return goal, robot, _squared(goals[goal], starts[robot])


def _cheapest(
    goals: FloatArray, starts: FloatArray, prices: FloatArray, k: int
) -> tuple[FloatArray, IntArray]:
    """Squared distance less price of each goal's k cheapest robots, and which they are, (n, k)."""
    from scipy.spatial import cKDTree

    top = prices.max()
    lifted = np.column_stack([starts, np.sqrt(top - prices)])
    flat = np.column_stack([goals, np.zeros(len(goals))])
    # Shrunk nodes and small leaves make queries from so far off the points several times slower.
    tree = cKDTree(lifted, compact_nodes=False, leafsize=32)
    distance, robot = tree.query(flat, k=range(1, k + 1))
    return np.asarray(distance, dtype=float) ** 2 - top, np.asarray(robot, dtype=np.intp)


def _spread_out(
    goals: FloatArray,
    starts: FloatArray,
    goal_blocks: list[IntArray],
    start_blocks: list[IntArray],
    takes: IntArray,
) -> IntArray:
    """Robots for single goals where blocks go to blocks; their sizes may differ by one."""
    robots = np.full(len(goals), -1, dtype=np.intp)
    for block, taken in zip(goal_blocks, takes, strict=True):
        team = start_blocks[int(taken)]
        rows, columns = _least_squares(goals[block], starts[team])
        robots[block[rows]] = team[columns]
    left = np.flatnonzero(robots < 0)
    idle = np.setdiff1d(np.arange(len(goals)), robots[robots >= 0])
    if len(left):
        for block, team in zip(*_median_blocks(goals[left], starts[idle], LEAF), strict=True):
            found = _least_squares(goals[left[block]], starts[idle[team]])[1]
            robots[left[block]] = idle[team[found]]
    return robots


def _interpolated_prices(
    starts: FloatArray,
    blocks: list[IntArray],
    centres: FloatArray,
    goals: FloatArray,
    coarse: Matching,
) -> FloatArray:
    """Prices of robots from those of their blocks, (n,).

    The squared length of a start less its price is convex where prices are optimal, and its
    gradient is twice the goal (Brenier 1991): a first-order step from the block's centre.
    """
    to = np.empty_like(goals)
    to[coarse.robots] = goals
    prices = np.empty(len(starts))
    for block, here, there, price in zip(blocks, centres, to, coarse.prices, strict=True):
        away = starts[block] - here
        prices[block] = price + (away * (starts[block] + here - 2 * there)).sum(axis=1)
    return prices


def _centres(points: FloatArray, blocks: list[IntArray]) -> FloatArray:
    return np.stack([points[block].mean(axis=0) for block in blocks])


def _median_blocks(
    goals: FloatArray, starts: FloatArray, size: int
) -> tuple[list[IntArray], list[IntArray]]:
    """Both sets cut at medians, again and again, into as many blocks of `size` or fewer, in step.

    Block i of one has as many points as block i of the other; any two differ by one at most.
    """
    n, count = len(goals), 1
    labels = [np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.intp)]
    while n > count * size:
        low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(low, labels[0], goals)
        np.maximum.at(high, labels[0], goals)
        axis = np.argmax(high - low, axis=1)
        sizes = np.bincount(labels[0], minlength=count)
        first = np.cumsum(sizes) - sizes
        for points, label in zip((goals, starts), labels, strict=True):
            order = np.lexsort((points[np.arange(n), axis[label]], label))
            rank = np.empty(n, dtype=np.intp)
            rank[order] = np.arange(n) - first[label[order]]
            label[:] = 2 * label + (rank >= sizes[label] // 2)
        count *= 2
    borders = np.cumsum(np.bincount(labels[0], minlength=count))[:-1]
    first_set, second_set = (np.split(np.argsort(b, kind="stable"), borders) for b in labels)
    return first_set, second_set


def _rotation(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def _squared(a: FloatArray, b: FloatArray) -> FloatArray:
    return ((a - b) ** 2).sum(axis=1)
