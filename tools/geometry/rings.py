"""Rings of robots: with equal chords, nested, or inside holes.

Pure functions from outlines to points, built on the offset curves of `curves`. Frame: image
pixels, x right, y down.
"""

from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from .curves import (
    QUAD_SEGMENTS,
    ROUND_JOIN_DIP,
    Curve,
    Frame,
    interpolate,
    ring,
)
from .outline import FloatArray, Outline
from .sampling import PHASES, along_curve, arc_length, nearest, split

CHORD_STEPS = 200
EQUAL = 0.999
"""Ratio of the shortest to the longest chord at which the relaxation stops."""
DAMPING = 0.5
MOST_STEP = 1.5
"""Ratio of the longest arc between neighbours to the mean arc beyond which other starts are tried:
a chord may be short only because it cuts straight through what the curve goes around."""
BARE = 2.1
"""Beyond this ratio too much of the ring is bare to be worth equal chords, and arcs are kept within
MOST_STEP."""


def equal_chords(curve: Curve, n: int) -> FloatArray:
    """Return n points on a curve in one piece, with equal straight distances between neighbours.

    Equal arc lengths cut corners short; here each point moves along the curve until the chords to
    its two neighbours are equally long. Points that are not neighbours may still come near each
    other across a neck: see `min_spacing`. A curve in several pieces keeps equal arc lengths. If
    equal chords would leave much of a ring bare, as around a thin object, chords are only as equal
    as is possible without that.

    On an open curve the end robots stay at its ends.

    Returns:
        (n, 2), in order along the curve.
    """
    points = along_curve(curve, n)
    if len(curve.lines) != 1 or n < 3:
        return points
    at = _arc_lengths(curve, points)
    found = _relaxed(curve, at)
    phase = 1
    while curve.closed and found.longest > MOST_STEP and phase < PHASES:
        other = _relaxed(curve, at + phase / PHASES * curve.length / n)
        found = min(found, other, key=lambda r: (r.even < EQUAL, r.longest))
        phase += 1
    if curve.closed and found.longest > BARE:
        found = _relaxed(curve, at, MOST_STEP)
    return found.points


class _Relaxed(NamedTuple):
    """Points, the ratio of shortest to longest chord, and that of longest to mean arc."""

    points: FloatArray
    even: float
    longest: float


def _relaxed(curve: Curve, at: FloatArray, most: float = np.inf) -> _Relaxed:
    """Slide points from the given arc lengths until chords are equal, or as even as they get.

    No arc gets longer than `most` times the mean arc.
    """
    best = _Relaxed(np.empty((0, 2)), -1.0, np.inf)
    for _ in range(CHORD_STEPS):
        ends = np.append(at, at[0] + curve.length) if curve.closed else at
        places = interpolate(curve.lines[0], ends % curve.length if curve.closed else ends)
        chords = np.linalg.norm(np.diff(places, axis=0), axis=1)
        steps = np.diff(ends)
        even = float(chords.min() / max(chords.max(), 1e-12))
        longest = float(steps.max() / steps.mean())
        if longest > most:
            break
        if even > best.even:
            best = _Relaxed(places[: len(at)], even, longest)
        if even >= EQUAL:
            break
        ideal = steps * (chords.mean() / np.maximum(chords, 1e-9)) ** DAMPING
        ideal *= (ends[-1] - ends[0]) / ideal.sum()
        at = at[0] + np.concatenate([[0.0], np.cumsum(ideal)])[: len(at)]
    return best


def nested_rings(
    outline: Outline,
    n: int,
    offset: float,
    step: float,
    count: int,
    frame: Frame | None = None,
) -> tuple[FloatArray, ...]:
    """Share n robots by length over several rings around an outline, each further out.

    Each ring is staggered into the gaps of the one inside it, as far as their counts allow.

    Args:
        outline: what to go around.
        n: number of robots over all rings.
        offset: distance of the first ring from the outline, px.
        step: distance from one ring to the next, px.
        count: number of rings.
        frame: where robots may stand, which may cut rings open; None for the whole plane.

    Returns:
        For each ring (k, 2), innermost first; the k sum to n unless the picture leaves no room.
    """
    offsets = [offset + k * step for k in range(count)]
    curves = [ring(outline, away, away, frame, keep=away) for away in offsets]
    curves = [curve for curve in curves if curve.length > 0]
    if not curves:
        return ()
    shares = split(np.array([curve.length for curve in curves]), n)
    placed: list[FloatArray] = []
    for curve, share in zip(curves, shares, strict=True):
        points = along_curve(curve, share) if share else np.empty((0, 2))
        if curve.closed and share and placed and len(placed[-1]):
            points = _staggered(curve, points, placed[-1])
        placed.append(points)
    return tuple(placed)


def hole_rings(outline: Outline, n: int, offset: float) -> tuple[FloatArray, ...]:
    """Share n robots by length over the holes of an outline, along the holes' edges.

    Args:
        outline: an outline with holes; without any there is nowhere to stand.
        n: number of robots over all holes.
        offset: distance kept from the hole's edge, px.

    Returns:
        (k, 2) for each hole with room and robots; empty if no hole is wide enough.
    """
    reach = offset * ROUND_JOIN_DIP
    holes = [Polygon(hole) for hole in outline.polygon.interiors]
    rooms = shapely.buffer(np.asarray(holes, dtype=object), -reach, quad_segs=QUAD_SEGMENTS)
    parts = [part for part in shapely.get_parts(rooms) if isinstance(part, Polygon) and part.area]
    if not parts:
        return ()
    loops = [shapely.get_coordinates(part.exterior) for part in parts]
    curves = [Curve((loop,), True, arc_length(loop)) for loop in loops]
    shares = split(np.array([curve.length for curve in curves]), n)
    return tuple(along_curve(c, k) for c, k in zip(curves, shares, strict=True) if k)


def _staggered(curve: Curve, points: FloatArray, before: FloatArray) -> FloatArray:
    """Rotate a ring to where its robots are furthest from those of the ring before it."""
    line, gap = curve.lines[0], curve.length / len(points)
    first = _first(line, points)
    stations = first + gap * (np.arange(len(points)) + np.arange(PHASES)[:, None] / PHASES)
    turned = interpolate(line, stations.ravel() % curve.length)
    apart = nearest(before, turned, 1)[0].reshape(PHASES, -1).min(axis=1)
    return turned.reshape(PHASES, -1, 2)[int(np.argmax(apart))]


def _first(line: FloatArray, points: FloatArray) -> float:
    """Return the arc length of the first of the points along a polyline, px."""
    return float(shapely.line_locate_point(LineString(line), shapely.Point(points[0])))


def _arc_lengths(curve: Curve, points: FloatArray) -> FloatArray:
    """Return the arc lengths, (n,), px, of points from `along_curve` on a curve in one piece.

    They may run past a loop's end.
    """
    count: FloatArray = np.arange(len(points), dtype=float)
    cut = 0.0 if curve.closed else curve.cut(len(points))
    if cut is None:
        return count * curve.length / (len(points) - 1)
    return _first(curve.lines[0], points) + count * (curve.length + cut) / len(points)
