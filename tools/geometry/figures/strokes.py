"""Spreads robots over drawn lines: at ends, corners and crossings first, then evenly between.

A drawing is any set of polylines, (k, 2) each; lines that meet are connected. Frame: image pixels,
y down.
"""

import heapq
import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, MultiLineString

from ..curves import interpolate
from ..outline import CORNER_TURN, FloatArray
from ..sampling import spread_subset

RESOLUTION = 20_000
"""Lines are snapped to a grid with this many steps over the drawing's extent, to find where they
meet; the drawing's outermost points lie on the grid."""
EVEN = 0.5
"""Corners are occupied if the narrowest gap is then at least this share of the widest."""


class Stretch(NamedTuple):
    """A part of a drawing that no robot stands on.

    Attributes:
        length: length along the line, px.
        robot: index of a robot at one of its ends; None if there is none.
    """

    length: float
    robot: int | None


def split_at_crossings(lines: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    """Split a drawing at its crossings and join lines where only two meet.

    Returns:
        Polylines, each between two crossings or ends; a loop repeats its first point.
    """
    points = np.concatenate(lines)
    low = points.min(axis=0)
    extent = np.ptp(points, axis=0)
    unit = np.where(extent > 0, extent, 1.0) / RESOLUTION
    drawn = MultiLineString([LineString((line - low) / unit) for line in lines])
    merged = shapely.line_merge(shapely.union_all(drawn, grid_size=1.0))
    found = [shapely.get_coordinates(g) for g in shapely.get_parts(merged) if g.length > 0]
    return tuple(low + line * unit for line in found)


def spread(lines: tuple[FloatArray, ...], n: int) -> FloatArray:
    """Return n points over a drawing, (n, 2): at ends, crossings and corners, and evenly between.

    Corners are not favoured if that gives more even gaps. If there are fewer robots than ends and
    crossings, they take a subset of these that is far apart.
    """
    whole = split_at_crossings(lines)
    parted = [piece for walk in whole for piece in _at_corners(walk)]
    cornered, plain = _distributed(parted, n), _distributed(list(whole), n)
    if plain is None:
        keys = _piece_ends(list(whole))
        return keys[spread_subset(keys, n)]
    if cornered is not None and cornered[1] >= min(EVEN, plain[1]):
        return cornered[0]
    return plain[0]


def stretches(lines: tuple[FloatArray, ...], points: FloatArray, reach: float) -> list[Stretch]:
    """Return the parts of a drawing between successive robots, or between a robot and an end.

    Args:
        lines: polylines, (k, 2) each, image pixels.
        points: (n, 2) robots, image pixels.
        reach: a robot within this distance of a line stands on it, px.
    """
    found: list[Stretch] = []
    places = np.asarray(shapely.points(points), dtype=object)
    tree = shapely.STRtree(places)
    for walk in split_at_crossings(lines):
        line = LineString(walk)
        near = np.asarray(tree.query(line, predicate="dwithin", distance=reach), dtype=np.intp)
        if not len(near):
            found.append(Stretch(float(line.length), None))
            continue
        station = np.asarray(shapely.line_locate_point(line, places[near]), dtype=float)
        order = np.argsort(station, kind="stable")
        at, who = station[order], near[order]
        gaps = np.diff(at)
        found += [Stretch(float(g), int(i)) for g, i in zip(gaps, who, strict=False)]
        ends = float(at[0]), float(line.length - at[-1])
        if _closed(walk):
            found.append(Stretch(sum(ends), int(who[-1])))
        else:
            found += [Stretch(ends[0], int(who[0])), Stretch(ends[1], int(who[-1]))]
    return found


def _closed(line: FloatArray) -> bool:
    return len(line) > 3 and bool((line[0] == line[-1]).all())


def _at_corners(walk: FloatArray) -> list[FloatArray]:
    """Split a polyline at its corners; a loop then begins at one, if it has any."""
    steps = np.diff(walk, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turns = np.diff(heading, prepend=heading[-1] if _closed(walk) else heading[:1])
    corners = np.flatnonzero(np.abs((turns + math.pi) % (2 * math.pi) - math.pi) > CORNER_TURN)
    if not len(corners):
        return [walk]
    if _closed(walk):
        walk = np.concatenate([np.roll(walk[:-1], -corners[0], axis=0), walk[corners[:1]]])
        corners = corners[1:] - corners[0]
    cuts = [0, *corners.tolist(), len(walk) - 1]
    return [walk[a : b + 1] for a, b in pairwise(cuts)]


def _piece_ends(pieces: list[FloatArray]) -> FloatArray:
    """Return the end points of pieces, (k, 2), each once; a loop that nothing touches has none."""
    ends = [p[[0, -1]] for p in pieces if not _closed(p) or _touched(p, pieces)]
    return np.unique(np.concatenate(ends), axis=0) if ends else np.empty((0, 2))


def _touched(loop: FloatArray, pieces: list[FloatArray]) -> bool:
    return any(p is not loop and bool((p[[0, -1]] == loop[0]).all(axis=1).any()) for p in pieces)


def _distributed(pieces: list[FloatArray], n: int) -> tuple[FloatArray, float] | None:
    """Place n robots, first at all ends; return them and the ratio of narrowest to widest gap.

    None if there are fewer robots than ends. Each further robot goes to the piece with the widest
    gaps, which makes the widest gap of all as narrow as possible.
    """
    keys = _piece_ends(pieces)
    if n < len(keys):
        return None
    free = [
        _closed(p) and not (len(keys) and bool((keys == p[0]).all(axis=1).any())) for p in pieces
    ]
    lengths = [float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in pieces]
    counts = [0] * len(pieces)
    heap = [(-2 * x if f else -x, i) for i, (x, f) in enumerate(zip(lengths, free, strict=True))]
    heapq.heapify(heap)
    for _ in range(n - len(keys)):
        i = heap[0][1]
        counts[i] += 1
        heapq.heapreplace(heap, (-lengths[i] / (counts[i] + (not free[i])), i))
    gaps = [-gap for gap, _ in heap]
    parts = [keys]
    for piece, length, count, loop in zip(pieces, lengths, counts, free, strict=True):
        first = 0 if loop else 1
        step = length / max(count + first, 1)
        parts.append(interpolate(piece, step * (first + np.arange(count, dtype=float))))
    return np.concatenate(parts), min(gaps) / max(gaps)
