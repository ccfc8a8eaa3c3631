"""From where robots are to where they shall stand: on which path.

Paths are shortest ones around the targets on a visibility graph (Lozano-Perez and Wesley 1979).
Frame: image pixels. Robots do not yet avoid each other.
"""

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import FleetError
from ..formation.contract import MIN_SPACING, Contract
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
LEAST_EXIT = 1.0
"""Robots that stand on an obstacle go at least so far off it, px."""
ROUND_SEGMENTS = 16
"""Segments of a quarter circle where distances are to be exact."""
ROUND_DIP = math.cos(math.pi / 4 / ROUND_SEGMENTS)
"""How near the middle of such a segment comes, as a share of the radius."""
NOBODY = np.empty((0, 2))

Bodies = NDArray[np.object_]


class NoRouteError(FleetError):
    """A place that no path leads to."""


def obstacles(contract: Contract, site: Site) -> BaseGeometry:
    """What robots have to drive around: targets no group of the contract stands on."""
    solid = [site.outlines[t].filled for t in contract.solid_targets]
    return shapely.union_all(np.asarray(solid, dtype=object)) if solid else Polygon()


def routes(
    starts: FloatArray,
    goals: FloatArray,
    solid: BaseGeometry,
    radius: float,
    frame: Frame,
    *,
    idle: FloatArray = NOBODY,
) -> list[FloatArray]:
    """Shortest paths that keep robots of a radius off obstacles and idle robots, start i to goal i.

    Paths stay in the frame where they can, and leave it only where there is no other way. A robot
    that stands on an obstacle first leaves it by the shortest way.

    Args:
        starts: (n, 2).
        goals: (n, 2), off the obstacles.
        solid: the obstacles' union.
        radius: of a robot, px.
        frame: the picture.
        idle: (m, 2) where robots stand that do not move.

    Returns:
        n polylines, (k, 2) each.

    Raises:
        NoRouteError: a goal is walled off.
    """
    ends = np.concatenate([starts, goals])
    exits = _exit_points(starts, goals, solid, radius, frame, _bodies(idle, ends, radius))
    bodies = _bodies(idle, np.concatenate([ends, exits]), radius)
    paths = _paths_past(exits, goals, solid, radius, frame, bodies)
    leaving = np.flatnonzero((exits != starts).any(axis=1))
    ways_out = _paths_past(starts[leaving], exits[leaving], Polygon(), radius, frame, bodies)
    for i, way_out in zip(leaving, ways_out, strict=True):
        paths[i] = np.concatenate([way_out[:-1], paths[i]])
    return paths


def _exit_points(
    starts: FloatArray,
    goals: FloatArray,
    solid: BaseGeometry,
    radius: float,
    frame: Frame,
    bodies: Bodies,
) -> FloatArray:
    """Starts, (n, 2), those on the obstacles moved off them as far as the goals are."""
    if solid.is_empty or not (on := distances(solid, starts) <= radius).any():
        return starts
    away = max(float(distances(solid, goals).min()), LEAST_EXIT)
    rim = solid.buffer(away / ROUND_DIP, quad_segs=ROUND_SEGMENTS)
    free = shapely.difference(rim.boundary, shapely.union_all(bodies))
    inside = shapely.intersection(free, frame.box)
    line = next(part for part in (inside, free, rim.boundary) if not part.is_empty)
    exits = starts.copy()
    shortest = shapely.shortest_line(shapely.points(starts[on]), line)
    exits[on] = shapely.get_coordinates(shortest)[1::2]
    return exits


def _bodies(idle: FloatArray, ends: FloatArray, radius: float) -> Bodies:
    """Discs, (m,), that the centres of others keep out of; smaller where a path ends near."""
    if not len(idle):
        return np.empty(0, dtype=object)
    nearest = np.linalg.norm(idle[:, None] - ends, axis=2).min(axis=1)
    reach = np.minimum(max(2 * radius, MIN_SPACING), 0.99 * nearest) / ROUND_DIP
    discs = shapely.buffer(shapely.points(idle), reach, quad_segs=ROUND_SEGMENTS)
    return np.asarray(discs, dtype=object)


