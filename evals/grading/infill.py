"""Infill: robots inside, apart from each other, and no part of the region far from all of them.

To count robots inside would credit a straight line in one arm of an L; to count the covered share
would credit a crowd with one robot in every part. The lesser of the two counts.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from ...tools.geometry.outline import FloatArray, distances
from ...tools.geometry.sampling import min_spacing, nearest
from ..tasks.task import Goal
from .grades import STRICT_SPREAD, Part

CELLS = 80
"""Cells along a length that is the square root of the area."""


def infill(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge an infill by `min_clearance_px`, `min_spacing_px` and `max_uncovered_px`.

    A robot is right if it stands deep enough inside and belongs to a set of robots that are far
    enough apart; the set is made large by choosing the least crowded first.
    """
    rule, target = goal.success, goal.target.region
    sign = np.where(shapely.contains_xy(target, points), 1.0, -1.0)
    depth = distances(target.boundary, points) * sign
    least, floor = rule["min_clearance_px"], rule["min_spacing_px"]
    problems, strict = list[str](), list[str]()
    if (depth < least).any():
        count = int((depth < least).sum())
        problems.append(f"{count} not inside by {least} px: the worst by {depth.min():.1f}")
    right = separated(points, free & (depth >= least), floor)
    apart = min_spacing(points)
    if apart < floor:
        problems.append(f"two robots {apart:.0f} px apart, {floor} needed")
    elif apart < STRICT_SPREAD * floor:
        strict.append(f"two robots {apart:.0f} px apart, {STRICT_SPREAD * floor:.0f} wanted")
    cells = cells_within(target, target.bounds, goal.target.outline.size / CELLS)
    bare = _bareness(cells, points)
    most = rule["max_uncovered_px"]
    if bare.max() > most:
        problems.append(f"a part {bare.max():.0f} px from the nearest robot, {most} allowed")
    elif STRICT_SPREAD * bare.max() > most:
        strict.append(f"a part {bare.max():.0f} px from a robot, {most / STRICT_SPREAD:.0f} wanted")
    covered = float((_bareness(cells, points[right]) <= most).mean()) if right.any() else 0.0
    measures = {"covered": covered, "uncovered_px": float(bare.max())}
    return Part(right, covered, tuple(problems), tuple(strict), measures)


def separated(points: FloatArray, allowed: NDArray[np.bool_], spacing: float) -> NDArray[np.bool_]:
    """Return a large set of allowed points, no two of which are nearer than the spacing, (m,)."""
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < spacing
    near &= allowed[:, None] & allowed[None]
    np.fill_diagonal(near, False)
    left, apart = allowed.copy(), np.zeros(len(points), dtype=bool)
    while left.any():
        crowd = np.where(left, (near & left).sum(axis=1), len(points) + 1)
        chosen = int(np.argmin(crowd))
        apart[chosen] = True
        left &= ~near[chosen]
        left[chosen] = False
    return apart


def cells_within(
    region: BaseGeometry, bounds: tuple[float, float, float, float], step: float
) -> FloatArray:
    """Return points of a grid over bounds, `step` apart, that lie within a region, (n, 2), px."""
    x0, y0, x1, y1 = bounds
    columns, rows = np.meshgrid(np.arange(x0, x1, step), np.arange(y0, y1, step))
    cells = np.stack([columns.ravel(), rows.ravel()], axis=1)
    return cells[shapely.contains_xy(region, cells)]


def _bareness(cells: FloatArray, points: FloatArray) -> FloatArray:
    """Return the distance of the region's cells to the nearest point, px."""
    return np.asarray(nearest(points, cells, 1)[0], dtype=float).reshape(len(cells))
