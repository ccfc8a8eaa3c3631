"""The overlay of a trial on its picture: true outlines, slots, robots, misses.

Frame: pixels of the picture, x right, y down, pixel centres at .0. A robot that stands wrong is
marked by its shape, not by colour alone. Rings have no slots, as they may begin anywhere: their
band is drawn.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..grading.slots import match_slots
from ..tasks.task import Goal, Task
from .pictures import PagePicture
from .run_folder import StoredAttempt

MARK = 0.011
"""Radius of a robot's mark as a share of the picture's long side."""
CROWD = 20
"""Number of robots above which marks are drawn smaller."""
Point = tuple[float, float]
Ends = tuple[Point, Point]


@dataclass(frozen=True)
class Path:
    """A closed line as SVG path data."""

    d: str
    kind: str
    title: str


@dataclass(frozen=True)
class Slot:
    """A place named by a rule, as wide as its tolerance; `held` if a robot is there."""

    x: float
    y: float
    radius: float
    held: bool


@dataclass(frozen=True)
class Mark:
    """A robot: planned, or observed and then right or wrong."""

    x: float
    y: float
    kind: str
    title: str


@dataclass(frozen=True)
class Drawing:
    """All that is drawn over a picture; `radius` is that of a robot's mark, px."""

    goals: Sequence[Goal]
    picture: PagePicture
    title: str
    radius: float
    paths: Sequence[Path]
    slots: Sequence[Slot]
    ways: Sequence[Ends]
    planned: Sequence[Mark]
    robots: Sequence[Mark]


def drawing(task: Task, attempt: StoredAttempt | None, picture: PagePicture, title: str) -> Drawing:
    """Return a picture with all that is drawn over it.

    Args:
        task: whose truth is drawn.
        attempt: of the trial; None for the truth alone.
        picture: the one it is drawn on, which the page holds once.
        title: for readers who cannot see it.
    """
    shown = attempt or StoredAttempt()
    planned, observed, size = shown.planned or (), shown.observed or (), picture.size
    crowded = len(observed or planned) > CROWD
    found = [_ring_path(ring, "found", "the outline it worked with") for ring in shown.found]
    return Drawing(
        goals=task.goals,
        picture=picture,
        title=title,
        radius=MARK * max(size) * (0.65 if crowded else 1.0),
        paths=[*found, *(path for goal in task.goals for path in _truth_paths(goal))],
        slots=[slot for goal in task.goals for slot in _rule_slots(goal, attempt)],
        ways=[
            (a, b)
            for a, b in zip(planned, observed, strict=False)
            if max(abs(a[0] - b[0]), abs(a[1] - b[1])) > 0.5
        ],
        planned=[_mark(i, p, "planned", size) for i, p in enumerate(planned, start=1)],
        robots=[
            _mark(i, point, "right" if right else "wrong", size)
            for i, (point, right) in enumerate(zip(observed, shown.right, strict=True), start=1)
        ],
    )


def _truth_paths(goal: Goal) -> Iterator[Path]:
    """Yield the true outlines, and where robots may stand as far as the rule says so."""
    for thing in goal.things:
        yield from _paths(thing.region, "truth", thing.name)
    rule, target = goal.success, goal.target.region
    if "band_px" in rule:
        low, high = rule["band_px"]
        yield from _paths(target.buffer(low), "band", f"{low:g} px off")
        yield from _paths(target.convex_hull.buffer(high), "band", f"{high:g} px off")
    elif rule["where"] == "inside":
        least = rule["min_clearance_px"]
        yield from _paths(target.buffer(-least), "band", f"{least:g} px inside")


def _rule_slots(goal: Goal, attempt: StoredAttempt | None) -> list[Slot]:
    """Return the places that the rule names; all count as held if no trial is shown."""
    rule = goal.success
    if rule["where"] not in ("corners", "center"):
        return []
    places = np.asarray(rule["points"], dtype=float).reshape(-1, 2)
    most, held = float(rule["tolerance_px"]), np.ones(len(places), dtype=bool)
    if attempt is not None:
        standing = zip(attempt.observed or (), attempt.right, strict=True)
        robots = np.asarray([point for point, right in standing if right]).reshape(-1, 2)
        taken = match_slots(robots, places, most) if len(robots) else np.array([], dtype=np.intp)
        held = np.isin(np.arange(len(places)), taken)
    return [
        Slot(x, y, most, full) for (x, y), full in zip(places.tolist(), held.tolist(), strict=True)
    ]


def _mark(number: int, point: Point, kind: str, size: tuple[int, int]) -> Mark:
    """Return the mark of a robot; one outside the picture is drawn at its edge, to be seen."""
    x, y = (min(max(value, 0.0), side - 1.0) for value, side in zip(point, size, strict=True))
    return Mark(x, y, kind, f"robot {number}, {kind} at {point[0]:.1f}, {point[1]:.1f}")


def _paths(shape: BaseGeometry, kind: str, title: str) -> Iterator[Path]:
    """Yield the outlines of a shape, which may have parts and holes or be empty."""
    for part in shapely.get_parts(shape):
        if isinstance(part, Polygon):
            for ring in (part.exterior, *part.interiors):
                if not ring.is_empty:
                    yield _ring_path(list(ring.coords), kind, title)


def _ring_path(points: Sequence[tuple[float, ...]], kind: str, title: str) -> Path:
    d = "L".join(f"{x:.1f} {y:.1f}" for x, y, *_ in points)
    return Path(f"M{d}Z", kind, title)
