"""Curves for robots to stand on: rings around an outline, its sides and chosen edges.

All are parts of offset curves (Minkowski sums with a disc), so every point on them has the
requested clearance. Frame: image pixels, x right, y down.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiLineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from .outline import (
    WALKED,
    FloatArray,
    Outline,
    distances,
    largest_part,
    nearest_segments,
)


def round_join_dip(quad_segments: int) -> float:
    """Return the factor on an offset that makes up for round joins, whose chords cut the true arc.

    GEOS rounds the number of chords of an arc, so a chord may span half as much again.
    """
    return 1 / math.cos(1.5 * math.pi / (4 * quad_segments))


QUAD_SEGMENTS = 24
ROUND_JOIN_DIP = round_join_dip(QUAD_SEGMENTS)
FACING = math.radians(50)
"""A curve still counts as a side where its outward normal is within this angle of the direction."""
CIRCLE_STEPS = 720
SIDE_STEP = 400
"""Number of samples across the extent of a side."""
LEAP = 0.02
"""A chord skips part of a curve if its middle is off it by more than this share of the offset."""


@dataclass(frozen=True)
class Curve:
    """One or more polylines; `closed` if it is a single loop.

    Attributes:
        lines: polylines, (n, 2) each, image pixels; a loop repeats its first point.
        closed: whether robots go all the way round.
        whole_length: length the curve would have if the picture cut nothing off, px.
        parted: whether it is open on purpose, so that no cut in it counts as a gap.
    """

    lines: tuple[FloatArray, ...]
    closed: bool
    whole_length: float
    parted: bool = False

    @property
    def length(self) -> float:
        """The length that is left, px."""
        return sum(float(np.linalg.norm(np.diff(x, axis=0), axis=1).sum()) for x in self.lines)

    def cut(self, n: int) -> float | None:
        """Return the straight distance between the ends of a loop that the picture cut once, px.

        None if the curve is not such a loop, or if the cut is wider than the gap between n robots,
        which then stand at the ends instead.
        """
        if self.closed or self.parted or len(self.lines) != 1:
            return None
        across = float(np.linalg.norm(self.lines[0][0] - self.lines[0][-1]))
        return across if across < (self.length + across) / n else None

    def geometry(self) -> MultiLineString:
        """Return the curve as a shapely geometry."""
        return MultiLineString([LineString(line) for line in self.lines])


@dataclass(frozen=True)
class Frame:
    """The part of the plane that robots may stand in: the picture less a margin.

    Attributes:
        width, height: size of the picture, px.
        margin: strip kept free along the picture's border, px.
    """

    width: float
    height: float
    margin: float = 0.0

    @property
    def box(self) -> Polygon:
        """The allowed rectangle; empty if the margin leaves nothing of the picture."""
        far_x, far_y = self.width - 1 - self.margin, self.height - 1 - self.margin
        if far_x < self.margin or far_y < self.margin:
            return Polygon()
        return shapely.box(self.margin, self.margin, far_x, far_y)


def ring(
    outline: Outline,
    offset: float,
    farthest: float,
    frame: Frame | None = None,
    keep: float = 0.0,
) -> Curve:
    """Return the loop around an outline at a distance; it follows the picture's border if cut.

    Concavities are bridged, as a ring of robots would do, but never further out than allowed.

    Args:
        outline: what to go around; its holes are ignored.
        offset: distance from the outline, px, > 0.
        farthest: greatest distance from the outline where a concavity is bridged, px, >= offset.
        frame: where robots may stand; None for the whole plane.
        keep: stretches along the border that come nearer to the outline than this, px, are cut out.
    """
    reach = max(farthest, offset * ROUND_JOIN_DIP)
    swept = outline.filled.buffer(reach, quad_segs=QUAD_SEGMENTS)
    inward = (reach - offset * ROUND_JOIN_DIP) / ROUND_JOIN_DIP
    closed = largest_part(swept.buffer(-inward, quad_segs=QUAD_SEGMENTS))
    assert closed is not None  # a grown region is not empty
    whole = closed.exterior
    if frame is None or frame.box.contains(closed):
        return Curve((shapely.get_coordinates(whole),), True, float(whole.length))
    inside = _filled_parts(closed.intersection(frame.box)).boundary
    near = outline.filled.buffer(keep * ROUND_JOIN_DIP, quad_segs=QUAD_SEGMENTS)
    border = frame.box.exterior  # the ring's own part already keeps its distance
    run = inside.intersection(border).difference(near)
    lines = _polylines(shapely.union(inside.difference(border), run))
    is_loop = len(lines) == 1 and bool(np.allclose(lines[0][0], lines[0][-1]))
    return Curve(lines, is_loop, float(whole.length))


def circle(centre: FloatArray, radius: float, frame: Frame | None = None) -> Curve:
    """Return a circle about a centre (2,), px; parts outside the frame are cut off."""
    turn: FloatArray = np.linspace(0, 2 * math.pi, CIRCLE_STEPS + 1)
    loop = centre + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    loop[-1] = loop[0]
    return _clip([loop], frame)


def part_of(curve: Curve, region: BaseGeometry, whole_length: float | None = None) -> Curve:
    """Return the part of a curve in a region; `whole_length` defaults to the part's own length."""
    lines = _polylines(curve.geometry().intersection(region))
    closed = len(lines) == 1 and bool(np.allclose(lines[0][0], lines[0][-1]))
    part = Curve(lines, closed, 0.0, parted=True)
    return replace(part, whole_length=part.length if whole_length is None else whole_length)


