"""Paths cut into short cells, and which cells of two robots are too near to be used at once.

Frame: image pixels; lengths along paths in px.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..geometry.outline import FloatArray
from .motion import Indices, arc_lengths

SEGMENT_ROWS = 2_000_000
"""Pairs of cells that are measured at a time, to bound the memory this takes."""


@dataclass(frozen=True)
class Cells:
    """The c cells of n paths, one path after the other.

    The first cell of a path is its start and the last its goal, both of no length.

    Attributes:
        robot: (c,) the robot that drives each cell.
        begin, end: (c, 2) px.
        enter, leave: (c,) arc length where it begins and ends along all that its robot drives, px.
        first: (n + 1,) index of the first cell of each path, and c at the end.
    """

    robot: Indices
    begin: FloatArray
    end: FloatArray
    enter: FloatArray
    leave: FloatArray
    first: Indices

    @property
    def starts(self) -> Indices:
        """Index of each path's start, (n,)."""
        return self.first[:-1]

    @property
    def goals(self) -> Indices:
        """Index of each path's goal, (n,)."""
        return self.first[1:] - 1

    def of(self, path: int) -> slice:
        """Return the slice of a path's cells."""
        return slice(int(self.first[path]), int(self.first[path + 1]))


def cut(paths: Sequence[FloatArray], owners: Indices, step: float) -> Cells:
    """Cut polylines, (k, 2) px each, at their vertices and into cells no longer than a step.

    Args:
        owners: (n,) the robot that drives each path. A path whose own index differs from that is a
            first leg, driven before the path of its robot's index.
    """
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
    before = np.zeros(len(paths))
    legs = np.arange(len(paths)) != owners
    before[owners[legs]] = [s[-1] for s, leg in zip(knots, legs, strict=True) if leg]
    knots = [s + offset for s, offset in zip(knots, before, strict=True)]
    return Cells(
        robot=np.repeat(owners, counts),
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
    """Return the pairs of cells of two robots that come nearer to each other than `apart` px.

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
    """Return how near the cells of each pair come, (p,) px, by their ends alone.

    For crossing cells this exceeds 0, but stays below any distance kept, since cells are shorter.
    """
    one, other = pairs.T
    ends = [
        _to_segment(cells.begin[one], other, cells),
        _to_segment(cells.end[one], other, cells),
        _to_segment(cells.begin[other], one, cells),
        _to_segment(cells.end[other], one, cells),
    ]
    return np.min(ends, axis=0)


def _to_segment(points: FloatArray, segment: Indices, cells: Cells) -> FloatArray:
    """Return the distance of points, (p, 2), to the cell of the same row, (p,)."""
    begin, along = cells.begin[segment], cells.end[segment] - cells.begin[segment]
    square = np.einsum("ij,ij->i", along, along)
    dot = np.einsum("ij,ij->i", points - begin, along)
    share = np.clip(np.divide(dot, square, out=np.zeros_like(dot), where=square > 0), 0.0, 1.0)
    off = begin + share[:, None] * along - points
    return np.sqrt(np.einsum("ij,ij->i", off, off))
