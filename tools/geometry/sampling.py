"""Where N robots stand on a curve, at corners, inside a region or around a point.

Pure functions from shapes to (n, 2) float arrays in image pixels (x right, y down). Equal
arc length on curves; centroidal Voronoi (Lloyd 1982) started from a hexagonal lattice inside,
with the lattice itself, the densest packing of discs, where spacing is what counts.
"""

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from .curves import Curve
from .outline import FloatArray, Outline, largest_part, rectangle_of

PHASES = 24
"""Rotations tried when the start of a closed curve is free."""
CELLS_PER_ROBOT = 150
MIN_CELLS, MAX_CELLS = 6_000, 300_000
LLOYD_STEPS = 40
THIN = 0.25
"""Area over boundary length, px, below which a region is treated as a line."""
LATTICE_TURNS = (0.0, math.pi / 12, math.pi / 6)


def along_curve(curve: Curve, n: int) -> FloatArray:
    """N points at equal arc length.

    On a loop the start is free and chosen so that nearest neighbours are as far apart as
    possible. On an open curve the first and last robot stand at its ends, but where that is a
    loop with a cut narrower than a gap, the cut counts as one of the gaps. Several pieces share
    the robots by length, half a gap from their ends.

    Returns:
        (n, 2); empty when nothing of the curve is left.
    """
    if curve.length <= 0:
        return np.empty((0, 2))
    if curve.closed:
        return _best_phase(curve.lines[0], n)
    cut = curve.cut(n)
    if cut is not None:  # the cut is one of n equal gaps, its middle the start
        step = (curve.length + cut) / n
        stations: FloatArray = (step - cut) / 2 + step * np.arange(n, dtype=float)
        return _interpolate(LineString(curve.lines[0]), stations)
    pieces = [LineString(x) for x in curve.lines]
    if len(pieces) == 1:
        return _open_points(pieces[0], n)
    shares = _shares(np.array([p.length for p in pieces]), n)
    return np.concatenate(
        [
            _interpolate(p, (np.arange(k) + 0.5) * p.length / k)
            for p, k in zip(pieces, shares, strict=True)
            if k
        ]
    )


def at_corners(outline: Outline, n: int, standoff: float) -> FloatArray:
    """A place off every corner that n robots may be sent to, pushed outward by a distance.

    Args:
        outline: the thing.
        n: how many robots; see `corner_points`.
        standoff: distance from the outline, px.

    Returns:
        (k, 2), in the corners' order.
    """
    corners = corner_points(outline, n)
    before = _unit(corners - np.roll(corners, 1, axis=0))
    after = _unit(np.roll(corners, -1, axis=0) - corners)
    outward = _unit(before - after)
    reflex = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0
    outward[reflex] *= -1
    return np.stack([_push(outline, c, u, standoff) for c, u in zip(corners, outward, strict=True)])


def corner_points(outline: Outline, n: int) -> FloatArray:
    """The corners that n robots are matched with, (k, 2).

    Four robots on an outline with another number of corners take the minimum-area rectangle's.
    """
    corners = outline.corners
    return outline.bulk_rectangle if n == 4 and len(corners) != 4 else corners


def inside(outline: Outline, n: int, margin: float, depth: float, spacing: float) -> FloatArray:
    """N points spread evenly over a region, holes and concavities respected.

    Lloyd's iteration to a centroidal Voronoi tessellation, best of a few lattice starts;
    where two robots would come nearer than `spacing`, a hexagonal lattice instead.

    Args:
        outline: the region.
        n: how many.
        margin: distance kept from the region's boundary, px.
        depth: greatest distance from it, px; beyond the region's half-width it means nothing.
        spacing: smallest distance allowed between two robots, px.

    Returns:
        (k, 2), k < n when no more fit.
    """
    region = outline.polygon.buffer(-margin).difference(
        outline.polygon.buffer(-min(depth, outline.perimeter))
    )
    if region.is_empty:
        return np.empty((0, 2))
    if region.area < THIN * region.length:
        return _on_axis(region, n, spacing)
    cells = _cells(region, n)
    turns = (_long_angle(region), *LATTICE_TURNS)
    starts = [_lattice(region, n, turn) for turn in (turns if n <= 100 else turns[:1])]
    relaxed = [_lloyd(cells, region, start) for start in starts]
    best = max(relaxed, key=min_spacing)
    if min_spacing(best) >= spacing:
        return best
    packed = max((_pack(region, spacing, turn) for turn in turns), key=len)
    return packed[spread_subset(packed, n)] if len(packed) > n else packed


