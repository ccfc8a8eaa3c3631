"""Graders: what is right in part, what a rule must not depend on, and where both rules agree."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from formup.evals.grade import grade
from formup.evals.graders.grading import Attempt, grade_attempt, grade_goals
from formup.evals.graders.region import separated
from formup.evals.policies import POLICIES, chance, positions
from formup.evals.reference import reference
from formup.evals.suite import Task, Thing, load_tasks, photos_folder
from formup.tools.geometry.outline import FloatArray
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

TASKS = [*load_tasks(), *load_tasks(photos_folder() / "many.json")]
IDS = [task.id for task in TASKS]
RIGHT = {task.id: reference(task) for task in TASKS}
HOLLOW = "ucm_airplane20_many"
"""Its ring bridges recesses, which the rule of the photographs takes for gaps."""


def square(rule: dict[str, object], robots: int, category: str = "general") -> Task:
    """A task on a square of 80 px in the middle of a picture."""
    ring = [[100.0, 100.0], [180.0, 100.0], [180.0, 180.0], [100.0, 180.0]]
    thing = Thing("square", "square", ring, [])
    return Task(
        id="square",
        instruction="",
        robots=robots,
        category=category,
        setup="single",
        image=Path("square.png"),
        size=(280, 280),
        target=thing,
        success=rule,
    )


RING = square({"where": "boundary", "band_px": [6, 30], "max_gap_px": 80, "even": True}, 8)
CORNERS = square(
    {
        "where": "corners",
        "points": [[100, 100], [180, 100], [180, 180], [100, 180]],
        "tolerance_px": 14,
    },
    4,
)
INFILL = square(
    {"where": "inside", "min_clearance_px": 3, "min_spacing_px": 18, "max_uncovered_px": 45}, 4
)
SIDE = square({"where": "side:left", "band_px": [4, 30], "min_span_frac": 0.5}, 4)


def noisy(task: Task, scale: float, seed: int) -> FloatArray:
    random = np.random.default_rng(seed)
    return RIGHT[task.id] + random.normal(0, scale, (task.robots, 2))


@pytest.mark.parametrize("task", TASKS, ids=IDS)
def test_success_is_that_of_the_photographs_rule(task: Task) -> None:
    """Where both can differ, and only there, they may: a crowd, and recesses."""
    for seed, share in enumerate((0.0, 0.01, 0.03, 0.06, 0.1, 0.2)):
        points = noisy(task, share * task.target.outline.size, seed)
        graded, rule = grade_goals([task], points), grade(task, points)
        if task.id != HOLLOW:
            assert graded.sr == rule.success, (share, graded.feedback, rule.failures)
        assert graded.sr == (graded.gcr == 1)
        assert graded.strict <= graded.sr
        assert bool(graded.feedback) == (not graded.strict)


@pytest.mark.parametrize("task", [RING, CORNERS, INFILL, SIDE], ids=lambda t: t.success["where"])
@given(seed=st.integers(0, 10_000), scale=st.floats(0, 60))
@settings(max_examples=25, deadline=None)
def test_gcr_is_1_exactly_where_it_succeeds(task: Task, seed: int, scale: float) -> None:
    random = np.random.default_rng(seed)
    points = reference(task) + random.normal(0, scale, (task.robots, 2))
    graded = grade_goals([task], points)
    assert 0 <= graded.gcr <= 1
    assert graded.sr == (graded.gcr == 1)
    shuffled = grade_goals([task], random.permutation(points))
    assert (shuffled.sr, shuffled.strict) == (graded.sr, graded.strict)
    assert shuffled.gcr == pytest.approx(graded.gcr, abs=1e-6)


def moved(task: Task, change: Callable[[FloatArray], FloatArray], scale: float) -> Task:
    """A task with its picture's contents changed, all lengths by a factor."""

    def ring(points: list[list[float]]) -> list[list[float]]:
        return change(np.asarray(points, dtype=float)).tolist()

    rule = dict(task.success)
    for key, value in rule.items():
        if key == "points":
            rule[key] = ring(value)
        elif key.endswith("_px"):
            rule[key] = (np.asarray(value) * scale).tolist()
    target = task.target
    thing = Thing(target.id, target.name, ring(target.polygon), [ring(h) for h in target.holes])
    return replace(task, target=thing, success=rule, size=(4000, 4000))


