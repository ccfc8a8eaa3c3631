"""Grades positions by a task's success rule, against the true outline.

The rules are those of evals/photos/README.md, written apart from the checker on purpose: a
certificate speaks of the outline the agent measured, a grade of the one a person drew.
Frame: pixels of the stored image, x right, y down.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from shapely.geometry import LineString, Polygon

from ...tools.geometry.cages.cages import cage
from ...tools.geometry.outline import FloatArray, distances
from ...tools.geometry.sampling import min_spacing, nearest
from ..tasks.photographs import Task

STRICT_GAPS = (0.5, 1.5)
"""Strict and even: each gap as a multiple of the mean gap."""
STRICT_SHARE = 2 / 3
"""Strict: the share of a tolerance that may be used."""
STRICT_SPREAD = 1.25
"""Strict and inside: spacing this much wider, coverage this much closer than the rule's."""


@dataclass
class Grade:
    """What was wrong, if anything: by the rule itself, and by its strict form."""

    failures: list[str] = field(default_factory=list[str])
    strict_failures: list[str] = field(default_factory=list[str])

    @property
    def success(self) -> bool:
        """The rule holds for every robot."""
        return not self.failures

    @property
    def strict(self) -> bool:
        """The rule holds, and evenness and two thirds of every tolerance too."""
        return not self.failures and not self.strict_failures


def grade(task: Task, positions: ArrayLike | None) -> Grade:
    """Grade (N, 2) positions, or None where nothing was placed."""
    result = Grade()
    if positions is None:
        result.failures.append("nothing was placed")
        return result
    points = np.asarray(positions, dtype=float).reshape(-1, 2)
    width, height = task.size
    if len(points) != task.robots:
        result.failures.append(f"{len(points)} positions for {task.robots} robots")
        return result
    if not ((points >= 0) & (points <= (width - 1, height - 1))).all():
        result.failures.append("a position outside the picture")
    where = str(task.success["where"]).partition(":")[0]
    _RULES[where](task, points, result)
    return result


def _limit(result: Grade, bad: bool, strict_bad: bool, text: str) -> None:
    if bad:
        result.failures.append(text)
    elif strict_bad:
        result.strict_failures.append(text)


def _at_most(result: Grade, value: float, most: float, share: float, text: str) -> None:
    """At most so much and, strictly, at most this share of it."""
    strict = "" if value > most else f", {most * share:.1f} strictly"
    text = f"{value:.1f} px {text}, {most} allowed{strict}"
    _limit(result, value > most, value > share * most, text)


def _truth(task: Task) -> Polygon:
    return Polygon(task.target.polygon, task.target.holes)


def _boundary(task: Task, points: FloatArray, result: Grade) -> None:
    rule, target = task.success, Polygon(task.target.polygon)
    _in_band(task, points, result)
    loop = points[around(target, points)]
    widest = float(gaps(loop).max()) if len(loop) > 1 else float("inf")
    most = rule["max_gap_px"]
    _limit(result, widest > most, False, f"gap of {widest:.0f} px, {most} allowed")
    all_round = goes_round(task.target.outline.centre, loop)
    _limit(result, not all_round, False, "the robots do not go round it")
    if rule.get("even") and len(loop) > 2:
        _even(_gaps_along(target, loop, task), result)


def _cage(task: Task, points: FloatArray, result: Grade) -> None:
    _in_band(task, points, result)
    state = cage(task.target.outline.filled, points, escapes=False).state
    _limit(result, state != "caged", False, "it is not certified that it cannot get out")


def _in_band(task: Task, points: FloatArray, result: Grade) -> None:
    target, (low, high) = Polygon(task.target.polygon), task.success["band_px"]
    near = float(distances(target, points).min())
    far = float(distances(target.convex_hull, points).max())
    _limit(result, near < low, False, f"{near:.1f} px from the target, {low} needed")
    _limit(result, far > high, False, f"{far:.1f} px from the target, {high} allowed")


def around(target: Polygon, points: FloatArray) -> NDArray[np.intp]:
    """Order of robots around a target: along its outline or its hull, which closes better.

    Along the outline, taken at their mean distance from it, robots that follow a recess come in
    turn; along the convex hull those that bridge one.
    """
    lines = (middle_line(target, points), LineString(shapely.get_coordinates(target.convex_hull)))
    orders = [np.lexsort((distances(line, points), stations(line, points))) for line in lines]
    return min(orders, key=lambda order: float(gaps(points[order]).max(initial=0.0)))


def middle_line(target: Polygon, points: FloatArray) -> LineString:
    """The outline at the mean distance of points from it."""
    return target.buffer(max(float(np.mean(distances(target, points))), 1.0)).exterior


def stations(line: LineString, points: FloatArray) -> FloatArray:
    """Arc length of the place of a line that is nearest to each point, (m,), px."""
    return np.asarray(shapely.line_locate_point(line, shapely.points(points)), dtype=float)


def gaps(loop: FloatArray) -> FloatArray:
    """Distance of each robot of a loop to the next, the last one's to the first, (m,), px."""
    return np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)


