"""Checks gaps between neighbours on a curve: an exact pitch, a greatest gap, and an opening."""

import numpy as np
from numpy.typing import NDArray

from ...geometry.curves import Curve, interpolate, locate
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import nearest
from ..contract import nominal, pitch_slack
from ..placement.ring_parts import opening_station, ring_line, sides_of
from ..placement.spacing import NARROWEST, WIDEST, count_for_max_gap, stations_on
from .verdict import TOLERANCE, Audit, Part

IntArray = NDArray[np.intp]
CLEARLY = 1.5
"""An opening is at least this many times as wide as the widest other gap, along the ring."""

WIDER = 1.1
"""An opening so many times as wide as was asked is told of where the other gaps make it so."""


def on_sides(part: Part, audit: Audit) -> None:
    """Check that no robot stands off the sides of the target that were named."""
    off = distances(sides_of(part.group, part.site), part.points)
    for i in np.flatnonzero(off > TOLERANCE):
        about = " and ".join(part.group.sides or ())
        audit.find("off_sides", off[i], 0.0, robot=part.first + i, about=about)


def _neighbours(part: Part, curve: Curve) -> tuple[IntArray, IntArray, FloatArray]:
    """Return indices of neighbours along a curve and their straight distances, px, (m,) each."""
    station, piece = stations_on(part.points, curve)
    order = np.argsort(station, kind="stable")
    after = np.roll(order, -1)
    if len(order) == 1 or not (curve.closed or curve.cut(len(order)) is not None):
        order, after = order[:-1], after[:-1]
    same = piece[order] == piece[after]
    order, after = order[same], after[same]
    return order, after, np.linalg.norm(part.points[after] - part.points[order], axis=1)


def pitch_kept(part: Part, curve: Curve, audit: Audit) -> None:
    """Check that neighbours along a curve stand exactly the contract's pitch apart."""
    _compare(part, *_neighbours(part, curve), audit)


def pitch_nearest(part: Part, audit: Audit) -> None:
    """Check that the nearest neighbour of every robot on a shape is exactly the pitch away."""
    if len(part.points) > 1:
        apart, other = nearest(part.points, part.points, 2)
        _compare(part, np.arange(len(part.points)), other[:, 1], apart[:, 1], audit)


def _compare(part: Part, one: IntArray, other: IntArray, apart: FloatArray, audit: Audit) -> None:
    pitch = part.group.pitch or 0.0
    if len(apart):
        audit.greatest("max_off_pitch_px", np.abs(apart - pitch).max())
    for k in np.flatnonzero(np.abs(apart - pitch) > pitch_slack(pitch) + TOLERANCE):
        i, j = part.first + one[k], part.first + other[k]
        audit.find("off_pitch", apart[k], pitch, robot=i, others=(j,))


def no_wider(part: Part, curve: Curve, audit: Audit) -> None:
    """Check that no gap between neighbours' edges is wider than the contract allows."""
    one, other, apart = _neighbours(part, curve)
    limit, wide = part.group.max_gap or 0.0, apart - 2 * part.radius
    if len(wide):
        audit.greatest("widest_opening_px", wide.max())
    for k in np.flatnonzero(wide > limit + TOLERANCE):
        i, j = part.first + one[k], part.first + other[k]
        audit.find(
            "opening", wide[k], limit, robot=i, others=(j,), needed=count_for_max_gap(part, curve)
        )


def opening_left(part: Part, curve: Curve, audit: Audit) -> None:
    """Check that the ring has its opening where demanded, clearly wider than all other gaps."""
    group = part.group
    offset = nominal(group.offsets()) + part.radius
    loop = ring_line(group, part.site, part.radius, offset)
    length = float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum())
    station = (locate(loop, part.points) - opening_station(group, part.site, loop)) % length
    order = np.argsort(station, kind="stable")
    first, last = order[0], order[-1]
    along, gaps = float(station[first] + length - station[last]), np.diff(station[order])
    ends = part.points[[first, last]]
    if along > length / 2:  # more than half the ring: measure to the opposite point
        ends[1] = interpolate(loop, (locate(loop, ends[:1]) - length / 2) % length)[0]
    width = float(np.linalg.norm(ends[0] - ends[1])) - 2 * part.radius
    audit.greatest("opening_px", width)
    others = (part.first + last,)
    least = group.opening or 0.0
    if width < least - TOLERANCE:
        audit.find("narrow_opening", width, least, robot=part.first + first, others=others)
    elif along < CLEARLY * gaps.max() - TOLERANCE:
        least = CLEARLY * gaps.max()
        audit.find("narrow_opening", along, least, robot=part.first + first, others=others)
    forced = len(gaps) > 0 and along < WIDER * CLEARLY * gaps.max()
    if group.opening and forced and width > WIDER * group.opening:
        wide, asked = part.site.length(width), part.site.length(group.opening)
        audit.notes.append(
            f"The opening is {wide} wide, not {asked}: it is at least {CLEARLY:g} times as wide as "
            "the other gaps. More robots would make all of them narrower."
        )
    for k in np.flatnonzero(group.spacing == "even" and group.pitch is None and gaps >= 0):
        kind = "gap" if gaps[k] > WIDEST * gaps.mean() + TOLERANCE else "crowded"
        limit = (WIDEST if kind == "gap" else NARROWEST) * float(gaps.mean())
        if kind == "gap" or gaps[k] < limit - TOLERANCE:
            i, j = part.first + order[k], part.first + order[k + 1]
            audit.find(kind, gaps[k], limit, robot=i, others=(j,))