def around_point(centre: tuple[float, float], n: int, spacing: float) -> FloatArray:
    """N points of a hexagonal lattice nearest to a centre, their mean on it, (n, 2)."""
    reach = math.ceil(math.sqrt(n)) + 1
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
    lattice = np.stack([i + j / 2, j * math.sqrt(3) / 2], axis=-1).reshape(-1, 2) * spacing
    seed = np.array([0.25, 0.1]) * spacing if n in (2, 3) else np.zeros(2)
    order = np.argsort(np.linalg.norm(lattice - seed, axis=1), kind="stable")
    chosen = lattice[order[:n]]
    return chosen - chosen.mean(axis=0) + np.asarray(centre)


def min_spacing(points: FloatArray) -> float:
    """Distance of the closest pair, px; infinite for fewer than two points."""
    if len(points) < 2:
        return math.inf
    return float(nearest(points, points, 2)[0][:, 1].min())


def coverage_radius(outline: Outline, points: FloatArray) -> float:
    """Greatest distance from a point of the region to its nearest robot, px (sampled)."""
    cells = _cells(outline.polygon, len(points))
    return float(nearest(points, cells, 1)[0].max())


def nearest(points: FloatArray, queries: FloatArray, k: int) -> tuple[FloatArray, NDArray[np.intp]]:
    """Distances to and indices of the k nearest points, (m,) each for k = 1, else (m, k)."""
    from scipy.spatial import cKDTree

    distance, index = cKDTree(points).query(queries, k=k)
    return np.asarray(distance, dtype=float), np.asarray(index, dtype=np.intp)


def _best_phase(loop: FloatArray, n: int) -> FloatArray:
    line = LineString(loop)
    step = line.length / n
    starts = np.arange(PHASES) / PHASES * step if n <= 200 else np.zeros(1)
    layouts = [_interpolate(line, start + step * np.arange(n)) for start in starts]
    return max(layouts, key=min_spacing)


def _open_points(line: LineString, n: int) -> FloatArray:
    if n == 1:
        return _interpolate(line, np.array([line.length / 2]))
    return _interpolate(line, np.linspace(0, line.length, n))


def _interpolate(line: LineString, positions: FloatArray) -> FloatArray:
    return shapely.get_coordinates(shapely.line_interpolate_point(line, positions))


def _shares(lengths: FloatArray, n: int) -> list[int]:
    """Split n by largest remainder."""
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
    """Indices of n points far apart, by farthest-point selection, in their given order."""
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    chosen = [int(np.argmax(distance))]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < n:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.sort(np.array(chosen))


def _cells(region: BaseGeometry, n: int) -> FloatArray:
    """Centres of a square grid's cells inside a region: the measure Lloyd's centroids use."""
    count = min(max(MIN_CELLS, CELLS_PER_ROBOT * n), MAX_CELLS)
    return _grid(region, math.sqrt(region.area / count))


def _grid(region: BaseGeometry, pitch: float) -> FloatArray:
    x0, y0, x1, y1 = region.bounds
    x, y = np.meshgrid(np.arange(x0 + pitch / 2, x1, pitch), np.arange(y0 + pitch / 2, y1, pitch))
    shapely.prepare(region)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    kept = points[shapely.contains_xy(region, points)]
    return kept if len(kept) else shapely.get_coordinates(region.representative_point())


