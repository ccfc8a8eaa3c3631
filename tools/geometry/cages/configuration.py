"""Floods a body's configuration space (x, y, theta) to see whether it can get out between robots.

A cell is blocked only if every configuration in it collides, so what the flood does not reach
cannot be reached (after Varava et al. 2018, who cover slices of the space). The converse does not
hold: a way out counts only once its moves have been checked continuously.
"""

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..outline import FloatArray, largest_part
from .configuration_grid import Grid, IndexArray, component, first_grid, halved
from .escape import way_out
from .leaks import leaks
from .rigid import Body, Obstacles

TABLE = 192
"""Side of the table of signed distances, in pixels of the table."""
DETAIL, MAX_CORNERS = 0.002, 48
"""An outline with more than MAX_CORNERS corners is shrunk and simplified by at least DETAIL, a
share of its reach."""
WALL_POINTS = 400
RUN = 24
"""Number of successive wall points for which cells out of reach are skipped together."""
SEARCHED = (1, 2)
"""Levels on which a way out is sought: earlier grids are too coarse, later ones too slow."""
FOLLOWED = 1
"""Level from which one path is followed down to the last level, which leaks if the path does."""


@dataclass(frozen=True)
class Flood:
    """The result of a flood: `enclosed` is proved; `path`, poses (k, 3), is a verified way out."""

    enclosed: bool
    path: FloatArray | None = None


def flood(body: Body, obstacles: Obstacles, levels: int, *, escapes: bool = True) -> Flood:
    """Flood the configurations from the body's present one, on ever finer grids.

    In the domain the pivot lies within the convex hull of the robots and the body, slightly
    widened; the body is enclosed if the flood does not reach its border. Let a cell have the
    centre (t0, theta0), the side h and the angle w. In a configuration (t, theta) of the cell
    the body sees a robot p at q = R(-theta)(p - t), with
    |q - q0| <= |t - t0| + 2 |p - t0| sin(|theta - theta0| / 2) <= h / sqrt(2) + |p - t0| w / 2.
    The signed distance sd to the body is 1-Lipschitz, and the table bounds it from above at q0
    (the value at the pixel's centre plus half the pixel's diagonal), for the body or a part of
    it, never for more. So if sd(q0) + h / sqrt(2) + |p - t0| w / 2 < radius, every configuration
    of the cell collides, and the cell is blocked. A path passes between cells with a common point,
    that is, 26-neighbours, with theta closed to a circle. Walls are represented by sample points.

    Args:
        body, obstacles: must not overlap.
        levels: greatest number of grids, each with half the cell size of the one before.
        escapes: whether to look for a way out.
    """
    table = _distance_table(body, obstacles.radius)
    grid = first_grid(body, obstacles)
    alive = np.broadcast_to(grid.domain, (grid.turns, *grid.domain.shape))
    sure = np.zeros(alive.shape, dtype=bool)
    last = levels - 1
    for level in range(levels):
        room = np.where(sure, _cell_motion(table, grid), -np.inf)
        cells = np.nonzero(alive & ~sure)
        room[cells] = _cell_clearances(table, obstacles, grid, cells)
        reached = component(room > -np.inf, grid.seed(body.pivot))
        if not reached[:, grid.border].any():
            return Flood(bool(reached.any()))
        room[~reached] = -np.inf
        if escapes and level in SEARCHED:
            path = way_out(body, obstacles, grid, room)
            if path is not None:
                return Flood(False, path)
        if level == FOLLOWED < last and leaks(
            partial(_cell_clearances, table, obstacles), grid, room, body.pivot, last - level
        ):
            last = max(SEARCHED) if escapes else level
        if level == last:
            break
        sure = halved(room > _cell_motion(table, grid) + table.slack)
        grid, alive = grid.halved(), halved(reached)
    return Flood(False)


def _cell_motion(table: "_Table", grid: Grid) -> float:
    """Return a bound on how far a robot moves in the body's frame within a cell, px."""
    return grid.side / np.sqrt(2) + grid.angle / 2 * table.reach


@dataclass(frozen=True)
class _Table:
    """Upper bounds on the signed distance to a body (negative inside), px.

    Attributes:
        values: one for each pixel of the square of half-side `half`, px, about the pivot.
        reach: the table is valid within this distance of the pivot, px.
        slack: how far a value lies above the distance at its pixel's centre, px.
    """

    values: FloatArray
    half: float
    reach: float
    slack: float

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        scale = len(self.values) / (2 * self.half)
        column = ((x + self.half) * scale).astype(np.intp)
        row = ((y + self.half) * scale).astype(np.intp)
        return self.values[row, column]


