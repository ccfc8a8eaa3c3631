"""The assignment whose longest way is shortest: what decides when the last robot arrives.

Bisection between a lower bound and the best matching so far (Gross 1959), each step a maximum
matching grown from the last one by augmenting paths. Neighbours are found in a k-d tree, so that
memory is linear. SciPy's matching can take exponential time on layered graphs, as grids are.
"""

import math

import numpy as np
from numpy.typing import NDArray

from .outline import FloatArray

IntArray = NDArray[np.intp]

DIRECTIONS = 32
"""Lines that both sets are projected onto for the lower bound."""
SAME = 1e-12
"""Share of a distance that is rounding."""


def bottleneck(
    goals: FloatArray, starts: FloatArray, robots: IntArray, floor: float = 0.0
) -> tuple[IntArray, float]:
    """An assignment whose greatest distance is the least possible, and that distance, px.

    Args:
        goals, starts: (n, 2), image pixels.
        robots: (n,) any assignment to start from; the shorter its longest way, the faster.
        floor: below this length, px, nothing is gained.
    """
    longest = _longest(goals, starts, robots)
    least = max(min(least_longest(goals, starts), longest), floor)
    radius = least
    while least < longest * (1 - SAME):
        found, bound = _within(goals, starts, robots, radius)
        if found is None:
            least = bound
        else:
            robots, longest = found, _longest(goals, starts, found)
        radius = (least + longest) / 2
    return robots, longest


def least_longest(goals: FloatArray, starts: FloatArray) -> float:
    """A lower bound of the longest way, px.

    No way is shorter than its projection, and on a line the sorted order is best; nor is any
    shorter than the way to the nearest neighbour.
    """
    from scipy.spatial import cKDTree

    angles = np.arange(DIRECTIONS) * math.pi / DIRECTIONS
    lines = np.stack([np.cos(angles), np.sin(angles)])
    apart = np.abs(np.sort(goals @ lines, axis=0) - np.sort(starts @ lines, axis=0))
    to_start, _ = cKDTree(starts).query(goals)
    to_goal, _ = cKDTree(goals).query(starts)
    # A projection of far-off points is rounded; a bound must not pass what it bounds.
    rounding = SAME * float(np.abs(goals).max() + np.abs(starts).max())
    return max(float(apart.max()) - rounding, float(np.max(to_start)), float(np.max(to_goal)))


def _longest(goals: FloatArray, starts: FloatArray, robots: IntArray) -> float:
    return float(np.linalg.norm(goals - starts[robots], axis=1).max())


def _within(
    goals: FloatArray, starts: FloatArray, robots: IntArray, radius: float
) -> tuple[IntArray | None, float]:
    """An assignment with no distance beyond a radius, or None and the next radius to try, px."""
    radius *= 1 + SAME
    robots = np.where(np.linalg.norm(goals - starts[robots], axis=1) <= radius, robots, -1)
    while (robots < 0).any():
        forest = _Forest(goals, starts, robots, radius)
        if not forest.ends:
            return None, forest.next_radius()
        for end in forest.ends:
            forest.augment(robots, end)
    return robots, radius


class _Forest:
    """Alternating trees grown breadth first from every goal without a robot (Hopcroft, Karp 1973).

    Trees share no robot, so that each may be augmented along one path.
    """

    def __init__(
        self, goals: FloatArray, starts: FloatArray, robots: IntArray, radius: float
    ) -> None:
        from scipy.spatial import cKDTree

        n = len(goals)
        self._goals, self._starts = goals, starts
        self._before = np.full(n, -1, dtype=np.intp)  # of a robot: the goal that reached it
        self._root = np.full(n, -1, dtype=np.intp)  # of a goal: the goal its tree grew from
        goal_of = np.full(n, -1, dtype=np.intp)
        goal_of[robots[robots >= 0]] = np.flatnonzero(robots >= 0)
        front = np.flatnonzero(robots < 0)
        self._root[front] = front
        ends: dict[int, int] = {}
        while len(front):
            unseen = np.flatnonzero(self._before < 0)
            tree = cKDTree(goals[front])
            distance, nearest = tree.query(starts[unseen], distance_upper_bound=radius)
            hit = np.isfinite(np.asarray(distance))
            reached = unseen[hit]
            self._before[reached] = front[np.asarray(nearest, dtype=np.intp)[hit]]
            roots = self._root[self._before[reached]]
            idle = goal_of[reached] < 0
            for robot, root in zip(reached[idle], roots[idle], strict=True):
                ends.setdefault(int(root), int(robot))
            front = goal_of[reached[~idle]]
            self._root[front] = roots[~idle]
            front = front[~np.isin(self._root[front], list(ends))]
        self.ends = list(ends.values())

    def augment(self, robots: IntArray, end: int) -> None:
        """Hand robots on along the path that ends at an idle one, in place."""
        robot = end
        while robot >= 0:
            goal = int(self._before[robot])
            robots[goal], robot = robot, int(robots[goal])

    def next_radius(self) -> float:
        """The least distance from the trees' goals to a robot outside: no smaller radius helps."""
        from scipy.spatial import cKDTree

        outside = self._starts[self._before < 0]
        distance, _ = cKDTree(self._goals[self._root >= 0]).query(outside)
        return float(np.min(distance))
