"""Checks along one path whether a flood of the finest grid would reach the border.

If it would, the finest grid certifies nothing and the work on its other cells is saved. The cells
checked are a subset of those that the whole flood reaches, so that no verdict depends on it.
"""

from collections.abc import Callable

import numpy as np

from ..outline import FloatArray
from .configuration_grid import (
    NEIGHBOURHOOD,
    BoolArray,
    Grid,
    IndexArray,
    neighbours,
    shortest_path,
)

Cells = tuple[IndexArray, ...]
Gaps = Callable[[Grid, Cells], FloatArray]
"""Clearance in the middle of cells of a grid, px; -infinite where a cell is blocked."""

BISECTIONS = 5
"""Steps in search of the way whose least clearance is greatest."""


def leaks(gaps: Gaps, grid: Grid, room: FloatArray, start: FloatArray, levels: int) -> bool:
    """Whether cells about one way to the border connect it with the start on the finest grid.

    Args:
        gaps: of cells.
        grid: whose flood is known.
        room: its cells' clearance, (turns, rows, columns), -infinite where it does not reach.
        start: of the pivot, (2,), image pixels.
        levels: how often the grid is halved.
    """
    cells = np.stack(np.nonzero(room > -np.inf), axis=1)
    gap = room[tuple(cells.T)]
    for level in range(levels + 1):
        way = _widest_way(cells, gap, grid, start)
        if way is None:
            return False
        if level < levels:
            cells = _halved(cells[_touching(cells, cells[way], grid)])
            grid = grid.halved()
            gap = gaps(grid, tuple(cells.T))
            cells, gap = cells[gap > -np.inf], gap[gap > -np.inf]
    return True


def _widest_way(
    cells: IndexArray, gap: FloatArray, grid: Grid, start: FloatArray
) -> IndexArray | None:
    """Indices of cells (k, 3) on a way from the start to the border, side by side.

    It has the fewest steps of those whose least clearance is about the greatest.
    """
    source = np.flatnonzero((cells == grid.seed(start)).all(axis=1))
    if not len(source):
        return None
    shape = (grid.turns, *grid.domain.shape)
    links, ends = neighbours(cells, shape), grid.border[cells[:, 1], cells[:, 2]]
    way = shortest_path(links, int(source[0]), ends)
    low, high = -4 * grid.side, float(gap[source[0]])
    for _ in range(BISECTIONS if way is not None else 0):
        middle = (low + high) / 2
        wide = links[(gap > middle)[links].all(axis=1)]
        wider = shortest_path(wide, int(source[0]), ends)
        way, low, high = (way, low, middle) if wider is None else (wider, middle, high)
    return way


def _touching(cells: IndexArray, way: IndexArray, grid: Grid) -> BoolArray:
    """Which cells are on a way or have a neighbour there, (k,)."""
    marked = np.zeros((grid.turns, *grid.domain.shape), dtype=bool)
    near = (way[:, None] + NEIGHBOURHOOD).reshape(-1, 3)
    near[:, 0] %= grid.turns
    near[:, 1:] = np.clip(near[:, 1:], 0, np.array(grid.domain.shape) - 1)
    marked[tuple(near.T)] = True
    return marked[tuple(cells.T)]


def _halved(cells: IndexArray) -> IndexArray:
    """The cells of the grid halved that make up some cells, (8 k, 3)."""
    halves = np.stack(np.meshgrid(*[(0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return (2 * cells[:, None] + halves).reshape(-1, 3)
