"""Graders: what is right in part, what a rule must not depend on, and where both rules agree."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely
from formup.evals.grading.attempts import Attempt, grade_attempt, grade_goals
from formup.evals.grading.infill import separated
from formup.evals.grading.policies import POLICIES, chance, positions
from formup.evals.grading.reference_answers import reference
from formup.evals.tasks.suites import load_suite
from formup.evals.tasks.task import Goal, Task, Thing
from formup.tools.geometry.outline import FloatArray
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

TASKS = [task for name in ("photos", "many") for task in load_suite(name).tasks]
SQUARE = [[100.0, 100.0], [180.0, 100.0], [180.0, 180.0], [100.0, 180.0]]
CUP = [[60.0, 60], [110, 60], [110, 170], [170, 170], [170, 60], [220, 60], [220, 220], [60, 220]]
"""A square with a recess from above, 60 px wide and 110 px deep."""


def on(ring: Sequence[Sequence[float]], rule: Mapping[str, object], robots: int) -> Goal:
    """A goal about a thing in the middle of a picture."""
    thing = Thing("thing", "thing", [list(point) for point in ring], [])
    return Goal(robots=robots, size=(280, 280), target=thing, success=dict(rule))


RING = on(SQUARE, {"where": "boundary", "band_px": [6, 30], "max_gap_px": 80, "even": True}, 8)
CORNERS = on(
    SQUARE,
    {
        "where": "corners",
        "points": [[100, 100], [180, 100], [180, 180], [100, 180]],
        "tolerance_px": 14,
    },
    4,
)
INFILL = on(
    SQUARE,
    {"where": "inside", "min_clearance_px": 3, "min_spacing_px": 18, "max_uncovered_px": 45},
    4,
)
SIDE = on(SQUARE, {"where": "side:left", "band_px": [4, 30], "min_span_frac": 0.5}, 4)
CAGE = on(CUP, {"where": "cage", "band_px": [4, 20]}, 9)


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.id)
def test_success_strict_and_gcr_agree(task: Task) -> None:
    (goal,) = task.goals
    right = reference(goal)
    for seed, share in enumerate((0.0, 0.01, 0.03, 0.06, 0.1, 0.2)):
        noise = np.random.default_rng(seed).normal(0, share * goal.target.outline.size, right.shape)
        graded = grade_goals([goal], right + noise)
        assert graded.sr == (graded.gcr == 1)
        assert graded.strict <= graded.sr
        assert bool(graded.feedback) == (not graded.strict)
        assert graded.strict or share


def test_strict_is_to_stand_on_even_places_not_only_to_keep_the_gaps() -> None:
    """Eight robots whose gaps are all 0.5 to 1.5 of the mean, and half of the way has three."""
    square = Polygon(SQUARE).buffer(18).exterior
    for widths, even in (([1.4] * 4 + [0.6] * 4, False), ([1.2, 0.8] * 4, True)):
        stations = np.cumsum(widths) / sum(widths)
        places = square.interpolate(stations, normalized=True)
        graded = grade_goals(
            [replace(RING, success=RING.success | {"max_gap_px": 100})],
            shapely.get_coordinates(places),
        )
        assert graded.sr
        assert graded.strict is even


@pytest.mark.parametrize(
    "goal", [RING, CORNERS, INFILL, SIDE, CAGE], ids=lambda t: t.success["where"]
)
@given(seed=st.integers(0, 10_000), scale=st.floats(0, 60))
@settings(max_examples=25, deadline=None)
def test_gcr_is_1_exactly_where_it_succeeds(goal: Goal, seed: int, scale: float) -> None:
    random = np.random.default_rng(seed)
    points = reference(goal) + random.normal(0, scale, (goal.robots, 2))
    graded = grade_goals([goal], points)
    assert 0 <= graded.gcr <= 1
    assert graded.sr == (graded.gcr == 1)
    shuffled = grade_goals([goal], random.permutation(points))
    assert (shuffled.sr, shuffled.strict) == (graded.sr, graded.strict)
    assert shuffled.gcr == pytest.approx(graded.gcr, abs=1e-6)


def moved(goal: Goal, change: Callable[[FloatArray], FloatArray], scale: float) -> Goal:
    """A goal with its picture's contents changed, all lengths by a factor."""

    def ring(points: list[list[float]]) -> list[list[float]]:
        return change(np.asarray(points, dtype=float)).tolist()

    rule = dict(goal.success)
    for key, value in rule.items():
        if key == "points":
            rule[key] = ring(value)
        elif key.endswith("_px"):
            rule[key] = (np.asarray(value) * scale).tolist()
    target = goal.target
    thing = Thing(target.id, target.name, ring(target.polygon), [ring(h) for h in target.holes])
    return replace(goal, target=thing, success=rule, size=(4000, 4000))