def side(
    outline: Outline, direction: tuple[float, float], offset: float, frame: Frame | None = None
) -> Curve:
    """Return the part of the envelope's offset curve that faces a direction, in one piece.

    Args:
        outline: the object.
        direction: outward vector of the side, image frame: (0, 1) is the bottom, (-1, 0) the left.
        offset: distance from the outline's envelope, px, > 0.
        frame: parts outside it are cut off; None for the whole plane.
    """
    unit = np.asarray(direction, dtype=float) / math.hypot(*direction)
    across = np.array([-unit[1], unit[0]])
    loop = outline.envelope.buffer(offset * ROUND_JOIN_DIP, quad_segs=QUAD_SEGMENTS)
    extent = shapely.get_coordinates(outline.filled) @ across
    depth = shapely.get_coordinates(loop) @ unit
    steps: FloatArray = np.linspace(float(extent.min()), float(extent.max()), SIDE_STEP)
    stations = steps[:, None] * across
    rays = shapely.linestrings(
        np.stack([stations + (depth.max() + 1) * unit, stations + depth.min() * unit], axis=1)
    )
    hits, ray = shapely.get_coordinates(shapely.intersection(rays, loop), return_index=True)
    order = np.lexsort((-(hits @ unit), ray))  # for each ray the outermost hit first
    line = hits[order[np.unique(ray[order], return_index=True)[1]]]
    tangent = np.gradient(line, axis=0)
    facing = np.abs(np.arctan2(tangent @ unit, np.abs(tangent @ across))) <= FACING
    found = np.flatnonzero(facing)
    kept = line if len(found) < 2 else line[found[0] : found[-1] + 1]
    return _clip([_along_loop(kept, loop, offset)], frame)


def _along_loop(line: FloatArray, loop: BaseGeometry, offset: float) -> FloatArray:
    """Return a polyline of points on a loop, with the loop's vertices where a chord skips part.

    Rays hit only the outer edge of an overhang; a chord from there to what lies behind it may come
    at any distance from the outline.
    """
    chords = np.linalg.norm(np.diff(line, axis=0), axis=1)
    leaps = np.flatnonzero(chords > 2 * np.median(chords))
    exterior = _filled_parts(loop).boundary
    off = distances(exterior, (line[leaps] + line[leaps + 1]) / 2)
    leaps = leaps[off > LEAP * offset]
    if not len(leaps):
        return line
    around = shapely.get_coordinates(exterior)
    pieces: list[FloatArray] = []
    start = 0
    for i in leaps:
        pieces += [line[start : i + 1], _stretch(around, line[i], line[i + 1])]
        start = i + 1
    return np.concatenate([*pieces, line[start:]])


