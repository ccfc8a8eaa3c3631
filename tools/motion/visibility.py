"""Shortest paths on a visibility graph (Lozano-Perez and Wesley 1979). Frame: image pixels."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..geometry.outline import FloatArray


class Visibility:
    """All-pairs shortest paths among nodes that see each other past a barrier."""

    def __init__(self, nodes: FloatArray, barrier: BaseGeometry) -> None:
        from scipy.sparse.csgraph import shortest_path

        self.barrier, self._nodes = barrier, nodes
        if not len(nodes):
            return
        lengths = np.stack([self._sight(node) for node in nodes])
        self._length, self._before = shortest_path(lengths, return_predecessors=True)

    def path(self, start: FloatArray, goal: FloatArray) -> FloatArray | None:
        """Return the shortest path, (k, 2), or None if there is none."""
        if not len(self._nodes):
            return None
        total = self._sight(start)[:, None] + self._length + self._sight(goal)[None, :]
        first, last = np.unravel_index(int(np.argmin(total)), total.shape)
        if not np.isfinite(total[first, last]):
            return None
        chain = [int(last)]
        while chain[-1] != first:
            chain.append(int(self._before[first, chain[-1]]))
        return np.concatenate([[start], self._nodes[chain[::-1]], [goal]])

    def lengths(self, starts: FloatArray, goals: FloatArray) -> FloatArray:
        """Return the lengths of the shortest paths from every start to every goal, (n, m) px."""
        if not len(self._nodes):
            return np.full((len(starts), len(goals)), np.inf)
        to_goals = np.stack([self._sight(goal) for goal in goals], axis=1)
        onward = np.min(self._length[:, :, None] + to_goals[None], axis=1)
        return np.stack([np.min(self._sight(s)[:, None] + onward, axis=0) for s in starts])

    def _sight(self, point: FloatArray) -> FloatArray:
        """Return the distance to every node that is seen from a point, infinite for the others."""
        ends = np.broadcast_to(point, self._nodes.shape)
        lines = shapely.linestrings(np.stack([ends, self._nodes], axis=1))
        distance = np.linalg.norm(self._nodes - point, axis=1)
        return np.where(shapely.intersects(lines, self.barrier), np.inf, distance)
