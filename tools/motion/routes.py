"""Paths from where robots are to where they are to stand.

They are the shortest ones around the targets on a visibility graph (Lozano-Perez and Wesley 1979).
Frame: image pixels. Robots do not avoid each other yet.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import FleetError
from ..formation.contract import MIN_SPACING, Contract
from ..formation.encounters import ROOM_SHARE
from ..formation.placement.place import Site
from ..geometry.curves import Frame, round_join_dip
from ..geometry.outline import FloatArray, distances
from .visibility import Visibility

MAX_NODES, EACH_NODES = 80, 12
"""Most vertices kept of obstacles, and for each further part of them: enough for a path within a
percent of the shortest."""
Bend = tuple[int, float]
BEND: Bend = (3, 0.01)
CLOSE: Bend = (8, 0.001)
FEW = 12
"""A bend has so many segments per quarter circle around a corner, and keeps off it by this share
more than it must. CLOSE is tried where nothing else leads through and bodies are at most FEW."""
ROOM_SHARES = (0.7, 0.3, 0.03)
"""Shares of the smallest clearance at starts and goals, but at most of the room kept from other
things, that paths try to keep: away where there is room, squeezing past where there is not."""
LONG = 1.5
"""Room is not kept at the cost of ways that are longer by more than this factor."""
LEAST_EXIT = 1.0
"""How far robots that stand on an obstacle at least go off it, px."""
ROUND_SEGMENTS = 16
"""Segments of a quarter circle where distances are to be exact."""
ROUND_DIP = math.cos(math.pi / 4 / ROUND_SEGMENTS)
"""How far the middle of such a segment is from the centre, as a share of the radius."""
SPARE = 1.02
"""Factor on the radius of bodies where robots leave obstacles, so that all of a body is avoided."""
NOBODY = np.empty((0, 2))
NOBODIES = np.empty(0, dtype=object)

Bodies = NDArray[np.object_]
Indices = NDArray[np.intp]


class NoRouteError(FleetError):
    """No path leads to the places of `robots`, which are indices of starts and goals."""

    def __init__(self, text: str, robots: Indices) -> None:
        super().__init__(text)
        self.robots = robots


def obstacles(contract: Contract, site: Site) -> BaseGeometry:
    """Return what robots have to drive around: targets that no group of the contract stands on."""
    return union(named_obstacles(contract, site))


def named_obstacles(contract: Contract, site: Site) -> dict[str, BaseGeometry]:
    """Return the same as `obstacles`, by the targets' ids."""
    return {name: site.solid(name, contract) for name in contract.solid_targets}


def union(regions: Mapping[str, BaseGeometry]) -> BaseGeometry:
    """Return all regions as one; empty if there is none."""
    return shapely.union_all(np.array([*regions.values()], dtype=object)) if regions else Polygon()


def routes(
    starts: FloatArray,
    goals: FloatArray,
    solid: BaseGeometry,
    radius: float,
    frame: Frame,
    *,
    idle: FloatArray = NOBODY,
    ends: FloatArray | None = None,
    bounded: bool = False,
) -> list[FloatArray]:
    """Return shortest paths from start i to goal i, off obstacles and robots that do not move.

    Paths leave the frame only where there is no other way, if at all. A robot that stands on an
    obstacle first leaves it by the shortest way.

    Args:
        starts: (n, 2).
        goals: (n, 2); one on an obstacle's edge is driven to straight from just off it.
        solid: the obstacles' union.
        radius: of a robot, px.
        frame: the picture.
        idle: (m, 2) where robots stand that do not move.
        ends: (k, 2) starts and goals of all calls in a row, so that all keep the same distance from
            obstacles.
        bounded: whether a way that leaves the frame counts as none.

    Returns:
        n polylines, (k, 2) each.

    Raises:
        NoRouteError: a goal is walled off.
    """
    own = np.concatenate([starts, goals])
    ends = own if ends is None else ends
    ground = _Ground(solid, radius, frame, ends, bounded)
    wider = _bodies(idle, own, SPARE * radius)
    exits, entries = ground.exits(starts, goals, wider), ground.exits(goals, goals, wider)
    bodies = _bodies(idle, np.concatenate([own, exits, entries]), radius)
    ground = replace(ground, ends=np.concatenate([ends, exits, entries]))
    paths = ground.paths(exits, entries, bodies)
    leaving = np.flatnonzero((exits != starts).any(axis=1))
    ways_out = _Ground(Polygon(), radius, frame, ends).paths(
        starts[leaving], exits[leaving], bodies
    )
    for i, way_out in zip(leaving, ways_out, strict=True):
        paths[i] = np.concatenate([way_out[:-1], paths[i]])
    for i in np.flatnonzero((entries != goals).any(axis=1)):
        paths[i] = np.concatenate([paths[i], goals[i : i + 1]])
    return paths


