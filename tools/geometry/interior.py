"""Places N robots inside a region: evenly over it, or as far apart as it allows.

An even spread is a centroidal Voronoi tessellation, relaxed from hexagonal lattices; if robots
would come too near to each other, they stand on the widest lattice itself. Frame: image pixels,
y down.
"""

import math
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from .curves import interpolate, round_join_dip
from .lattice import (
    ALL_PHASES,
    Lattice,
    densest_lattice,
    ideal_pitch,
    lattice_points,
    widest_lattice,
)
from .lloyd import MAX_CELLS, cells_of, grid, relax
from .outline import FloatArray, Outline, largest_part, rectangle_of
from .sampling import min_spacing, nearest, open_points, spread_subset

FEW, MANY = 50, 2_000
"""Up to FEW robots, four starts are relaxed for LLOYD_STEPS; past MANY, one lattice in one
orientation is used."""
LLOYD_STEPS = 40
BRISK_STEPS, STRETCH = 12, 1.7
BRISK_CELLS, CELLS_EACH = 75_000, 60
"""Past FEW robots: BRISK_CELLS cells, or CELLS_EACH for each robot if that is more, relaxed in
fewer steps, each STRETCH times as far."""
SOME = 100
"""Up to this many robots four starts are tried; up to MANY, two."""
SURELY = 1.2
"""Slack on the bound that discs about robots cover at most the share of the ground they reach that
hexagonal packing does."""
RELAXED = 0.7
"""Distance of the closest pair after relaxing a lattice of thousands of points, as a share of its
pitch; measured."""
THIN = 0.25
"""Ratio of area to boundary length, px, below which a region is treated as a line."""
FINE_SEGMENTS = 96
FINE_DIP = round_join_dip(FINE_SEGMENTS)
"""Offsetting further than the margin wastes ground; with segments this fine, under 1 part in 10,000
of the margin."""
TURNS = (0.0, math.pi / 12, math.pi / 6)


def inside(outline: Outline, n: int, margin: float, depth: float, spacing: float) -> FloatArray:
    """Return n points spread evenly over a region, respecting holes and concavities.

    Uses Lloyd's iteration to a centroidal Voronoi tessellation, the best of a few lattice starts;
    if two robots would come nearer than `spacing`, a hexagonal lattice instead.

    Args:
        outline: the region.
        n: number of points.
        margin: least distance from the region's boundary, px.
        depth: greatest distance from it, px; no effect beyond the region's half-width.
        spacing: smallest distance allowed between two robots, px.

    Returns:
        (k, 2), k < n if no more fit.
    """
    region = ground(outline, margin, depth)
    if region.is_empty:
        return np.empty((0, 2))
    if region.area < THIN * region.length:
        return _on_axis(region, n, spacing)
    reached = max(region.buffer(spacing / 2).area, region.area)  # GEOS grows nothing by 1e-200
    if n * spacing**2 * math.sqrt(3) / 2 < SURELY * reached:  # otherwise they cannot all fit
        even = _evenly_spread(region, ground(outline, 0, depth), n)
        if min_spacing(even) >= spacing:
            return even.copy()
    turns = (_long_angle(region), *TURNS)
    lies = [Lattice(t, p) for t in turns for p in (ALL_PHASES if n <= MANY else ALL_PHASES[:1])]
    packed = densest_lattice(region, spacing, lies)
    return widest_lattice(region, n, lies, spacing) if len(packed) > n else packed


def yardstick(
    outline: Outline, n: int, margin: float, depth: float, spacing: float
) -> tuple[float, FloatArray]:
    """Return a reference for judging n points in a region: a closest distance and an even spread.

    Up to MANY robots these are the points of `inside`. Beyond that they are the lattice those would
    be relaxed from, which leaves less ground bare, with the share RELAXED of its pitch as distance.

    Args:
        outline, n, margin, depth, spacing: as for `inside`.

    Returns:
        The distance of the closest pair, px, and the points (k, 2); k = 0 if nothing fits.
    """
    region = ground(outline, margin, depth)
    if n > MANY and region.area >= THIN * region.length:
        lattice = widest_lattice(region, n, [Lattice(_long_angle(region))])
        if len(lattice) == n:
            return max(RELAXED * min_spacing(lattice), spacing), lattice
    points = inside(outline, n, margin, depth, spacing)
    return (min_spacing(points) if len(points) > 1 else 0.0), points


