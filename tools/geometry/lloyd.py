"""Lloyd's iteration to a centroidal Voronoi tessellation, on a square grid of cells.

A step searches again only for cells whose nearest robot may have changed, by an upper bound on the
distance to the own robot and a lower bound on that to any other (Hamerly 2010); none is nearer
within half the way from the robot to its neighbour. Frame: image pixels, x right, y down.
"""

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from .outline import FloatArray
from .sampling import nearest

CELLS_PER_ROBOT = 150
MIN_CELLS, MAX_CELLS = 6_000, 300_000
SETTLED = 1e-3
"""Relaxation ends once no point moves further than this in a step, px."""
ROUNDING = 1e-9
"""Distances that differ by no more than this share are a tie."""


def cells_of(region: BaseGeometry, n: int, most: int = MAX_CELLS) -> FloatArray:
    """Return the centres of square cells that sample a region for computing centroids, (m, 2)."""
    count = min(max(MIN_CELLS, CELLS_PER_ROBOT * n), most)
    return grid(region, math.sqrt(region.area / count))


def grid(region: BaseGeometry, pitch: float) -> FloatArray:
    """Return the centres of a square grid's cells that lie inside a region, (m, 2), m >= 1."""
    x0, y0, x1, y1 = region.bounds
    x, y = np.meshgrid(np.arange(x0 + pitch / 2, x1, pitch), np.arange(y0 + pitch / 2, y1, pitch))
    shapely.prepare(region)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    kept = points[shapely.contains_xy(region, points)]
    return kept if len(kept) else shapely.get_coordinates(region.representative_point())


def relax(
    cells: FloatArray, region: BaseGeometry, points: FloatArray, steps: int, stretch: float = 1.0
) -> FloatArray:
    """Repeatedly move every point towards the centroid of the cells nearest to it.

    Args:
        cells: (m, 2) samples of the area to be covered, see `cells_of`.
        region: no point leaves it.
        points: (n, 2) to start from.
        steps: greatest number of steps.
        stretch: length of a step, as a multiple of the way to the centroid; 1 is Lloyd's (1982),
            up to 2 converges sooner (over-relaxation). The last step is always Lloyd's.

    Returns:
        (n, 2).
    """
    shapely.prepare(region)
    owners = _Owners(cells, points)
    for step in range(steps):
        moved = points.copy()
        size = np.bincount(owners.index, minlength=len(points)).astype(float)
        sums = [np.bincount(owners.index, weights=x, minlength=len(points)) for x in cells.T]
        filled = size > 0
        moved[filled] = np.stack(sums, axis=1)[filled] / size[filled, None]
        if stretch != 1 and step < steps - 1:
            further = points + stretch * (moved - points)
            kept = shapely.intersects_xy(region, further)
            moved[kept] = further[kept]
        outside = ~shapely.intersects_xy(region, moved)
        if outside.any():  # a concave cell's centroid: use the nearest place in the region
            way = shapely.shortest_line(region, shapely.points(moved[outside]))
            moved[outside] = shapely.get_coordinates(way)[::2]
        if float(np.abs(moved - points).max()) < SETTLED:
            return moved
        if step < steps - 1:
            owners.follow(moved, float(np.linalg.norm(moved - points, axis=1).max()))
        points = moved
    return points


class _Owners:
    """The nearest point to every cell, updated as the points move.

    Attributes:
        index: (m,) index of the point nearest to each cell.
    """

    def __init__(self, cells: FloatArray, points: FloatArray) -> None:
        self._cells = cells
        self.index: NDArray[np.intp] = np.zeros(len(cells), dtype=np.intp)
        self._other: FloatArray = np.full(len(cells), np.inf)  # no other point is nearer
        self._reassign(np.arange(len(cells)), points)

    def follow(self, points: FloatArray, furthest: float) -> None:
        """Update after the points have moved to new places, none further than `furthest` px."""
        self._other -= furthest
        own = self._cells - points[self.index]
        distance = np.sqrt(own[:, 0] * own[:, 0] + own[:, 1] * own[:, 1])
        known = self._other
        if len(points) > 1:  # within half the way from its point to the next, none is nearer
            halves = nearest(points, points, 2)[0][:, 1] / 2
            known = np.maximum(known, halves[self.index])
        self._reassign(np.flatnonzero(distance >= known * (1 - ROUNDING)), points)

    def _reassign(self, which: NDArray[np.intp], points: FloatArray) -> None:
        if not len(which) or len(points) < 2:
            return
        distance, index = nearest(points, self._cells[which], 2)
        self.index[which], self._other[which] = index[:, 0], distance[:, 1]
        tie = which[distance[:, 0] >= distance[:, 1] * (1 - ROUNDING)]
        if len(tie):  # of two equally near, the one that a search for one finds
            self.index[tie] = nearest(points, self._cells[tie], 1)[1]
