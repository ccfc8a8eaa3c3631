"""The shape of a target as an immutable value: polygon, graph G = (V, E), corners, axes.

Frame everywhere: image pixels, x right, y down, pixel centres at integer coordinates.
A pixel contour is dense and noisy; V and E are its simplification, found by an epsilon sweep that
also decides whether the object is polygonal or smooth.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from ..errors import InputError

FloatArray = NDArray[np.float64]
Kind = Literal["polygonal", "smooth"]

SWEEP_STEPS = 8
SMOOTH_SLOPE = -0.40
"""As the tolerance eps grows, the vertex count falls as eps**-1/2 on smooth curves and is constant
on polygons; this log-log slope divides the two."""
CORNER_TURN = math.radians(25)
"""A vertex turning less than this is a bend of the contour, not a corner."""
MAX_VERTICES = 5_000
FARTHEST = 1e6
"""Largest absolute coordinate, px, that is accepted as a place in a picture."""
RECESS_SHARE = 0.5
"""Recesses narrower than twice this share of the size are bridged to find an object's sides."""
KNOB_SHARE, BULK_SHARE = 0.05, 0.93
"""What a morphological opening by KNOB_SHARE of the size removes counts as a knob, provided that
BULK_SHARE of the area is left."""
WALKED = 200_000
"""Number of points times vertices below which walking along a geometry for each point is quick."""
HALF_SPAN, SPAN_STEPS = 0.5, 100
"""A side of the bulk lies where the region still spans HALF_SPAN of its widest span; searched for
in SPAN_STEPS steps."""
MIN_AREA = 4.0
"""Area in square pixels below which an outline has no usable shape."""


