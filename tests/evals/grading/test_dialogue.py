"""Graders of dialogues: right answers pass every turn, policies without understanding fail."""

from collections import Counter
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from formup.evals.grading.dialogue import STATUSES, STILL, grade_turn
from formup.evals.grading.dialogue_checks import CHECKS
from formup.evals.grading.dialogue_states import NOTHING, State, case_of
from formup.evals.tasks.dialogues import dialogue_task
from formup.evals.tasks.suites import load_suite
from formup.evals.tasks.task import Task, Turn

reference: Any = import_module("dialogue_reference")
LUCKY = 0.15
"""Share of turns that a policy without understanding may get right, such as closing what is."""


@cache
def tasks() -> tuple[Task, ...]:
    return load_suite("dialogues").tasks


def graded(answer: Callable[[Task], Any]) -> list[tuple[Task, int, Turn, tuple[str, ...]]]:
    found: list[tuple[Task, int, Turn, tuple[str, ...]]] = []
    for task in tasks():
        for number, (turn, case) in enumerate(reference.hold(task, answer(task)), start=1):
            found.append((task, number, turn, grade_turn(turn, case).problems))
    return found


def test_a_right_answer_passes_every_turn() -> None:
    wrong = [
        f"{task.id} turn {number} {turn.words!r}: {'; '.join(problems)}"
        for task, number, turn, problems in graded(lambda task: reference.Reference())
        if problems
    ]
    assert wrong == []


@pytest.mark.parametrize("policy", ["never_changes", "starts_over", "jitters"])
def test_policies_that_understand_nothing_fail(policy: str) -> None:
    """They claim the right status and a child of the plan that stood; places tell."""
    found = graded(lambda task: getattr(reference, policy))
    tried = Counter(turn.expect for _, _, turn, _ in found)
    passed = Counter(turn.expect for _, _, turn, problems in found if not problems)
    assert passed["edit"] <= LUCKY * tried["edit"]
    assert passed["back"] == passed["go"] == 0
    assert sum(passed[kind] for kind in STILL) <= LUCKY * sum(tried[kind] for kind in STILL)
    assert {task.id for task, *_ in found} == {t.id for t, _, _, problems in found if problems}


def test_what_the_suite_holds() -> None:
    turns = [turn for task in tasks() if task.dialogue for turn in task.dialogue.turns]
    assert len(tasks()) >= 120
    assert all(task.dialogue and 3 <= len(task.dialogue.turns) <= 10 for task in tasks())
    assert {turn.expect for turn in turns} == STATUSES.keys()
    assert {name for turn in turns for name in turn.checks} == {*CHECKS, "turn"}
    assert {task.setup for task in tasks()} == {"photo", "drawn"}


RING = np.array([[10.0, 10], [50, 10], [50, 50], [10, 50]])
DOWN = RING + np.array([0, 9])
LAST_DOWN = np.concatenate([RING[:3], DOWN[3:]])


def square() -> Task:
    """A turn about a drawn thing, whatever it is."""
    turns = [{"say": "closer", "expect": "edit"}]
    given = {"id": "one", "scene": 711, "point": ["plate_0"], "turns": turns}
    return dialogue_task(given, "distance", "dev")


def stands(name: str, parent: str | None = None, points: Any = RING, **more: Any) -> State:
    ids = tuple(str(i) for i in range(1, len(points) + 1))
    facts: dict[str, Any] = {
        "status": "planned",
        "message": "-",
        "robots": ids,
        "certified": True,
    } | more
    return State(plan_id=name, parent=parent, positions=np.asarray(points, float), **facts)


def problems_of(turn: Turn, before: State, after: State) -> str:
    dialogue = square().dialogue
    assert dialogue is not None
    return "; ".join(grade_turn(turn, case_of(dialogue, (NOTHING, before), after)).problems)


