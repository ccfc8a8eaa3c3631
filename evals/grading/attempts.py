"""Grading of an attempt at a task: of all its goals, or that robots rightly stayed put."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from shapely.geometry import Polygon

from ...agent.report import Status
from ...tools.geometry.outline import FloatArray
from ..tasks.task import Goal, Thing
from .boundaries import boundary_error
from .grades import Graded, Part, distinct
from .infill import infill
from .lines import centre, corners, line_between, side
from .ring import escape_proof, ring

SAME = 0.5
"""Overlap (intersection over union) above which an outline found is taken for the thing meant."""
Rule = Callable[[Goal, FloatArray, NDArray[np.bool_]], Part]
"""Judges a goal by its rule, given positions, (m, 2) px, and which can be right at all, (m,)."""
RULES: dict[str, Rule] = {
    "boundary": ring,
    "cage": escape_proof,
    "inside": infill,
    "corners": corners,
    "side": side,
    "line_between": line_between,
    "center": centre,
}


@dataclass(frozen=True)
class Attempt:
    """The result of a task.

    Attributes:
        status: how the run ended.
        planned: positions commanded, (m, 2) px; None if there are none.
        observed: positions read back after the move; None if nothing has moved.
        found: outlines robots were placed about; none if that is not known.
        measured: all outlines that were measured.
        message: the text the run ended with.
        declined: whether a question or a refusal was made in the way the interface has for it.
            Words alone do not count: they cannot be told from a reply that went wrong.
    """

    status: Status
    planned: Sequence[tuple[float, float]] | None = None
    observed: Sequence[tuple[float, float]] | None = None
    found: tuple[Polygon, ...] = ()
    measured: tuple[Polygon, ...] = ()
    message: str = ""
    declined: bool = False


def grade_goals(goals: Sequence[Goal], positions: ArrayLike | None) -> Graded:
    """Grade positions against the goals of a task, each with a number of robots of its own.

    Which robot serves which goal is decided in the robots' favour by distance; their order does
    not matter.

    Args:
        goals: one or more, on one picture.
        positions: (m, 2) px; None if nothing was placed.
    """
    points = _point_array(positions)
    if points is None or not len(points):
        return Graded(False, 0.0, False, feedback="nothing was placed")
    robots = sum(goal.robots for goal in goals)
    width, height = goals[0].size
    with np.errstate(invalid="ignore"):
        in_picture = ((points >= 0) & (points <= (width - 1, height - 1))).all(axis=1)
    free = in_picture & distinct(points)
    owned = _robots_of_goals(goals, points)
    parts = [
        (goal, RULES[str(goal.success["where"]).partition(":")[0]](goal, points[own], free[own]))
        for goal, own in zip(goals, owned, strict=True)
    ]
    right = np.zeros(len(points), dtype=bool)
    for own, (_, part) in zip(owned, parts, strict=True):
        right[own] = part.right
    wrong = list[str]()
    if len(points) != robots:
        wrong.append(f"{len(points)} positions for {robots} robots")
    if not in_picture.all():
        wrong.append(f"{int((~in_picture).sum())} outside the picture")
    if (in_picture & ~free).any():
        wrong.append(f"{int((in_picture & ~free).sum())} in another robot's place")
    sr = len(points) == robots and all(part.success(goal.robots) for goal, part in parts)
    hits = sum(max(part.hits(goal.robots), 0.0) for goal, part in parts)
    strict = [p for _, part in parts for p in part.strict_problems]
    return Graded(
        sr=sr,
        gcr=1.0 if sr else hits / max(robots, len(points)),
        strict=sr and not strict,
        feedback="; ".join([*wrong, *(p for _, part in parts for p in part.problems), *strict]),
        measures=_named_measures([part for _, part in parts]),
        right=tuple(right.tolist()),
    )


def grade_attempt(goals: Sequence[Goal], expects: Sequence[Status], attempt: Attempt) -> Graded:
    """Grade the result of a task; the observed positions are the official ones.

    Args:
        goals: of the task; none if nothing is to be placed.
        expects: statuses that are right; if `deployed` is not among them, robots that moved are a
            failure whatever the message.
        attempt: the result.
    """
    if "deployed" not in expects:
        return _graded_refusal(expects, attempt)
    graded = grade_goals(goals, attempt.observed)
    planned = grade_goals(goals, attempt.planned)
    feedback = graded.feedback if attempt.observed else f"{attempt.status}: {attempt.message}"
    if graded.sr != planned.sr:
        feedback += f" (as planned: {'right' if planned.sr else planned.feedback})"
    things = {thing.id: thing for goal in goals for thing in goal.things}
    iou, e95 = _outlined(goals[0].target, attempt.measured)
    return Graded(
        sr=graded.sr,
        gcr=graded.gcr,
        strict=graded.strict,
        object_correct=_meant(attempt.found, list(things.values())) if attempt.found else None,
        iou=iou,
        e95=e95,
        feedback=feedback,
        measures={**graded.measures, "planned_gcr": planned.gcr},
        right=graded.right,
    )


def _outlined(thing: Thing, measured: Sequence[Polygon]) -> tuple[float | None, float | None]:
    """Return the overlap of the best outline with a thing, and its boundary error."""
    if not measured:
        return None, None
    best = max(measured, key=thing.overlap)
    error = boundary_error(best, shapely.make_valid(thing.region))
    return round(thing.overlap(best), 4), round(error, 4)


def _graded_refusal(expects: Sequence[Status], attempt: Attempt) -> Graded:
    right = attempt.declined and attempt.status in expects and attempt.observed is None
    wanted = " or ".join(expects)
    if attempt.observed is not None:
        feedback = f"robots were moved, {wanted} was right"
    elif right:
        feedback = ""
    else:
        words = "" if attempt.declined else ", in words alone"
        feedback = f"{attempt.status}{words}, {wanted} was right: {attempt.message}"
    return Graded(right, float(right), right, feedback=feedback)


def _point_array(positions: ArrayLike | None) -> FloatArray | None:
    """Return positions as an array (m, 2); those that are not finite are put far outside."""
    if positions is None:
        return None
    points = np.asarray(positions, dtype=float).reshape(-1, 2)
    return np.where(np.isfinite(points), points, -1e9)


def _robots_of_goals(goals: Sequence[Goal], points: FloatArray) -> list[NDArray[np.intp]]:
    """Return the robots of each goal by least total distance; the last goal gets the surplus."""
    if len(goals) == 1:
        return [np.arange(len(points))]
    slots = [i for i, goal in enumerate(goals) for _ in range(goal.robots)]
    places = shapely.points(points)
    far = np.stack([shapely.distance(goal.target.region, places) for goal in goals], axis=1)
    rows, columns = linear_sum_assignment(far[:, slots])
    owner = np.full(len(points), len(goals) - 1)
    owner[rows] = np.asarray(slots)[columns]
    return [np.flatnonzero(owner == i) for i in range(len(goals))]


def _meant(found: Sequence[Polygon], things: Sequence[Thing]) -> bool:
    """Return whether the outlines found are those of the things meant, in any order."""
    return len(found) == len(things) and any(
        all(thing.overlap(outline) > SAME for outline, thing in zip(found, order, strict=True))
        for order in permutations(things)
    )


def _named_measures(parts: Sequence[Part]) -> dict[str, float]:
    if len(parts) == 1:
        return dict(parts[0].measures)
    return {f"{k}_{i}": v for i, p in enumerate(parts, start=1) for k, v in p.measures.items()}