def coverage_radius(outline: Outline, points: FloatArray, cells: FloatArray | None = None) -> float:
    """Return the greatest distance from a sampled point of the region to its nearest robot, px.

    Args:
        outline: the region.
        points: (n, 2) robots.
        cells: the samples, if the caller already has them; see `cells_of`.
    """
    sampled = cells_of(outline.polygon, len(points)) if cells is None else cells
    return float(nearest(points, sampled, 1)[0].max())


def ground(outline: Outline, margin: float, depth: float) -> BaseGeometry:
    """Return the part of a region whose distance from its boundary lies within limits.

    Args:
        outline: the region.
        margin: least distance from its boundary, px; kept at reflex corners and holes too.
        depth: greatest distance from it, px.
    """
    kept = outline.polygon.buffer(-margin * FINE_DIP, quad_segs=FINE_SEGMENTS)
    if kept.is_empty:  # a sliver has no round joins to compensate
        kept = outline.polygon.buffer(-margin, quad_segs=FINE_SEGMENTS)
    x0, y0, x1, y1 = outline.bounds
    if 2 * depth >= min(x1 - x0, y1 - y0):  # nothing lies deeper, which GEOS takes long to find out
        return kept
    return kept.difference(outline.polygon.buffer(-depth))


@lru_cache(maxsize=4)  # robots are checked right after they are placed
def _evenly_spread(region: BaseGeometry, covered: BaseGeometry, n: int) -> FloatArray:
    """Return n points of a region spread evenly over a wider one, however near to each other.

    The margin in `covered` is to be covered like the rest, though no robot stands there.
    """
    long = _long_angle(region)
    if n <= FEW:
        cells = cells_of(covered, n)
        starts = [_thinned(region, n, turn) for turn in (long, *TURNS)]
        return max((relax(cells, region, s, LLOYD_STEPS) for s in starts), key=min_spacing)
    cells = cells_of(covered, n, max(BRISK_CELLS, min(CELLS_EACH * n, MAX_CELLS)))
    turns = (long, *TURNS) if n <= SOME else (long, long + math.pi / 6) if n <= MANY else (long,)
    starts = [widest_lattice(region, n, [Lattice(turn)]) for turn in turns]
    full = [s if len(s) == n else _thinned(region, n, long) for s in starts]
    relaxed = [relax(cells, region, s, BRISK_STEPS, STRETCH) for s in full]
    return max(relaxed, key=min_spacing)


def _thinned(region: BaseGeometry, n: int, turn: float) -> FloatArray:
    """Return exactly n starting points: the first lattice found with n or more, thinned evenly."""
    shapely.prepare(region)
    pitch = ideal_pitch(region.area, n)
    for _ in range(60):
        points = lattice_points(region, pitch, Lattice(turn))
        if len(points) >= n:
            return points[spread_subset(points, n)]
        pitch *= 0.97
    return grid(region, pitch)[:n]


def _long_angle(region: BaseGeometry) -> float:
    """Return the direction of the longer side of the minimum-area rectangle, radians."""
    sides = np.diff(rectangle_of(region), axis=0)
    x, y = sides[int(np.argmax(np.linalg.norm(sides, axis=1)))]
    return math.atan2(y, x)


def _on_axis(region: BaseGeometry, n: int, spacing: float) -> FloatArray:
    """Return up to n points along a region that is little more than a line or a loop, (k, 2)."""
    band = largest_part(region)
    if band is not None and band.interiors:
        loop = LineString(band.exterior.coords)
        fits = n if spacing <= 0 else min(n, int(loop.length / spacing))
        return interpolate(
            shapely.get_coordinates(loop), np.arange(fits, dtype=float) * loop.length / max(fits, 1)
        )
    a, b, c, d = rectangle_of(region)
    wide = np.linalg.norm(b - a) > np.linalg.norm(c - b)
    ends = [(d + a) / 2, (b + c) / 2] if wide else [(a + b) / 2, (c + d) / 2]
    inner = LineString(ends).intersection(region)
    lines = [g for g in shapely.get_parts(inner) if isinstance(g, LineString) and g.length > 0]
    if not lines:
        return shapely.get_coordinates(region.representative_point())
    line = max(lines, key=lambda g: g.length)
    fits = n if spacing <= 0 else min(n, int(line.length / spacing) + 1)
    return open_points(shapely.get_coordinates(line), fits)
