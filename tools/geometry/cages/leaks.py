"""Checks along one path whether a flood of the finest grid would reach the border.

If it would, the finest grid certifies nothing and the work on its other cells is saved. The cells
checked are a subset of those that the full flood reaches, so no verdict changes.
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
"""Returns the clearance at the centres of cells of a grid, px; -infinite for a blocked cell."""

BISECTIONS = 5
"""Steps of the search for the path whose least clearance is greatest."""


def leaks(gaps: Gaps, grid: Grid, room: FloatArray, start: FloatArray, levels: int) -> bool:
    """Return whether the cells around one path to the border still leak on the finest grid.

    Args:
        gaps: returns the clearance of cells.
        grid: the grid that has been flooded.
        room: its cells' clearance, (turns, rows, columns), -infinite where the flood did not reach.
        start: position of the pivot at the start, (2,), image pixels.
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
    """Return indices into cells (k, 3) of a path of adjacent cells from start to border, or None.

    Of the paths whose least clearance is about the greatest it has the fewest steps.
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
    """Return a mask (k,) of the cells on a path or next to one of its cells."""
    marked = np.zeros((grid.turns, *grid.domain.shape), dtype=bool)
    near = (way[:, None] + NEIGHBOURHOOD).reshape(-1, 3)
    near[:, 0] %= grid.turns
    near[:, 1:] = np.clip(near[:, 1:], 0, np.array(grid.domain.shape) - 1)
    marked[tuple(near.T)] = True
    return marked[tuple(cells.T)]


def _halved(cells: IndexArray) -> IndexArray:
    """Return the cells of the halved grid that make up the given cells, (8 k, 3)."""
    halves = np.stack(np.meshgrid(*[(0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return (2 * cells[:, None] + halves).reshape(-1, 3)
