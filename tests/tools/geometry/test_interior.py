"""Inside: relaxing takes no short cut, lattices have no holes, and the energy is near its least."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.geometry.interior import coverage_radius, inside, yardstick
from formup.tools.geometry.lattice import (
    ALL_PHASES,
    Lattice,
    ideal_pitch,
    lattice_points,
    widest_lattice,
)
from formup.tools.geometry.lloyd import cells_of, grid, relax
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from formup.tools.geometry.sampling import min_spacing, nearest
from hypothesis import given, settings
from hypothesis import strategies as st

T = np.arange(200) / 200 * 2 * math.pi
BUMPY = make_outline(
    np.stack([np.cos(T), np.sin(T)], axis=1) * (300 + 60 * np.sin(3 * T))[:, None] + 500
)
SQUARE = make_outline([(0, 0), (400, 0), (400, 400), (0, 400)])
HEXAGON = 5 / (18 * math.sqrt(3))
"""Energy of a hexagonal lattice by area squared over the number of robots."""


def plainly(cells: FloatArray, points: FloatArray, steps: int) -> FloatArray:
    """Lloyd's iteration in its plainest words, for convex regions."""
    for _ in range(steps):
        owner = np.argmin(((cells[:, None] - points[None]) ** 2).sum(axis=2), axis=1)
        points = np.stack([cells[owner == k].mean(axis=0) for k in range(len(points))])
    return points


@given(st.integers(2, 12), st.integers(0, 2**32 - 1))
@settings(derandomize=True, deadline=None, max_examples=15)
def test_asking_only_where_an_answer_may_have_changed_changes_no_answer(n: int, seed: int) -> None:
    cells = grid(SQUARE.polygon, 9.7)
    points = np.random.default_rng(seed).uniform(5, 395, (n, 2))
    relaxed = relax(cells, SQUARE.polygon, points, 12)
    assert relaxed == pytest.approx(plainly(cells, points, 12), abs=0.02)


def energy_ratio(outline: Outline, points: FloatArray) -> float:
    cells = grid(outline.polygon, math.sqrt(outline.area / 200_000))
    mean = float((nearest(points, cells, 1)[0] ** 2).mean())
    return mean / (HEXAGON * outline.area / len(points))


@pytest.mark.parametrize("n", [60, 100, 700, 3000])
def test_the_energy_is_within_a_few_hundredths_of_the_least(n: int) -> None:
    points = inside(BUMPY, n, 0.5, math.inf, 0.0)
    assert len(points) == n
    assert energy_ratio(BUMPY, points) < 1.05
    assert min_spacing(points) > 0.6 * ideal_pitch(BUMPY.area, n)


@pytest.mark.parametrize("n", [11, 13, 14, 22, 23, 24])
def test_the_margin_is_kept_at_a_reflex_corner(n: int) -> None:
    """Off it the edge of what is left is a chord of an arc, which must not cut the arc."""
    turns, reach = np.arange(8) * math.pi / 4, np.full(8, 30.0)
    reach[7] = 11.2
    bitten = make_outline(np.stack([np.cos(turns), np.sin(turns)], axis=1) * reach[:, None] + 50)
    points = inside(bitten, n, 5.3, math.inf, 6.0)
    assert shapely.distance(bitten.polygon.boundary, shapely.points(points)).min() >= 5.3 - 1e-6


@given(st.integers(3, 400), st.floats(0, 1.05))
@settings(derandomize=True, deadline=None, max_examples=15)
def test_the_widest_lattice_has_exactly_n_and_none_missing_inside(n: int, turn: float) -> None:
    region = BUMPY.polygon
    lies = [Lattice(turn, phase) for phase in ALL_PHASES[:4]]
    points = widest_lattice(region, n, lies)
    pitch = min_spacing(points)
    assert len(points) == n
    assert pitch >= 0.93 * ideal_pitch(region.area, n) or n < 30
    middle = grid(region.buffer(-1.5 * pitch), pitch / 5) if n > 60 else points
    assert nearest(points, middle, 1)[0].max() <= 1.01 * pitch / math.sqrt(3)


def test_robots_asked_to_keep_apart_stand_on_a_lattice_and_as_many_as_fit() -> None:
    spacing = 0.95 * ideal_pitch(SQUARE.area, 100)
    points = inside(SQUARE, 100, 0.0, math.inf, spacing)
    assert len(points) == 100
    assert min_spacing(points) >= spacing - 1e-6
    crowd = inside(SQUARE, 1000, 0.0, math.inf, spacing)
    assert 100 <= len(crowd) <= 125
    assert min_spacing(crowd) >= spacing - 1e-6
    assert len(inside(SQUARE, 30, 0.0, math.inf, 500.0)) <= 2


def test_lattices_lie_as_they_are_told() -> None:
    flat, turned = (lattice_points(SQUARE.polygon, 40, Lattice(t)) for t in (0.0, math.pi / 2))
    rows = np.unique(np.round(flat[:, 1], 6))
    assert np.diff(rows) == pytest.approx(40 * math.sqrt(3) / 2)
    assert np.unique(np.round(turned[:, 0], 6)) == pytest.approx(rows)


@pytest.mark.parametrize("n", [1, 2, 40, 2500])
def test_what_is_placed_is_as_even_as_what_it_is_judged_by(n: int) -> None:
    points = inside(BUMPY, n, 3.0, math.inf, 2.0)
    apart, ideal = yardstick(BUMPY, n, 3.0, math.inf, 2.0)
    assert len(ideal) == n
    assert coverage_radius(BUMPY, points) <= 1.25 * coverage_radius(BUMPY, ideal)
    assert n == 1 or min_spacing(points) >= 0.85 * apart


def test_one_robot_stands_in_the_middle_and_two_share_it() -> None:
    assert inside(SQUARE, 1, 5, math.inf, 0)[0] == pytest.approx((200, 200), abs=1.5)
    two = inside(SQUARE, 2, 5, math.inf, 0)
    assert two.mean(axis=0) == pytest.approx((200, 200), abs=2)
    assert min_spacing(two) == pytest.approx(200, rel=0.05)


def test_a_result_belongs_to_the_caller_alone() -> None:
    points = inside(SQUARE, 5, 3, math.inf, 0)
    points[:] = 0
    assert inside(SQUARE, 5, 3, math.inf, 0).min() > 3


def test_cells_stand_for_the_region_alone() -> None:
    cells = cells_of(BUMPY.polygon, 10)
    assert shapely.contains_xy(BUMPY.polygon, cells).all()
    assert len(cells) == pytest.approx(6000, rel=0.02)
