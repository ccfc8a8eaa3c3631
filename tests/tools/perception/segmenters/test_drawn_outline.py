"""Where an outline somebody drew is taken in place of the measured one, or lays out its sides."""

from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.builtin.targets import measured_all
from formup.tools.context import Context
from formup.tools.errors import ToolError
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.segmenters.drawn_outline import (
    clipped_to_picture,
    segment_corrected,
    with_straight_sides,
)
from formup.tools.perception.segmenters.grabcut import Bytes
from formup.tools.perception.segmenters.segment import segment_outline
from formup.tools.perception.target_prompt import TargetPrompt
from formup.tools.world import Target
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from shapely.geometry import Polygon

BOX = [(60.0, 40.0), (140.0, 40.0), (140.0, 100.0), (60.0, 100.0)]
WIDER = [(60.0, 40.0), (143.0, 40.0), (143.0, 100.0), (60.0, 100.0)]


def picture() -> Bytes:
    """A red box of 80 x 60 px on grey."""
    pixels = np.full((140, 240, 3), 90, np.uint8)
    pixels[40:100, 60:140] = (200, 40, 40)
    return pixels


def test_what_was_drawn_is_taken_beside_a_point_on_it_and_nowhere_else() -> None:
    plain = segment_outline(picture(), WIDER)
    mended = segment_corrected(picture(), WIDER, positive=[(142.0, 70.0)])
    assert not plain.mask[70, 141:].any()
    assert mended.mask[60:80, 141:143].all()
    changed = np.argwhere(plain.mask != mended.mask)
    assert np.hypot(*(changed - (70, 142)).T).max() <= 0.2 * np.sqrt(Polygon(WIDER).area) + 1
    assert mended.confidence == plain.confidence


def test_nothing_beyond_what_was_drawn_is_kept_beside_a_negative_point() -> None:
    pixels = picture()
    pixels[55:85, 140:143] = (200, 40, 40)  # a bump of the same colour
    bumped = segment_outline(pixels, BOX)
    mended = segment_corrected(pixels, BOX, negative=[(147.0, 70.0)])
    assert bumped.mask[70, 141]
    assert not mended.mask[62:78, 141:].any()
    assert (mended.mask | bumped.mask == bumped.mask).all()
    assert mended.mask[:, :130].sum() == bumped.mask[:, :130].sum()


def test_points_against_the_outline_have_it_cut_anew() -> None:
    pixels = picture()
    pixels[60:80, 90:110] = (40, 40, 200)
    assert segment_corrected(pixels, BOX).mask[70, 100]
    assert not segment_corrected(pixels, BOX, negative=[(100.0, 70.0)]).mask[70, 100]


angles = st.floats(0.0, np.pi / 2)
shifts = st.lists(st.floats(-3.0, 3.0), min_size=8, max_size=8)


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return points @ np.array([[cos, sin], [-sin, cos]]) + 300


@given(angles, shifts)
def test_sides_come_out_straight_where_corners_were_rounded_and_vertices_are_off(
    angle: float, shift: list[float]
) -> None:
    true = turned(np.array([(-90.0, -60.0), (90.0, -60.0), (90.0, 60.0), (-90.0, 60.0)]), angle)
    measured = make_outline(Polygon(true).buffer(-12).buffer(12).exterior.coords)
    drawn = true + np.reshape(shift, (4, 2))
    found = with_straight_sides(measured, [(float(x), float(y)) for x, y in drawn])
    assert len(found.filled.exterior.coords) == 5
    off, drawn_off = (
        shapely.hausdorff_distance(ring, Polygon(true).exterior)
        for ring in (found.filled.exterior, Polygon(drawn).exterior)
    )
    assert off < 0.55 * drawn_off + 0.5


@given(angles, st.floats(0.0, 0.7), st.floats(-10.0, 10.0))
def test_a_dent_in_a_quarter_of_a_side_does_not_move_it(
    angle: float, place: float, depth: float
) -> None:
    true = np.array([(-100.0, -60.0), (100.0, -60.0), (100.0, 60.0), (-100.0, 60.0)])
    x = -100 + 200 * np.array([place, place, place + 0.25, place + 0.25])
    dent = np.stack([x, -60 + np.array([0.0, depth, depth, 0.0])], axis=1)
    measured = make_outline(turned(np.concatenate([true[:1], dent, true[1:]]), angle))
    sides = turned(true, angle)
    found = with_straight_sides(measured, [(float(x), float(y)) for x, y in sides])
    assert shapely.hausdorff_distance(found.filled.exterior, Polygon(sides).exterior) < 1.5


def test_where_little_was_measured_the_drawn_side_stays() -> None:
    measured = make_outline([(0, 0), (100, 0), (100, 30), (60, 30), (0, 60)])  # a corner is missing
    drawn = [(1.0, 1.0), (99.0, 1.0), (99.0, 61.0), (1.0, 61.0)]
    corners = np.array(with_straight_sides(measured, drawn).filled.exterior.coords)
    assert np.abs(corners - (99.0, 61.0)).sum(axis=1).min() < 4


@pytest.mark.parametrize(
    "drawn",
    [
        [(0.0, 30.0), (100.0, 29.9), (100.0, 30.1)],
        [(10.0, 10.0), (12.0, 10.0), (11.0, 11.0)],
        [(300.0, 0.0), (400.0, 0.0), (400.0, 60.0), (300.0, 60.0)],
        [(0.0, 0.0), (100.0, 0.0), (50.0, 2.0), (0.0, 4.0)],
    ],
)
def test_sides_of_something_else_leave_it_as_measured(drawn: list[tuple[float, float]]) -> None:
    measured = make_outline([(0, 0), (100, 0), (100, 60), (0, 60)])
    assert with_straight_sides(measured, drawn) is measured


def segmented(pixels: Bytes, **prompt: Any) -> Target:
    context = Context.of(picture_from_array(pixels))
    return measured_all(context, (TargetPrompt(**prompt),)).target("t1")


def test_sides_that_would_lie_beyond_the_picture_end_at_its_border() -> None:
    pixels = picture()
    pixels[:60, :80] = (200, 40, 40)
    rough = ((0, 0), (78, 1), (80, 59), (0, 61))
    x0, y0, *_ = segmented(pixels, outline=rough, straight=True).box
    assert min(x0, y0) >= -0.5
    drawn = make_outline([(-5.0, -3.0), (300.0, -3.0), (300.0, 200.0), (-5.0, 200.0)])
    assert clipped_to_picture(drawn, 240, 140).bounds == (-0.5, -0.5, 239.5, 139.5)


def test_straight_goes_with_an_outline_that_was_drawn() -> None:
    with pytest.raises(ValidationError, match="straight belongs to an outline"):
        TargetPrompt(box=(1, 2, 30, 40), straight=True)
    rough = ((62.0, 38.0), (138.0, 41.0), (141.0, 98.0), (58.0, 101.0))
    target = segmented(picture(), outline=rough, straight=True)
    assert len(target.outline.filled.exterior.coords) == 5
    truth = shapely.box(59.5, 39.5, 139.5, 99.5)
    off = shapely.hausdorff_distance(target.outline.filled.exterior, truth.exterior)
    assert off < 0.55 * shapely.hausdorff_distance(Polygon(rough).exterior, truth.exterior)
    with pytest.raises(ToolError, match="Insufficient segmentation accuracy"):
        segmented(
            np.full((90, 90, 3), 9, np.uint8),
            outline=((10, 10), (50, 10), (50, 50), (10, 50)),
            straight=True,
        )
