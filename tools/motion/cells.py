"""Paths cut into short cells, and which cells of two robots are too near for both to be in.

Frame: image pixels; lengths along paths in px.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..geometry.outline import FloatArray
from .motion import Indices, arc_lengths

SEGMENT_ROWS = 2_000_000
"""Pairs of cells that are measured at a time, which bounds the memory it takes."""


@dataclass(frozen=True)
class Cells:
    """Parts of paths, c of them, one robot's after the other's.

    The first of a robot is its start and the last its goal, both of no length.

    Attributes:
        robot: (c,) whose it is.
        begin, end: (c, 2) px.
        enter, leave: (c,) arc length where it begins and ends, px.
        first: (n + 1,) where the cells of each robot begin, and the last one's end.
    """

    robot: Indices
    begin: FloatArray
    end: FloatArray
    enter: FloatArray
    leave: FloatArray
    first: Indices

    @property
    def starts(self) -> Indices:
        """(n,) each robot's start."""
        return self.first[:-1]

    @property
    def goals(self) -> Indices:
        """(n,) each robot's goal."""
        return self.first[1:] - 1

    def of(self, robot: int) -> slice:
        """The cells of a robot."""
        return slice(int(self.first[robot]), int(self.first[robot + 1]))


def cut(paths: Sequence[FloatArray], step: float) -> Cells:
    """Cut polylines, (k, 2) px each, at their vertices and into cells no longer than a step."""
    knots: list[FloatArray] = []
    for path in paths:
        along = arc_lengths(path)
        shares: list[FloatArray] = [along[:1], along[:1]]
        for begin, end in pairwise(map(float, along)):
            if end > begin:
                count = int(np.ceil((end - begin) / step - 1e-9)) or 1
                shares.append(np.linspace(begin, end, count + 1)[1:])
        shares.append(along[-1:])
        knots.append(np.concatenate(shares))
    points = [_points(path, s) for path, s in zip(paths, knots, strict=True)]
    counts = np.array([len(s) - 1 for s in knots], dtype=np.intp)
    return Cells(
        robot=np.repeat(np.arange(len(paths)), counts),
        begin=np.concatenate([p[:-1] for p in points]),
        end=np.concatenate([p[1:] for p in points]),
        enter=np.concatenate([s[:-1] for s in knots]),
        leave=np.concatenate([s[1:] for s in knots]),
        first=np.concatenate([[0], np.cumsum(counts)]).astype(np.intp),
    )


def _points(path: FloatArray, along: FloatArray) -> FloatArray:
    s = arc_lengths(path)
    return np.stack([np.interp(along, s, path[:, axis]) for axis in (0, 1)], axis=1)


def conflicts(cells: Cells, apart: float, step: float) -> Indices:
    """Pairs of cells of two robots that come nearer to each other than `apart` px.

    Args:
        step: greatest length of a cell, less than `apart`.

    Returns:
        (p, 2), the cell of the robot with the lower number first.
    """
    from scipy.spatial import cKDTree

    middles = (cells.begin + cells.end) / 2
    pairs = cKDTree(middles).query_pairs(apart + step, output_type="ndarray")
    pairs = pairs[cells.robot[pairs[:, 0]] != cells.robot[pairs[:, 1]]]
    pairs.sort(axis=1)
    found = [
        part[_distance(cells, part) < apart]
        for part in np.array_split(pairs, len(pairs) // SEGMENT_ROWS + 1)
    ]
    return np.concatenate(found)


def _distance(cells: Cells, pairs: Indices) -> FloatArray:
    """How near two cells come, (p,) px, unless they cross: where they do they are shorter."""
    one, other = pairs.T
    ends = [
        _to_segment(cells.begin[one], other, cells),
        _to_segment(cells.end[one], other, cells),
        _to_segment(cells.begin[other], one, cells),
        _to_segment(cells.end[other], one, cells),
    ]
    return np.min(ends, axis=0)


def _to_segment(points: FloatArray, segment: Indices, cells: Cells) -> FloatArray:
    """Distance of points, (p, 2), to the cell of the same row, (p,)."""
    begin, along = cells.begin[segment], cells.end[segment] - cells.begin[segment]
    square = np.einsum("ij,ij->i", along, along)
    dot = np.einsum("ij,ij->i", points - begin, along)
    share = np.clip(np.divide(dot, square, out=np.zeros_like(dot), where=square > 0), 0.0, 1.0)
    off = begin + share[:, None] * along - points
    return np.sqrt(np.einsum("ij,ij->i", off, off))
