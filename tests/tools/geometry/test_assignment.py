"""Who takes which place is the best choice there is, or says how far from it at most."""

from itertools import permutations

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.geometry import assignment
from formup.tools.geometry.assignment import Assignment, assign
from formup.tools.geometry.outline import FloatArray
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

MANY = settings(derandomize=True, deadline=None, max_examples=40)
seeds = st.integers(0, 2**32 - 1)
OBJECTIVES: tuple[assignment.Objective, ...] = ("squares", "makespan", "named")
SHAPES = ("scattered", "lattice", "ring", "one spot", "far")


def team(shape: str, n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Starts and goals; ties and doubles abound in all but the scattered ones."""
    rng = np.random.default_rng(seed)
    starts, goals = rng.uniform(0, 100, (n, 2)), rng.uniform(0, 100, (n, 2))
    if shape == "lattice":
        return np.round(starts, -1), np.round(goals, -1)
    if shape == "ring":
        angle = np.arange(n) / n * 2 * np.pi
        return np.round(starts, -1), np.stack([np.cos(angle), np.sin(angle)], axis=1) * 300
    if shape == "one spot":
        return np.full((n, 2), 50.0), goals
    return starts, goals + 1e5 * (shape == "far")


def costs(starts: FloatArray, goals: FloatArray, robots: object) -> tuple[float, float]:
    """Sum of squares and greatest distance."""
    apart = np.linalg.norm(goals - starts[np.asarray(robots)], axis=1)
    return float((apart**2).sum()), float(apart.max())


def best(starts: FloatArray, goals: FloatArray, fixed: dict[int, int], makespan: bool) -> float:
    every = (p for p in permutations(range(len(goals))) if all(p[g] == r for g, r in fixed.items()))
    each = [costs(starts, goals, p) for p in every]
    if not makespan:
        return min(c for c, _ in each)
    least = min(m for _, m in each)
    return min(c for c, m in each if m <= least * (1 + 1e-9))


@given(st.integers(1, 6), seeds, st.sampled_from(SHAPES), st.integers(0, 3))
@MANY
def test_nothing_is_cheaper_whatever_is_fixed(n: int, seed: int, shape: str, held: int) -> None:
    starts, goals = team(shape, n, seed)
    rng = np.random.default_rng(seed)
    pairs = zip(rng.permutation(n)[:held], rng.permutation(n)[:held], strict=True)
    fixed = {int(goal): int(robot) for goal, robot in pairs}
    for objective in ("squares", "makespan"):
        found = assign(starts, goals, objective=objective, fixed=fixed)
        assert sorted(found.robots) == list(range(n))
        assert all(found.robots[g] == r for g, r in fixed.items())
        assert (found.cost, found.makespan) == pytest.approx(costs(starts, goals, found.robots))
        least = best(starts, goals, fixed, objective == "makespan")
        assert found.cost <= least * (1 + 1e-9) + 1e-6
        assert found.gap == 0


@given(st.integers(7, 60), seeds, st.sampled_from(SHAPES))
@MANY
def test_the_shortest_longest_way_is_the_least_there_is(n: int, seed: int, shape: str) -> None:
    starts, goals = team(shape, n, seed)
    shortest = assign(starts, goals, objective="makespan")
    cheapest = assign(starts, goals)
    assert shortest.makespan <= cheapest.makespan * (1 + 1e-9)
    assert shortest.cost >= cheapest.cost * (1 - 1e-9)
    closer = cdist(goals, starts) >= shortest.makespan * (1 - 1e-9)
    rows, columns = linear_sum_assignment(closer)
    assert closer[rows, columns].any(), "all could arrive sooner"


@given(st.integers(2, 40), seeds, st.sampled_from(SHAPES))
@MANY
def test_the_cost_does_not_depend_on_the_order(n: int, seed: int, shape: str) -> None:
    starts, goals = team(shape, n, seed)
    rng = np.random.default_rng(seed)
    for objective in ("squares", "makespan"):
        one = assign(starts, goals, objective=objective)
        other = assign(rng.permutation(starts), rng.permutation(goals), objective=objective)
        assert other.cost == pytest.approx(one.cost, rel=1e-9)
        if objective == "makespan":  # equal sums of squares may have other longest ways
            assert other.makespan == pytest.approx(one.makespan, rel=1e-9)


@given(st.integers(1, 40), seeds, st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
@MANY
def test_moving_all_places_together_changes_nobodys_place(
    n: int, seed: int, dx: float, dy: float
) -> None:
    starts, goals = team("scattered", n, seed)
    moved = goals + np.array([dx, dy])
    assert np.array_equal(assign(starts, goals).robots, assign(starts, moved).robots)


@given(st.integers(1, 40), seeds, st.floats(0, 6.3), st.floats(0.01, 100), st.booleans())
@MANY
def test_turned_enlarged_and_mirrored_together_everybody_takes_the_same_place(
    n: int, seed: int, turn: float, size: float, mirror: bool
) -> None:
    c, s = np.cos(turn), np.sin(turn)
    change = size * np.array([[c, s], [-s, c]]) @ np.diag([-1.0 if mirror else 1.0, 1.0])
    starts, goals = team("scattered", n, seed)
    one, other = assign(starts, goals), assign(starts @ change, goals @ change)
    assert np.array_equal(one.robots, other.robots)
    assert other.cost == pytest.approx(size**2 * one.cost, rel=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_the_same_again_is_the_same(shape: str, objective: assignment.Objective) -> None:
    count = 200 if objective == "makespan" else 700
    first, again = (assign(*team(shape, count, 1), objective=objective) for _ in range(2))
    assert np.array_equal(first.robots, again.robots)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_exact_method_is_as_good_as_scipys(shape: str) -> None:
    starts, goals = team(shape, 900, 3)
    cost = cdist(goals - goals.mean(axis=0), starts - starts.mean(axis=0), "sqeuclidean")
    least = cost[linear_sum_assignment(cost)].sum()
    displacement = 900 * ((goals.mean(axis=0) - starts.mean(axis=0)) ** 2).sum()
    found = assign(starts, goals)
    assert found.method == "exact"
    assert found.cost == pytest.approx(least + displacement, rel=1e-9)


def nearly(monkeypatch: pytest.MonkeyPatch, *args: FloatArray, **how: object) -> Assignment:
    """As though there were more robots than an exact method has time for."""
    with monkeypatch.context() as patch:
        patch.setattr(assignment, "EXACT", 10)
        patch.setattr("formup.tools.geometry.optimal_transport.BASE", 40)
        return assign(*args, **how)  # type: ignore[arg-type]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_an_approximation_is_within_the_gap_it_states(
    monkeypatch: pytest.MonkeyPatch, shape: str, seed: int
) -> None:
    starts, goals = team(shape, 300, seed)
    exact, found = assign(starts, goals), nearly(monkeypatch, starts, goals)
    assert sorted(found.robots) == list(range(300))
    assert found.method == "approximate"
    assert 0 <= found.gap <= (0.5 if shape == "lattice" else 0.05)  # many share a spot there
    assert exact.cost * (1 - 1e-9) <= found.cost
    assert found.cost * (1 - found.gap) <= exact.cost * (1 + 1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_longest_way_is_shortest_for_any_number_and_the_gap_is_of_the_cost(
    monkeypatch: pytest.MonkeyPatch, shape: str
) -> None:
    starts, goals = team(shape, 300, 5)
    exact = assign(starts, goals, objective="makespan")
    found = nearly(monkeypatch, starts, goals, objective="makespan")
    assert found.makespan == pytest.approx(exact.makespan, rel=1e-6)
    assert exact.cost * (1 - 1e-6) <= found.cost
    assert found.cost * (1 - found.gap) <= exact.cost * (1 + 1e-9)


def test_more_robots_than_are_exact_are_placed_well_and_say_so() -> None:
    starts, goals = team("far", assignment.EXACT + 1, 0)
    found = assign(starts, goals)
    assert sorted(found.robots) == list(range(len(starts)))
    assert found.method == "approximate"
    assert found.gap < assignment.ENOUGH


def test_by_name_everyone_takes_their_own_place_but_for_those_given_away() -> None:
    starts, goals = team("scattered", 8, 0)
    assert list(assign(starts, goals, objective="named").robots) == list(range(8))
    goals[0], goals[2] = starts[5], starts[1]
    found = assign(starts, goals, objective="named", fixed={1: 0, 5: 2})
    assert list(found.robots) == [5, 0, 1, 3, 4, 2, 6, 7]
    assert found.method == "named"


def test_nobody_and_one_alone_are_teams_as_well() -> None:
    none, one = np.empty((0, 2)), np.array([[3.0, 4.0]])
    for objective in OBJECTIVES:
        assert assign(none, none, objective=objective).cost == 0
        found = assign(one * 0, one, objective=objective)
        assert (found.cost, found.makespan) == pytest.approx((25, 5))
    assert assign(one, one, fixed={0: 0}).makespan == 0


@pytest.mark.parametrize(
    ("fixed", "said"),
    [
        ({0: 1, 2: 1}, "robot 1 is given two"),
        ({3: 0}, "place 3 is not there"),
        ({-1: 0}, "place -1 is not there"),
        ({0: 3}, "robot 3 is not there"),
        ({5: 9}, "robot 9 is not there"),
    ],
)
def test_what_cannot_be_fixed_is_told_in_words(fixed: dict[int, int], said: str) -> None:
    starts, goals = team("scattered", 3, 0)
    with pytest.raises(ToolError, match=said):
        assign(starts, goals, fixed=fixed)


@pytest.mark.parametrize(
    "goals", [np.zeros((2, 2)), np.zeros((3, 3)), np.full((3, 2), np.nan), np.full((3, 2), 1e9)]
)
def test_places_nobody_can_take_are_refused(goals: FloatArray) -> None:
    with pytest.raises(ToolError):
        assign(np.zeros((3, 2)), goals)
