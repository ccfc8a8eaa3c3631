"""Places N robots on a curve, at corners or around a point, and measures their spacing.

Pure functions from shapes to (n, 2) float arrays in image pixels (x right, y down).
"""

import math

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, Point

from .curves import Curve, interpolate
from .outline import FloatArray, Outline

PHASES = 24
"""Number of starts tried on a closed curve, whose start is free."""
PAIRS = 64
"""Up to this many robots all pairs are compared at once; beyond it a tree is quicker."""


def along_curve(curve: Curve, n: int) -> FloatArray:
    """Return n points at equal arc lengths along a curve.

    On a loop the start is free and chosen so that nearest neighbours are as far apart as
    possible. On an open curve the first and last robots stand at its ends; if it is a loop with a
    cut narrower than a gap, though, the cut counts as one of the gaps. Several pieces share the
    robots by length, half a gap from their ends.

    Returns:
        (n, 2); empty if nothing of the curve is left.
    """
    if curve.length <= 0:
        return np.empty((0, 2))
    if curve.closed:
        return _best_phase(curve.lines[0], n)
    cut = curve.cut(n)
    if cut is not None:  # the cut is one of n equal gaps, its middle the start
        step = (curve.length + cut) / n
        stations: FloatArray = (step - cut) / 2 + step * np.arange(n, dtype=float)
        return interpolate(curve.lines[0], stations)
    if len(curve.lines) == 1:
        return open_points(curve.lines[0], n)
    lengths = [arc_length(line) for line in curve.lines]
    shares = split(np.array(lengths), n)
    return np.concatenate(
        [
            interpolate(line, (np.arange(k) + 0.5) * length / k)
            for line, length, k in zip(curve.lines, lengths, shares, strict=True)
            if k
        ]
    )


def at_corners(outline: Outline, n: int, standoff: float) -> FloatArray:
    """Return a place off each of the `corner_points`, `standoff` px from the outline, (k, 2)."""
    corners = corner_points(outline, n)
    before = _unit(corners - np.roll(corners, 1, axis=0))
    after = _unit(np.roll(corners, -1, axis=0) - corners)
    outward = _unit(before - after)
    reflex = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0
    outward[reflex] *= -1
    return np.stack([_push(outline, c, u, standoff) for c, u in zip(corners, outward, strict=True)])


def corner_points(outline: Outline, n: int) -> FloatArray:
    """Return the corners that n robots are matched with, (k, 2).

    Four robots take the corners of the bulk's rectangle if the outline does not have four corners.
    """
    corners = outline.corners
    return outline.bulk_rectangle if n == 4 and len(corners) != 4 else corners


def around_point(centre: tuple[float, float], n: int, spacing: float) -> FloatArray:
    """Return the n points of a hexagonal lattice nearest to a centre, their mean on it, (n, 2).

    `spacing` is the lattice's pitch, px.
    """
    reach = math.ceil(math.sqrt(n)) + 1
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
    lattice = np.stack([i + j / 2, j * math.sqrt(3) / 2], axis=-1).reshape(-1, 2) * spacing
    seed = np.array([0.25, 0.1]) * spacing if n in (2, 3) else np.zeros(2)
    order = np.argsort(np.linalg.norm(lattice - seed, axis=1), kind="stable")
    chosen = lattice[order[:n]]
    return chosen - chosen.mean(axis=0) + np.asarray(centre)


def min_spacing(points: FloatArray) -> float:
    """Return the distance of the closest pair, px; infinite for fewer than two points."""
    if len(points) < 2:
        return math.inf
    return float(nearest(points, points, 2)[0][:, 1].min())


def nearest(points: FloatArray, queries: FloatArray, k: int) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return distances to and indices of the k nearest points, (m,) each for k = 1, else (m, k)."""
    from scipy.spatial import cKDTree

    distance, index = cKDTree(points).query(queries, k=k)
    return np.asarray(distance, dtype=float), np.asarray(index, dtype=np.intp)


def open_points(line: FloatArray, n: int) -> FloatArray:
    """Return n points at equal arc lengths of a polyline (m, 2), both ends included.

    A single point lies in its middle.
    """
    length = arc_length(line)
    return interpolate(line, np.array([length / 2]) if n == 1 else np.linspace(0, length, n))


def _best_phase(loop: FloatArray, n: int) -> FloatArray:
    step = arc_length(loop) / n
    starts = np.arange(PHASES) / PHASES * step if n <= 200 else np.zeros(1)
    stations = starts[:, None] + step * np.arange(n)
    layouts = interpolate(loop, stations.ravel()).reshape(len(starts), n, 2)
    return layouts[int(np.argmax(_closest_pairs(layouts)))]


def _closest_pairs(layouts: FloatArray) -> FloatArray:
    """Return the distance of the closest pair of each layout (k, n, 2), (k,), px."""
    n = layouts.shape[1]
    if n > PAIRS:
        return np.array([min_spacing(points) for points in layouts])
    i, j = np.triu_indices(n, 1)
    apart = layouts[:, i] - layouts[:, j]
    squares = apart[..., 0] * apart[..., 0] + apart[..., 1] * apart[..., 1]
    return np.sqrt(squares.min(axis=1, initial=np.inf))


def arc_length(line: FloatArray) -> float:
    """Return the length of a polyline (m, 2), px."""
    return float(LineString(line).length)


def split(lengths: FloatArray, n: int) -> list[int]:
    """Split n robots in proportion to lengths (k,), rounding by largest remainder."""
    ideal = n * lengths / lengths.sum()
    counts = np.floor(ideal).astype(int)
    for index in np.argsort(counts - ideal, kind="stable")[: n - counts.sum()]:
        counts[index] += 1
    return [int(c) for c in counts]


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)


def _push(outline: Outline, corner: FloatArray, outward: FloatArray, standoff: float) -> FloatArray:
    """Walk outward from a corner until the region is `standoff` away."""
    reach = standoff
    place = corner + reach * outward
    for _ in range(30):
        place = corner + reach * outward
        short = standoff - outline.filled.distance(Point(place))
        if short <= 1e-6:
            break
        reach += max(short, 0.05 * standoff)
    return place


def spread_subset(points: FloatArray, n: int) -> NDArray[np.intp]:
    """Return the indices of n points far apart, by farthest-point selection, in ascending order."""
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    chosen = [int(np.argmax(distance))]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < n:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.sort(np.array(chosen))
