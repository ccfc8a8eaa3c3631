"""Points on curves, at corners, inside and around: even, apart and where they belong."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.geometry.curves import Curve, Frame, ring, segment
from formup.tools.geometry.interior import coverage_radius, inside
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from formup.tools.geometry.sampling import (
    along_curve,
    around_point,
    at_corners,
    corner_points,
    min_spacing,
    spread_subset,
)
from hypothesis import given, settings
from hypothesis import strategies as st

FEW = settings(derandomize=True, deadline=None, max_examples=40)
COUNTS = [1, 2, 3, 4, 5, 7, 12, 33, 100, 200]
ELL = [(100, 100), (160, 100), (160, 240), (300, 240), (300, 300), (100, 300)]
NOTCHED = [(100, 100), (300, 100), (300, 300), (230, 300), (230, 200), (170, 200), (170, 300),
           (100, 300)]  # fmt: skip


def stations(curve: Curve, points: FloatArray) -> FloatArray:
    line = shapely.LineString(curve.lines[0])
    return np.asarray(shapely.line_locate_point(line, shapely.points(points)))


def rectangle(w: float, h: float, angle: float = 0.0) -> Outline:
    c, s = math.cos(angle), math.sin(angle)
    points = np.array([(-w, -h), (w, -h), (w, h), (-w, h)]) / 2
    return make_outline(points @ np.array([[c, s], [-s, c]]) + (320, 240))


@pytest.mark.parametrize("n", COUNTS)
def test_on_a_loop_all_gaps_are_equal(n: int) -> None:
    curve = ring(make_outline(ELL), 20, 40)
    points = along_curve(curve, n)
    at = np.sort(stations(curve, points))
    gaps = np.diff(at, append=at[0] + curve.length)
    assert len(points) == n
    assert gaps == pytest.approx(curve.length / n, rel=1e-6)


@pytest.mark.parametrize("n", COUNTS)
def test_on_an_open_line_the_ends_are_taken_and_gaps_are_equal(n: int) -> None:
    curve = segment(np.array([10.0, 20.0]), np.array([310.0, 420.0]))
    points = along_curve(curve, n)
    at = stations(curve, points)
    wanted = [250.0] if n == 1 else np.linspace(0, 500, n)
    assert at == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("n", COUNTS)
def test_a_narrow_cut_counts_as_a_gap_and_a_wide_one_ends_the_line(n: int) -> None:
    t = np.linspace(0.05, 2 * math.pi - 0.05, 400)
    curve = Curve((np.stack([np.cos(t), np.sin(t)], axis=1) * 100,), False, 200 * math.pi)
    points, cut = along_curve(curve, n), curve.cut(n)
    at = stations(curve, points)
    assert (cut is not None) == (n < 63)
    if cut is None:
        assert (at[0], at[-1]) == pytest.approx((0, curve.length), abs=1e-6)
    else:
        gaps = np.diff(at, append=at[0] + curve.length + cut)
        assert gaps == pytest.approx((curve.length + cut) / n, rel=1e-6)


def test_pieces_share_robots_by_length_and_an_empty_curve_takes_none() -> None:
    first, second = np.array([(0.0, 0), (300, 0)]), np.array([(0.0, 50), (100, 50)])
    points = along_curve(Curve((first, second), False, 400), 8)
    assert (points[:, 1] == 0).sum() == 6
    assert along_curve(Curve((), False, 400), 5).shape == (0, 2)


@given(st.integers(1, 200), st.floats(1, 50), st.floats(-500, 500))
@FEW
def test_around_a_point_the_mean_is_the_point_and_neighbours_a_pitch_apart(
    n: int, pitch: float, x: float
) -> None:
    points = around_point((x, 7.0), n, pitch)
    assert points.shape == (n, 2)
    assert points.mean(axis=0) == pytest.approx((x, 7.0), abs=1e-6)
    if n > 1:
        assert min_spacing(points) == pytest.approx(pitch, rel=1e-6)
    reach = np.linalg.norm(points - (x, 7.0), axis=1).max()
    assert reach <= pitch * (1.3 + 0.62 * math.sqrt(n)), "they are gathered, not strung out"


@pytest.mark.parametrize("ring_", [ELL, NOTCHED, ELL[::-1]])
@pytest.mark.parametrize("standoff", [2.0, 9.0, 15.0])
def test_corner_robots_stand_off_exactly_on_the_outside(
    ring_: list[tuple[int, int]], standoff: float
) -> None:
    outline = make_outline(ring_)
    places = at_corners(outline, len(ring_), standoff)
    away = shapely.distance(outline.filled, shapely.points(places))
    corners = corner_points(outline, len(ring_))
    assert away == pytest.approx(standoff, rel=0.06)
    assert np.linalg.norm(places - corners, axis=1).max() <= 1.5 * standoff


@pytest.mark.parametrize("n", range(1, 9))
def test_fewer_robots_than_corners_take_different_corners_far_apart(n: int) -> None:
    outline = make_outline(NOTCHED)
    places = at_corners(outline, n, 5)
    assert len(places) == (4 if n == 4 else 8), "four robots take the rectangle's corners"
    taken = places[spread_subset(places, n)]
    assert taken.shape == (n, 2)
    assert min_spacing(taken) > (200 if n <= 4 else 40)


@given(st.floats(0.005, 0.05), st.floats(0, 3.2), st.floats(1, 20))
@FEW
def test_corners_of_thin_things_are_taken_on_the_right_side(
    share: float, angle: float, standoff: float
) -> None:
    outline = rectangle(600, 600 * share, angle)
    places = at_corners(outline, 4, standoff)
    corners = corner_points(outline, 4)
    assert np.linalg.norm(places - corners, axis=1) == pytest.approx(standoff, rel=0.06)
    middle = np.array([320.0, 240.0])
    out = np.linalg.norm(places - middle, axis=1) - np.linalg.norm(corners - middle, axis=1)
    assert out.min() > 0


SHAPES = {
    "ell": make_outline(ELL),
    "notched": make_outline(NOTCHED),
    "slanted": rectangle(240, 90, 0.4),
    "holed": make_outline([(100, 100), (300, 100), (300, 300), (100, 300)],
                          ([(150, 150), (250, 150), (250, 250), (150, 250)],)),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 13, 40, 120])
def test_inside_all_keep_the_margin_and_spread(name: str, n: int) -> None:
    outline = SHAPES[name]
    points = inside(outline, n, 5.0, math.inf, 4.0)
    depth = shapely.distance(outline.polygon.boundary, shapely.points(points))
    assert len(points) == n
    assert shapely.contains_xy(outline.polygon, points).all()
    assert depth.min() >= 5.0 - 1e-3
    if n > 1:
        fair = math.sqrt(outline.area / n)
        assert min_spacing(points) >= max(4.0, 0.45 * fair)
        assert coverage_radius(outline, points) <= 1.6 * fair


@pytest.mark.parametrize("name", SHAPES)
def test_inside_a_band_nobody_is_deeper_than_allowed(name: str) -> None:
    outline = SHAPES[name]
    points = inside(outline, 10, 4.0, 12.0, 4.0)
    depth = shapely.distance(outline.polygon.boundary, shapely.points(points))
    assert len(points) == 10
    assert depth.min() >= 4.0 - 1e-3
    assert depth.max() <= 12.0 + 1e-3


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.785, 1.57])
def test_a_slanted_strip_holds_the_row_that_fits(angle: float) -> None:
    """300 px of row at 20 px take 16 robots; a lattice laid at a fixed angle finds fewer."""
    points = inside(rectangle(310, 14, angle), 14, 5.0, math.inf, 20.0)
    assert len(points) == 14
    assert min_spacing(points) >= 20 - 1e-6


@given(st.integers(2, 60), st.floats(5, 60))
@settings(derandomize=True, deadline=None, max_examples=8)
def test_inside_gives_as_many_as_fit_and_never_closer(n: int, spacing: float) -> None:
    points = inside(rectangle(200, 120, 0.2), n, 4.0, math.inf, spacing)
    assert min_spacing(points) >= spacing - 1e-6
    hexagons = 192 * 112 / (spacing**2 * math.sqrt(3) / 2)
    assert len(points) >= min(n, int(0.6 * hexagons))


def test_a_margin_that_leaves_a_sliver_is_no_trap() -> None:
    for margin in (4.0, 4.9, 4.99, 4.9999):
        points = inside(rectangle(800, 10, 0.785), 3, margin, math.inf, 5.0)
        assert 1 <= len(points) <= 3
    assert len(inside(rectangle(800, 10, 0.785), 3, 5.01, math.inf, 5.0)) == 0


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.3, 1.571])
@pytest.mark.parametrize("size", [(300, 10), (10, 300)])
def test_a_row_with_no_width_to_spare_is_filled_wherever_it_lies(
    size: tuple[float, float], angle: float
) -> None:
    ring_ = np.array([(0, 0), (size[0], 0), size, (0, size[1])], dtype=float)
    c, s = math.cos(angle), math.sin(angle)
    turned = ring_ @ np.array([[c, s], [-s, c]])
    for x, y in ((0, 0), (300, 600), (600, 600), (0, 200)):
        outline = make_outline(turned + np.array([x, y], dtype=float))
        points = inside(outline, 5, 4.95, math.inf, 20.0)
        assert len(points) == 5
        assert min_spacing(points) >= 20 - 1e-6


def test_a_thin_band_all_round_is_filled_all_round() -> None:
    outline = make_outline([(100, 100), (300, 100), (300, 300), (100, 300)])
    points = inside(outline, 20, 5.0, 5.3, 10.0)
    assert len(points) == 20
    assert min_spacing(points) >= 10 - 1e-6


def test_a_frame_smaller_than_its_margin_is_empty() -> None:
    assert Frame(100, 80, 45).box.is_empty
    assert Frame(100, 80, 10).box.bounds == (10, 10, 89, 69)
