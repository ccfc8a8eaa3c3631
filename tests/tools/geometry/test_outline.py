"""Outlines of known shapes, their symmetries, and whatever else a caller may hand over."""

import math

import numpy as np
import pytest
from formup.tools.errors import InputError
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

FEW = settings(derandomize=True, deadline=None, max_examples=40)
ELL = np.array([(0, 0), (30, 0), (30, 70), (100, 70), (100, 100), (0, 100)], dtype=float)
angles = st.floats(0, 2 * math.pi)


def turned(points: FloatArray, angle: float, scale: float = 1.0) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]]) * scale


def rectangle(width: float, height: float) -> FloatArray:
    return np.array([(0, 0), (width, 0), (width, height), (0, height)], dtype=float)


def disc(radius: float, count: int = 360) -> FloatArray:
    t = np.linspace(0, 2 * math.pi, count, endpoint=False)
    return np.stack([np.cos(t), np.sin(t)], axis=1) * radius


def star(points: int, outer: float, inner: float) -> FloatArray:
    t = np.arange(2 * points) * math.pi / points
    r = np.where(np.arange(2 * points) % 2, inner, outer)
    return np.stack([np.cos(t), np.sin(t)], axis=1) * r[:, None]


def matched(got: FloatArray, wanted: FloatArray, tolerance: float) -> bool:
    """Whether two sets of points are the same, in any order."""
    apart = np.linalg.norm(got[:, None] - wanted[None], axis=2)
    return len(got) == len(wanted) and float(apart.min(axis=0).max()) <= tolerance


@given(st.floats(8, 300), st.floats(0.02, 1), angles)
@FEW
def test_a_turned_rectangle_keeps_its_measures_and_corners(
    w: float, share: float, t: float
) -> None:
    h = max(w * share, 1.0)
    ring = turned(rectangle(w, h), t) + 400
    outline = make_outline(ring)
    assert outline.area == pytest.approx(w * h, rel=1e-6)
    assert outline.perimeter == pytest.approx(2 * (w + h), rel=1e-6)
    assert outline.min_width == pytest.approx(h, rel=1e-6)
    assert outline.centre == pytest.approx(tuple(ring.mean(axis=0)), abs=0.05 * h + 1e-6)
    assert matched(outline.rectangle, ring, 1e-4)
    assert matched(outline.corners, ring, 1e-4)
    _, long, short = outline.long_axis
    assert (long, short) == pytest.approx((w, h), rel=1e-6)


@given(angles)
@FEW
def test_an_ell_has_six_corners_and_its_centre_inside(angle: float) -> None:
    outline = make_outline(turned(ELL, angle) + 300)
    assert outline.kind == "polygonal"
    assert outline.area == pytest.approx(5100)
    assert matched(outline.corners, turned(ELL, angle) + 300, 1e-6)
    assert outline.polygon.contains(Polygon([outline.centre] * 3).centroid)


def test_a_star_has_its_tips_and_notches_as_corners() -> None:
    outline = make_outline(star(5, 100, 45) + 200)
    assert outline.kind == "polygonal"
    assert matched(outline.corners, star(5, 100, 45) + 200, 1e-6)
    assert outline.centre == pytest.approx((200, 200), abs=1e-6)


@pytest.mark.parametrize("radius", [40, 90, 250])
def test_a_circle_is_smooth_and_offers_its_square(radius: float) -> None:
    outline = make_outline(disc(radius) + 300)
    assert outline.kind == "smooth"
    assert outline.area == pytest.approx(math.pi * radius**2, rel=1e-3)
    assert outline.min_width == pytest.approx(2 * radius, rel=1e-3)
    assert len(outline.corners) == 4
    assert outline.centre == pytest.approx((300, 300), abs=1e-3 * radius)


def test_a_ring_excludes_its_hole_from_area_but_not_from_size() -> None:
    outline = make_outline(disc(100) + 200, (disc(60) + 200,))
    assert outline.area == pytest.approx(math.pi * (100**2 - 60**2), rel=1e-3)
    assert outline.size == pytest.approx(math.sqrt(math.pi) * 100, rel=1e-3)
    assert outline.filled.area == pytest.approx(math.pi * 100**2, rel=1e-3)
    away = math.dist(outline.centre, (200, 200))
    assert 60 < away < 100, "the centre lies in the ring's material"


