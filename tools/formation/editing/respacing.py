"""Moves robots of an existing arrangement along its curve, preserving their order.

The curve is the offset curve that robots are found to stand on, not the nominal one of their
clearance, so that a change and its inverse bring all robots back. Frame: image pixels, x right,
y down.
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
"""Robots within this distance of a curve, px, plus the error of its polyline, stand on it."""
FARTHEST_PUSH = 30.0
"""A robot in a recess is pushed by at most this many times the intended distance."""
HALVINGS = 60
PHASES = 8
"""Number of initial phases in the search for the least motion onto a ring."""


@dataclass(frozen=True)
class Track:
    """The curve a group of robots stands on.

    Attributes:
        base: what distances are measured from: the filled outline, or for a side its envelope.
        offset: distance of the curve from it, px.
        curve: the curve, as far as it lies in the picture.
    """

    base: BaseGeometry
    offset: float
    curve: Curve

    def holds(self, points: FloatArray) -> bool:
        """Return whether all points (n, 2) are on the curve."""
        if not self.curve.lines:
            return False
        slack = OFF_TRACK + (ROUND_JOIN_DIP**2 - 1) * self.offset
        return bool((distances(self.curve.geometry(), points) <= slack).all())

    def stations(self, points: FloatArray) -> FloatArray:
        """Return the arc lengths of the feet of points (n, 2), pieces end to end, (n,), px."""
        return stations_on(points, self.curve)[0]

    def at(self, stations: FloatArray) -> FloatArray:
        """Return points (n, 2) of a curve in one piece at arc lengths, px; a loop wraps around."""
        line = LineString(self.curve.lines[0])
        wrapped = np.mod(stations, line.length) if self.curve.closed else stations
        return shapely.get_coordinates(shapely.line_interpolate_point(line, wrapped))

    @property
    def clockwise(self) -> float:
        """1.0 if arc length grows clockwise as seen in the picture, else -1.0."""
        return 1.0 if LinearRing(self.curve.lines[0]).is_ccw else -1.0  # y points down

    def at_distances(self, points: FloatArray, apart: FloatArray) -> FloatArray:
        """Move points of the polyline exactly to distances that it only approximates, (n, 2).

        Args:
            points: (n, 2) on the curve.
            apart: (n,) distances from the base, px; points that are off theirs by more than the
                polyline's error, as over a recess, are not moved.
        """
        now = distances(self.base, points)
        feet = feet_on(self.base, points)
        near = np.abs(now - apart) <= OFF_TRACK + (ROUND_JOIN_DIP**2 - 1) * self.offset
        share = np.where(near & (now > 0), apart / np.maximum(now, 1e-9), 1.0)
        return feet + (points - feet) * share[:, None]


def track(group: Group, points: FloatArray, site: Site, radius: float) -> Track:
    """Return the curve that a ring or side group's robots are on, from their positions."""
    base = _base(group, site)
    return track_at(group, site, radius, float(distances(base, points).min()))


def track_at(group: Group, site: Site, radius: float, offset: float) -> Track:
    """Return a ring or side group's curve at an offset of robots' centres, px, > 0."""
    return Track(_base(group, site), offset, reference_curve(group, site, radius, offset))


def moved_out(points: FloatArray, old: Track, new: Track) -> FloatArray:
    """Move the robots (n, 2) of a ring or side to a curve further out or in.

    On a loop one of them moves straight out and the others keep their shares of the way round. If
    a curve is cut or in several pieces, robots are spread anew in their order; if they are not on
    their curve, each moves straight out.
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
        return new.at_distances(new.at(stations * share), apart + by)
    anchor = int(np.argmax(apart <= old.offset + OFF_TRACK))
    foot = feet_on(old.base, points[anchor : anchor + 1])
    start = new.stations(pushed(old.base, points[anchor : anchor + 1], foot, by))[0]
    turn = new.clockwise * old.clockwise
    return new.at_distances(
        new.at(start + turn * share * (stations - stations[anchor])), apart + by
    )


def pushed(base: BaseGeometry, points: FloatArray, origins: FloatArray, by: float) -> FloatArray:
    """Move points straight away from their origins until they are further from a geometry, (n, 2).

    Args:
        base: what distances are measured from.
        points: (n, 2), off the base.
        origins: (n, 2), which they move away from, or towards.
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
    step = np.where(np.abs(there - aim) < OFF_TRACK, far, by)  # not reached: plain step
    return points + step[:, None] * unit


def respaced(here: Track, points: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
    """Return even slots along a curve for its robots, or for more, and who takes which.

    Robots keep their order along the curve; on a loop the phase is free. Both are chosen for the
    least sum of squared distances along it, so that adding robots and removing them again leaves
    all others where they were.

    Returns:
        The slots (count, 2), and for each of the robots (n, 2) the index of its slot, (n,).
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
    return here.at_distances(slots, np.full(count, here.offset)), takes


def _fitted(
    stations: FloatArray, step: float, count: int, phase: float
) -> tuple[float, float, IntArray]:
    """Fit ascending stations on a loop from an initial phase: sum of squares, phase and slots."""
    taken = np.arange(len(stations))
    for _ in range(PHASES):
        taken = _monotone((stations - phase) / step, None, count)
        phase = float(np.mean(stations - taken * step))
    return float(((stations - taken * step - phase) ** 2).sum()), phase, taken


def _ordered(here: Track, points: FloatArray, slots: FloatArray) -> IntArray:
    """Return a slot for each point, (n,), keeping their order on the curve, by least squares."""
    stations, places = here.stations(points), here.stations(slots)
    order, by_place = np.argsort(stations, kind="stable"), np.argsort(places, kind="stable")
    wish = np.interp(stations[order], places[by_place], np.arange(len(slots), dtype=float))
    takes = np.empty(len(points), dtype=np.intp)
    takes[order] = by_place[_monotone(wish, 0, len(slots))]
    return takes


def _monotone(wish: FloatArray, first: int | None, count: int) -> IntArray:
    """Return increasing integers nearest to ascending wishes, within a range of `count` values.

    The range begins at `first`, or anywhere if None. The real-valued solution is an isotonic
    regression; rounding it keeps it optimal.
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
    """Return the nearest point of a geometry to each of the points (n, 2), (n, 2)."""
    lines = shapely.shortest_line(base, shapely.points(points))
    return shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 0]


def _base(group: Group, site: Site) -> BaseGeometry:
    outline = site.outlines[group.targets[0]]
    return outline.envelope if group.side is not None else outline.filled