@pytest.mark.parametrize("goal", [RING, CORNERS, INFILL, CAGE], ids=lambda t: t.success["where"])
@pytest.mark.parametrize(("scale", "turn", "shift"), [(1, 0, 500), (2.5, 0, 90), (1, 90, 700)])
def test_the_whole_scene_may_be_moved_turned_and_scaled(
    goal: Goal, scale: float, turn: float, shift: float
) -> None:
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))

    def change(points: FloatArray) -> FloatArray:
        turned = (points - 140) @ np.array([[c, s], [-s, c]])
        return turned * scale + 140 * scale + shift

    for seed in range(6):
        random = np.random.default_rng(seed)
        points = reference(goal) + random.normal(0, 4.0 * seed, (goal.robots, 2))
        before = grade_goals([replace(goal, size=(4000, 4000))], points)
        after = grade_goals([moved(goal, change, scale)], change(points))
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
    graded = grade_goals([RING], crowd)
    assert "do not go round" in graded.feedback
    assert graded.gcr < 0.5


def test_a_ring_may_follow_a_recess_or_bridge_it() -> None:
    cup = Polygon(CUP)
    followed, bridged = cup.buffer(12).exterior, cup.convex_hull.buffer(12).exterior
    for loop, robots in ((followed, 24), (bridged, 16)):
        most = 1.6 * loop.length / robots
        rule = {"where": "boundary", "band_px": [6, 30], "max_gap_px": most, "even": True}
        goal = on(CUP, rule, robots)
        places = loop.interpolate((np.arange(robots) + 0.5) / robots, normalized=True)
        points = shapely.get_coordinates(places)
        random = np.random.default_rng(0)
        assert grade_goals([goal], random.permutation(points)).sr
        open_ring = np.concatenate([points[:3], points[2:3] + 3, points[4:]])
        assert "a gap of" in grade_goals([goal], open_ring).feedback


def test_a_crowd_within_a_recess_is_no_ring() -> None:
    crowd = np.array([[140 + 14 * (-1) ** i, 68 + 9.0 * i] for i in range(10)])
    rule = {"where": "boundary", "band_px": [6, 30], "max_gap_px": 110, "even": True}
    goal = on(CUP, rule, 10)
    graded = grade_goals([goal], crowd)
    assert not graded.sr
    assert "do not go round" in graded.feedback


def test_a_closed_ring_need_not_hold_and_what_holds_need_not_be_a_ring() -> None:
    bar = [[100.0, 130], [180, 130], [180, 150], [100, 150]]
    ring = on(bar, {"where": "boundary", "band_px": [4, 30], "max_gap_px": 70, "even": True}, 6)
    hold = on(bar, {"where": "cage", "band_px": [4, 30]}, 6)
    turns = 2 * np.pi * np.arange(6) / 6
    loose = (140, 140) + np.array([57, 25]) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    assert grade_goals([ring], loose).sr
    graded = grade_goals([hold], loose)
    assert not graded.sr
    assert graded.gcr < 1
    assert "it can get out, on a way that was checked" in graded.feedback
    tight = reference(replace(hold, robots=16))
    assert grade_goals([replace(hold, robots=16)], tight).sr
    assert grade_goals([hold], tight).gcr < 1
    uneven = np.concatenate([tight, tight[:2] + np.array([2.5, 0.0])])
    assert grade_goals([replace(hold, robots=18)], uneven).strict
    assert not grade_goals([replace(ring, robots=18)], uneven).strict


def test_a_cage_that_holds_stands_in_its_band() -> None:
    right = reference(CAGE)
    far = right + np.array([0.0, 30.0])
    graded = grade_goals([CAGE], far)
    assert "too far" in graded.feedback or "too near" in graded.feedback
    assert not graded.sr


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
    asked = grade_attempt([CORNERS], ["deployed"], Attempt("question", message="Which one?"))
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
