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


def cost_of(starts: FloatArray, goals: FloatArray, robots: object) -> float:
    """Sum of squared distances."""
    return float(((goals - starts[np.asarray(robots)]) ** 2).sum())


@given(st.integers(1, 6), seeds, st.sampled_from(SHAPES))
@MANY
def test_no_assignment_is_cheaper(n: int, seed: int, shape: str) -> None:
    starts, goals = team(shape, n, seed)
    found = assign(starts, goals)
    assert sorted(found.robots) == list(range(n))
    assert found.cost == pytest.approx(cost_of(starts, goals, found.robots))
    least = min(cost_of(starts, goals, order) for order in permutations(range(n)))
    assert found.cost <= least * (1 + 1e-9) + 1e-6
    assert found.gap == 0


@given(st.integers(2, 40), seeds, st.sampled_from(SHAPES))
@MANY
def test_the_cost_does_not_depend_on_the_order(n: int, seed: int, shape: str) -> None:
    starts, goals = team(shape, n, seed)
    rng = np.random.default_rng(seed)
    other = assign(rng.permutation(starts), rng.permutation(goals))
    assert other.cost == pytest.approx(assign(starts, goals).cost, rel=1e-9)


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
def test_the_same_again_is_the_same(shape: str) -> None:
    first, again = (assign(*team(shape, 700, 1)) for _ in range(2))
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


def nearly(monkeypatch: pytest.MonkeyPatch, starts: FloatArray, goals: FloatArray) -> Assignment:
    """As though there were more robots than an exact method has time for."""
    with monkeypatch.context() as patch:
        patch.setattr(assignment, "EXACT", 10)
        patch.setattr("formup.tools.geometry.optimal_transport.BASE", 40)
        return assign(starts, goals)


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


def test_more_robots_than_are_exact_are_placed_well_and_say_so() -> None:
    starts, goals = team("far", assignment.EXACT + 1, 0)
    found = assign(starts, goals)
    assert sorted(found.robots) == list(range(len(starts)))
    assert found.method == "approximate"
    assert found.gap < assignment.ENOUGH


def test_nobody_and_one_alone_are_teams_as_well() -> None:
    none, one = np.empty((0, 2)), np.array([[3.0, 4.0]])
    assert assign(none, none).cost == 0
    assert assign(one * 0, one).cost == pytest.approx(25)


@pytest.mark.parametrize(
    "goals", [np.zeros((2, 2)), np.zeros((3, 3)), np.full((3, 2), np.nan), np.full((3, 2), 1e9)]
)
def test_places_nobody_can_take_are_refused(goals: FloatArray) -> None:
    with pytest.raises(ToolError):
        assign(np.zeros((3, 2)), goals)
