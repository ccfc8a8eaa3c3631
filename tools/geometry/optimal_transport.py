"""Approximate assignment of robots to places, for teams too large for an exact one.

A multilevel scheme with prices: blocks of robots are assigned first, then the robots within them.
Prices (the linear program's dual) bound what a better assignment could save. Memory is linear.
The cost is the sum of squared distances; coordinates are image pixels, any common shift cancels.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .outline import FloatArray

IntArray = NDArray[np.intp]

BASE = 600
"""Most robots for which a level is solved exactly: a few hundredths of a second."""
FINER = 4
"""Most robots in a block that the next coarser level treats as one."""
LEAF = 64
"""Most robots in a block solved exactly for improvement; time grows faster than block size."""
PASSES = 4
"""Number of block layouts, each turned by the golden angle so that no block border persists."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
NEAR, CHEAP = 8, 8
"""Candidate robots for a place: the NEAR ones nearest to its own, and the CHEAP cheapest ones."""
SWEEPS, STEPS = 12, 8
"""Searches for exchange cycles in a round, and relaxations of the prices before each search."""
ROUNDING = 1e-12
"""Differences up to this share of the largest cost count as zero."""


@dataclass(frozen=True)
class Matching:
    """The robot that each goal takes, (n,), and the price of each robot, (n,), px^2."""

    robots: IntArray
    prices: FloatArray


def sum_of_squares(goals: FloatArray, starts: FloatArray, robots: IntArray) -> float:
    """Return the sum of squared distances, px^2."""
    return float(_squared(goals, starts[robots]).sum())


def lower_bound(goals: FloatArray, starts: FloatArray, prices: FloatArray) -> float:
    """Return a lower bound on the cost of any assignment, px^2, by weak duality for any prices.

    Each goal pays the squared distance less the price of its cheapest robot. That robot is the
    nearest in a space whose third coordinate holds the prices (power diagram, Aurenhammer 1987).
    """
    cheapest, _ = _cheapest(goals, starts, prices, 1)
    return float((cheapest[:, 0] + prices).sum())


def multilevel_matching(goals: FloatArray, starts: FloatArray) -> Matching:
    """Nearly minimise the sum of squared distances by levels; goals and starts are (n, 2) each."""
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
    """Return the exact assignment as indices of goals and robots, as many as the smaller set."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    rows, columns = linear_sum_assignment(cdist(goals, starts, "sqeuclidean"))
    return np.asarray(rows, dtype=np.intp), np.asarray(columns, dtype=np.intp)


def _blockwise(goals: FloatArray, starts: FloatArray, matching: Matching) -> Matching:
    """Reassign exactly within blocks of neighbours, for several layouts of the blocks."""
    robots = matching.robots.copy()
    for k in range(PASSES):
        by = starts[robots] if k % 2 else goals
        turned = by @ _rotation(k * GOLDEN_ANGLE)
        for block in _median_blocks(turned, turned, LEAF)[0]:
            robots[block] = robots[block][_least_squares(goals[block], starts[robots[block]])[1]]
    return replace(matching, robots=robots)


def improved_by_cycles(goals: FloatArray, starts: FloatArray, matching: Matching) -> Matching:
    """Exchange robots along cycles that save (Klein 1967) and move prices towards the dual optimum.

    Prices fall by Bellman-Ford: a robot is worth no more than the price at which another goal
    would rather take it. If they keep falling around a cycle, exchanging robots along it saves.
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
    """Pass robots on around the cycles of a graph in which each robot has at most one rival.

    Args:
        robots: (n,) the robot of each goal.
        robot, rival: (m,) edges: the goal of `rival` would rather have `robot`.
        more: (m,) how much more that goal would pay for it, px^2.
        nothing: savings up to this count as none, px^2.

    Returns:
        (n,) the new robot of each goal.
    """
    n = len(robots)
    before, extra = np.arange(n), np.zeros(n)
    before[robot], extra[robot] = rival, more
    far, name = before, np.arange(n)
    for _ in range(n.bit_length()):  # pointer jumping: all end on a cycle, named by its least index
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
    """Return candidate pairs ordered by robot: goal, robot and squared distance, (m,) each."""
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
    """Return each goal's k cheapest robots: squared distance less price, and index, (n, k) each."""
    from scipy.spatial import cKDTree

    top = prices.max()
    lifted = np.column_stack([starts, np.sqrt(top - prices)])
    flat = np.column_stack([goals, np.zeros(len(goals))])
    # Compact nodes and small leaves make queries from so far off the points several times slower.
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
    """Return the robot of each goal, (n,), where each block of goals takes a block of starts.

    The sizes of the blocks may differ by one.
    """
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
    """Interpolate the prices of robots, (n,), from those of their blocks.

    At optimal prices, the squared length of a start less its price is convex and its gradient is
    twice the goal (Brenier 1991); this takes a first-order step from the block's centre.
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
    """Cut both sets repeatedly at medians, in step, into blocks of `size` points or fewer.

    Block i of one set has as many points as block i of the other; the sizes of any two blocks
    differ by at most one.
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