def way_lengths(
    starts: FloatArray, goals: FloatArray, solid: BaseGeometry, radius: float, frame: Frame
) -> FloatArray:
    """Return how long the ways around obstacles are from every start to every goal, px.

    Args:
        starts: (n, 2).
        goals: (m, 2).

    Returns:
        (n, m); infinite where there is no way.
    """
    from scipy.spatial.distance import cdist

    graph = _graph(solid.wkb, radius, frame, BEND)
    lengths = cdist(starts, goals)
    lines = np.stack(np.broadcast_arrays(starts[:, None], goals[None]), axis=2)
    bent = shapely.intersects(shapely.linestrings(lines), graph.barrier)
    if bent.any():
        lengths[bent] = graph.lengths(starts, goals)[bent]
    if (shut := np.isinf(lengths)).any():
        beyond = _graph(solid.wkb, radius, None, BEND)
        lengths[shut] = beyond.lengths(starts, goals)[shut]
    return lengths


def _bodies(idle: FloatArray, ends: FloatArray, radius: float) -> Bodies:
    """Return discs, (m,), that others' centres keep out of, smaller where a path ends near."""
    if not len(idle):
        return NOBODIES
    nearest = np.linalg.norm(idle[:, None] - ends, axis=2).min(axis=1)
    body = max(2 * radius, MIN_SPACING)
    reach = np.where(nearest > body / ROUND_DIP, body, np.minimum(body, 0.99 * nearest)) / ROUND_DIP
    discs = shapely.buffer(shapely.points(idle), reach, quad_segs=ROUND_SEGMENTS)
    return np.asarray(discs, dtype=object)


