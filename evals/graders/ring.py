"""Rings around a target: in the band, closed all round, and (strict) evenly spaced.

A closed ring has no gap wider than allowed. That nothing can get out of it is a stronger
statement, which a ring does not prove for every shape; it is not made here.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from ...tools.geometry.outline import FloatArray, distances
from ..grade import around
from ..suite import Task
from .graded import Part
from .slots import even_along, phase_free

EVEN = 0.25
"""Strict: how far off its slot a robot may stand along the loop, as a share of a gap."""
WAYS = ("right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right")


def ring(task: Task, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge a ring by `band_px` and `max_gap_px`.

    A robot is right if it stands in the band and at least one of the gaps beside it is closed. Of
    the whole, the share of the way round that lies in closed gaps counts.

    Args:
        task: with the rule.
        points: (m, 2), px.
        free: which of them can be right at all, (m,).
    """
    target, (low, high) = Polygon(task.target.polygon), task.success["band_px"]
    near, far = distances(target, points), distances(target.convex_hull, points)
    stands = free & (near >= low) & (far <= high)
    problems: list[str] = []
    if (near < low).any():
        problems.append(f"{_count(near < low)} too near: {near.min():.1f} px, {low} needed")
    if (far > high).any():
        problems.append(f"{_count(far > high)} too far: {far.max():.1f} px, {high} allowed")
    right = np.zeros(len(points), dtype=bool)
    if stands.sum() < 2:
        problems.append("no ring: fewer than 2 robots stand in the band")
        return Part(right, 0.0, tuple(problems))
    order = np.flatnonzero(stands)[_order(target, points[stands])]
    loop = points[order]
    gaps = _gaps(loop)
    closed = gaps <= task.success["max_gap_px"]
    right[order] = closed | np.roll(closed, 1)
    measures = {"worst_gap_px": float(gaps.max())}
    if not closed.all():
        problems.append(_widest(task, loop, gaps))
    whole = _closed_share(target, loop, closed)
    if not _goes_round(task.target.outline.centre, loop):
        problems.insert(0, "the robots do not go round it")
        whole = min(whole, _reach(target, loop))
    even, share = _even(task, target, loop)
    measures["even_share"] = share
    strict = () if even else (f"uneven: {share:.0%} of the robots on even places",)
    return Part(right, whole, tuple(problems), strict, measures)


def _order(target: Polygon, points: FloatArray) -> NDArray[np.intp]:
    """Order of robots around a target: along its convex hull or its outline, which closes better.

    Along the hull robots on both sides of a recess are mixed, along the outline those that bridge
    one are. The rule of the photographs knows the hull alone and so can find gaps that are none.
    """
    middle = target.buffer(max(float(np.mean(distances(target, points))), 1.0)).exterior
    station = _stations(middle, points)
    orders = (around(target, points), np.argsort(station, kind="stable"))
    return min(orders, key=lambda order: float(_gaps(points[order]).max()))


def _stations(line: LineString, points: FloatArray) -> FloatArray:
    """Arc length of the place of a line that is nearest to each point, (m,), px."""
    return np.asarray(shapely.line_locate_point(line, shapely.points(points)), dtype=float)


def _gaps(loop: FloatArray) -> FloatArray:
    return np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)


def _count(flags: NDArray[np.bool_]) -> str:
    count = int(flags.sum())
    return "1 robot is" if count == 1 else f"{count} robots are"


def _widest(task: Task, loop: FloatArray, gaps: FloatArray) -> str:
    worst = int(np.argmax(gaps))
    x, y = (loop[worst] + loop[(worst + 1) % len(loop)]) / 2 - task.target.outline.centre
    way = WAYS[round(float(np.degrees(np.arctan2(y, x))) / 45) % 8]
    return f"a gap of {gaps[worst]:.0f} px at the {way}, {task.success['max_gap_px']} allowed"


def _closed_share(target: Polygon, loop: FloatArray, closed: NDArray[np.bool_]) -> float:
    """Share of the convex hull's length that lies in no open gap."""
    hull = LineString(shapely.get_coordinates(target.convex_hull))
    station = _stations(hull, loop)
    open_ends = zip(station[~closed], np.roll(station, -1)[~closed], strict=True)
    bare = sum((end - start) % hull.length for start, end in open_ends)
    return float(np.clip(1 - bare / hull.length, 0, 1))


def _goes_round(centre: tuple[float, float], loop: FloatArray) -> bool:
    """Whether the polygon of the robots winds round a point of the target: a crowd does not.

    The rule of the photographs does not ask this and takes a crowd on one side for a ring.
    """
    x, y = (loop - centre).T
    turns = np.diff(np.arctan2(y, x), append=np.arctan2(y[0], x[0]))
    return round(float(((turns + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi))) != 0


def _reach(target: Polygon, loop: FloatArray) -> float:
    """Share of the convex hull's length that the robots are spread along."""
    hull = LineString(shapely.get_coordinates(target.convex_hull))
    station = np.sort(_stations(hull, loop))
    return 1 - float(np.diff(station, append=station[0] + hull.length).max() / hull.length)


def _even(task: Task, target: Polygon, loop: FloatArray) -> tuple[bool, float]:
    """Whether all stand on even places of a loop in mid band whose start is free; which share.

    Where the picture cuts the loop, the places are even along the rest of it.
    """
    if not task.success.get("even") or len(loop) < 3:
        return True, 1.0
    middle = target.buffer(max(float(np.mean(distances(target, loop))), 1.0)).exterior
    station = _stations(middle, loop)
    width, height = task.size
    n = len(loop)
    if shapely.box(0, 0, width - 1, height - 1).contains(middle):
        hits = phase_free(station, middle.length, n, EVEN * middle.length / n)
    else:
        ordered = np.sort(station)
        cut = int(np.argmax(np.diff(ordered, append=ordered[0] + middle.length)))
        start = ordered[(cut + 1) % n]
        hits = even_along((ordered - start) % middle.length, EVEN)
    return hits == n, hits / n