def _distance_table(body: Body, radius: float) -> _Table:
    inner = _simplified(body)
    reach = body.reach + radius
    half = reach * 1.001
    pixel = 2 * half / TABLE
    ticks = (np.arange(TABLE) + 0.5) * pixel - half
    x, y = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
    ring = shapely.get_coordinates(inner.exterior)
    squared = np.full(len(x), np.inf)
    for (ax, ay), (bx, by) in pairwise(ring.tolist()):
        dx, dy = bx - ax, by - ay
        px, py = x - ax, y - ay
        along = np.clip((px * dx + py * dy) / max(dx * dx + dy * dy, 1e-30), 0, 1)
        px -= along * dx
        py -= along * dy
        np.minimum(squared, px * px + py * py, out=squared)
    shapely.prepare(inner)
    sign = np.where(shapely.contains_xy(inner, x, y), -1.0, 1.0)
    slack = pixel / np.sqrt(2) * (1 + 1e-9)
    values = sign * np.sqrt(squared) + slack
    return _Table(values.reshape(TABLE, TABLE), half, reach, float(slack))


def _simplified(body: Body) -> Polygon:
    """Return a part of the body with few corners; if that cannot get out, the body cannot."""
    share = DETAIL
    while len(body.polygon.exterior.coords) > MAX_CORNERS + 1 and share < 0.05:
        step = share * body.reach
        part = largest_part(body.polygon.buffer(-step).simplify(step, preserve_topology=True))
        share *= 2
        if part is None:
            break
        few = Polygon(part.exterior)
        if len(few.exterior.coords) <= MAX_CORNERS + 1 and body.polygon.covers(few):
            return few
    return body.polygon


def _cell_clearances(
    table: _Table, obstacles: Obstacles, grid: Grid, cells: tuple[IndexArray, ...]
) -> FloatArray:
    """Return the clearance at the centre of each cell, estimated from the table, (k,), px.

    It is infinite where no robot is near, -infinite where the whole cell is blocked.
    """
    x, y, theta = grid.centres(cells).T
    cos, sin = np.cos(theta), np.sin(theta)
    least = np.full(len(x), np.inf)
    step, turn = grid.side / np.sqrt(2), grid.angle / 2
    for points, radius in _obstacle_points(table, obstacles, grid):
        (x0, y0), (x1, y1) = points.min(axis=0) - table.reach, points.max(axis=0) + table.reach
        close = np.flatnonzero((x > x0) & (x < x1) & (y > y0) & (y < y1) & (least > -np.inf))
        cx, cy = x[close], y[close]
        for px, py in points:
            dx, dy = px - cx, py - cy
            away = dx * dx + dy * dy
            near = np.flatnonzero(away < table.reach**2)
            index, dx, dy = close[near], dx[near], dy[near]
            c, s = cos[index], sin[index]
            distance = table(c * dx + s * dy, c * dy - s * dx) - radius
            bound = step + turn * np.sqrt(away[near])
            gap = np.where(distance + bound < 0, -np.inf, distance - table.slack)
            least[index] = np.minimum(least[index], gap)
    return least


def clearances(body: Body, robots: FloatArray, radius: float, grid: Grid) -> NDArray[np.float32]:
    """Return the rough clearance in every cell from each robot (k, 2) alone, px.

    Returns:
        (k, turns, rows, columns), infinite where a robot is out of the body's reach.
    """
    table = _distance_table(body, radius)
    cells = tuple(index.ravel() for index in np.indices((grid.turns, *grid.domain.shape)))
    x, y, theta = grid.centres(cells).T
    cos, sin = np.cos(theta), np.sin(theta)
    fields = np.full((len(robots), len(x)), np.inf, dtype=np.float32)
    for field, (px, py) in zip(fields, robots, strict=True):
        dx, dy = px - x, py - y
        near = np.flatnonzero(dx * dx + dy * dy < table.reach**2)
        c, s, dx, dy = cos[near], sin[near], dx[near], dy[near]
        field[near] = table(c * dx + s * dy, c * dy - s * dx) - table.slack - radius
    return fields.reshape(-1, grid.turns, *grid.domain.shape)


def _obstacle_points(
    table: _Table, obstacles: Obstacles, grid: Grid
) -> list[tuple[FloatArray, float]]:
    """Return groups of obstacle points, each with a radius.

    First the robots with theirs, then runs of points on the walls within reach, with radius 0.
    """
    points = [(obstacles.robots, obstacles.radius)]
    if obstacles.walls is not None:
        walls = _wall_points(obstacles.walls, table.half, grid)
        points += [(walls[i : i + RUN], 0.0) for i in range(0, len(walls), RUN)]
    return points


def _wall_points(walls: BaseGeometry, reach: float, grid: Grid) -> FloatArray:
    """Return points on the walls within `reach` px of the grid, (k, 2)."""
    x0, y0 = grid.origin - reach
    x1, y1 = grid.origin + grid.side * np.array(grid.domain.shape[::-1]) + reach
    lines = walls.boundary if shapely.get_dimensions(walls) == 2 else walls
    lines = lines.intersection(Polygon.from_bounds(float(x0), float(y0), float(x1), float(y1)))
    step = max(float(lines.length) / WALL_POINTS, grid.side / 4)
    return shapely.get_coordinates(shapely.segmentize(lines, step))
