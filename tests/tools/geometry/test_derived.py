"""Groups, gaps, bays and parts: regions that follow from outlines alone."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.geometry.derived import PartName, bay_of, gap_between, grouped, part_of
from formup.tools.geometry.outline import Outline, outline_of
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, scale
from shapely.geometry import Point

FEW = settings(derandomize=True, deadline=None, max_examples=60)
U_SHAPE = shapely.Polygon(
    [(0, 0), (30, 0), (30, 70), (70, 70), (70, 0), (100, 0), (100, 100), (0, 100)]
)


def oval(x: float, y: float, radius: float, squeeze: float, turn: float) -> Outline:
    return outline_of(rotate(scale(Point(x, y).buffer(radius), 1, squeeze), turn))


SOMETHING = st.builds(
    oval,
    st.floats(100, 900),
    st.floats(100, 700),
    st.floats(15, 80),
    st.floats(0.3, 1),
    st.floats(0, 180),
)


def box(x0: float, y0: float, x1: float, y1: float) -> Outline:
    return outline_of(shapely.box(x0, y0, x1, y1))


def test_things_that_touch_are_one_by_their_union_and_else_by_their_hull() -> None:
    union, which = grouped([box(0, 0, 40, 40), box(40.2, 0, 80, 20)])
    assert which == "union"
    assert union.area == pytest.approx(1600 + 39.8 * 20, abs=10)
    hull, which = grouped([box(0, 0, 40, 40), box(60, 0, 100, 40)])
    assert (which, hull.bounds) == ("convex hull", (0, 0, 100, 40))
    assert hull.area == pytest.approx(4000)


@FEW
@given(SOMETHING, SOMETHING, SOMETHING)
def test_a_group_holds_all_its_things(one: Outline, two: Outline, three: Outline) -> None:
    group, _ = grouped([one, two, three])
    for member in (one, two, three):
        assert member.filled.difference(group.filled).area <= 0.01 * member.area


@FEW
@given(SOMETHING, SOMETHING, SOMETHING)
def test_a_gap_is_free_and_lies_between(one: Outline, two: Outline, third: Outline) -> None:
    try:
        gap, width = gap_between(one, two, [third.filled])
    except InputError as error:
        near = one.filled.distance(two.filled) <= 0.5
        assert near or "Nothing is free" in str(error)
        return
    assert width == pytest.approx(one.filled.distance(two.filled))
    for thing in (one, two, third):
        assert gap.polygon.intersection(thing.filled).area <= 1e-6 * gap.area + 1e-3
    hull = shapely.union_all([one.filled, two.filled]).convex_hull
    assert hull.buffer(1).covers(gap.polygon)


def test_what_lies_in_a_gap_is_cut_out_of_it() -> None:
    gap, width = gap_between(box(0, 0, 40, 100), box(100, 0, 140, 100))
    assert (width, gap.bounds) == (60, (40, 0, 100, 100))
    free, _ = gap_between(box(0, 0, 40, 100), box(100, 0, 140, 100), [shapely.box(60, 40, 70, 60)])
    assert free.area == pytest.approx(6000 - 200)
    with pytest.raises(InputError, match="no gap"):
        gap_between(box(0, 0, 40, 40), box(40, 0, 80, 40))
    with pytest.raises(InputError, match="Nothing is free"):
        gap_between(box(0, 0, 40, 40), box(60, 0, 100, 40), [shapely.box(30, 0, 70, 40)])


def test_a_bay_is_the_largest_dent() -> None:
    bay = bay_of(outline_of(U_SHAPE), None)
    assert bay.bounds == (30, 0, 70, 70)
    assert bay_of(outline_of(U_SHAPE), "top").bounds == (30, 0, 70, 70)
    assert bay_of(outline_of(rotate(U_SHAPE, 90)), "right").area == pytest.approx(2800, rel=0.01)
    with pytest.raises(InputError, match="no bay on its left"):
        bay_of(outline_of(U_SHAPE), "left")
    with pytest.raises(InputError, match="no bay:"):
        bay_of(box(0, 0, 40, 40), None)
    with pytest.raises(InputError, match="Nothing is free in that bay"):
        bay_of(outline_of(U_SHAPE), None, [shapely.box(20, -10, 80, 80)])


def test_of_two_bays_alike_one_has_to_be_named() -> None:
    letter_h = U_SHAPE | rotate(U_SHAPE, 180, origin=(50, 100))
    with pytest.raises(InputError, match=r"2 bays about as large \(bottom, top\)"):
        bay_of(outline_of(letter_h), None)
    assert bay_of(outline_of(letter_h), "bottom").bounds == (30, 130, 70, 200)


HALVES: list[tuple[PartName, tuple[float, ...]]] = [
    ("left half", (0, 0, 50, 100)),
    ("right half", (50, 0, 100, 100)),
    ("top half", (0, 0, 100, 50)),
    ("bottom half", (0, 50, 100, 100)),
]


@pytest.mark.parametrize(("part", "bounds"), HALVES)
def test_halves_go_by_what_the_picture_shows(part: PartName, bounds: tuple[float, ...]) -> None:
    assert part_of(box(0, 0, 100, 100), part).bounds == pytest.approx(bounds, abs=1e-6)


@FEW
@given(SOMETHING, st.sampled_from([("left half", "right half"), ("top half", "bottom half")]))
def test_two_halves_are_the_whole(thing: Outline, names: tuple[PartName, PartName]) -> None:
    one, other = (part_of(thing, name) for name in names)
    assert one.area + other.area == pytest.approx(thing.area, rel=1e-3)
    assert one.filled.intersection(other.filled).area <= 1e-6 * thing.area + 1e-3


@FEW
@given(st.floats(-55, 55))
def test_an_end_goes_by_the_long_axis(turn: float) -> None:
    stick = rotate(shapely.box(-10, -100, 10, 100), turn, origin=(0, 0))
    end = part_of(outline_of(stick), "top end")
    assert end.area == pytest.approx(stick.area / 4, rel=0.01)
    away = np.array(end.centre)
    tip = 75 * np.array((math.sin(math.radians(turn)), -math.cos(math.radians(turn))))
    assert away == pytest.approx(tip, abs=1)


def test_what_is_not_long_that_way_has_no_end_there() -> None:
    with pytest.raises(InputError, match="no left end"):
        part_of(box(0, 0, 20, 100), "left end")
    with pytest.raises(InputError, match="name a half"):
        part_of(box(0, 0, 100, 100), "top end")