def goes_round(centre: tuple[float, float], loop: FloatArray) -> bool:
    """Whether the polygon of the robots winds round a point of the target: a crowd does not."""
    x, y = (loop - centre).T
    turns = np.diff(np.arctan2(y, x), append=np.arctan2(y[0], x[0]))
    return round(float(((turns + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi))) != 0


def _gaps_along(target: Polygon, loop: FloatArray, task: Task) -> FloatArray:
    """Gaps along a loop in mid band; where the picture cuts it, the widest is that cut."""
    middle = middle_line(target, loop)
    station = np.sort(stations(middle, loop))
    along = np.diff(station, append=station[0] + middle.length)
    width, height = task.size
    frame = shapely.box(0, 0, width - 1, height - 1)
    return along if frame.contains(middle) else np.sort(along)[:-1]


def _even(lengths: FloatArray, result: Grade) -> None:
    mean = max(float(lengths.mean()), 1e-9)
    low, high = lengths.min() / mean, lengths.max() / mean
    uneven = bool(low < STRICT_GAPS[0] or high > STRICT_GAPS[1])
    _limit(result, False, uneven, f"uneven: gaps {low:.2f} to {high:.2f} of their mean")


def _inside(task: Task, points: FloatArray, result: Grade) -> None:
    rule, target = task.success, _truth(task)
    depth = distances(target.boundary, points) * np.where(
        shapely.contains_xy(target, points), 1.0, -1.0
    )
    least = rule["min_clearance_px"]
    _limit(
        result,
        depth.min() < least,
        False,
        f"{depth.min():.1f} px inwards, {least} needed",
    )
    apart = min_spacing(points)
    floor = rule["min_spacing_px"]
    _limit(
        result,
        apart < floor,
        apart < STRICT_SPREAD * floor,
        f"two robots {apart:.1f} px apart, {floor} needed, {STRICT_SPREAD * floor:.1f} strictly",
    )
    x0, y0, x1, y1 = target.bounds
    step = task.target.outline.size / 80
    columns, rows = np.meshgrid(np.arange(x0, x1, step), np.arange(y0, y1, step))
    cells = np.stack([columns.ravel(), rows.ravel()], axis=1)
    bare = float(nearest(points, cells[shapely.contains_xy(target, cells)], 1)[0].max())
    most = rule["max_uncovered_px"]
    _at_most(result, bare, most, 1 / STRICT_SPREAD, "from the nearest robot to some part")


def _corners(task: Task, points: FloatArray, result: Grade) -> None:
    rule = task.success
    distance = np.linalg.norm(points[:, None] - np.asarray(rule["points"])[None], axis=2)
    worst = float(distance[linear_sum_assignment(np.maximum(distance, 1e-9) ** 4)].max())
    most = rule["tolerance_px"]
    _at_most(result, worst, most, STRICT_SHARE, "from its corner")
    near = float(distances(_truth(task), points).min())
    low = rule.get("min_clearance_px", 0)
    _limit(result, near <= 0 or near < low, near < 1, f"{near:.1f} px from the target")


def _side(task: Task, points: FloatArray, result: Grade) -> None:
    rule, target = task.success, Polygon(task.target.polygon)
    name = rule["where"].partition(":")[2]
    axis = 0 if name in ("top", "bottom") else 1
    span, extent = np.ptp(points[:, axis]), np.ptp(np.asarray(task.target.polygon)[:, axis])
    low, high = rule["band_px"]
    clearance = distances(target, points)
    _limit(
        result,
        clearance.min() < low or clearance.max() > high,
        False,
        f"{clearance.min():.0f} to {clearance.max():.0f} px from the target, {low}-{high} wanted",
    )
    most = rule["min_span_frac"]
    _limit(result, span < most * extent, False, f"spans {span / extent:.2f}, {most} needed")
    _limit(result, not beyond(target, points, name), False, f"not all on the {name} side")
    ordered = points[np.argsort(points[:, axis])]
    _even(np.linalg.norm(np.diff(ordered, axis=0), axis=1), result)


def beyond(target: Polygon, points: FloatArray, name: str) -> bool:
    """Nothing of the target lies between a robot and the picture's border on that side."""
    far = 1e5
    way = {"left": (-far, 0), "right": (far, 0), "top": (0, -far), "bottom": (0, far)}[name]
    rays = shapely.linestrings(np.stack([points, points + way], axis=1))
    return not bool(shapely.intersects(rays, target).any())


def _line_between(task: Task, points: FloatArray, result: Grade) -> None:
    rule = task.success
    a, b = np.asarray(rule["points"], dtype=float)
    along = (points - a) @ (b - a) / float((b - a) @ (b - a))
    off = distances(LineString([a, b]), points)
    most = rule["tolerance_px"]
    _at_most(result, float(off.max()), most, STRICT_SHARE, "off the line")
    if len(points) > 2:
        _even(np.diff(np.sort(along)), result)


def _center(task: Task, points: FloatArray, result: Grade) -> None:
    most = task.success["tolerance_px"]
    off = float(np.linalg.norm(points - np.asarray(task.success["points"][0]), axis=1).max())
    _at_most(result, off, most, STRICT_SHARE, "from the centre")


_RULES: dict[str, Callable[[Task, FloatArray, Grade], None]] = {
    "boundary": _boundary,
    "cage": _cage,
    "inside": _inside,
    "corners": _corners,
    "side": _side,
    "line_between": _line_between,
    "center": _center,
}