def test_an_edit_is_a_certified_child_with_the_same_robots() -> None:
    edit, before = Turn("closer", "edit"), stands("a")
    assert problems_of(edit, before, stands("b", "a", RING + 5)) == ""
    assert "parent" in problems_of(edit, before, stands("b", None, RING + 5))
    assert "not certified" in problems_of(edit, before, stands("b", "a", certified=False))
    assert "the robots are" in problems_of(edit, before, stands("b", "a", RING[:3]))
    assert "same as before" in problems_of(edit, before, before)
    assert "outside the picture" in problems_of(edit, before, stands("b", "a", RING - 30))
    assert "share a place" in problems_of(edit, before, stands("b", "a", RING[[0, 0, 1, 2]]))


def test_what_was_to_stay_is_told_from_what_changed_and_what_moved() -> None:
    dialogue = square().dialogue
    assert dialogue is not None
    before = stands("a")
    for after, kept in (
        (stands("a", status="question"), True),
        (stands("b", status="question"), False),
        (stands("a", status="question", observed=RING), False),
        (stands("a", points=RING + 9, status="question"), False),
        (stands("a", status="answered"), True),
    ):
        grade = grade_turn(Turn("?", "ask"), case_of(dialogue, (NOTHING, before), after))
        assert (grade.still, grade.kept) == (True, kept)
        assert bool(grade.problems) == (not kept or after.status == "answered")


def test_robots_move_only_at_go() -> None:
    go, edit, before = Turn("go", "go"), Turn("closer", "edit"), stands("a")
    moved = stands("a", status="deployed", observed=RING)
    assert problems_of(go, before, moved) == ""
    assert "not observed" in problems_of(go, before, stands("a", status="deployed"))
    assert "another plan" in problems_of(go, before, stands("b", status="deployed", observed=RING))
    driven = stands("b", "a", RING + 5, observed=RING)
    assert "robots were moved" in problems_of(edit, before, driven)


@pytest.mark.parametrize(
    ("checks", "after", "wrong"),
    [
        ({"swap": [1, 3]}, RING[[2, 1, 0, 3]], ""),
        ({"swap": [1, 2]}, RING[[2, 1, 0, 3]], "robot 3 was to stay"),
        ({"move": [4]}, LAST_DOWN, ""),
        ({"move": [3]}, LAST_DOWN, "robot 4 was to stay"),
        ({"shift": {"robots": [4], "towards": "bottom"}}, DOWN, ""),
        ({"shift": {"robots": [4], "towards": "top"}}, DOWN, "not towards top"),
        ({"shift": {"robots": "all", "by": [0, 20]}}, DOWN, "not by"),
        ({"turned": [80, 100]}, RING[[1, 2, 3, 0]], ""),
        ({"turned": [80, 100]}, RING[[3, 0, 1, 2]], "turned by"),
        ({"size": [1.9, 2.1]}, 2 * RING, ""),
        ({"robots": 5}, RING, "4 robots"),
        ({"spacing": "wider"}, RING, "not times"),
        ({"form": "around"}, RING, "do not go round"),
        ({"form": "inside"}, RING, "are out"),
        ({"closed": True}, RING, "a gap"),
        ({"heading": "towards"}, RING, "no headings"),
        ({"kept_off": "t1"}, RING, "is not kept off"),
    ],
)
def test_checks(checks: dict[str, Any], after: Any, wrong: str) -> None:
    found = problems_of(Turn("", "edit", checks), stands("a"), stands("b", "a", after))
    assert (wrong in found) if wrong else not found


def test_numbers_of_an_answer_are_worked_out() -> None:
    before = stands("a")
    far = case_of(square().dialogue, (NOTHING,), before).distances(before)  # type: ignore[arg-type]
    asked = Turn("how far is robot 2?", "answer", {"says": {"distance": 2}})
    right = stands("a", status="answered", message=f"Robot 2 is {far[1]:.0f} px from it.")
    wrong = stands("a", status="answered", message=f"Robot 2 is {far[1] * 2:.0f} px from it.")
    assert problems_of(asked, before, right) == ""
    assert "is not in" in problems_of(asked, before, wrong)
