"""Who takes which place when there may be more robots than places."""

from itertools import permutations

import numpy as np
import pytest
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.protocol import FleetSizeError, Pose, points_of
from formup.tools.geometry.outline import FloatArray
from hypothesis import given
from hypothesis import strategies as st


def scattered(robots: int, places: int, seed: int) -> tuple[tuple[Pose, ...], FloatArray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 100, (robots, 2))
    poses = tuple(Pose(f"r{i}", float(x), float(y)) for i, (x, y) in enumerate(points))
    return poses, rng.uniform(0, 100, (places, 2))


@given(st.integers(1, 5), st.integers(0, 3), st.integers(0, 2**32 - 1))
def test_no_other_choice_of_robots_has_shorter_squared_ways(n: int, more: int, seed: int) -> None:
    poses, places = scattered(n + more, n, seed)
    assigned = assign_robots(poses, places)
    assert len(set(assigned.robots)) == n
    assert assigned.gap is None
    points = points_of(poses)
    cost = ((points[:, None] - places) ** 2).sum(axis=2)
    least = min(cost[list(some), range(n)].sum() for some in permutations(range(n + more), n))
    taken = [int(robot[1:]) for robot in assigned.robots]
    assert cost[taken, range(n)].sum() == pytest.approx(least)


@pytest.mark.parametrize("more", [0, 4])
def test_an_assignment_says_what_it_may_have_left_to_save_only_if_it_is_approximate(
    monkeypatch: pytest.MonkeyPatch, more: int
) -> None:
    poses, places = scattered(9 + more, 9, 1)
    exact = assign_robots(poses, places)
    monkeypatch.setattr("formup.tools.geometry.assignment.EXACT", 5)
    again = assign_robots(poses, places)
    assert exact.gap is None
    assert again.gap == pytest.approx(0, abs=1e-9)  # found the optimum all the same
    assert again.robots == exact.robots


def test_more_places_than_robots_cannot_be_assigned() -> None:
    with pytest.raises(FleetSizeError, match="has 2 robots; the plan needs 9"):
        assign_robots(*scattered(2, 9, 0))
