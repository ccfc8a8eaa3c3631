"""Grading of a dialogue's turn: whether it was right to act, ask or only answer; what changed.

States are compared on true outlines, robots by their ids; sentences are judged only by the numbers
and names in them. What a turn was to leave alone must be unchanged, down to the plan's id.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...agent.report import Status
from ...tools.geometry.outline import FloatArray
from ..tasks.task import Turn
from .dialogue_checks import CHECKS
from .dialogue_states import UNMOVED, Case, State, same_places

STATUSES: Mapping[str, tuple[Status, ...]] = {
    "plan": ("planned",),
    "edit": ("planned",),
    "back": ("planned", "answered"),
    "answer": ("answered",),
    "ask": ("question",),
    "refuse": ("question", "impossible", "answered"),
    "go": ("deployed",),
}
"""Right statuses by what is expected of a turn: a new plan, a change of the current one, an earlier
one, words alone, a question, a sentence that says why not, motion."""
STILL = ("answer", "ask", "refuse")
"""Turns that change nothing."""
BACK = "turn"
"""Key of the turn whose plan becomes the current one again."""
LONGEST = 300
"""Most characters of what is wrong with a turn."""
ARRIVED = 2.0
"""A robot observed this near to its place, px, has arrived."""


@dataclass(frozen=True)
class TurnGrade:
    """The grade of a turn.

    Attributes:
        problems: what is wrong; none if it is right.
        still: whether it was to leave everything alone.
        kept: whether nothing was changed that it was to leave alone.
    """

    problems: tuple[str, ...]
    still: bool
    kept: bool


def grade_turn(turn: Turn, case: Case) -> TurnGrade:
    """Grade a turn by what is expected of it and by its checks."""
    before, after = case.before, case.after
    still = turn.expect in STILL
    changed = [*_changes(before, after)] if still else []
    if after.observed is not None and turn.expect != "go":
        changed.append("robots were moved")
    kept = not changed
    wanted = STATUSES[turn.expect]
    if after.status not in wanted:
        said = f"{after.status}, {' or '.join(wanted)} was right: {after.message}"
        return TurnGrade((*changed, said), still, kept)
    problems = [*changed, *_expectation_problems(turn, case)]
    if not problems:
        problems = [
            p
            for name, wish in turn.checks.items()
            if name != BACK
            for p in CHECKS[name](case, wish)
        ]
    return TurnGrade(tuple(problems), still, kept)


def _changes(before: State, after: State) -> Iterator[str]:
    if after.plan_id != before.plan_id:
        yield f"the plan is {after.plan_id}, not {before.plan_id} as before"
    elif before.plan_id and not same_places(before, after):
        yield "robots have other places than before"


def _expectation_problems(turn: Turn, case: Case) -> Iterator[str]:
    before, after, checks = case.before, case.after, turn.checks
    if turn.expect in STILL:
        if not after.message.strip():
            yield "nothing was said"
        return
    if after.plan_id is None:
        yield "there is no plan"
        return
    yield from _placement_problems(case)
    if turn.expect == "go":
        if after.plan_id != before.plan_id:
            yield f"another plan was driven to than {before.plan_id}"
        if after.observed is None or _largest_offset(after.observed, before.positions) > ARRIVED:
            yield "robots were not observed at the places of the plan"
    elif turn.expect == "back":
        then = case.past[int(checks[BACK])]
        if after.plan_id != then.plan_id or not same_places(after, then):
            yield f"the plan is not that of turn {checks['turn']}, {then.plan_id}"
    else:
        yield from _new_plan_problems(turn.expect, case, {"robots", "ids", "leave"} & checks.keys())


def _new_plan_problems(expect: str, case: Case, counted: set[str]) -> Iterator[str]:
    """Yield what is wrong with a new plan.

    An edit must be of a plan that stood (a correction may be of an earlier one) and keep the ids of
    robots.
    """
    before, after = case.before, case.after
    if after.plan_id == before.plan_id:
        yield "the plan is the same as before"
    if not after.certified:
        yield "the plan is not certified"
    if expect == "plan":
        return
    if after.parent is None or after.parent not in {state.plan_id for state in case.past}:
        yield f"the plan's parent is {after.parent}, not {before.plan_id}"
    if not counted and set(after.robots) != set(before.robots):
        yield f"the robots are {', '.join(after.robots)}, not {', '.join(before.robots)}"


def _placement_problems(case: Case) -> Iterator[str]:
    points, (width, height) = case.after.positions, case.size
    if not len(points):
        yield "nobody is placed"
        return
    if ((points < -0.5) | (points > (width - 0.5, height - 0.5))).any():
        yield "robots are outside the picture"
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points)) * 1e9
    if apart.min() < UNMOVED:
        yield "two robots share a place"


def _largest_offset(observed: FloatArray, places: FloatArray) -> float:
    if observed.shape != places.shape:
        return np.inf
    return float(np.linalg.norm(observed - places, axis=1).max())


def summary(grades: Sequence[TurnGrade], turns: Sequence[Turn]) -> str:
    """Return what was wrong, one line for each turn that was."""
    pairs = enumerate(zip(turns, grades, strict=True), start=1)
    return "".join(
        f"\n  turn {i} {turn.words!r}: {'; '.join(grade.problems)[:LONGEST]}"
        for i, (turn, grade) in pairs
        if grade.problems
    )