def _stretch(loop: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the vertices of a loop (m, 2) on the shorter way between two points on it, (k, 2)."""
    lengths = np.linalg.norm(np.diff(loop, axis=0), axis=1)
    whole, at = float(lengths.sum()), (np.cumsum(lengths) - lengths)
    a, b = locate(loop, np.stack([start, end]))
    ahead, turn = (b - a) % whole, 1.0
    if ahead > whole / 2:
        ahead, turn = whole - ahead, -1.0
    way = (turn * (at - a)) % whole
    passed = np.flatnonzero((way > 0) & (way < ahead))
    return loop[passed[np.argsort(way[passed], kind="stable")]]


def edge_curve(
    outline: Outline, edges: tuple[int, ...], offset: float, frame: Frame | None = None
) -> Curve:
    """Return the part of the offset curve that is nearer to the chosen edges than to any other.

    Args:
        outline: the object, with its graph G = (V, E).
        edges: indices into E.
        offset: distance from the outline, px, > 0.
        frame: parts outside it are cut off; None for the whole plane.

    Raises:
        IndexError: an edge number is not in E.
    """
    vertices, pairs = outline.graph()
    sides = [LineString(vertices[list(pair)]) for pair in pairs]
    _ = [sides[i] for i in edges]
    loop = _filled_parts(outline.filled.buffer(offset * ROUND_JOIN_DIP, quad_segs=QUAD_SEGMENTS))
    dense = shapely.get_coordinates(shapely.segmentize(loop.boundary, max(offset / 20, 0.1)))
    nearest = np.argmin(np.stack([distances(s, dense) for s in sides]), axis=0)
    chosen = np.isin(nearest, edges)
    if chosen.all():
        return _clip([dense], frame)
    start = int(np.argmin(chosen))
    rolled, flags = np.roll(dense[:-1], -start, axis=0), np.roll(chosen[:-1], -start)
    return _clip(_flagged_runs(rolled, flags), frame)


def segment(
    start: FloatArray,
    end: FloatArray,
    frame: Frame | None = None,
    solid: BaseGeometry | None = None,
) -> Curve:
    """Return the straight line between two points (2,), image pixels, less what is solid.

    Parts outside the frame are cut off too.
    """
    line = LineString([start, end])
    free = _polylines(line if solid is None else line.difference(solid))
    return _clip(list(free), frame)


def interpolate(line: FloatArray, stations: FloatArray) -> FloatArray:
    """Return the points (n, 2) at arc lengths (n,) along a polyline (m, 2), px.

    Arc lengths beyond an end give that end. The results equal GEOS's to the last bit, but GEOS
    walks along the line for each point, whereas one search here serves all.
    """
    steps = np.diff(line, axis=0)
    lengths = np.sqrt(steps[:, 0] * steps[:, 0] + steps[:, 1] * steps[:, 1])
    ends = np.cumsum(lengths)
    i = np.minimum(np.searchsorted(ends, stations, side="right"), len(steps) - 1)
    starts = np.where(i > 0, ends[i - 1], 0.0)
    share = np.clip((stations - starts) / np.where(lengths[i] > 0, lengths[i], 1.0), 0.0, 1.0)
    share[stations >= ends[-1]] = 1.0
    return np.where((share < 1)[:, None], steps[i] * share[:, None] + line[i], line[i + 1])


def locate(line: FloatArray, points: FloatArray) -> FloatArray:
    """Return the arc length, (n,), px, of the place on a polyline (m, 2) nearest to each point."""
    places = np.asarray(shapely.points(points), dtype=object)
    whole = LineString(line)
    if len(points) * len(line) < WALKED:
        return np.asarray(shapely.line_locate_point(whole, places), dtype=float)
    index = nearest_segments(whole, places)[0]
    steps = np.diff(line, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    along = ((points - line[index]) * steps[index]).sum(axis=1)
    share = np.clip(along / np.maximum(lengths[index] ** 2, 1e-300), 0.0, 1.0)
    return (np.cumsum(lengths) - lengths)[index] + share * lengths[index]


def _flagged_runs(line: FloatArray, flags: NDArray[np.bool_]) -> list[FloatArray]:
    """Return the runs of at least two successive flagged points, (k, 2) each."""
    changes = np.flatnonzero(np.diff(flags.astype(np.int8))) + 1
    pieces = np.split(line, changes)
    kept = np.split(flags, changes)
    return [p for p, f in zip(pieces, kept, strict=True) if f[0] and len(p) > 1]


def _clip(lines: list[FloatArray], frame: Frame | None) -> Curve:
    whole = MultiLineString([LineString(line) for line in lines])
    kept = _polylines(whole if frame is None else whole.intersection(frame.box))
    closed = len(kept) == 1 and len(kept[0]) > 3 and bool(np.allclose(kept[0][0], kept[0][-1]))
    return Curve(kept, closed, float(whole.length))


def _polylines(geometry: BaseGeometry) -> tuple[FloatArray, ...]:
    """Return the polylines of any geometry; touching ones are joined, those <= 0.5 px dropped."""
    parts = [g for g in shapely.get_parts(geometry) if isinstance(g, LineString) and g.length]
    merged = shapely.line_merge(MultiLineString(parts)) if parts else MultiLineString()
    lines = (shapely.get_coordinates(g) for g in shapely.get_parts(merged))
    return tuple(x for x in lines if np.linalg.norm(np.diff(x, axis=0), axis=1).sum() > 0.5)


def _filled_parts(geometry: BaseGeometry) -> BaseGeometry:
    """Return the geometry's polygons without their holes."""
    parts = [Polygon(g.exterior) for g in shapely.get_parts(geometry) if isinstance(g, Polygon)]
    return MultiPolygon(parts) if parts else Polygon()