def _hex(region: BaseGeometry, pitch: float, turn: float) -> FloatArray:
    """Points of a turned hexagonal lattice inside a region."""
    cx, cy = region.envelope.centroid.x, region.envelope.centroid.y
    x0, y0, x1, y1 = region.bounds
    reach = math.ceil(math.hypot(x1 - x0, y1 - y0) / 2 / pitch * 1.2) + 2
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
    rows = np.stack([i + (j % 2) / 2, j * math.sqrt(3) / 2], axis=-1).reshape(-1, 2) * pitch
    rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    points = rows @ rotation + (cx, cy)
    return points[shapely.intersects_xy(region, points)]


def _long_angle(region: BaseGeometry) -> float:
    """Direction of the longer side of the minimum-area rectangle, radians."""
    sides = np.diff(rectangle_of(region), axis=0)
    x, y = sides[int(np.argmax(np.linalg.norm(sides, axis=1)))]
    return math.atan2(y, x)


def _on_axis(region: BaseGeometry, n: int, spacing: float) -> FloatArray:
    """Up to n points along a region that is little more than a line, straight or closed."""
    band = largest_part(region)
    if band is not None and band.interiors:
        loop = LineString(band.exterior.coords)
        fits = n if spacing <= 0 else min(n, int(loop.length / spacing))
        return _interpolate(loop, np.arange(fits, dtype=float) * loop.length / max(fits, 1))
    a, b, c, d = rectangle_of(region)
    wide = np.linalg.norm(b - a) > np.linalg.norm(c - b)
    ends = [(d + a) / 2, (b + c) / 2] if wide else [(a + b) / 2, (c + d) / 2]
    inner = LineString(ends).intersection(region)
    lines = [g for g in shapely.get_parts(inner) if isinstance(g, LineString) and g.length > 0]
    if not lines:
        return shapely.get_coordinates(region.representative_point())
    line = max(lines, key=lambda g: g.length)
    fits = n if spacing <= 0 else min(n, int(line.length / spacing) + 1)
    return _open_points(line, fits)


def _pack(region: BaseGeometry, spacing: float, turn: float) -> FloatArray:
    """The densest regular packing at a spacing: as many robots as fit."""
    shapely.prepare(region)
    points = _hex(region, spacing, turn)
    return points if len(points) else shapely.get_coordinates(region.representative_point())


def _lattice(region: BaseGeometry, n: int, turn: float) -> FloatArray:
    """Exactly n starting points: the finest lattice with n or more, thinned out evenly."""
    shapely.prepare(region)
    pitch = math.sqrt(2 * region.area / (math.sqrt(3) * n))
    for _ in range(60):
        points = _hex(region, pitch, turn)
        if len(points) >= n:
            return points[spread_subset(points, n)] if n < 2000 else points[_every(len(points), n)]
        pitch *= 0.97
    return _grid(region, pitch)[:n]


def _every(count: int, n: int) -> NDArray[np.intp]:
    return np.linspace(0, count - 1, n).round().astype(np.intp)


def _lloyd(cells: FloatArray, region: BaseGeometry, points: FloatArray) -> FloatArray:
    for _ in range(LLOYD_STEPS):
        owner = nearest(points, cells, 1)[1]
        size = np.bincount(owner, minlength=len(points)).astype(float)
        mean = np.stack(
            [np.bincount(owner, weights=cells[:, k], minlength=len(points)) for k in (0, 1)], axis=1
        )
        filled = size > 0
        moved = points.copy()
        moved[filled] = mean[filled] / size[filled, None]
        outside = ~shapely.intersects_xy(region, moved)
        if outside.any():  # a concave cell's centroid: the nearest place in the region instead
            moved[outside] = cells[nearest(cells, moved[outside], 1)[1]]
        done = float(np.abs(moved - points).max()) < 1e-3
        points = moved
        if done:
            break
    return points
