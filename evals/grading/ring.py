"""Robots around a target: closed rings, and escape-proof cages, which are not the same.

A closed ring has no gap wider than allowed and is (strict) evenly spaced. That the thing cannot
get out is a stronger statement, which no rule about gaps proves for every shape: an escape-proof
cage is one that is certified, even or not.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from ...tools.geometry.cages.cages import THOROUGH, Cage, cage
from ...tools.geometry.outline import FloatArray, distances
from ..tasks.task import Goal
from .grades import EVEN, Part
from .slots import even_along, phase_free

WAYS = ("right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right")


def ring(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge a ring by `band_px` and `max_gap_px`.

    A robot is right if it stands in the band and at least one of the gaps beside it is closed. The
    whole is the share of the way round that lies in closed gaps, at most the share that robots are
    spread along if they do not go round.
    """
    target = Polygon(goal.target.polygon)
    stands, problems = _in_band(goal, points, free)
    right = np.zeros(len(points), dtype=bool)
    if stands.sum() < 2:
        problems.append("no ring: fewer than 2 robots stand in the band")
        return Part(right, 0.0, tuple(problems))
    order = np.flatnonzero(stands)[_order_around(target, points[stands])]
    loop = points[order]
    wide = _gaps_of_loop(loop)
    closed = wide <= goal.success["max_gap_px"]
    right[order] = closed | np.roll(closed, 1)
    measures = {"worst_gap_px": float(wide.max())}
    if not closed.all():
        problems.append(_widest(goal, loop, wide))
    whole = _closed_share(target, loop, closed)
    if not _goes_round(goal.target.outline.centre, loop):
        problems.insert(0, "the robots do not go round it")
        whole = min(whole, _share_reached(target, loop))
    even, share = _even_places(goal, target, loop)
    measures["even_share"] = share
    strict = () if even else (f"uneven: {share:.0%} of the robots on even places",)
    return Part(right, whole, tuple(problems), strict, measures)


