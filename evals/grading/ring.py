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
from ..tasks.photographs import Task
from .graded import Part
from .photo_rules import around, gaps, goes_round, middle_line, stations
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
    target = Polygon(task.target.polygon)
    stands, problems = _in_band(task, points, free)
    right = np.zeros(len(points), dtype=bool)
    if stands.sum() < 2:
        problems.append("no ring: fewer than 2 robots stand in the band")
        return Part(right, 0.0, tuple(problems))
    order = np.flatnonzero(stands)[around(target, points[stands])]
    loop = points[order]
    wide = gaps(loop)
    closed = wide <= task.success["max_gap_px"]
    right[order] = closed | np.roll(closed, 1)
    measures = {"worst_gap_px": float(wide.max())}
    if not closed.all():
        problems.append(_widest(task, loop, wide))
    whole = _closed_share(target, loop, closed)
    if not goes_round(task.target.outline.centre, loop):
        problems.insert(0, "the robots do not go round it")
        whole = min(whole, _reach(target, loop))
    even, share = _even(task, target, loop)
    measures["even_share"] = share
    strict = () if even else (f"uneven: {share:.0%} of the robots on even places",)
    return Part(right, whole, tuple(problems), strict, measures)


def escape_proof(task: Task, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge a cage by `band_px` and a certificate that the target cannot get out of it.

    A robot is right if it stands in the band. The whole is done where those that do certainly
    cage the target; else the share of the way round counts that they are spread along. Evenness
    is not asked for, so strict is the same.

    Args:
        task: with the rule.
        points: (m, 2), px.
        free: which of them can be right at all, (m,).
    """
    stands, problems = _in_band(task, points, free)
    complete = len(points) == task.robots and bool(stands.all())
    found = cage(task.target.outline.filled, points[stands], levels=THOROUGH if complete else 0)
    measures = {"certified": float(found.state == "caged")}
    if found.state == "caged":
        return Part(stands, 1.0, tuple(problems), (), measures)
    spread = _reach(Polygon(task.target.polygon), points[stands]) if stands.any() else 0.0
    return Part(stands, spread, (*problems, _loose(found)), (), measures)


def _in_band(
    task: Task, points: FloatArray, free: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], list[str]]:
    """Which robots stand in the band, and what is wrong with the others."""
    target, (low, high) = Polygon(task.target.polygon), task.success["band_px"]
    near, far = distances(target, points), distances(target.convex_hull, points)
    problems: list[str] = []
    if (near < low).any():
        problems.append(f"{_count(near < low)} too near: {near.min():.1f} px, {low} needed")
    if (far > high).any():
        problems.append(f"{_count(far > high)} too far: {far.max():.1f} px, {high} allowed")
    return free & (near >= low) & (far <= high), problems


def _loose(found: Cage) -> str:
    said = (
        "it can get out, on a way that was checked"
        if found.state == "escape"
        else "it is not certified that it cannot get out"
    )
    gap = "" if found.widest_gap is None else f": a gap of {found.widest_gap:.0f} px"
    return f"{said}{gap}; gaps below {found.inscribed_diameter:.0f} px certainly hold it"


def _count(flags: NDArray[np.bool_]) -> str:
    count = int(flags.sum())
    return "1 robot is" if count == 1 else f"{count} robots are"


def _widest(task: Task, loop: FloatArray, wide: FloatArray) -> str:
    worst = int(np.argmax(wide))
    x, y = (loop[worst] + loop[(worst + 1) % len(loop)]) / 2 - task.target.outline.centre
    way = WAYS[round(float(np.degrees(np.arctan2(y, x))) / 45) % 8]
    return f"a gap of {wide[worst]:.0f} px at the {way}, {task.success['max_gap_px']} allowed"


def _closed_share(target: Polygon, loop: FloatArray, closed: NDArray[np.bool_]) -> float:
    """Share of the convex hull's length that lies in no open gap."""
    hull = LineString(shapely.get_coordinates(target.convex_hull))
    station = stations(hull, loop)
    open_ends = zip(station[~closed], np.roll(station, -1)[~closed], strict=True)
    bare = sum((end - start) % hull.length for start, end in open_ends)
    return float(np.clip(1 - bare / hull.length, 0, 1))


def _reach(target: Polygon, loop: FloatArray) -> float:
    """Share of the convex hull's length that the robots are spread along."""
    hull = LineString(shapely.get_coordinates(target.convex_hull))
    station = np.sort(stations(hull, loop))
    return 1 - float(np.diff(station, append=station[0] + hull.length).max() / hull.length)


def _even(task: Task, target: Polygon, loop: FloatArray) -> tuple[bool, float]:
    """Whether all stand on even places of a loop in mid band whose start is free; which share.

    Where the picture cuts the loop, the places are even along the rest of it.
    """
    if not task.success.get("even") or len(loop) < 3:
        return True, 1.0
    middle = middle_line(target, loop)
    station = stations(middle, loop)
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
