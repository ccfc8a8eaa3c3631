"""Equal chords, nested rings, rings in holes; and outlines that are hardly outlines."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.geometry.curves import Curve, Frame, interpolate, locate, ring, side
from formup.tools.geometry.outline import FloatArray, Outline, distances, make_outline
from formup.tools.geometry.rings import equal_chords, hole_rings, nested_rings
from formup.tools.geometry.sampling import along_curve, min_spacing
from hypothesis import given, settings
from hypothesis import strategies as st

FEW = settings(derandomize=True, deadline=None, max_examples=40)
ELL = [(100, 100), (160, 100), (160, 240), (300, 240), (300, 300), (100, 300)]
T = np.arange(60) / 60 * 2 * math.pi
DUMBBELL = np.stack([np.cos(T) * 200, np.sin(T) * (20 + 80 * np.cos(T) ** 2)], axis=1) + 400
HOLED = make_outline(
    [(0, 0), (400, 0), (400, 200), (0, 200)],
    ([(40, 40), (160, 40), (160, 160), (40, 160)], [(240, 80), (280, 80), (280, 120), (240, 120)]),
)


def chords(points: FloatArray, closed: bool) -> FloatArray:
    loop = np.concatenate([points, points[:1]]) if closed else points
    return np.linalg.norm(np.diff(loop, axis=0), axis=1)


@pytest.mark.parametrize("corners", [ELL, DUMBBELL], ids=["ell", "dumbbell"])
@pytest.mark.parametrize("n", [3, 4, 6, 7, 25, 100, 400])
def test_neighbours_are_at_equal_straight_distances(corners: FloatArray, n: int) -> None:
    outline = make_outline(corners)
    for curve in (ring(outline, 15, 15), side(outline, (0, 1), 12)):
        points = equal_chords(curve, n)
        apart = chords(points, curve.closed)
        assert points.shape == (n, 2)
        assert distances(curve.geometry(), points).max() < 1e-6
        assert apart.min() >= 0.99 * apart.max()


@pytest.mark.parametrize("n", [3, 5, 8, 9, 12, 31])
@pytest.mark.parametrize("height", [12.0, 20.0, 80.0])
def test_equal_chords_leave_no_part_of_a_thin_thing_bare(n: int, height: float) -> None:
    """Straight through it two robots at an end are as near as neighbours along it."""
    thin = make_outline([(120, 230), (520, 230), (520, 230 + height), (120, 230 + height)])
    curve = ring(thin, 12, 12)
    points = equal_chords(curve, n)
    at = np.sort(locate(curve.lines[0], points))
    arcs = np.diff(np.append(at, at[0] + curve.length))
    assert arcs.max() <= 2.1 * arcs.mean() + 1e-6


def test_across_a_neck_robots_that_are_no_neighbours_may_be_nearer_and_that_is_measured() -> None:
    curve = ring(make_outline(DUMBBELL), 4, 4)
    points = equal_chords(curve, 6)
    assert min_spacing(points) < 0.8 * chords(points, closed=True).min()


@given(st.integers(1, 300), st.integers(1, 5), st.floats(4, 40), st.floats(3, 40))
@FEW
def test_nested_rings_share_the_robots_and_stand_behind_each_other(
    n: int, count: int, offset: float, step: float
) -> None:
    outline = make_outline(ELL)
    rings = nested_rings(outline, n, offset, step, count)
    assert [len(r) for r in rings] == sorted(len(r) for r in rings)
    assert sum(len(r) for r in rings) == n
    for k, points in enumerate(rings):
        if len(points):
            away = distances(outline.filled, points)
            assert away == pytest.approx(offset + k * step, rel=0.02)


def test_every_second_ring_stands_in_the_gaps() -> None:
    disc = make_outline(np.stack([np.cos(T), np.sin(T)], axis=1) * 200 + 400)
    first, second = nested_rings(disc, 20, 10, 8, 2)
    assert len(first) == len(second) == 10
    apart = np.linalg.norm(first[:, None] - second[None], axis=2).min(axis=1)
    assert apart.min() > 0.45 * min_spacing(first)


def test_robots_in_holes_keep_off_the_edge_and_share_them_by_length() -> None:
    large, small = hole_rings(HOLED, 16, 5)
    assert (len(large), len(small)) == (13, 3)
    for points in (large, small):
        assert distances(HOLED.polygon, points) == pytest.approx(5, rel=0.01)
    assert [len(points) for points in hole_rings(HOLED, 7, 30)] == [7], "one has no room"
    assert hole_rings(make_outline(ELL), 7, 5) == ()


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=2, max_size=30))
@FEW
def test_places_along_a_line_are_those_of_geos_to_the_last_bit(
    corners: list[tuple[int, int]],
) -> None:
    line = np.asarray(corners, dtype=float)
    whole = shapely.LineString(line)
    if whole.length == 0:
        return
    stations = np.linspace(0, whole.length, 37)
    expected = shapely.get_coordinates(shapely.line_interpolate_point(whole, stations))
    assert (interpolate(line, stations) == expected).all()


def test_many_points_are_located_and_measured_as_few_are() -> None:
    curve = ring(HOLED, 20, 20)
    line = curve.lines[0]
    points = along_curve(curve, 5000) + np.random.default_rng(0).normal(0, 3, (5000, 2))
    few = np.concatenate([locate(line, part) for part in np.split(points, 1000)])
    assert locate(line, points) == pytest.approx(few, abs=1e-6)
    spread = np.random.default_rng(1).uniform((-50, -50), (450, 250), (20_000, 2))
    for geometry in (HOLED.polygon, HOLED.polygon.boundary, curve.geometry()):
        parts = [distances(geometry, part) for part in np.split(spread, 1000)]
        assert distances(geometry, spread) == pytest.approx(np.concatenate(parts), abs=1e-9)


TOUCHING = make_outline(
    [(0, 0), (300, 0), (300, 100), (0, 100)],
    (
        [(0, 0), (50, 50), (0, 90)],
        [(60, 20), (100, 20), (100, 80)],
        [(100, 80), (140, 20), (150, 90)],
    ),
)
HAIRPIN = [(0, 0), (300, 0), (300, 3), (2, 3), (2, 5), (300, 5), (300, 8), (0, 8)]
LONG = np.arange(100_000) / 100_000 * 2 * math.pi
WAVES = 150 + 9 * np.sin(40 * LONG)
DEGENERATE: dict[str, Outline] = {
    "sliver": make_outline([(100, 100), (500, 100.02), (500, 100.04), (100, 100.06)]),
    "three pixels": make_outline([(10, 10), (13, 10), (13, 11.5), (10, 11.5)]),
    "touching holes": TOUCHING,
    "hairpin": make_outline(HAIRPIN),
    "100,000 vertices": make_outline(
        np.stack([np.cos(LONG), np.sin(LONG)], axis=1) * WAVES[:, None] + 300
    ),
}


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize("offset", [0.3, 6.0, 80.0])
def test_hardly_an_outline_is_no_trap(name: str, offset: float) -> None:
    outline = DEGENERATE[name]
    frame = Frame(640, 480, 2)
    curves: list[Curve] = [ring(outline, offset, offset, frame), side(outline, (1, 0), offset)]
    for curve in curves:
        for n in (1, 2, 3, 50):
            assert np.isfinite(along_curve(curve, n)).all()
            assert np.isfinite(equal_chords(curve, n)).all()
    assert sum(len(r) for r in nested_rings(outline, 30, offset, offset, 3)) == 30
    assert all(np.isfinite(r).all() for r in hole_rings(outline, 9, offset))
