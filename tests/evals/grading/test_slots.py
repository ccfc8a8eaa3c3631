"""Matching robots with slots, and slots along a loop whose start is free."""

import numpy as np
import pytest
from formup.evals.grading.slots import even_along, match_slots, phase_free
from hypothesis import given
from hypothesis import strategies as st


def test_most_pairs_come_before_short_ones() -> None:
    points, slots = np.array([[0.8, 0], [2.0, 0]]), np.array([[0.0, 0], [1.0, 0]])
    assert (match_slots(points, slots, 0.3) >= 0).sum() == 1
    crossed = np.array([[0.9, 0], [2.1, 0]]), np.array([[0.0, 0], [1.0, 0], [3.0, 0]])
    assert match_slots(*crossed, 1.0).tolist() == [1, 2]
    shifted = np.array([[1.0, 0], [2.0, 0]]), np.array([[0.0, 0], [1.0, 0]])
    assert match_slots(*shifted, 1.0).tolist() == [
        0,
        1,
    ]  # one pair at distance 0 would cost the other


def test_two_robots_in_one_slot_count_once() -> None:
    assert sorted(match_slots(np.zeros((2, 2)), np.zeros((1, 2)), 1.0).tolist()) == [-1, 0]


@given(st.integers(2, 40), st.floats(0, 1), st.floats(5, 500))
def test_even_robots_fill_all_slots_whatever_the_start(n: int, phase: float, length: float) -> None:
    stations = (np.arange(n) + phase) * length / n % length
    assert phase_free(stations, length, n, 0.25 * length / n) == n
    assert phase_free(stations[::-1], length, n, 0.25 * length / n) == n


@given(st.lists(st.floats(0, 99), min_size=1, max_size=12), st.floats(0, 100))
def test_the_start_of_the_loop_does_not_matter(stations: list[float], turn: float) -> None:
    here = np.asarray(stations)
    counts = {phase_free((here + t) % 100, 100.0, 7, 3.0) for t in (0.0, turn)}
    assert max(counts) - min(counts) <= 1  # one at the very edge of the tolerance


@given(st.lists(st.floats(0, 99), min_size=1, max_size=10))
def test_no_start_fills_more_slots(stations: list[float]) -> None:
    here, gap, tolerance = np.asarray(stations), 100 / 6, 3.0
    best = 0
    for start in np.arange(0, gap, 0.05):
        number = np.round((here - start) / gap)
        near = np.abs(here - start - number * gap) <= tolerance - 1e-6
        best = max(best, len(set((number[near] % 6).tolist())))
    assert phase_free(here, 100.0, 6, tolerance) >= best


def test_a_line_is_even_between_its_ends() -> None:
    assert even_along(np.array([0.0, 10, 20, 30]), 0.25) == 4
    assert even_along(np.array([0.0, 10, 26, 30]), 0.25) == 3
    assert even_along(np.zeros(4), 0.25) == 1
    assert even_along(np.array([3.0]), 0.25) == 1


@pytest.mark.parametrize("n", [1, 3])
def test_no_robots_fill_no_slots(n: int) -> None:
    assert phase_free(np.empty(0), 10.0, n, 1.0) == 0
