"""Finds a way out between robots: planned on a grid of configurations, then proved move by move.

Moves are checked only when a path uses them (lazy planning, Bohlin and Kavraki 2000). A path that
is returned is clear throughout and ends where a line separates the body from every robot.
"""

import numpy as np

from ..outline import FloatArray
from .configuration_grid import (
    NEIGHBOURHOOD,
    BoolArray,
    Grid,
    component,
    neighbours,
    shortest_path,
)
from .rigid import Body, Obstacles, clear_moves, shortened, ways_out

RETRIES = 6
"""How many paths are planned, each without the moves found not to be clear."""
EXITS = 24
"""Most border cells at which a path may end, evenly spread over those that are reached."""


def way_out(body: Body, obstacles: Obstacles, grid: Grid, room: FloatArray) -> FloatArray | None:
    """Return a verified way out of the domain and away, poses (k, 3) from the start, or None.

    Args:
        body: what is to get out.
        obstacles: what it is to get out of.
        grid: the grid of configurations.
        room: (turns, rows, columns), clearance at the centre of each cell, px; only a guide.
    """
    start = _entry(body, obstacles, grid, room)
    if start is None:
        return None
    reached = component(room > 0, start)
    exits = _exits(body, obstacles, grid, reached)
    if not exits:
        return None
    cells = np.flatnonzero(reached)
    poses = grid.centres(np.unravel_index(cells, reached.shape))
    links = np.sort(neighbours(np.stack(np.nonzero(reached), axis=1), reached.shape), axis=1)
    source = int(np.searchsorted(cells, np.ravel_multi_index(start, reached.shape)))
    ends = np.isin(cells, list(exits))
    for _ in range(RETRIES):
        nodes = shortest_path(links, source, ends)
        if nodes is None:
            return None
        path = np.stack([body.start, *poses[nodes], exits[int(cells[nodes[-1]])]])
        path[:, 2] = np.unwrap(path[:, 2])
        clear = clear_moves(body, obstacles, path[:-1], path[1:])
        if clear.all():
            return shortened(body, obstacles, path)
        if not (clear[0] and clear[-1]):
            return None
        bad = np.sort(np.stack([nodes[:-1], nodes[1:]], axis=1)[~clear[1:-1]], axis=1)
        links = links[~np.isin(links @ (len(cells), 1), bad @ (len(cells), 1))]
    return None


def _entry(
    body: Body, obstacles: Obstacles, grid: Grid, room: FloatArray
) -> tuple[int, int, int] | None:
    """Return the roomiest cell at or beside the start with a clear straight move to its centre.

    None if there is none with positive clearance.
    """
    cells = NEIGHBOURHOOD + grid.seed(body.pivot)
    inside = ((cells[:, 1:] >= 0) & (cells[:, 1:] < room.shape[1:])).all(axis=1)
    cells = cells[inside]
    poses = grid.centres(tuple(cells.T))  # before theta wraps, so that the turn stays small
    clear = clear_moves(body, obstacles, np.repeat(body.start[None], len(poses), 0), poses)
    cells[:, 0] %= room.shape[0]
    best = max(cells[clear], key=lambda c: room[tuple(c)], default=None)
    if best is None or room[tuple(best)] <= 0:
        return None
    return int(best[0]), int(best[1]), int(best[2])


def _exits(
    body: Body, obstacles: Obstacles, grid: Grid, reached: BoolArray
) -> dict[int, FloatArray]:
    """Return the border cells from which a straight move gets the body away, with its end pose."""
    found = np.flatnonzero(reached & grid.border)
    if not len(found):
        return {}
    found = found[np.unique(np.linspace(0, len(found) - 1, EXITS).astype(int))]
    poses = grid.centres(np.unravel_index(found, reached.shape))
    away = np.stack([ways_out(body, obstacles, pose) for pose in poses])
    here = np.repeat(poses[:, None], away.shape[1], axis=1)
    clear = clear_moves(body, obstacles, here.reshape(-1, 3), away.reshape(-1, 3))
    reach = np.linalg.norm((away - here)[..., :2], axis=2)
    reach[~clear.reshape(reach.shape)] = np.inf
    return {
        int(found[k]): away[k, np.argmin(reach[k])]
        for k in np.flatnonzero(np.isfinite(reach.min(axis=1)))
    }
