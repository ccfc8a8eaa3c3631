"""Decides whether robots that stand still cage a rigid object.

Two tests are sufficient for a cage: a disc inside the object and a flood of its configuration
space. A third shows an escape, checked move by move. Between them the answer is "not certified".
Comparing gaps with the object's least width is no test: it is wrong for shapes with recesses.
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
"""Levels of the flood: about 10 to 60 ms for ten robots, and up to a second."""
THOROUGH_STEPS, MANY = 6, 50
"""Steps of the budget for a flood of all levels, and robots that make it as many again."""
MOST_FLOODED = 300
"""With more robots than this only the disc is tried: a flood costs time for every robot."""
MARGIN = 1e-9
"""Relative slack of comparisons, so that rounding certifies nothing."""


@dataclass(frozen=True)
class Cage:
    """What is known of a cage.

    Attributes:
        state: caged is proved, escape is shown by a path, not certified is neither.
        test: which proof, where caged.
        inscribed_diameter: of a greatest disc in the object, px; gaps below it certify.
        widest_gap: between robots' edges, px, in the ring about that disc whose widest gap is
            least; None where the robots form no ring about it.
        widest_between: indices of the robots on either side of that gap.
        path: poses (k, 3) of a verified escape: x, y of the pivot, px, and the turn about it,
            radians from x to y; the first is where the object is.
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
    """Whether robots that stand still hold an object that may move and turn in the plane.

    Args:
        region: the object; its holes do not matter. Image pixels.
        robots: their centres, (n, 2), image pixels.
        radius: of each, px; 0 is a point.
        walls: what else the object cannot pass. Caged by the configuration space then means that
            it cannot leave the hull of the robots and itself; the disc test leaves walls out, and
            its gaps are given only where it is what certifies.
        levels: of the flood, QUICK to THOROUGH; 0 for the disc alone.
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


@lru_cache(maxsize=16)  # one thing is put in many cages before the best of them is found
def _inscribed_disc(region: Polygon) -> tuple[FloatArray, float]:
    """Centre and radius of a greatest inscribed disc; the radius holds for that very centre."""
    with np.errstate(all="ignore"):  # GEOS on denormal coordinates
        middle = shapely.get_point(shapely.maximum_inscribed_circle(region), 0)
    inside = region.contains(middle)
    return shapely.get_coordinates(middle)[0], float(region.boundary.distance(middle)) * inside


def widest_link(points: FloatArray, centre: FloatArray) -> tuple[int, int] | None:
    """The widest link of the ring of points about a centre whose widest link is least.

    Proof of the disc test: the object holds a disc of radius rho about c, so c stays out of the
    open discs of radius r + rho about the robots. A link shorter than 2 (r + rho) is covered by
    those at its ends. If c lies in a closed simple polygon of such links it cannot leave it.
    Links are sought among the edges of the Delaunay triangulation, which hold such a ring
    wherever discs of that radius leave c no way out (Edelsbrunner 1995). They are added by length
    until one closes a loop that winds about c. Seen from c it goes round one way only, or is
    checked as a polygon.

    Args:
        points: (n, 2).
        centre: (2,).

    Returns:
        Indices of the points at its ends; None where no ring of the points holds the centre.
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
    """Whether a polygon (n, 2) is simple and the origin lies in it."""
    places = loop.tolist()
    turns = [
        math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        for (ax, ay), (bx, by) in pairwise([*places, places[0]])
    ]
    if min(turns) > MARGIN and max(turns) < math.pi - MARGIN:  # star-shaped, so it is
        return sum(turns) < 3 * math.pi  # once round, not more often
    if max(turns) < -MARGIN and min(turns) > MARGIN - math.pi:
        return sum(turns) > -3 * math.pi
    polygon = shapely.polygons(loop)
    return bool(shapely.is_valid(polygon) and shapely.contains_xy(polygon, 0.0, 0.0))


class _Forest:
    """Trees of points with the angle each is seen at from the first of its tree (union-find)."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))
        self._angle = [0.0] * count  # from the parent
        self._size = [1] * count

    def _root(self, i: int) -> tuple[int, float]:
        angle = 0.0
        while self._parent[i] != i:
            angle += self._angle[i]
            i = self._parent[i]
        return i, angle

    def join(self, i: int, j: int, angle: float) -> float:
        """Link j, seen at an angle from i; returns by how much that winds if they were linked."""
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
    """Edges of the Delaunay triangulation, shortest first, pairs of indices (m, 2)."""
    edges = shapely.delaunay_triangles(shapely.multipoints(points), only_edges=True)
    ends = shapely.get_coordinates(edges)
    index = {(x, y): i for i, (x, y) in enumerate(points.tolist())}
    links = np.array([index[x, y] for x, y in ends.tolist()], dtype=np.intp).reshape(-1, 2)
    across = ends[1::2] - ends[::2]
    return links[np.argsort((across * across).sum(axis=1), kind="stable")]


def _fewest_links_path(near: list[list[int]], start: int, end: int) -> list[int]:
    """A way with the fewest links from one point to another."""
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
