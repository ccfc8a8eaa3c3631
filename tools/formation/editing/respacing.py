"""Where robots of a standing arrangement go when it is changed: along its curve, in their order.

A curve is the offset curve robots are found to stand on, not the one a clearance would aim at,
so that a change and its inverse bring everybody back. Frame: image pixels, x right, y down.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LinearRing, LineString
from shapely.geometry.base import BaseGeometry

from ...geometry.curves import ROUND_JOIN_DIP, Curve
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import along_curve
from ..contract import Group
from ..placement.place import Site, reference_curve
from ..placement.spacing import stations_on

IntArray = NDArray[np.intp]

OFF_TRACK = 0.05
"""Robots within this, px, and what a polyline falls short of its arc, stand on a curve."""
FARTHEST_PUSH = 30.0
"""A robot in a recess is pushed along its way at most this many times the distance meant."""
HALVINGS = 60
PHASES = 8
"""Phases from which the least motion onto a ring is looked for."""


@dataclass(frozen=True)
class Track:
    """The curve a group of robots stands on.

    Attributes:
        base: what distances are measured from: the outline, or for a side its envelope.
        offset: distance of the curve from it, px.
        curve: in the picture.
    """

    base: BaseGeometry
    offset: float
    curve: Curve

    def holds(self, points: FloatArray) -> bool:
        """Whether all of (n, 2) points stand on the curve."""
        if not self.curve.lines:
            return False
        slack = OFF_TRACK + (ROUND_JOIN_DIP**2 - 1) * self.offset
        return bool((distances(self.curve.geometry(), points) <= slack).all())

    def stations(self, points: FloatArray) -> FloatArray:
        """Arc lengths of (n, 2) points' feet, pieces laid end to end, (n,), px."""
        return stations_on(points, self.curve)[0]

    def at(self, stations: FloatArray) -> FloatArray:
        """Points of a curve in one piece at arc lengths, on a loop all the way round, (n, 2)."""
        line = LineString(self.curve.lines[0])
        wrapped = np.mod(stations, line.length) if self.curve.closed else stations
        return shapely.get_coordinates(shapely.line_interpolate_point(line, wrapped))

    @property
    def clockwise(self) -> float:
        """1.0 where arc length grows clockwise as seen in the picture, else -1.0."""
        return 1.0 if LinearRing(self.curve.lines[0]).is_ccw else -1.0  # y points down

    def settled(self, points: FloatArray, apart: FloatArray) -> FloatArray:
        """Points of the polyline put exactly at distances it only approximates, (n, 2).

        Args:
            points: (n, 2) on the curve.
            apart: (n,) from the base, px; points much further off, over a recess, stay.
        """
        now = distances(self.base, points)
        feet = feet_on(self.base, points)
        near = np.abs(now - apart) <= OFF_TRACK + (ROUND_JOIN_DIP**2 - 1) * self.offset
        share = np.where(near & (now > 0), apart / np.maximum(now, 1e-9), 1.0)
        return feet + (points - feet) * share[:, None]


def track(group: Group, points: FloatArray, site: Site, radius: float) -> Track:
    """The curve a ring or side group's robots stand on, found from where they are."""
    base = _base(group, site)
    return track_at(group, site, radius, float(distances(base, points).min()))


def track_at(group: Group, site: Site, radius: float, offset: float) -> Track:
    """A ring or side group's curve at an offset of robots' centres, px, > 0."""
    return Track(_base(group, site), offset, reference_curve(group, site, radius, offset))


def moved_out(points: FloatArray, old: Track, new: Track) -> FloatArray:
    """The robots of a ring or side on a curve further out or in.

    On a loop one of them moves straight out and the others keep their shares of the way round.
    Where robots, (n, 2), are spread over several curves each moves straight out.
    """
    by = new.offset - old.offset
    apart = distances(old.base, points)
    loops = old.curve.closed and new.curve.closed
    whole = loops or _one_piece(old.curve, new.curve)
    if not old.holds(points):
        return pushed(old.base, points, feet_on(old.base, points), by)
    if not whole:
        slots = along_curve(new.curve, len(points))
        return slots[_ordered(new, points, slots)]
    stations, share = old.stations(points), new.curve.length / old.curve.length
    if not loops:
        return new.settled(new.at(stations * share), apart + by)
    anchor = int(np.argmax(apart <= old.offset + OFF_TRACK))
    foot = feet_on(old.base, points[anchor : anchor + 1])
    start = new.stations(pushed(old.base, points[anchor : anchor + 1], foot, by))[0]
    turn = new.clockwise * old.clockwise
    return new.settled(new.at(start + turn * share * (stations - stations[anchor])), apart + by)