@pytest.mark.parametrize("task", [RING, CORNERS, INFILL], ids=lambda t: t.success["where"])
@pytest.mark.parametrize(("scale", "turn", "shift"), [(1, 0, 500), (2.5, 0, 90), (1, 90, 700)])
def test_the_whole_scene_may_be_moved_turned_and_scaled(
    task: Task, scale: float, turn: float, shift: float
) -> None:
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))

    def change(points: FloatArray) -> FloatArray:
        turned = (points - 140) @ np.array([[c, s], [-s, c]])
        return turned * scale + 140 * scale + shift

    for seed in range(6):
        random = np.random.default_rng(seed)
        points = reference(task) + random.normal(0, 4.0 * seed, (task.robots, 2))
        before = grade_goals([replace(task, size=(4000, 4000))], points)
        after = grade_goals([moved(task, change, scale)], change(points))
        assert (after.sr, after.strict) == (before.sr, before.strict)
        assert after.gcr == pytest.approx(before.gcr, abs=0.02)


def test_a_ring_may_start_anywhere_and_its_gap_is_told() -> None:
    for phase in (0.0, 0.3, 0.7):
        turns = 2 * np.pi * (np.arange(8) + phase) / 8
        ring = 140 + 68 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        assert grade_goals([RING], ring).sr
    gap = grade_goals([RING], np.concatenate([ring[:5], ring[4:7] + 3]))
    assert not gap.sr
    assert "a gap of" in gap.feedback


def test_a_crowd_on_one_side_is_no_ring() -> None:
    crowd = np.array([[90.0 - 3 * (i % 2), 110 + 6 * i] for i in range(8)])
    assert grade(RING, crowd).success  # what the rule of the photographs makes of it
    graded = grade_goals([RING], crowd)
    assert "do not go round" in graded.feedback
    assert graded.gcr < 0.5


def test_robots_too_many_and_too_few_cost() -> None:
    right = reference(CORNERS)
    assert grade_goals([CORNERS], right[:3]).gcr == 0.75
    extra = grade_goals([CORNERS], np.concatenate([right, [[10, 10]]]))
    assert (extra.sr, extra.gcr) == (False, 0.6)  # 5 positions, and never all of 4 without success
    twice = grade_goals([CORNERS], np.concatenate([right[:3], right[:1]]))
    assert twice.gcr == 0.75
    assert "another robot's place" in twice.feedback
    assert grade_goals([CORNERS], None).gcr == 0
    odd = np.concatenate([right[:3], [[np.nan, 4]]])
    assert "outside the picture" in grade_goals([CORNERS], odd).feedback


def test_robots_apart_are_chosen_as_many_as_can_be() -> None:
    line = np.array([[0.0, 0], [5, 0], [10, 0], [15, 0], [20, 0]])
    assert separated(line, np.ones(5, dtype=bool), 8.0).sum() == 3
    assert separated(line, np.array([True, True, False, False, False]), 8.0).sum() == 1


def test_groups_are_graded_together_whatever_the_order() -> None:
    beside = [[x + 140, y] for x, y in CORNERS.target.polygon]
    other = replace(CORNERS.target, id="other", polygon=beside)
    rule = CORNERS.success | {"points": beside}
    goals = [RING, replace(CORNERS, target=other, success=rule)]
    goals = [replace(goal, size=(400, 280)) for goal in goals]
    points = np.concatenate([reference(goal) for goal in goals])
    assert grade_goals(goals, points).sr
    assert grade_goals(goals, points[::-1]).sr
    wrong = points.copy()
    wrong[-1] = (390, 20)
    assert grade_goals(goals, wrong).gcr == pytest.approx(11 / 12)


def test_observed_positions_count_and_planned_ones_are_told() -> None:
    right = [(float(x), float(y)) for x, y in reference(CORNERS)]
    drifted = [(x + 40, y) for x, y in right]
    graded = grade_attempt([CORNERS], ["deployed"], Attempt("deployed", right, drifted))
    assert not graded.sr
    assert "as planned: right" in graded.feedback
    assert graded.measures["planned_gcr"] == 1
    asked = grade_attempt([CORNERS], ["deployed"], Attempt("question", said="Which one?"))
    assert (asked.gcr, asked.feedback) == (0, "question: Which one?")


def test_the_wrong_thing_is_told_apart_from_wrong_places() -> None:
    right = [(float(x), float(y)) for x, y in reference(CORNERS)]
    outline = Polygon(CORNERS.target.polygon)
    for found, expected in (((outline,), True), ((outline.buffer(40),), False), ((), None)):
        attempt = Attempt("deployed", right, right, found=found)
        assert grade_attempt([CORNERS], ["deployed"], attempt).object_correct is expected


def test_chance_is_the_best_policy() -> None:
    sr, gcr = chance([[RING], [INFILL]])
    means = [
        np.mean([grade_goals([t], positions(name, [t], 0)).gcr for t in (RING, INFILL)])
        for name in ("pile", "circle", "line")
    ]
    assert gcr >= max(means) > 0
    assert 0 <= sr < 1
    assert chance([[]]) == (0, 0)
    assert len(POLICIES) == 5
