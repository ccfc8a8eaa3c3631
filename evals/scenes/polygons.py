"""Outlines of things as polygons about the origin, in units of their own.

Frame: x right, y down, as in a picture; the caller scales, turns and moves them.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Point, Polygon, box


def polar(radii: Sequence[float] | np.ndarray) -> Polygon:
    """A polygon with corners at these distances from the origin, at even angles from the top."""
    turns = np.linspace(0, 2 * math.pi, len(radii), endpoint=False) - math.pi / 2
    return Polygon(np.stack([np.cos(turns), np.sin(turns)], axis=1) * np.asarray(radii)[:, None])


def regular(sides: int) -> Polygon:
    """A regular polygon with a corner at the top."""
    return polar([1.0] * sides)


def circle(radius: float = 1.0, x: float = 0.0, y: float = 0.0) -> Polygon:
    """A disc."""
    return Point(x, y).buffer(radius, quad_segs=20)


def oval(ratio: float) -> Polygon:
    """An ellipse, `ratio` times as long as high."""
    return affinity.scale(circle(), ratio, 1)


def rectangle(ratio: float) -> Polygon:
    """A rectangle about the origin, 1 high and `ratio` long."""
    return box(-ratio / 2, -0.5, ratio / 2, 0.5)


def rounded(polygon: Polygon, radius: float) -> Polygon:
    """The polygon with its convex corners rounded off."""
    return _one_polygon(polygon.buffer(-radius).buffer(radius, quad_segs=6))


def star(points: int, waist: float) -> Polygon:
    """A star whose inner corners lie at `waist` of its radius."""
    return polar([1.0, waist] * points)


def cross(arm: float) -> Polygon:
    """A plus sign with arms this wide and 2 long."""
    return union([box(-1, -arm / 2, 1, arm / 2), box(-arm / 2, -1, arm / 2, 1)])


def ell(arm: float) -> Polygon:
    """The letter L."""
    return union([box(-0.8, -1, -0.8 + arm, 1), box(-0.8, 1 - arm, 0.8, 1)])


def tee(arm: float) -> Polygon:
    """The letter T."""
    return union([box(-1, -1, 1, arm - 1), box(-arm / 2, -1, arm / 2, 1)])


def arrow(shaft: float) -> Polygon:
    """An arrow to the right."""
    half = shaft / 2
    return Polygon(
        [(-1, -half), (0.2, -half), (0.2, -0.75), (1.1, 0), (0.2, 0.75), (0.2, half), (-1, half)]
    )


def heart() -> Polygon:
    """A heart with its tip down."""
    t = np.linspace(0, 2 * math.pi, 72, endpoint=False)
    y = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    return Polygon(np.stack([16 * np.sin(t) ** 3, -y], axis=1) / 16)


def crescent(depth: float) -> Polygon:
    """A moon: a disc less a smaller one that reaches `depth` beyond its right side."""
    return _one_polygon(circle().difference(circle(0.85, 0.15 + depth, 0)))


def annulus(hole: float) -> Polygon:
    """A ring whose hole has this share of its radius."""
    return Polygon(circle().exterior, [circle(hole).exterior])


def frame(ratio: float, width: float) -> Polygon:
    """A rectangular frame, 1 high, `ratio` long, its sides this wide."""
    hole = box(width - ratio / 2, width - 0.5, ratio / 2 - width, 0.5 - width)
    return Polygon(rectangle(ratio).exterior, [hole.exterior])


def cee(width: float, mouth: float) -> Polygon:
    """The letter C: a ring of this width, open by `mouth` degrees to the right."""
    half = math.radians(mouth / 2)
    wedge = Polygon(
        [
            (0, 0),
            (3 * math.cos(half), -3 * math.sin(half)),
            (3 * math.cos(half), 3 * math.sin(half)),
        ]
    )
    return _one_polygon(annulus(1 - width).difference(wedge))


def capsule(ratio: float) -> Polygon:
    """A rectangle with half discs for ends, `ratio` times as long as high."""
    return shapely.LineString([(-(ratio - 1) / 2, 0), ((ratio - 1) / 2, 0)]).buffer(0.5)


def hull(ratio: float, stern: float) -> Polygon:
    """A boat from above, its bow to the right; its stern is this share of the beam wide."""
    along = np.linspace(0, 1, 24)
    half = 0.5 * np.minimum(stern + 1.6 * along, 1) * (1 - along**2.6)
    upper = np.stack([ratio * (along - 0.5), -half], axis=1)
    return Polygon(np.concatenate([upper, (upper * (1, -1))[::-1][1:]]))


def blob(random: Generator, roughness: float) -> Polygon:
    """A smooth, irregular round shape, such as a pond."""
    turns = np.linspace(0, 2 * math.pi, 90, endpoint=False)
    radii = np.ones(90)
    for wave in range(2, 6):
        swing = roughness * random.uniform(0.4, 1) / wave
        radii += swing * np.cos(wave * turns + random.uniform(0, 6.3))
    return polar(radii)


def scalloped(bumps: int, depth: float) -> Polygon:
    """A round shape with bumps, such as a bush."""
    turns = np.linspace(0, math.pi * bumps, 12 * bumps, endpoint=False)
    return polar(1 + depth * np.abs(np.sin(turns)))


def union(polygons: Iterable[Polygon]) -> Polygon:
    """The union of polygons, which must be a single polygon."""
    return _one_polygon(shapely.union_all(list(polygons)))


def _one_polygon(geometry: shapely.Geometry) -> Polygon:
    assert isinstance(geometry, Polygon)
    return geometry
