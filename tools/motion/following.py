"""Follows a motion in its order of passage: how far each robot may go on, and where that is."""

import numpy as np

from ..geometry.outline import FloatArray
from .motion import Indices, Motion, arc_lengths

EXACT = 1e-6
"""Within so many px a robot counts as having come to a point of its path."""
NEAR = 0.05
"""Seen within so many px of a vertex of its path, a robot counts as having come to it."""


class Following:
    """The paths of a motion, and which of its passages are open by now.

    Progress, (n,) px, is how far along its path each robot is, in the order of the motion's paths.

    Attributes:
        ids: of the robots.
        lengths: (n,) px of their paths.
        turns: by how much the paths bend at their vertices, one path after the other, radians;
            pi at their ends.
        legs_before: length of the leg that ends at each vertex, px.
    """

    def __init__(self, motion: Motion) -> None:
        self.ids = tuple(motion.paths)
        lengths = [arc_lengths(path) for path in motion.paths.values()]
        self.lengths = np.array([s[-1] for s in lengths])
        kept = [_distinct_vertices(s) for s in lengths]
        sizes = np.array([len(rows) for rows in kept], dtype=np.intp)
        self._ends = np.cumsum(sizes)
        self._begins = self._ends - sizes
        # One sorted table for all paths: the arc lengths of each are offset past those before it.
        self._base = np.concatenate([[0.0], np.cumsum(self.lengths + 1.0)[:-1]])
        self._along = np.concatenate(
            [s[k] + base for s, k, base in zip(lengths, kept, self._base, strict=True)]
        )
        paths = zip(motion.paths.values(), kept, strict=True)
        self._points = np.concatenate([np.asarray(path, dtype=float)[k] for path, k in paths])
        self._directions, self.legs_before, self.turns = self._shape()
        self._passages = motion.passages
        robots = np.arange(len(self.ids))
        self._next = np.searchsorted(motion.passages.waiting, robots, side="left")
        self._last = np.searchsorted(motion.passages.waiting, robots, side="right")

    def _shape(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return unit vectors of the legs after vertices, lengths of those before, and turns."""
        legs = np.diff(self._points, axis=0, append=self._points[-1:])
        size = np.linalg.norm(legs, axis=1)
        size[self._ends - 1] = 0.0
        along = np.divide(legs, size[:, None], out=np.zeros_like(legs), where=size[:, None] > 0)
        cosine = np.einsum("ij,ij->i", along, np.roll(along, 1, axis=0))
        turns = np.arccos(np.clip(cosine, -1.0, 1.0))
        turns[self._ends - 1] = np.pi  # robots stand at the end
        turns[self._begins] = 0.0
        return along, np.roll(size, 1), turns

    def at(self, progress: FloatArray) -> FloatArray:
        """Return the points of the paths at a progress, (n, 2) px."""
        after = self._after(progress)
        before = after - 1
        length = self._along[after] - self._along[before]
        done = self._base + progress - self._along[before]
        share = np.divide(done, length, out=np.zeros(len(done)), where=length > 0)
        begin, end = self._points[before], self._points[after]
        return begin + np.clip(share, 0.0, 1.0)[:, None] * (end - begin)

    def limits(self, progress: FloatArray) -> FloatArray:
        """Return how far along its path each robot may go now, (n,) px; it never gets less."""
        rows, self._next = self._passages, self._open(progress)
        limits = self.lengths.copy()
        held = np.flatnonzero(self._next < self._last)
        limits[held] = rows.at[self._next[held]]
        return limits

    def waits_for(self, progress: FloatArray, slack: float = EXACT) -> dict[str, str]:
        """Return robots within `slack` px of a closed passage, by id, and whom each waits for."""
        held = np.flatnonzero(self._next < self._last)
        rows = self._next[held]
        there = progress[held] >= self._passages.at[rows] - slack
        pairs = zip(held[there], self._passages.first[rows[there]], strict=True)
        return {self.ids[i]: self.ids[j] for i, j in pairs}

    def stops(self, rooms: FloatArray) -> FloatArray:
        """Return how far a robot may go at most, by the vertex it comes to next; for `room`.

        Args:
            rooms: how far past each vertex a robot may come to a stop if it passes the vertex as
                fast as it may, px, in the order of `turns`.
        """
        return np.minimum.accumulate((self._along + rooms)[::-1])[::-1]

    def room(self, progress: FloatArray, stops: FloatArray) -> FloatArray:
        """Return the distance in which each robot must be able to stop for bends ahead, (n,) px."""
        return stops[self._after(progress)] - self._base - progress

    def directions(self, progress: FloatArray) -> FloatArray:
        """Return unit vectors along the legs that robots are on, (n, 2); zero at the end."""
        along = self._directions[self._after(progress) - 1]
        along[progress >= self.lengths - EXACT] = 0.0
        return along

    def advance(self, points: FloatArray, progress: FloatArray, near: float = NEAR) -> FloatArray:
        """Return how far along its path each robot seen at a point, (n, 2) px, is, (n,) px.

        That is where the leg it is on comes nearest; a vertex within `near` px counts as reached,
        and the next leg begins there. Progress never goes back.
        """
        progress, rows = progress.copy(), np.arange(len(progress))
        while len(rows):
            after = self._after(progress[rows], rows)
            before, base = after - 1, self._base[rows]
            begin, vertex = self._along[before] - base, self._along[after] - base
            ahead = points[rows] - self._points[before]
            way = begin + np.einsum("ij,ij->i", ahead, self._directions[before])
            way = np.where(way >= vertex - near, vertex, np.maximum(way, progress[rows]))
            progress[rows] = way
            rows = rows[(way >= vertex - EXACT) & (vertex < self.lengths[rows] - EXACT)]
        return progress

    def _open(self, progress: FloatArray) -> Indices:
        """Return the first passage of each robot that is not open yet, (n,)."""
        rows, upcoming = self._passages, self._next.copy()
        checked = np.flatnonzero(upcoming < self._last)
        while len(checked):
            row = upcoming[checked]
            opened = progress[rows.first[row]] >= rows.past[row] - EXACT
            checked = checked[opened]
            upcoming[checked] += 1
            checked = checked[upcoming[checked] < self._last[checked]]
        return upcoming

    def _after(self, progress: FloatArray, rows: Indices | slice = slice(None)) -> Indices:
        """Return the vertex that each robot comes to next, (n,)."""
        place = self._base[rows] + progress + EXACT / 2
        found = np.searchsorted(self._along, place, side="right")
        return np.clip(found, self._begins[rows] + 1, self._ends[rows] - 1)


def _distinct_vertices(lengths: FloatArray) -> Indices:
    """Return the vertices that are not where the one before is, and the last one.

    At the others, which repeat a place, robots do not turn.
    """
    moved = np.flatnonzero(np.diff(lengths) > EXACT) + 1
    return np.array([0, *moved[:-1], len(lengths) - 1], dtype=np.intp)