@dataclass(frozen=True)
class Outline:
    """One connected region with holes, in image pixels (x right, y down).

    Attributes:
        polygon: the exact boundary; valid, positive area, exterior counter-clockwise in (x, y).
        vertices: V, the simplified exterior, in the exterior's order, (k, 2).
        kind: polygonal if V are real corners, smooth if they are samples of a curve.
        kind_confidence: 0.5 (undecided) to 1.
    """

    polygon: Polygon
    vertices: tuple[tuple[float, float], ...]
    kind: Kind
    kind_confidence: float

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """E, index pairs into V; edge i runs from vertex i to the next, the last one back to 0."""
        count = len(self.vertices)
        return tuple((i, (i + 1) % count) for i in range(count))

    @property
    def area(self) -> float:
        """Area in square pixels, holes excluded."""
        return float(self.polygon.area)

    @property
    def size(self) -> float:
        """The square root of the area, holes filled, px: the length all defaults scale with."""
        return math.sqrt(self.filled.area)

    @property
    def perimeter(self) -> float:
        """Length of the exterior, px."""
        return float(self.polygon.exterior.length)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounding box (x0, y0, x1, y1)."""
        x0, y0, x1, y1 = self.polygon.bounds
        return float(x0), float(y0), float(x1), float(y1)

    @cached_property
    def filled(self) -> Polygon:
        """The region with its holes filled, which robots outside have to keep off."""
        return Polygon(self.polygon.exterior)

    @cached_property
    def envelope(self) -> Polygon:
        """The filled region with its recesses bridged: what a line of robots beside it faces."""
        reach = RECESS_SHARE * self.size
        closed = self.filled.buffer(reach).buffer(-reach).union(self.filled)
        bridged = largest_part(closed)
        return self.filled if bridged is None else Polygon(bridged.exterior)

    @cached_property
    def rectangle(self) -> FloatArray:
        """Corners of the minimum-area rectangle, (4, 2), in the exterior's direction."""
        return rectangle_of(self.polygon)

    @cached_property
    def bulk_rectangle(self) -> FloatArray:
        """The rectangle of the bulk without what sticks out of it, such as mirrors or a porch.

        Its sides lie where the region, measured along the side, still spans half of its widest
        span; corners, (4, 2), in the exterior's direction.
        """
        reach = KNOB_SHARE * self.size
        bulk = self.filled.buffer(-reach, join_style="mitre").buffer(reach, join_style="mitre")
        kept = bulk.intersection(self.filled)
        bulk = kept if kept.area >= BULK_SHARE * self.filled.area else self.filled
        return _half_spanned(bulk, rectangle_of(bulk))

    @property
    def min_width(self) -> float:
        """The smallest distance between two parallel lines that enclose the region, px."""
        points = shapely.get_coordinates(self.polygon.convex_hull)
        along = np.diff(points, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
        heights = points @ normal.T
        return float((heights.max(axis=0) - heights.min(axis=0)).min())

    @cached_property
    def long_axis(self) -> tuple[FloatArray, float, float]:
        """Unit vector along the rectangle's long side, then the long and short lengths, px."""
        sides = np.roll(self.rectangle, -1, axis=0) - self.rectangle
        lengths = np.linalg.norm(sides, axis=1)
        longest = int(np.argmax(lengths[:2]))
        unit = sides[longest] / lengths[longest]
        if unit[0] < 0 or (unit[0] == 0 and unit[1] < 0):
            unit = -unit
        return unit, float(lengths[longest]), float(lengths[1 - longest])

    @cached_property
    def centre(self) -> tuple[float, float]:
        """The centroid if it lies well inside, else the centre of the largest inscribed disc."""
        with np.errstate(all="ignore"):  # GEOS on denormal coordinates
            disc = shapely.maximum_inscribed_circle(self.polygon)
        centroid = self.polygon.centroid
        depth = self.polygon.boundary.distance(centroid)
        if self.polygon.contains(centroid) and depth >= 0.5 * disc.length:
            return float(centroid.x), float(centroid.y)
        x, y = disc.coords[0]
        return float(x), float(y)

    @cached_property
    def corners(self) -> FloatArray:
        """The corners that robots can be sent to, (k, 2).

        The vertices of a polygonal outline that turn by more than 25 degrees, if they overlap
        the filled region by more than 0.9 (IoU); else the corners of the bulk's rectangle.
        """
        if self.kind == "polygonal":
            turning = [
                v
                for v, turn in zip(self.vertices, _turning_angles(self.vertices), strict=True)
                if abs(turn) > CORNER_TURN
            ]
            if len(turning) >= 3 and _overlap(Polygon(turning), self.filled) > 0.9:
                return np.asarray(turning, dtype=float)
        return self.bulk_rectangle

    def graph(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return G = (V, E) as arrays: (k, 2) coordinates and (k, 2) index pairs."""
        return np.asarray(self.vertices, dtype=float), np.asarray(self.edges, dtype=np.intp)


def make_outline(exterior: ArrayLike, holes: tuple[ArrayLike, ...] = ()) -> Outline:
    """Build an outline from rings of points.

    Args:
        exterior: (n, 2) points in image pixels, n >= 3, any direction, closed or not.
        holes: rings of the same form.

    Raises:
        InputError: points are not pairs of numbers, number fewer than 3, lie beyond FARTHEST, or
            enclose under 4 square pixels.
    """
    outer, *inner = (_checked_ring(ring) for ring in (exterior, *holes))
    region = shapely.make_valid(Polygon(outer))
    for hole in inner:
        region = region.difference(shapely.make_valid(Polygon(hole)))
    return outline_of(region)


def _checked_ring(points: ArrayLike) -> FloatArray:
    try:
        ring = np.asarray(points, dtype=float)
    except (ValueError, TypeError):
        raise InputError("An outline's points must be (x, y) pairs of numbers.") from None
    if ring.ndim != 2 or ring.shape[1:] != (2,) or len(ring) < 3:
        raise InputError(f"An outline needs 3 or more (x, y) points; got shape {ring.shape}.")
    if not (np.abs(ring) <= FARTHEST).all():
        raise InputError(f"An outline's coordinates must lie within {FARTHEST:g} px.")
    return ring


def outline_of(polygon: BaseGeometry) -> Outline:
    """Build an outline from a polygon.

    An invalid polygon is mended, and of several parts the largest is used. More than 5,000 vertices
    are thinned out, which moves the boundary by a fraction of a pixel.

    Raises:
        InputError: the region has an area under 4 square pixels.
    """
    tolerance = 0.05
    while shapely.get_num_coordinates(polygon) > MAX_VERTICES:
        polygon = polygon.simplify(tolerance, preserve_topology=False)
        tolerance *= 2
    region = largest_part(shapely.make_valid(polygon))
    if region is None or region.area < MIN_AREA:
        area = 0.0 if region is None else region.area
        raise InputError(f"The outline encloses {area:.1f} square pixels; 4 or more are needed.")
    region = orient(region)
    vertices, kind, confidence = _simplify(np.asarray(region.exterior.coords, dtype=float)[:-1])
    return Outline(region, tuple((float(x), float(y)) for x, y in vertices), kind, confidence)


def distances(geometry: BaseGeometry, points: FloatArray) -> FloatArray:
    """Return the distance of each point (n, 2) to a geometry, (n,), px; 0 inside a polygon."""
    places = np.asarray(shapely.points(points), dtype=object)
    if len(places) * shapely.get_num_coordinates(geometry) < WALKED:
        return np.asarray(shapely.distance(geometry, places), dtype=float)
    found = nearest_segments(geometry, places)[1]
    if shapely.area(geometry) > 0:
        shapely.prepare(geometry)
        found[shapely.intersects_xy(geometry, points)] = 0.0
    return found


def nearest_segments(
    geometry: BaseGeometry, places: NDArray[np.object_]
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return each place's (n,) nearest segment of lines or boundaries, and its distance, px.

    Segments are numbered through all lines in order. A tree is used because GEOS's own distance
    walks along the whole geometry for each place.
    """
    points, line = shapely.get_coordinates(
        shapely.get_parts(_lines_of(geometry)), return_index=True
    )
    joined = np.flatnonzero(line[1:] == line[:-1])
    segments = shapely.linestrings(np.stack([points[joined], points[joined + 1]], axis=1))
    index, distance = shapely.STRtree(np.asarray(segments, dtype=object)).query_nearest(
        places, return_distance=True, all_matches=False
    )
    return np.asarray(index[1], dtype=np.intp), np.asarray(distance, dtype=float)


def _lines_of(geometry: BaseGeometry) -> BaseGeometry:
    """Return the boundary of a geometry with an area, else the lines themselves."""
    return geometry.boundary if shapely.area(geometry) > 0 else geometry


def largest_part(geometry: shapely.Geometry) -> Polygon | None:
    """Return the polygon of largest area in any geometry, or None if it has none."""
    parts = [g for g in shapely.get_parts(shapely.get_parts(geometry)) if isinstance(g, Polygon)]
    return max(parts, key=lambda g: g.area, default=None)


def _simplify(ring: FloatArray) -> tuple[FloatArray, Kind, float]:
    """Return V, the kind and its confidence, by sweeping the Douglas-Peucker tolerance.

    For a polygonal ring, V is the first candidate with the commonest vertex count; for a smooth
    one, that of the smallest tolerance.
    """
    start = int(np.argmax(((ring - ring.mean(axis=0)) ** 2).sum(axis=1)))
    closed = np.concatenate([np.roll(ring, -start, axis=0), ring[start : start + 1]])
    line = shapely.LineString(closed)
    low = max(1.5, 4 * _contour_noise(closed), 0.008 * line.length)
    tolerances = np.geomspace(low, max(0.04 * line.length, 2 * low), SWEEP_STEPS)
    candidates = [_douglas_peucker(line, eps) for eps in tolerances]
    counts = np.array([len(c) for c in candidates])
    slope = float(np.polyfit(np.log(tolerances), np.log(counts), 1)[0])
    kind: Kind = "polygonal" if slope > SMOOTH_SLOPE else "smooth"
    confidence = 1 / (1 + math.exp(-abs(slope - SMOOTH_SLOPE) / 0.1))
    if kind == "smooth":
        return candidates[0], kind, confidence
    values, frequency = np.unique(counts, return_counts=True)
    commonest = values[np.argmax(frequency)]
    return candidates[int(np.argmax(counts == commonest))], kind, confidence


def _douglas_peucker(line: shapely.LineString, tolerance: float) -> FloatArray:
    simple = shapely.get_coordinates(line.simplify(tolerance, preserve_topology=False))[:-1]
    return simple if len(simple) > 2 else rectangle_of(line)


def rectangle_of(geometry: BaseGeometry) -> FloatArray:
    """Return the corners of the minimum-area rectangle, (4, 2), counter-clockwise in (x, y).

    One of its sides lies on a side of the convex hull (Freeman and Shapira 1975), so all are tried.
    The rectangle of GEOS 3.14 can leave a part of the geometry outside.
    """
    hull = shapely.get_coordinates(geometry.convex_hull)
    sides = np.diff(hull, axis=0)
    lengths = np.linalg.norm(sides, axis=1, keepdims=True)
    along = sides[lengths[:, 0] > 0] / lengths[lengths[:, 0] > 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    u, v = hull @ along.T, hull @ across.T
    best = int(np.argmin(np.ptp(u, axis=0) * np.ptp(v, axis=0)))
    low = np.array([u[:, best].min(), v[:, best].min()])
    high = np.array([u[:, best].max(), v[:, best].max()])
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    return corners @ np.stack([along[best], across[best]])


def _half_spanned(region: BaseGeometry, rectangle: FloatArray) -> FloatArray:
    """Return the rectangle, (4, 2), with each side moved in to where the region spans HALF_SPAN."""
    corner, sides = rectangle[0], (rectangle[1] - rectangle[0], rectangle[3] - rectangle[0])
    steps = (np.arange(SPAN_STEPS) + 0.5) / SPAN_STEPS
    bounds: list[tuple[float, float]] = []
    for along, across in (sides, sides[::-1]):
        starts = corner + steps[:, None] * along
        cuts = shapely.linestrings(np.stack([starts, starts + across], axis=1))
        spans = shapely.length(shapely.intersection(cuts, region))
        wide = np.flatnonzero(spans >= HALF_SPAN * spans.max())
        bounds.append((float(wide[0]) / SPAN_STEPS, float(wide[-1] + 1) / SPAN_STEPS))
    (low, high), (near, far) = bounds
    places = np.array([(low, near), (high, near), (high, far), (low, far)])
    return corner + places @ np.stack(sides)


def _contour_noise(closed: FloatArray) -> float:
    """Return the noise of a pixel contour, px: its robust deviation from its smoothed version."""
    ring = closed[:-1]
    if len(ring) < 60 or shapely.LineString(closed).length / len(ring) > 2:
        return 0.0  # a drawn polygon, not a traced one
    offsets = np.arange(-12, 13)
    weights = np.exp(-0.5 * (offsets / 4.0) ** 2)
    weights /= weights.sum()
    smooth = sum(w * np.roll(ring, -k, axis=0) for w, k in zip(weights, offsets, strict=True))
    tangent = np.roll(smooth, -1, axis=0) - np.roll(smooth, 1, axis=0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    return float(1.48 * np.median(np.abs(((ring - smooth) * normal).sum(axis=1))))


def _turning_angles(vertices: tuple[tuple[float, float], ...]) -> FloatArray:
    """Return the signed turning angle at each vertex, (k,), radians."""
    points = np.asarray(vertices, dtype=float)
    before = points - np.roll(points, 1, axis=0)
    after = np.roll(points, -1, axis=0) - points
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.arctan2(cross, (before * after).sum(axis=1))


def _overlap(a: Polygon, b: Polygon) -> float:
    if not a.is_valid:
        return 0.0
    return float(a.intersection(b).area / a.union(b).area)
