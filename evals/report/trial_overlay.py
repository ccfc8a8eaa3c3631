"""What a trial placed, drawn over its picture as SVG: true outlines, slots, robots, misses.

Frame: pixels of the picture, x right, y down, pixel centres at .0. A robot that stands wrong is
told by its shape, not by colour alone. Rings have no slots, as they may begin anywhere: their band
is drawn.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..grading.slots import matched
from ..tasks.stored_suite import KeptGoal, KeptTask, KeptThing, Point
from .markup import Html, joined, tag
from .pictures import Shown
from .read import Kept

MARK = 0.011
"""Radius of a robot as a share of the picture's long side."""
CROWD = 20
"""Robots above which marks are drawn smaller."""


def overlay(task: KeptTask, kept: Kept | None, picture: Shown, title: str) -> Html:
    """A picture with what belongs on it.

    Args:
        task: whose truth is drawn.
        kept: of the trial; None for the truth alone.
        picture: what it is drawn on, which the page holds once.
        title: for those who do not see it.
    """
    width, height = picture.size
    radius = MARK * max(width, height)
    if kept is not None and len(kept.observed or kept.planned or ()) > CROWD:
        radius *= 0.65
    drawn = [_found(kept)] if kept is not None else []
    drawn += [_truth(goal, kept) for goal in task.goals]
    drawn += [_robots(kept, picture.size, radius)] if kept is not None else []
    box = f"-0.5 -0.5 {width} {height}"
    base = tag("use", href=f"#{picture.id}") if picture.id else None
    return tag(
        "svg",
        tag("title", title),
        base,
        joined(drawn),
        viewBox=box,
        role="img",
        class_="over" if base else "over bare",
    )


def _truth(goal: KeptGoal, kept: Kept | None) -> Html:
    """The true outlines, and where robots may stand as far as the rule says it."""
    lines = [_path(_polygon(thing), "truth", thing.name) for thing in goal.things]
    return joined(lines, _band(goal), _slots(goal, kept))


def _band(goal: KeptGoal) -> Html:
    rule, target = goal.success, _polygon(goal.things[0])
    if "band_px" in rule:
        low, high = rule["band_px"]
        return joined(
            _path(target.buffer(low), "band", f"{low:g} px off"),
            _path(target.convex_hull.buffer(high), "band", f"{high:g} px off"),
        )
    if rule["where"] == "inside":
        least = rule["min_clearance_px"]
        return _path(target.buffer(-least), "band", f"{least:g} px inside")
    return joined()


def _slots(goal: KeptGoal, kept: Kept | None) -> Html:
    """Places that the rule names, as wide as the tolerance; those without a robot are crossed."""
    rule = goal.success
    points = np.asarray(rule.get("points", ()), dtype=float).reshape(-1, 2)
    if rule["where"] == "line_between":
        (x1, y1), (x2, y2) = points.tolist()
        width = 2 * rule["tolerance_px"]
        return joined(
            tag("line", x1=x1, y1=y1, x2=x2, y2=y2, class_="corridor", stroke_width=width),
            tag("line", x1=x1, y1=y1, x2=x2, y2=y2, class_="band"),
        )
    if rule["where"] not in ("corners", "center"):
        return joined()
    most, held = float(rule["tolerance_px"]), _held(points, kept, float(rule["tolerance_px"]))
    return joined(
        joined(
            tag("circle", cx=x, cy=y, r=most, class_="slot" if full else "slot empty"),
            None if full else _cross(x, y, most * 0.5, "slot empty"),
        )
        for (x, y), full in zip(points.tolist(), held, strict=True)
    )


def _held(slots: np.ndarray, kept: Kept | None, tolerance: float) -> list[bool]:
    """Which slots hold a robot that stands right; all of them where no trial is shown."""
    if kept is None:
        return [True] * len(slots)
    standing = zip(kept.observed or (), kept.right, strict=True)
    robots = np.asarray([point for point, right in standing if right], dtype=float).reshape(-1, 2)
    if not len(robots):
        return [False] * len(slots)
    return np.isin(np.arange(len(slots)), matched(robots, slots, tolerance)).tolist()


def _found(kept: Kept) -> Html:
    return joined(_ring(ring, "found", "the outline it worked with") for ring in kept.found)


def _robots(kept: Kept, size: tuple[int, int], radius: float) -> Html:
    planned, observed = kept.planned or (), kept.observed or ()
    marks = [
        tag(
            "circle", tag("title", f"robot {i}, planned {_at(point)}"), **_disc(point, size, radius)
        )
        for i, point in enumerate(planned, start=1)
    ]
    ways = [
        tag("line", x1=x1, y1=y1, x2=x2, y2=y2, class_="way")
        for (x1, y1), (x2, y2) in zip(planned, observed, strict=False)
        if max(abs(x1 - x2), abs(y1 - y2)) > 0.5
    ]
    for i, (point, right) in enumerate(zip(observed, kept.right, strict=True), start=1):
        kind = "right" if right else "wrong"
        title = tag("title", f"robot {i}, {kind}, {_at(point)}")
        marks.append(robot(_within(point, size), radius, kind, title))
    return joined(ways, marks)


def robot(place: Point, radius: float, kind: str, title: Html | None = None) -> Html:
    """The mark of a robot that stands `right` or `wrong`; its lines are as wide as it is large."""
    x, y = place
    disc = tag("circle", cx=x, cy=y, r=radius, stroke_width=round(0.22 * radius, 2))
    line = round(0.3 * radius, 2)
    cross = _cross(x, y, radius * 0.5, "cross", line) if kind == "wrong" else None
    return tag("g", title, disc, cross, class_=kind)


def _disc(point: Point, size: tuple[int, int], radius: float) -> dict[str, str | float]:
    x, y = _within(point, size)
    return {"cx": x, "cy": y, "r": radius * 0.6, "class_": "planned"}


def _cross(x: float, y: float, arm: float, kind: str, width: float | None = None) -> Html:
    a, b, c, d = (round(value, 1) for value in (x - arm, y - arm, x + arm, y + arm))
    way = f"M{a:g} {b:g}L{c:g} {d:g}M{a:g} {d:g}L{c:g} {b:g}"
    return tag("path", d=way, class_=kind, **({} if width is None else {"stroke_width": width}))


def _within(point: Point, size: tuple[int, int]) -> Point:
    """Where it can be seen: what is outside the picture is drawn at its edge."""
    x, y = (min(max(value, 0.0), side - 1.0) for value, side in zip(point, size, strict=True))
    return x, y


def _at(point: Point) -> str:
    return f"at {point[0]:.1f}, {point[1]:.1f}"


def _polygon(thing: KeptThing) -> Polygon:
    return Polygon(thing.outline, thing.holes)


def _path(shape: BaseGeometry, kind: str, title: str) -> Html:
    """The outlines of a shape, which may have parts and holes or be empty."""
    return joined(
        _ring(list(ring.coords), kind, title)
        for part in shapely.get_parts(shape)
        if isinstance(part, Polygon)
        for ring in (part.exterior, *part.interiors)
        if not ring.is_empty
    )


def _ring(points: Sequence[tuple[float, ...]], kind: str, title: str) -> Html:
    d = "L".join(f"{x:.1f} {y:.1f}" for x, y, *_ in points)
    return tag("path", tag("title", title), d=f"M{d}Z", class_=kind)
