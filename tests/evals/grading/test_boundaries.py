"""How far boundaries lie apart."""

import pytest
from formup.evals.grading.boundaries import boundary_error
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity
from shapely.geometry import box

SQUARE = box(0, 0, 100, 100)


@given(st.floats(0.5, 12))
def test_the_boundary_error_of_a_grown_square_is_how_far_it_grew(by: float) -> None:
    grown = SQUARE.buffer(by)
    assert boundary_error(grown, SQUARE) == pytest.approx(by / 100, rel=0.05)
    assert boundary_error(SQUARE, SQUARE) < 1e-9


def test_the_boundary_error_sees_a_part_that_is_missing_or_too_much() -> None:
    spur = SQUARE.union(box(100, 40, 140, 60))
    assert boundary_error(spur, SQUARE) == pytest.approx(boundary_error(SQUARE, spur), abs=0.05)
    assert boundary_error(spur, SQUARE) > 0.1
    holed = SQUARE - affinity.scale(SQUARE, 0.3, 0.3)
    assert boundary_error(SQUARE, holed) > 0.1


def test_nothing_is_further_off_than_its_size() -> None:
    assert boundary_error(box(5000, 0, 5100, 100), SQUARE) == 1
