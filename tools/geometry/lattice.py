"""Fits hexagonal lattices, the densest packings of discs, into a region for n points.

Frame: image pixels, x right, y down; turns are radians.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from .outline import FloatArray, distances
from .sampling import spread_subset

HALVINGS = 12
"""Steps of the search for the widest pitch, which find it to about 1 part in 10,000."""
NARROWEST = 0.55
"""The search for a pitch starts at this share of the ideal pitch on open ground."""
ALL_PHASES = tuple((i / 4, j / 4) for i in range(4) for j in range(4))
"""Phases of a lattice to try, as shares of its two basis vectors."""


class Lattice(NamedTuple):
    """The placement of a lattice: its turn, radians, and phase, as shares of its basis vectors."""

    turn: float
    phase: tuple[float, float] = (0.0, 0.0)


def ideal_pitch(area: float, n: int) -> float:
    """Return the pitch, px, at which n points of a hexagonal lattice take up an area, px^2."""
    return math.sqrt(2 * area / (math.sqrt(3) * n))


def lattice_points(region: BaseGeometry, pitch: float, placement: Lattice) -> FloatArray:
    """Return the points of a lattice inside a region, row by row, (k, 2)."""
    cx, cy = region.envelope.centroid.x, region.envelope.centroid.y
    x0, y0, x1, y1 = region.bounds
    c, s = math.cos(placement.turn), math.sin(placement.turn)
    width, height = (x1 - x0) / 2, (y1 - y0) / 2
    along, across = width * abs(c) + height * abs(s), width * abs(s) + height * abs(c)
    columns = math.ceil(along / pitch) + 2
    rows = math.ceil(across / (pitch * math.sqrt(3) / 2)) + 1
    i, j = np.meshgrid(np.arange(-columns, columns + 1), np.arange(-rows, rows + 1))
    x, y = i + (j % 2) / 2 + placement.phase[0] + placement.phase[1] / 2, j + placement.phase[1]
    flat = np.stack([x, y * math.sqrt(3) / 2], axis=-1).reshape(-1, 2) * pitch
    points = flat @ np.array([[c, s], [-s, c]]) + (cx, cy)
    return points[shapely.intersects_xy(region, points)]


def densest_lattice(
    region: BaseGeometry, pitch: float, placements: Sequence[Lattice]
) -> FloatArray:
    """Return the points of a lattice in a region, in the placement that fits the most, (k, 2).

    A representative point of the region if none fits.
    """
    shapely.prepare(region)
    best = max((lattice_points(region, pitch, placement) for placement in placements), key=len)
    return best if len(best) else shapely.get_coordinates(region.representative_point())


def widest_lattice(
    region: BaseGeometry, n: int, placements: Sequence[Lattice], least: float = 0.0
) -> FloatArray:
    """Return exactly n points of the widest lattice with n in a region, without gaps inside.

    Args:
        region: one or more polygons.
        n: number of points.
        placements: the turns and phases to try.
        least: a pitch known to give n or more, px; 0 if none is known.

    Returns:
        (n, 2); fewer only if the region is too thin for a lattice.
    """
    shapely.prepare(region)
    low = max(least, NARROWEST * ideal_pitch(region.area, n))
    best, pitch = np.empty((0, 2)), low
    for placement in placements:
        if len(best) < n or len(lattice_points(region, pitch * 1.0005, placement)) >= n:
            points, wider = _widest_pitch(region, n, placement, low if len(best) < n else pitch)
            if (len(best) < n) or (len(points) >= n and wider > pitch):
                best, pitch = points, wider
    return _thinned_at_boundary(region, best, len(best) - n, pitch) if len(best) > n else best


def _widest_pitch(
    region: BaseGeometry, n: int, placement: Lattice, low: float
) -> tuple[FloatArray, float]:
    """Return the points of the widest pitch that gives n or more, by bisection, and that pitch.

    The count does not fall steadily with the pitch; the last pitch that gave enough is used.
    """
    kept = lattice_points(region, low, placement)
    for _ in range(20):
        if len(kept) >= n:
            break
        low *= 0.9
        kept = lattice_points(region, low, placement)
    high = max(1.25 * ideal_pitch(region.area, n), low * 1.3)
    for _ in range(HALVINGS):
        pitch = (low + high) / 2
        points = lattice_points(region, pitch, placement)
        if len(points) >= n:
            kept, low = points, pitch
        else:
            high = pitch
    return kept, low


def _thinned_at_boundary(
    region: BaseGeometry, points: FloatArray, surplus: int, pitch: float
) -> FloatArray:
    """Return the points less `surplus` of those next to the boundary, chosen far apart."""
    depth = distances(region.boundary, points)
    outermost = np.argsort(depth, kind="stable")
    count = max(int((depth < pitch / 2).sum()), surplus)
    edge = outermost[: min(count, max(4 * surplus, 8))]
    gone = edge[spread_subset(points[edge], surplus)] if surplus < len(edge) else edge
    return np.delete(points, gone, axis=0)
