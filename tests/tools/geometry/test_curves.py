"""Rings, sides and edges keep the distance they promise, in the frame they are given."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.geometry.curves import Curve, Frame, edge_curve, ring, segment, side
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import assume, given, settings
from hypothesis import strategies as st

FEW = settings(derandomize=True, deadline=None, max_examples=40)
DIRECTIONS = ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))
SLACK = 0.998
"""GEOS simplifies what it buffers by a permille of the distance."""


def rectangle(w: float, h: float, angle: float = 0.0) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    points = np.array([(-w, -h), (w, -h), (w, h), (-w, h)]) / 2
    return points @ np.array([[c, s], [-s, c]]) + (320, 240)


def distance(outline: Outline, points: FloatArray) -> FloatArray:
    return np.asarray(shapely.distance(outline.filled, shapely.points(points)))


def dense(curve: Curve) -> FloatArray:
    return shapely.get_coordinates(shapely.segmentize(curve.geometry(), 1.0))


@st.composite
def outlines(draw: st.DrawFn) -> Outline:
    """Star-shaped polygons about (320, 240), from smooth to ragged."""
    count = draw(st.integers(4, 16))
    radii = draw(st.lists(st.floats(25, 180), min_size=count, max_size=count))
    turn = draw(st.floats(0, 1))
    t = (np.arange(count) + turn) / count * 2 * math.pi
    points = np.stack([np.cos(t), np.sin(t)], axis=1) * np.array(radii)[:, None]
    try:
        return make_outline(points + np.array([320.0, 240.0]))
    except InputError:
        assume(False)
        raise


@given(outlines(), st.floats(2, 60), st.floats(1, 4))
@FEW
def test_a_ring_stands_off_between_its_offset_and_the_farthest_allowed(
    outline: Outline, offset: float, factor: float
) -> None:
    curve = ring(outline, offset, offset * factor)
    away = distance(outline, dense(curve))
    assert curve.closed
    assert away.min() >= offset - (1 - SLACK) * offset * factor
    assert away.max() <= offset * factor * 1.004


@given(st.floats(40, 200), st.floats(40, 200), st.floats(0, 3.2), st.floats(2, 80))
@FEW
def test_around_a_convex_thing_a_ring_is_at_its_offset_everywhere(
    w: float, h: float, angle: float, offset: float
) -> None:
    outline = make_outline(rectangle(w, h, angle))
    away = distance(outline, dense(ring(outline, offset, 2 * offset)))
    assert away.min() >= offset * SLACK
    assert away.max() <= offset * 1.004


@given(outlines(), st.floats(5, 60), st.floats(0, 30), st.sampled_from([(640, 480), (420, 300)]))
@FEW
def test_a_framed_ring_stays_in_the_frame_and_off_what_is_too_near(
    outline: Outline, offset: float, margin: float, room: tuple[float, float]
) -> None:
    frame = Frame(*room, margin)
    curve = ring(outline, offset, 2 * offset, frame, keep=offset / 2)
    if not curve.lines:
        return
    points = dense(curve)
    assert shapely.distance(frame.box, shapely.points(points)).max() <= 1e-6
    assert distance(outline, points).min() >= offset / 2 * SLACK
    assert curve.closed == (np.abs(curve.lines[0][0] - curve.lines[0][-1]).max() < 1e-6)


@pytest.mark.parametrize("margin", [0, 100, 239, 300, 5000])
def test_a_ring_with_nowhere_to_be_is_empty_not_an_error(margin: float) -> None:
    outline = make_outline(rectangle(200, 200))
    curve = ring(outline, 30, 60, Frame(640, 480, margin), keep=15)
    assert (curve.length > 0) == (margin <= 100)
    assert ring(outline, 30, 60, Frame(100, 80), keep=15).length == 0


@given(
    st.floats(60, 200), st.floats(60, 200), st.floats(-0.5, 0.5), st.floats(4, 60),
    st.sampled_from(DIRECTIONS),
)  # fmt: skip
@FEW
def test_a_side_lies_beyond_the_thing_on_that_side(
    w: float, h: float, angle: float, offset: float, direction: tuple[float, float]
) -> None:
    outline = make_outline(rectangle(w, h, angle))
    points = dense(side(outline, direction, offset))
    middle, unit = np.array(outline.centre), np.array(direction)
    assert distance(outline, points).min() >= offset * 0.98
    assert distance(outline, points).max() <= offset * 1.02
    assert ((points - middle) @ unit).min() > 0
    assert points.mean(axis=0) @ unit > middle @ unit + offset
    extent = np.ptp(points @ unit[::-1])
    assert extent >= 0.6 * min(w, h), "the side is walked from end to end"


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("offset", [3, 20, 80])
def test_a_side_of_a_circle_is_its_arc_on_that_side(
    direction: tuple[float, float], offset: float
) -> None:
    t = np.linspace(0, 2 * math.pi, 300, endpoint=False)
    outline = make_outline(np.stack([np.cos(t), np.sin(t)], axis=1) * 70 + (320, 240))
    points = dense(side(outline, direction, offset)) - (320, 240)
    assert np.hypot(*points.T) == pytest.approx(70 + offset, rel=0.01)
    turn = np.abs(np.arctan2(points @ np.array([-direction[1], direction[0]]), points @ direction))
    assert turn.max() <= math.radians(55)
    shadow = math.asin(70 / (70 + offset))  # of the circle, seen from that side
    assert turn.max() >= min(math.radians(45), shadow) - math.radians(3)


@pytest.mark.parametrize("offset", [2, 10, 40])
@pytest.mark.parametrize("edge", range(6))
def test_an_edge_curves_points_are_nearest_to_the_edges_chosen(offset: float, edge: int) -> None:
    ell = [(100, 100), (160, 100), (160, 240), (300, 240), (300, 300), (100, 300)]
    outline = make_outline(ell)
    vertices, pairs = outline.graph()
    assert len(pairs) == 6
    for chosen in ((edge,), tuple({edge, (edge + 1) % 6})):
        curve = edge_curve(outline, chosen, offset)
        points = dense(curve)
        lines = [shapely.LineString(vertices[list(p)]) for p in pairs]
        away = np.stack([shapely.distance(x, shapely.points(points)) for x in lines])
        assert (away[list(chosen)].min(axis=0) <= away.min(axis=0) + offset / 10 + 0.2).all()
        assert distance(outline, points).min() >= offset * SLACK
        assert distance(outline, points).max() <= offset * 1.004


def test_an_edge_that_is_not_there_is_an_index_error() -> None:
    with pytest.raises(IndexError):
        edge_curve(make_outline(rectangle(100, 50)), (4,), 5)


def test_a_segment_is_cut_by_frame_and_obstacle() -> None:
    start, end = np.array([0.0, 50.0]), np.array([200.0, 50.0])
    solid = shapely.box(80, 0, 120, 100)
    assert segment(start, end).length == pytest.approx(200)
    assert segment(start, end, Frame(151, 100, 10)).length == pytest.approx(130)
    assert segment(start, end, None, solid).length == pytest.approx(160)
    assert segment(start, start).length == 0
    assert segment(start - 500, start - 400, Frame(100, 100)).length == 0