def _clusters(bodies: Bodies) -> NDArray[np.intp]:
    """Return the number of each body's cluster, (m,); no robot fits between its members."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = shapely.STRtree(bodies).query(bodies, predicate="intersects")
    graph = coo_array((np.ones(pairs.shape[1]), pairs), shape=(len(bodies), len(bodies)))
    return np.asarray(connected_components(graph)[1], dtype=np.intp)


@dataclass(frozen=True)
class _Ground:
    """Obstacles, and the picture, in which robots of a radius drive around them."""

    solid: BaseGeometry
    radius: float
    frame: Frame
    ends: FloatArray
    bounded: bool = False

    def exits(self, starts: FloatArray, goals: FloatArray, bodies: Bodies) -> FloatArray:
        """Return starts, (n, 2), those on obstacles moved off as far as the nearest goal is."""
        if self.solid.is_empty:
            return starts
        on = distances(self.solid, starts) <= self.radius
        if not on.any():
            return starts
        away = max(float(distances(self.solid, goals).min()), LEAST_EXIT)
        rim = self.solid.buffer(away / ROUND_DIP, quad_segs=ROUND_SEGMENTS)
        free = shapely.difference(rim.boundary, shapely.union_all(bodies))
        open_ = shapely.intersection(free, self._within_reach(goals, bodies))
        tried = [shapely.intersection(part, self.frame.box) for part in (open_, free)]
        tried = [tried[0], open_, tried[1], free, rim.boundary]
        line = next(part for part in tried if not part.is_empty)
        exits = starts.copy()
        shortest = shapely.shortest_line(shapely.points(starts[on]), line)
        exits[on] = shapely.get_coordinates(shortest)[1::2]
        return exits

    def _within_reach(self, goals: FloatArray, bodies: Bodies) -> BaseGeometry:
        """Return the region, off obstacles and bodies, from which some goal can be driven to."""
        taken = shapely.union_all([self.solid.buffer(0.99 * self.radius), *bodies])
        ground = self.frame.box.buffer(self.far).difference(taken)
        parts = shapely.get_parts(ground)
        at = shapely.multipoints(goals)
        return shapely.union_all(parts[shapely.intersects(parts, at)])

    def paths(self, starts: FloatArray, goals: FloatArray, bodies: Bodies) -> list[FloatArray]:
        """Return shortest paths past the obstacles and those bodies that would be in the way."""
        paths = self._paths_around(starts, goals, bodies[:0])
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
            try:
                found = self._paths_around(starts[again], goals[again], bodies[in_the_way])
            except NoRouteError as error:
                raise NoRouteError(str(error), again[error.robots]) from None
            for i, path in zip(again, found, strict=True):
                paths[i] = path

    def _paths_around(
        self, starts: FloatArray, goals: FloatArray, bodies: Bodies
    ) -> list[FloatArray]:
        """Return shortest paths around the obstacles and around all given bodies."""
        ways = np.stack([starts, goals], axis=1)
        paths = list(ways)
        for group, keeps in self._groups(starts, goals):
            left = group
            for keep, frame, bend in self._tries(keeps, len(bodies)):
                graph = self._graph(keep, bodies, frame, bend)
                straight = shapely.linestrings(ways[left])
                left = left[shapely.intersects(straight, graph.barrier)]
                found = {int(i): graph.path(*ways[i]) for i in left}
                for i, path in found.items():
                    paths[i] = paths[i] if path is None else path
                left = np.array([i for i, path in found.items() if path is None], dtype=np.intp)
                if not len(left):
                    break
            if len(left):
                raise self._no_route(left, goals, bodies)
            self._shorten(paths, group, keeps[-1], bodies)
        return paths

    def _shorten(
        self, paths: list[FloatArray], group: Indices, keep: float, bodies: Bodies
    ) -> None:
        """Squeeze past where the way with more room is longer by more than LONG."""
        far = [i for i in map(int, group) if _longer(paths[i], paths[i][[0, -1]])]
        if not far:
            return
        graph = self._graph(keep, bodies, self.frame, BEND)
        for i in far:
            near = graph.path(*paths[i][[0, -1]])
            if near is not None and _longer(paths[i], near):
                paths[i] = near

    def _graph(self, keep: float, bodies: Bodies, frame: Frame | None, bend: Bend) -> Visibility:
        if len(bodies):
            return _graph_past(self.solid, keep, bodies, frame, bend)
        return _graph(self.solid.wkb, keep, frame, bend)

    def _tries(self, keeps: Sequence[float], bodies: int) -> list[tuple[float, Frame | None, Bend]]:
        """Return the distances to keep, px, frames and bends that are tried in turn."""
        bends = [BEND, CLOSE] if bodies <= FEW else [BEND]
        tries: list[tuple[float, Frame | None, Bend]] = [(k, self.frame, BEND) for k in keeps]
        tries += [(keeps[-1], self.frame, bend) for bend in bends[1:]]
        return tries + [(keeps[-1], None, bend) for bend in bends if not self.bounded]

    def _groups(self, starts: FloatArray, goals: FloatArray) -> list[tuple[Indices, list[float]]]:
        """Return groups of robots and the distances to keep from obstacles, px, in order of trial.

        Only robots that start or end with their bodies on an obstacle keep less than their radius.
        """
        near = np.minimum(self._off(starts), self._off(goals))
        clear, free = near > self.radius, self._off(self.ends)
        room = self.radius + ROOM_SHARE * math.hypot(self.frame.width, self.frame.height)
        least = float(free[free > self.radius].min(initial=room))
        keeps = [self.radius + share * (least - self.radius) for share in ROOM_SHARES]
        tight = np.flatnonzero(~clear)
        groups = [
            (np.flatnonzero(clear), keeps),
            (tight, [0.99 * near[tight].min(initial=self.radius)]),
        ]
        return [group for group in groups if len(group[0])]

    def _off(self, points: FloatArray) -> FloatArray:
        """Return how far points, (n, 2), are from the obstacles, px; `far` if there are none."""
        far = self.far
        return np.full(len(points), far) if self.solid.is_empty else distances(self.solid, points)

    @property
    def far(self) -> float:
        """A distance greater than that of any two ends, px."""
        return self.frame.width + self.frame.height

    def _no_route(self, robots: Indices, goals: FloatArray, bodies: Bodies) -> NoRouteError:
        what = "the target and the robots that stay" if len(bodies) else "the target"
        x, y = goals[robots[0]]
        return NoRouteError(f"There is no way around {what} to place ({x:.0f}, {y:.0f}).", robots)


@lru_cache(maxsize=32)
def _graph(solid: bytes, keep: float, frame: Frame | None, bend: Bend) -> Visibility:
    """Return the graph around obstacles alone; cached, since it is needed again and again."""
    return _graph_past(shapely.from_wkb(solid), keep, NOBODIES, frame, bend)


def _graph_past(
    solid: BaseGeometry, keep: float, bodies: Bodies, frame: Frame | None, bend: Bend
) -> Visibility:
    """Return the visibility graph around obstacles and bodies, within a frame if there is one.

    Paths must not touch bodies, nor the obstacles grown by nearly `keep`.
    """
    barrier: BaseGeometry = solid.buffer(keep * 0.999)
    if len(bodies):
        barrier = shapely.union_all([barrier, *bodies])
    shapely.prepare(barrier)
    nodes = _nodes(solid, keep, bodies, barrier, bend)
    if frame is not None:
        nodes = nodes[shapely.intersects_xy(frame.box, nodes)]
    return Visibility(nodes, barrier)


def _longer(path: FloatArray, other: FloatArray) -> bool:
    """Return whether a path is longer than another by more than LONG."""
    one, two = (float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in (path, other))
    return one > LONG * two


def along(paths: Sequence[FloatArray], shares: FloatArray) -> FloatArray:
    """Return where robots are when each has covered its share of its path, (n, 2)."""
    lines = np.asarray([LineString(path) for path in paths], dtype=object)
    return shapely.get_coordinates(shapely.line_interpolate_point(lines, shares, normalized=True))


def _nodes(
    solid: BaseGeometry, keep: float, bodies: Bodies, barrier: BaseGeometry, bend: Bend
) -> FloatArray:
    """Return corners to bend around: vertices of what is grown so that chords clear the barrier."""
    segments, spare = bend
    dip = round_join_dip(segments)
    grown = solid.buffer(((1 + spare) * keep + 5 * spare) * dip, quad_segs=segments)
    tolerance, most = 0.0, MAX_NODES + EACH_NODES * (shapely.get_num_geometries(grown) - 1)
    while True:
        coarse = grown.simplify(tolerance).buffer(1.05 * tolerance, join_style="mitre")
        coordinates = shapely.get_coordinates(coarse)
        if len(coordinates) <= most:
            break
        tolerance = max(1.5 * tolerance, 0.25)
    x0, _, x1, _ = shapely.bounds(bodies).reshape(-1, 4).T
    reach = ((1 + spare) * (x1 - x0) / 2 + 5 * spare) * dip
    corners = shapely.buffer(shapely.centroid(bodies), reach, quad_segs=segments)
    bends = shapely.get_coordinates(corners)
    free = bends[~shapely.intersects_xy(barrier, bends)]
    return np.unique(np.concatenate([coordinates, free]), axis=0)
