"""From where robots are to where they shall stand: on which path.

Paths are shortest ones around the targets on a visibility graph (Lozano-Perez and Wesley 1979).
Frame: image pixels. Robots do not yet avoid each other.
"""

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import FleetError
from ..formation.contract import Contract
from ..formation.placement.place import Site
from ..geometry.curves import Frame
from ..geometry.outline import FloatArray, distances

MAX_NODES = 60
"""Vertices kept of an obstacle: enough for a path within a percent of the shortest."""
BEND_SEGMENTS = 2
"""Segments of a quarter circle around an obstacle's corner."""
ROOM_SHARES = (0.7, 0.3, 0.03)
"""How much of the smallest clearance at starts and goals paths keep: well away where there is
room, squeezing past where not."""


def obstacles(contract: Contract, site: Site) -> BaseGeometry:
    """What robots have to drive around: targets no group of the contract stands on."""
    solid = [site.outlines[t].filled for t in contract.solid_targets]
    return shapely.union_all(np.asarray(solid, dtype=object)) if solid else Polygon()


def routes(
    starts: FloatArray, goals: FloatArray, solid: BaseGeometry, radius: float, frame: Frame
) -> list[FloatArray]:
    """Shortest paths that keep robots of a radius off the obstacles, start i to goal i.

    Paths stay in the frame where they can, and leave it only where there is no other way.

    Args:
        starts, goals: (n, 2), off the obstacles.
        solid: the obstacles' union.
        radius: of a robot, px.
        frame: the picture.

    Returns:
        n polylines, (k, 2) each.

    Raises:
        FleetError: a goal is walled off.
    """
    paths = list(np.stack([starts, goals], axis=1))
    if solid.is_empty:
        return paths
    near = float(min(distances(solid, starts).min(), distances(solid, goals).min()))
    widest = _barrier(solid, radius, near, ROOM_SHARES[0])
    straight = shapely.linestrings(np.stack([starts, goals], axis=1))
    open_ends = [int(i) for i in np.flatnonzero(shapely.intersects(straight, widest))]
    if not open_ends:
        return paths
    for share in ROOM_SHARES:
        barrier = _barrier(solid, radius, near, share)
        nodes = _nodes(solid, _keep(radius, near, share))
        within = nodes[shapely.intersects_xy(frame.box, nodes)]
        graph = _Visibility(within, barrier)
        open_ends = [i for i in open_ends if not _settled(paths, i, graph, barrier)]
        if not open_ends:
            return paths
    barrier = _barrier(solid, radius, near, ROOM_SHARES[-1])
    anywhere = _Visibility(_nodes(solid, _keep(radius, near, ROOM_SHARES[-1])), barrier)
    for i in open_ends:
        if not _settled(paths, i, anywhere, barrier):
            x, y = goals[i]
            raise FleetError(f"There is no way around the target to place ({x:.0f}, {y:.0f}).")
    return paths


def _barrier(solid: BaseGeometry, radius: float, near: float, share: float) -> BaseGeometry:
    """What paths must not touch: the obstacles grown by a share of the room there is."""
    barrier = solid.buffer(_keep(radius, near, share) * 0.999)
    shapely.prepare(barrier)
    return barrier


def _keep(radius: float, near: float, share: float) -> float:
    return radius + share * (near - radius) if near > radius else 0.99 * near


def _settled(paths: list[FloatArray], i: int, graph: "_Visibility", barrier: BaseGeometry) -> bool:
    """Whether path i clears the barrier, straight or by the bends it is now given."""
    start, goal = paths[i][0], paths[i][-1]
    if not LineString([start, goal]).intersects(barrier):
        return True
    bent = graph.path(start, goal)
    if bent is not None:
        paths[i] = bent
    return bent is not None


def along(paths: Sequence[FloatArray], shares: FloatArray) -> FloatArray:
    """Where robots are when each has covered its share of its path, (n, 2)."""
    places = [_interpolated(path, float(share)) for path, share in zip(paths, shares, strict=True)]
    return np.stack(places)


def _interpolated(path: FloatArray, share: float) -> FloatArray:
    if not np.ptp(path, axis=0).any():
        return path[-1]
    return shapely.get_coordinates(LineString(path).interpolate(share, normalized=True))[0]


def _nodes(solid: BaseGeometry, keep: float) -> FloatArray:
    """Corners to bend around: vertices of the obstacles grown so that chords clear the barrier."""
    dip = math.cos(math.pi / (4 * BEND_SEGMENTS))
    grown = solid.buffer((1.01 * keep + 0.05) / dip, quad_segs=BEND_SEGMENTS)
    tolerance = 0.0
    while True:
        coarse = grown.simplify(tolerance).buffer(1.05 * tolerance, join_style="mitre")
        coordinates = shapely.get_coordinates(coarse)
        if len(coordinates) <= MAX_NODES:
            return np.unique(coordinates, axis=0)
        tolerance = max(1.5 * tolerance, 0.25)


class _Visibility:
    """All-pairs shortest paths among nodes that see each other past a barrier."""

    def __init__(self, nodes: FloatArray, barrier: BaseGeometry) -> None:
        from scipy.sparse.csgraph import shortest_path

        self._nodes, self._barrier = nodes, barrier
        if not len(nodes):
            return
        lengths = np.stack([self._sight(node) for node in nodes])
        self._length, self._before = shortest_path(lengths, return_predecessors=True)

    def path(self, start: FloatArray, goal: FloatArray) -> FloatArray | None:
        """The shortest path, (k, 2), or None where there is none."""
        if not len(self._nodes):
            return None
        total = self._sight(start)[:, None] + self._length + self._sight(goal)[None, :]
        first, last = np.unravel_index(int(np.argmin(total)), total.shape)
        if not np.isfinite(total[first, last]):
            return None
        chain = [int(last)]
        while chain[-1] != first:
            chain.append(int(self._before[first, chain[-1]]))
        return np.concatenate([[start], self._nodes[chain[::-1]], [goal]])

    def _sight(self, point: FloatArray) -> FloatArray:
        """Distance to every node that is seen from a point, infinite to the others."""
        ends = np.broadcast_to(point, self._nodes.shape)
        lines = shapely.linestrings(np.stack([ends, self._nodes], axis=1))
        distance = np.linalg.norm(self._nodes - point, axis=1)
        return np.where(shapely.intersects(lines, self._barrier), np.inf, distance)
