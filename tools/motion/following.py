"""Follows a motion in its order of passage: how far each robot may go on, and where that is."""

import numpy as np

from ..geometry.outline import FloatArray
from .motion import Indices, Motion, arc_lengths

EXACT = 1e-6
"""A robot has come to a point of its path within so many px."""


class Following:
    """The paths of a motion, and which of its passages are open by now.

    Progress, (n,) px, is how far along its path each robot is, in the order of the motion's paths.

    Attributes:
        ids: of the robots.
        lengths: (n,) px of their paths.
    """

    def __init__(self, motion: Motion) -> None:
        self.ids = tuple(motion.paths)
        lengths = [arc_lengths(path) for path in motion.paths.values()]
        self.lengths = np.array([s[-1] for s in lengths])
        sizes = np.array([len(s) for s in lengths], dtype=np.intp)
        self._ends = np.cumsum(sizes)
        self._begins = self._ends - sizes
        # One table for all: what comes before a robot is shorter, what comes after it longer.
        self._base = np.concatenate([[0.0], np.cumsum(self.lengths + 1.0)[:-1]])
        self._along = np.concatenate(
            [s + base for s, base in zip(lengths, self._base, strict=True)]
        )
        self._points = np.concatenate(list(motion.paths.values()))
        self._passages = motion.passages
        robots = np.arange(len(self.ids))
        self._next = np.searchsorted(motion.passages.waiting, robots, side="left")
        self._last = np.searchsorted(motion.passages.waiting, robots, side="right")

    def at(self, progress: FloatArray) -> FloatArray:
        """Points of the paths, (n, 2) px."""
        after = self._after(progress)
        before = after - 1
        length = self._along[after] - self._along[before]
        done = self._base + progress - self._along[before]
        share = np.divide(done, length, out=np.zeros(len(done)), where=length > 0)
        begin, end = self._points[before], self._points[after]
        return begin + np.clip(share, 0.0, 1.0)[:, None] * (end - begin)

    def limits(self, progress: FloatArray) -> FloatArray:
        """How far along its path each robot may go now, (n,) px; it never goes back."""
        rows, self._next = self._passages, self._open(progress)
        limits = self.lengths.copy()
        held = np.flatnonzero(self._next < self._last)
        limits[held] = rows.at[self._next[held]]
        return limits

    def waits_for(self, progress: FloatArray) -> dict[str, str]:
        """Robots that stand before a passage, by id, and the robot that each waits for."""
        held = np.flatnonzero(self._next < self._last)
        rows = self._next[held]
        there = progress[held] >= self._passages.at[rows] - EXACT
        pairs = zip(held[there], self._passages.first[rows[there]], strict=True)
        return {self.ids[i]: self.ids[j] for i, j in pairs}

    def bends(self, progress: FloatArray) -> FloatArray:
        """How far along its path each robot's next vertex is, (n,) px; the end of it at last."""
        return self._along[self._after(progress)] - self._base

    def directions(self, progress: FloatArray) -> FloatArray:
        """Unit vectors along the paths to the next vertex, (n, 2); zero at the end."""
        ahead = self._points[self._after(progress)] - self.at(progress)
        size = np.linalg.norm(ahead, axis=1, keepdims=True)
        return np.divide(ahead, size, out=np.zeros_like(ahead), where=size > EXACT)

    def nearest(self, points: FloatArray, progress: FloatArray, reach: float) -> FloatArray:
        """How far along its path each robot seen at a point, (n, 2) px, is, (n,) px.

        Looked for between its progress so far and `reach` px on, as a path may come back.
        """
        tried = progress[:, None] + np.linspace(0.0, reach, 9)
        tried = np.minimum(tried, self.lengths[:, None])
        away = [np.linalg.norm(self.at(column) - points, axis=1) for column in tried.T]
        best = np.argmin(np.stack(away, axis=1), axis=1)
        return np.asarray(tried[np.arange(len(tried)), best])

    def _open(self, progress: FloatArray) -> Indices:
        """The first passage of each robot that is not open yet, (n,)."""
        rows, upcoming = self._passages, self._next.copy()
        checked = np.flatnonzero(upcoming < self._last)
        while len(checked):
            row = upcoming[checked]
            opened = progress[rows.first[row]] >= rows.past[row] - EXACT
            checked = checked[opened]
            upcoming[checked] += 1
            checked = checked[upcoming[checked] < self._last[checked]]
        return upcoming

    def _after(self, progress: FloatArray) -> Indices:
        """The vertex that each robot comes to next, (n,)."""
        found = np.searchsorted(self._along, self._base + progress, side="right")
        return np.clip(found, self._begins + 1, self._ends - 1)