def escape_proof(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge a cage by `band_px` and a certificate that the target cannot get out of it.

    A robot is right if it stands in the band. The whole is done if those that do certainly cage the
    target; else it is the share of the way round that they are spread along. Evenness is not asked
    for, so strict is the same.
    """
    stands, problems = _in_band(goal, points, free)
    complete = len(points) == goal.robots and bool(stands.all())
    found = cage(goal.target.outline.filled, points[stands], levels=THOROUGH if complete else 0)
    measures = {"certified": float(found.state == "caged")}
    if found.state == "caged":
        return Part(stands, 1.0, tuple(problems), (), measures)
    spread = _share_reached(Polygon(goal.target.polygon), points[stands]) if stands.any() else 0.0
    return Part(stands, spread, (*problems, _loose(found)), (), measures)


def _in_band(
    goal: Goal, points: FloatArray, free: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], list[str]]:
    """Return which robots stand in the band, (m,), and what is wrong with the others."""
    target, (low, high) = Polygon(goal.target.polygon), goal.success["band_px"]
    near, far = distances(target, points), distances(target.convex_hull, points)
    problems: list[str] = []
    if (near < low).any():
        problems.append(f"{_robots_are(near < low)} too near: {near.min():.1f} px, {low} needed")
    if (far > high).any():
        problems.append(f"{_robots_are(far > high)} too far: {far.max():.1f} px, {high} allowed")
    return free & (near >= low) & (far <= high), problems


def _loose(found: Cage) -> str:
    text = (
        "it can get out, on a way that was checked"
        if found.state == "escape"
        else "it is not certified that it cannot get out"
    )
    gap = "" if found.widest_gap is None else f": a gap of {found.widest_gap:.0f} px"
    return f"{text}{gap}; gaps below {found.inscribed_diameter:.0f} px certainly hold it"


def _robots_are(flags: NDArray[np.bool_]) -> str:
    count = int(flags.sum())
    return "1 robot is" if count == 1 else f"{count} robots are"


def _widest(goal: Goal, loop: FloatArray, wide: FloatArray) -> str:
    worst = int(np.argmax(wide))
    x, y = (loop[worst] + loop[(worst + 1) % len(loop)]) / 2 - goal.target.outline.centre
    way = WAYS[round(float(np.degrees(np.arctan2(y, x))) / 45) % 8]
    return f"a gap of {wide[worst]:.0f} px at the {way}, {goal.success['max_gap_px']} allowed"


def _closed_share(target: Polygon, loop: FloatArray, closed: NDArray[np.bool_]) -> float:
    """Return the share of the convex hull's length that lies in no open gap."""
    hull = LineString(shapely.get_coordinates(target.convex_hull))
    station = _stations_along(hull, loop)
    open_ends = zip(station[~closed], np.roll(station, -1)[~closed], strict=True)
    bare = sum((end - start) % hull.length for start, end in open_ends)
    return float(np.clip(1 - bare / hull.length, 0, 1))


def _share_reached(target: Polygon, loop: FloatArray) -> float:
    """Return the share of the convex hull's length that the robots are spread along."""
    hull = LineString(shapely.get_coordinates(target.convex_hull))
    station = np.sort(_stations_along(hull, loop))
    return 1 - float(np.diff(station, append=station[0] + hull.length).max() / hull.length)


def _even_places(goal: Goal, target: Polygon, loop: FloatArray) -> tuple[bool, float]:
    """Return whether all robots stand on even places of a loop, and which share does.

    The loop is the outline at the robots' mean distance, and the start of the places is free. If
    the picture cuts the loop, the places are even along the rest of it.
    """
    if not goal.success.get("even") or len(loop) < 3:
        return True, 1.0
    middle = _middle_line(target, loop)
    station = _stations_along(middle, loop)
    width, height = goal.size
    n = len(loop)
    if shapely.box(0, 0, width - 1, height - 1).contains(middle):
        hits = phase_free(station, middle.length, n, EVEN * middle.length / n)
    else:
        ordered = np.sort(station)
        cut = int(np.argmax(np.diff(ordered, append=ordered[0] + middle.length)))
        start = ordered[(cut + 1) % n]
        hits = even_along((ordered - start) % middle.length, EVEN)
    return hits == n, hits / n


def _order_around(target: Polygon, points: FloatArray) -> NDArray[np.intp]:
    """Return the order of robots round a target: by its outline or hull, whichever closes better.

    Along the outline, at their mean distance from it, robots that follow a recess come in turn;
    along the convex hull those that bridge one do.
    """
    lines = (_middle_line(target, points), LineString(shapely.get_coordinates(target.convex_hull)))
    orders = [
        np.lexsort((distances(line, points), _stations_along(line, points))) for line in lines
    ]
    return min(orders, key=lambda order: float(_gaps_of_loop(points[order]).max(initial=0.0)))


def _middle_line(target: Polygon, points: FloatArray) -> LineString:
    """Return the outline at the mean distance of points from it."""
    return target.buffer(max(float(np.mean(distances(target, points))), 1.0)).exterior


def _stations_along(line: LineString, points: FloatArray) -> FloatArray:
    """Return the arc length of the place on a line that is nearest to each point, (m,), px."""
    return np.asarray(shapely.line_locate_point(line, shapely.points(points)), dtype=float)


def _gaps_of_loop(loop: FloatArray) -> FloatArray:
    """Return the distance of each robot of a loop to the next, the last to the first, (m,), px."""
    return np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)


def _goes_round(centre: tuple[float, float], loop: FloatArray) -> bool:
    """Return whether the polygon of robots winds round a point of the target; a crowd doesn't."""
    x, y = (loop - centre).T
    turns = np.diff(np.arctan2(y, x), append=np.arctan2(y[0], x[0]))
    return round(float(((turns + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi))) != 0
