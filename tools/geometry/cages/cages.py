"""Decides whether stationary robots cage a rigid object.

Two tests can prove a cage: a disc inside the object and a flood of its configuration space. A
third shows an escape, checked move by move. If none succeeds, the answer is "not certified".
Comparing gaps with the object's least width would be wrong for shapes with recesses.
"""

import math
from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..outline import FloatArray
from .budget import spend
from .configuration import flood
from .rigid import Obstacles, body_of, overlaps

State = Literal["caged", "not certified", "escape"]
Test = Literal["disc", "configuration space"]
QUICK, THOROUGH = 2, 4
"""Levels of the flood; for ten robots about 10 to 60 ms, and up to a second."""
THOROUGH_STEPS, MANY = 6, 50
"""Steps of the budget that a flood of all levels costs; every MANY robots add as many again."""
MOST_FLOODED = 300
"""Beyond this many robots only the disc test is tried, as the flood's time grows with them."""
MARGIN = 1e-9
"""Relative slack in comparisons, so that no cage is certified by a rounding error."""


@dataclass(frozen=True)
class Cage:
    """The result of testing a cage.

    Attributes:
        state: caged if proved, escape if a path shows one, otherwise not certified.
        test: the test that proved the cage; None unless caged.
        inscribed_diameter: diameter of a largest disc in the object, px; gaps narrower than this
            certify a cage.
        widest_gap: widest gap between robots' edges, px, in the ring about that disc whose widest
            gap is least; None if the robots form no ring about it.
        widest_between: indices of the robots on either side of that gap.
        path: poses (k, 3) of a verified escape: x, y of the pivot, px, and the turn about it,
            radians from x to y; the first is the object's present pose.
    """

    state: State
    test: Test | None
    inscribed_diameter: float
    widest_gap: float | None = None
    widest_between: tuple[int, int] | None = None
    path: FloatArray | None = None