def pushed(base: BaseGeometry, points: FloatArray, origins: FloatArray, by: float) -> FloatArray:
    """Points moved straight away from their origins until they are further from a geometry.

    Args:
        base: what distances are measured from.
        points: (n, 2), off it.
        origins: (n, 2) what they move away from, or towards.
        by: how much the distance grows, px; negative to move nearer.
    """
    ways = points - origins
    unit = ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
    aim = distances(base, points) + by
    near, far = np.zeros(len(points)), np.full(len(points), FARTHEST_PUSH * by)
    if by < 0:
        far = np.maximum(far, -np.linalg.norm(ways, axis=1))
    for _ in range(HALVINGS):
        middle = (near + far) / 2
        beyond = (distances(base, points + middle[:, None] * unit) >= aim) == (by > 0)
        near, far = np.where(beyond, near, middle), np.where(beyond, middle, far)
    there = distances(base, points + far[:, None] * unit)
    step = np.where(np.abs(there - aim) < OFF_TRACK, far, by)  # a way that leads nowhere: as it is
    return points + step[:, None] * unit


def respaced(here: Track, points: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
    """Slots evenly along a curve for as many robots as stand on it or more, and who takes which.

    Robots keep their order along the curve; on a loop its phase is free. Both are chosen for
    the least sum of squared ways along it, so that robots put in and taken out again leave
    everybody where they were.

    Returns:
        slots, (count, 2), and for each of the (n, 2) robots that stay its slot, (n,).
    """
    if not here.curve.closed:
        slots = along_curve(here.curve, count)
        return slots, _ordered(here, points, slots)
    stations, step = here.stations(points), here.curve.length / count
    order = np.argsort(stations, kind="stable")
    ascending = stations[order]
    fits = [
        _fitted(ascending, step, count, float(ascending[0]) + k / PHASES * step)
        for k in range(PHASES)
    ]
    _, phase, taken = min(fits, key=lambda fit: round(fit[0], 6))
    takes = np.empty(len(points), dtype=np.intp)
    takes[order] = taken % count
    slots = here.at(phase + step * np.arange(count, dtype=float))
    return here.settled(slots, np.full(count, here.offset)), takes


def _fitted(
    stations: FloatArray, step: float, count: int, phase: float
) -> tuple[float, float, IntArray]:
    """Sum of squares, phase and slots for ascending stations on a loop, from a first phase."""
    taken = np.arange(len(stations))
    for _ in range(PHASES):
        taken = _monotone((stations - phase) / step, None, count)
        phase = float(np.mean(stations - taken * step))
    return float(((stations - taken * step - phase) ** 2).sum()), phase, taken


def _ordered(here: Track, points: FloatArray, slots: FloatArray) -> IntArray:
    """For each point a slot, in the order of both along a curve, by least squares of the ways."""
    stations, places = here.stations(points), here.stations(slots)
    order, by_place = np.argsort(stations, kind="stable"), np.argsort(places, kind="stable")
    wish = np.interp(stations[order], places[by_place], np.arange(len(slots), dtype=float))
    takes = np.empty(len(points), dtype=np.intp)
    takes[order] = by_place[_monotone(wish, 0, len(slots))]
    return takes


def _monotone(wish: FloatArray, first: int | None, count: int) -> IntArray:
    """Increasing integers nearest to ascending wishes, all within `count` of each other.

    The real solution is an isotonic regression; rounding it keeps it optimal.
    """
    from scipy.optimize import isotonic_regression

    rank = np.arange(len(wish))
    lead = np.floor(np.asarray(isotonic_regression(wish - rank).x) + 0.5).astype(np.intp)
    low = int(lead[0]) if first is None else first
    return np.clip(lead, low, low + count - len(wish)) + rank


def _one_piece(old: Curve, new: Curve) -> bool:
    whole = [len(c.lines) == 1 and c.length > 0.995 * c.whole_length for c in (old, new)]
    return all(whole) and not old.closed and not new.closed


def feet_on(base: BaseGeometry, points: FloatArray) -> FloatArray:
    """The nearest point of a geometry to each of (n, 2) points, (n, 2)."""
    lines = shapely.shortest_line(base, shapely.points(points))
    return shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 0]


def _base(group: Group, site: Site) -> BaseGeometry:
    outline = site.outlines[group.targets[0]]
    return outline.envelope if group.side is not None else outline.filled
