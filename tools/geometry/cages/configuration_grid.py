"""Cells of a configuration space (x, y, theta): grids, connected components and paths.

Arrays are (turns, rows, columns); theta wraps around and its first cell begins at 0. Frame: image
pixels, x right, y down.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPoint

from ..outline import FloatArray
from .rigid import Body, Obstacles

BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]

COARSE = 20
"""Cells along the longer side of the domain at the first level; each level doubles the number."""
MIN_TURNS, MAX_TURNS = 16, 64
"""Fewest and most cells of theta at the first level."""
NEIGHBOURHOOD = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
"""Index offsets to a cell itself and its 26 neighbours, (27, 3)."""


@dataclass(frozen=True)
class Grid:
    """A grid of cells of side `side`, px, from the corner `origin`, image pixels.

    `turns` is the number of cells of theta; `domain` (rows, columns) marks the cells considered.
    """

    origin: FloatArray
    side: float
    turns: int
    domain: BoolArray

    @property
    def angle(self) -> float:
        """The angle of a cell, radians."""
        return 2 * np.pi / self.turns

    @cached_property
    def border(self) -> BoolArray:
        """Cells of the domain that have a neighbour outside it."""
        from scipy import ndimage

        return self.domain & ~ndimage.binary_erosion(self.domain, np.ones((3, 3), dtype=np.intp))

    def seed(self, point: FloatArray) -> tuple[int, int, int]:
        """Return the cell (turn, row, column) of the start pose, whose theta is 0."""
        x, y = np.floor((point - self.origin) / self.side).astype(int)
        return 0, int(y), int(x)

    def centres(self, cells: tuple[IndexArray, ...]) -> FloatArray:
        """Return the poses at the centres of cells, (k, 3)."""
        k, j, i = (index.astype(float) + 0.5 for index in cells)
        x, y = self.origin[0] + i * self.side, self.origin[1] + j * self.side
        return np.stack([x, y, k * self.angle], axis=1)

    def halved(self) -> "Grid":
        """Return a grid of the same domain with cells of half the side and angle."""
        domain = self.domain.repeat(2, axis=0).repeat(2, axis=1)
        return Grid(self.origin, self.side / 2, self.turns * 2, domain)


def first_grid(body: Body, obstacles: Obstacles) -> Grid:
    """Return the coarsest grid, on the slightly widened convex hull of the robots and the body."""
    corners = shapely.get_coordinates(body.polygon) + body.pivot
    hull = MultiPoint(np.concatenate([obstacles.robots, corners])).convex_hull
    x0, y0, x1, y1 = hull.bounds
    side = max(x1 - x0, y1 - y0) / (COARSE - 4)
    region = hull.buffer(1.5 * side)
    origin = np.array([x0, y0]) - 2 * side
    nx, ny = (int(np.ceil(length / side)) + 4 for length in (x1 - x0, y1 - y0))
    x, y = np.meshgrid(np.arange(nx) + 0.5, np.arange(ny) + 0.5)
    centres = origin + np.stack([x.ravel(), y.ravel()], axis=1) * side
    domain = np.asarray(shapely.contains_xy(region, centres), dtype=np.bool_).reshape(x.shape)
    # With this many turns, a cell of theta moves the body about as far as a cell of x or y.
    even = np.pi * np.sqrt(2) * body.reach / side
    turns = int(np.clip(np.ceil(even), MIN_TURNS, MAX_TURNS))
    return Grid(origin, side, turns, domain)


def component(free: BoolArray, seed: tuple[int, int, int]) -> BoolArray:
    """Return the cells 26-connected to the cell `seed`; the first axis wraps around."""
    from scipy import ndimage
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    closed = np.concatenate([free, free[:1]])  # the first layer again, behind the last
    labels = np.empty(closed.shape, dtype=np.int32)
    count = int(ndimage.label(closed, np.ones((3, 3, 3), dtype=np.intp), output=labels))
    same = np.stack([labels[0][free[0]], labels[-1][free[0]]])
    links = coo_array((np.ones(len(same.T)), (same[0], same[1])), (count + 1, count + 1))
    _, part = connected_components(links, directed=False)
    wanted = part == part[labels[seed]]
    wanted[0] = False
    return wanted[labels[:-1]]


def halved(cells: BoolArray) -> BoolArray:
    """Return the same region as cells of the halved grid."""
    return cells.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)


def neighbours(cells: IndexArray, shape: tuple[int, ...]) -> IndexArray:
    """Return the pairs of cells that share a face, (m, 2) indices into cells (k, 3).

    The first axis wraps around.
    """
    keys: IndexArray = np.asarray(np.ravel_multi_index(tuple(cells.T), shape), dtype=np.intp)
    order = np.argsort(keys)
    ordered = keys[order]
    pairs: list[IndexArray] = []
    for axis in range(3):
        beside = cells.copy()
        beside[:, axis] += 1
        beside[:, 0] %= shape[0]
        there = beside[:, axis] < shape[axis]
        beside[~there] = 0
        other = np.asarray(np.ravel_multi_index(tuple(beside.T), shape), dtype=np.intp)
        rank = np.minimum(np.searchsorted(ordered, other), len(keys) - 1)
        found = np.flatnonzero(there & (ordered[rank] == other))
        pairs.append(np.stack([found, order[rank[found]]], axis=1))
    return np.concatenate(pairs)


def shortest_path(links: IndexArray, source: int, ends: BoolArray) -> IndexArray | None:
    """Return a path with the fewest links from a node to the nearest end, or None.

    Args:
        links: (m, 2) pairs of nodes.
        source: the node it starts from.
        ends: (n,) mask of the nodes it may end at.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    count = len(ends)
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), (count, count)).tocsr()
    order, before = breadth_first_order(graph, source, directed=False)
    found = order[ends[order]]
    if not len(found):
        return None
    path = [int(found[0])]
    while path[-1] != source:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])