def cage(
    region: Polygon,
    robots: ArrayLike,
    radius: float = 0.0,
    *,
    walls: BaseGeometry | None = None,
    levels: int = THOROUGH,
    escapes: bool = True,
) -> Cage:
    """Test whether stationary robots cage an object that may move and turn in the plane.

    Args:
        region: the object, image pixels; its holes are ignored.
        robots: the robots' centres, (n, 2), image pixels.
        radius: radius of each robot, px; 0 for a point.
        walls: other obstacles the object cannot pass. Caged by the configuration space then means
            that it cannot leave the convex hull of the robots and itself; the disc test ignores
            walls, and its gaps are given only where it is the test that certifies.
        levels: levels of the flood, QUICK to THOROUGH; 0 for the disc test alone.
        escapes: whether to look for a way out, which takes longer than proving that there is none.
    """
    points = np.asarray(robots, dtype=float).reshape(-1, 2)
    filled = Polygon(region.exterior) if region.interiors else region
    centre, depth = _inscribed_disc(filled)
    between = widest_link(points, centre)
    gap = None
    if between is not None:
        gap = math.dist(*points[list(between)].tolist()) - 2 * radius
    small = gap is not None and gap < 2 * depth * (1 - MARGIN)
    known = (2 * depth, gap, between) if small or walls is None else (2 * depth, None, None)
    if not len(points):
        return Cage("not certified", None, *known)
    if shapely.dwithin(filled, shapely.multipoints(points), radius):
        return Cage("not certified", None, *known)
    if small:
        return Cage("caged", "disc", *known)
    body, obstacles = body_of(filled), Obstacles(points, radius, walls)
    if len(points) > MOST_FLOODED or not levels or overlaps(body, obstacles):
        return Cage("not certified", None, *known)
    spend((1 if levels <= QUICK else THOROUGH_STEPS) * (1 + len(points) // MANY))
    found = flood(body, obstacles, levels, escapes=escapes)
    if found.enclosed:
        return Cage("caged", "configuration space", *known)
    return Cage("not certified" if found.path is None else "escape", None, *known, found.path)


@lru_cache(maxsize=16)  # the search for the best cage tests the same object many times
def _inscribed_disc(region: Polygon) -> tuple[FloatArray, float]:
    """Return the centre (2,) and radius of a largest inscribed disc, px.

    The radius is measured from that very centre; it is 0 if the centre lies outside.
    """
    with np.errstate(all="ignore"):  # GEOS on denormal coordinates
        middle = shapely.get_point(shapely.maximum_inscribed_circle(region), 0)
    inside = region.contains(middle)
    return shapely.get_coordinates(middle)[0], float(region.boundary.distance(middle)) * inside


def widest_link(points: FloatArray, centre: FloatArray) -> tuple[int, int] | None:
    """Find the ring of points about a centre whose longest link is shortest; return that link.

    Proof of the disc test: the object contains a disc of radius rho about c, so c stays out of the
    open discs of radius r + rho about the robots. A link shorter than 2 (r + rho) is covered by
    the discs at its ends. If c lies in a closed simple polygon of such links, it cannot leave it.
    Links are sought among the edges of the Delaunay triangulation, which contain such a ring
    wherever discs of that radius leave c no way out (Edelsbrunner 1995). They are added by length
    until one closes a loop that winds about c. Seen from c, that loop either turns one way only or
    is checked as a polygon.

    Args:
        points: (n, 2).
        centre: (2,).

    Returns:
        Indices of the points at the link's ends; None if no ring of the points encloses the centre.
    """
    links = _delaunay_links(points)
    if not len(links):
        return None
    (xi, yi), (xj, yj) = (points[links] - centre).transpose(1, 2, 0)
    angles = np.arctan2(xi * yj - yi * xj, xi * xj + yi * yj).tolist()
    forest = _Forest(len(points))
    near: list[list[int]] = [[] for _ in points]
    for (i, j), angle in zip(links.tolist(), angles, strict=True):
        winds = abs(forest.join(i, j, angle)) > math.pi
        if winds and _winds_around_origin(points[_fewest_links_path(near, i, j)] - centre):
            return i, j
        near[i].append(j)
        near[j].append(i)
    return None


def _winds_around_origin(loop: FloatArray) -> bool:
    """Return whether a polygon (n, 2) is simple and contains the origin."""
    places = loop.tolist()
    turns = [
        math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        for (ax, ay), (bx, by) in pairwise([*places, places[0]])
    ]
    if min(turns) > MARGIN and max(turns) < math.pi - MARGIN:  # star-shaped about the origin
        return sum(turns) < 3 * math.pi  # once round, not more often
    if max(turns) < -MARGIN and min(turns) > MARGIN - math.pi:
        return sum(turns) > -3 * math.pi
    polygon = shapely.polygons(loop)
    return bool(shapely.is_valid(polygon) and shapely.contains_xy(polygon, 0.0, 0.0))


class _Forest:
    """Union-find trees of points, with each point's angle as seen from the centre.

    The angle is relative to the root of the point's tree.
    """

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))
        self._angle = [0.0] * count  # relative to the parent
        self._size = [1] * count

    def _root(self, i: int) -> tuple[int, float]:
        angle = 0.0
        while self._parent[i] != i:
            angle += self._angle[i]
            i = self._parent[i]
        return i, angle

    def join(self, i: int, j: int, angle: float) -> float:
        """Link j, seen at `angle` from i; return the winding, radians, of the loop this closes.

        Returns 0 if the two were not yet connected, so that no loop is closed.
        """
        (a, to_i), (b, to_j) = self._root(i), self._root(j)
        across = to_i + angle - to_j
        if a == b:
            return across
        if self._size[a] < self._size[b]:
            a, b, across = b, a, -across
        self._parent[b], self._angle[b] = a, across
        self._size[a] += self._size[b]
        return 0.0


def _delaunay_links(points: FloatArray) -> NDArray[np.intp]:
    """Return the edges of the Delaunay triangulation, shortest first, as index pairs (m, 2)."""
    edges = shapely.delaunay_triangles(shapely.multipoints(points), only_edges=True)
    ends = shapely.get_coordinates(edges)
    index = {(x, y): i for i, (x, y) in enumerate(points.tolist())}
    links = np.array([index[x, y] for x, y in ends.tolist()], dtype=np.intp).reshape(-1, 2)
    across = ends[1::2] - ends[::2]
    return links[np.argsort((across * across).sum(axis=1), kind="stable")]


def _fewest_links_path(near: list[list[int]], start: int, end: int) -> list[int]:
    """Return a path with the fewest links between two points, from `end` back to `start`."""
    before = {start: start}
    queue = deque([start])
    while end not in before:
        here = queue.popleft()
        for other in near[here]:
            if other not in before:
                before[other] = here
                queue.append(other)
    way = [end]
    while way[-1] != start:
        way.append(before[way[-1]])
    return way