def _paths_past(
    starts: FloatArray,
    goals: FloatArray,
    solid: BaseGeometry,
    radius: float,
    frame: Frame,
    bodies: Bodies,
) -> list[FloatArray]:
    """Shortest paths past the obstacles and those bodies that would be in the way."""
    paths = _paths_around(starts, goals, solid, radius, frame, bodies[:0])
    if not len(bodies) or not len(paths):
        return paths
    tree, cluster = shapely.STRtree(bodies), _clusters(bodies)
    in_the_way = np.zeros(len(bodies), dtype=bool)
    while True:
        lines = np.asarray([LineString(path) for path in paths], dtype=object)
        blocked, hit = tree.query(lines, predicate="intersects")
        if not len(hit):
            return paths
        again = np.unique(blocked)
        in_the_way |= np.isin(cluster, cluster[hit])
        found = _paths_around(starts[again], goals[again], solid, radius, frame, bodies[in_the_way])
        for i, path in zip(again, found, strict=True):
            paths[i] = path


def _clusters(bodies: Bodies) -> NDArray[np.intp]:
    """The number of the cluster each body belongs to, (m,); nobody fits between its members."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = shapely.STRtree(bodies).query(bodies, predicate="intersects")
    graph = coo_array((np.ones(pairs.shape[1]), pairs), shape=(len(bodies), len(bodies)))
    return np.asarray(connected_components(graph)[1], dtype=np.intp)


def _paths_around(
    starts: FloatArray,
    goals: FloatArray,
    solid: BaseGeometry,
    radius: float,
    frame: Frame,
    bodies: Bodies,
) -> list[FloatArray]:
    """Shortest paths around the obstacles and around all of some bodies."""
    paths = list(np.stack([starts, goals], axis=1))
    if solid.is_empty and not len(bodies):
        return paths
    near = 0.0
    if not solid.is_empty:
        near = float(min(distances(solid, starts).min(), distances(solid, goals).min()))
    keeps = [_keep(radius, near, share) for share in ROOM_SHARES]
    widest = _barrier(solid, keeps[0], bodies)
    straight = shapely.linestrings(np.stack([starts, goals], axis=1))
    open_ends = [int(i) for i in np.flatnonzero(shapely.intersects(straight, widest))]
    if not open_ends:
        return paths
    for keep in keeps:
        barrier = _barrier(solid, keep, bodies)
        nodes = _nodes(solid, keep, bodies, barrier)
        graph = _Visibility(nodes[shapely.intersects_xy(frame.box, nodes)], barrier)
        open_ends = [i for i in open_ends if not _settled(paths, i, graph, barrier)]
        if not open_ends:
            return paths
    barrier = _barrier(solid, keeps[-1], bodies)
    anywhere = _Visibility(_nodes(solid, keeps[-1], bodies, barrier), barrier)
    for i in open_ends:
        if not _settled(paths, i, anywhere, barrier):
            what = "the target and the robots that stay" if len(bodies) else "the target"
            x, y = goals[i]
            raise NoRouteError(f"There is no way around {what} to place ({x:.0f}, {y:.0f}).")
    return paths


def _barrier(solid: BaseGeometry, keep: float, bodies: Bodies) -> BaseGeometry:
    """What paths must not touch: the obstacles grown by nearly what is kept, and the bodies."""
    barrier = solid.buffer(keep * 0.999)
    if len(bodies):
        barrier = shapely.union_all([barrier, *bodies])
    shapely.prepare(barrier)
    return barrier


def _keep(radius: float, near: float, share: float) -> float:
    """Distance kept from the obstacles, px, where starts and goals have `near` of room."""
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
    lines = np.asarray([LineString(path) for path in paths], dtype=object)
    return shapely.get_coordinates(shapely.line_interpolate_point(lines, shares, normalized=True))


def _nodes(solid: BaseGeometry, keep: float, bodies: Bodies, barrier: BaseGeometry) -> FloatArray:
    """Corners to bend around: vertices of the obstacles grown so that chords clear the barrier."""
    dip = math.cos(math.pi / (4 * BEND_SEGMENTS))
    grown = solid.buffer((1.01 * keep + 0.05) / dip, quad_segs=BEND_SEGMENTS)
    tolerance = 0.0
    while True:
        coarse = grown.simplify(tolerance).buffer(1.05 * tolerance, join_style="mitre")
        coordinates = shapely.get_coordinates(coarse)
        if len(coordinates) <= MAX_NODES:
            break
        tolerance = max(1.5 * tolerance, 0.25)
    x0, _, x1, _ = shapely.bounds(bodies).reshape(-1, 4).T
    reach = (1.01 * (x1 - x0) / 2 + 0.05) / dip
    corners = shapely.buffer(shapely.centroid(bodies), reach, quad_segs=BEND_SEGMENTS)
    bends = shapely.get_coordinates(corners)
    free = bends[~shapely.intersects_xy(barrier, bends)]
    return np.unique(np.concatenate([coordinates, free]), axis=0)


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