@given(angles, st.floats(0.7, 5), st.floats(-500, 500), st.sampled_from(["ell", "star", "disc"]))
@FEW
def test_moving_turning_and_scaling_change_nothing_else(
    angle: float, scale: float, shift: float, shape: str
) -> None:
    ring = {"ell": ELL, "star": star(6, 80, 35), "disc": disc(70, 200)}[shape]
    before, after = make_outline(ring), make_outline(turned(ring, angle, scale) + shift)
    assert after.kind == before.kind
    assert after.area == pytest.approx(before.area * scale**2, rel=1e-6)
    assert after.perimeter == pytest.approx(before.perimeter * scale, rel=1e-6)
    assert after.min_width == pytest.approx(before.min_width * scale, rel=1e-6)
    assert len(after.corners) == len(before.corners)
    centre = turned(np.array([before.centre]), angle, scale)[0] + shift
    assert after.centre == pytest.approx(tuple(centre), abs=0.02 * scale * before.size)


@pytest.mark.parametrize("size", [(1000, 10), (400, 4), (200, 1.2), (60, 1)])
def test_vertices_of_thin_rectangles_run_in_the_exteriors_direction(
    size: tuple[float, float],
) -> None:
    for angle in (0.0, 0.3, 1.2, 2.5):
        for ring in (rectangle(*size), rectangle(*size)[::-1]):
            outline = make_outline(turned(ring, angle) + 1000)
            assert outline.polygon.exterior.is_ccw
            assert Polygon(outline.vertices).exterior.is_ccw


@pytest.mark.parametrize(
    "ring", [[(0, 3), (0, 2), (3, 1), (-1, 0)], [(0, 30), (0, 20), (30, 10), (-10, 0)]]
)
def test_the_rectangle_covers_the_outline(ring: list[tuple[float, float]]) -> None:
    outline = make_outline(ring)
    assert Polygon(outline.rectangle).buffer(1e-6).covers(outline.polygon)
    best = 0.0
    for turn in np.linspace(0, math.pi, 721):
        c, s = math.cos(turn), math.sin(turn)
        extent = np.ptp(np.array(ring) @ np.array([[c, s], [-s, c]]), axis=0)
        area = float(extent.prod())
        best = min(best or area, area)
    assert Polygon(outline.rectangle).area <= best * 1.0001


def check_whole(outline: Outline) -> None:
    """Every property is a number, and those that must agree do."""
    assert outline.polygon.is_valid
    assert outline.area >= 4
    assert 0 < outline.min_width <= outline.long_axis[2] * (1 + 1e-6)
    assert outline.size >= math.sqrt(outline.area) * (1 - 1e-9)
    assert np.isfinite(outline.corners).all()
    assert len(outline.corners) >= 3
    assert outline.rectangle.shape == (4, 2)
    assert np.isfinite(outline.centre).all()
    assert len(outline.edges) == len(outline.vertices) >= 3
    assert 0.5 <= outline.kind_confidence <= 1


coordinate = st.one_of(
    st.integers(-3, 12).map(float), st.floats(-1e4, 1e4), st.sampled_from([0.0, 1e-9, 1e6])
)


@given(st.lists(st.tuples(coordinate, coordinate), max_size=12))
@settings(derandomize=True, deadline=None, max_examples=300)
def test_any_ring_gives_a_whole_outline_or_an_input_error(ring: list[tuple[float, float]]) -> None:
    try:
        outline = make_outline(ring)
    except InputError:
        return
    check_whole(outline)


@pytest.mark.parametrize(
    "ring",
    [
        [(0, 0), (5, 5), (10, 10)],
        [(0, 0), (0, 0), (0, 0)],
        [(0, 0), (1, 0), (1, 3)],
        [(0, 0), (math.nan, 1), (5, 5)],
        [(0, 0), (math.inf, 1), (5, 5)],
        [(1, 2, 3), (4, 5, 6), (7, 8, 10)],
        [(0, 0), (10, 10)],
        [],
    ],
)
def test_what_encloses_nothing_is_refused(ring: list[tuple[float, ...]]) -> None:
    with pytest.raises(InputError):
        make_outline(ring)


def test_a_bow_tie_keeps_one_of_its_halves() -> None:
    assert make_outline([(0, 0), (10, 10), (10, 0), (0, 10)]).area == pytest.approx(25)


def test_repeated_points_and_a_closing_point_change_nothing() -> None:
    ring = [(0, 0), (0, 0), (10, 0), (10, 0), (10, 10), (0, 10), (0, 10), (0, 0)]
    assert make_outline(ring).area == pytest.approx(100)
    assert len(make_outline(ring).corners) == 4


def test_slivers_a_thousand_times_longer_than_wide_are_whole() -> None:
    for ring in ([(0, 0), (4000, 0), (2000, 0.0021)], rectangle(4000, 0.5), rectangle(9000, 9)):
        check_whole(make_outline(ring))


def test_a_hundred_thousand_vertices_are_taken() -> None:
    noise = np.random.default_rng(0).normal(0, 0.2, (100_000, 1))
    outline = make_outline(disc(1.0, 100_000) * (200 + noise) + 300)
    check_whole(outline)
    assert outline.kind == "smooth"
    assert outline.area == pytest.approx(math.pi * 200**2, rel=0.01)
