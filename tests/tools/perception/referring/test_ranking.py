"""Superlatives and the odd one out: won by a clear margin, or handed to a person."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from formup.tools.geometry.outline import FloatArray, make_outline
from formup.tools.perception.referring.attributes import Attributes, Candidate, ShapeName
from formup.tools.perception.referring.relations import Pick, Query, Selection, select
from hypothesis import given, settings
from hypothesis import strategies as st

FEW = settings(derandomize=True, deadline=None, max_examples=60)
WIDTH, HEIGHT = 1000, 800
RED, GREEN, BLUE = (50.0, 65.0, 45.0), (55.0, -50.0, 45.0), (40.0, 10.0, -55.0)
DISC = np.array([(math.cos(t), math.sin(t)) for t in np.arange(96) * math.pi / 48]) * 20
SQUARE = np.array([(-20, -20), (20, -20), (20, 20), (-20, 20)], dtype=float)
BAR = SQUARE * (2, 0.6)
TRIANGLE = np.array([(0, -26), (22.5, 13), (-22.5, 13)], dtype=float)
PENTAGON = np.array([(math.cos(t), math.sin(t)) for t in np.arange(5) * math.pi * 0.4]) * 22
# Overlaps of traced shapes with drawn ones, as the detector measures them.
FITS: dict[int, dict[ShapeName, float]] = {
    96: {"circle": 0.99, "hexagon": 0.93, "pentagon": 0.91, "square": 0.83, "irregular": 0.82},
    4: {"square": 0.98, "circle": 0.83, "hexagon": 0.82, "pentagon": 0.83, "irregular": 0.82},
    5: {"pentagon": 0.99, "circle": 0.92, "hexagon": 0.9, "square": 0.82, "irregular": 0.82},
    3: {"triangle": 0.99, "hexagon": 0.7, "square": 0.6, "circle": 0.6, "irregular": 0.82},
}


def thing(
    name: int,
    x: float,
    y: float,
    ring: FloatArray = DISC,
    turn: float = 0.0,
    scale: float = 1.0,
    **changes: Any,
) -> Candidate:
    """A red thing around a place, turned clockwise by degrees."""
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    outline = make_outline(ring @ np.array([[c, s], [-s, c]]) * scale + np.array([x, y]))
    axis, long, short = outline.long_axis
    attributes = Attributes(
        colours=(("red", 1.0),),
        lab=RED,
        area=outline.area,
        centre=(x, y),
        orientation=math.degrees(math.atan2(axis[1], axis[0])) % 180,
        elongation=long / short,
        roundness=4 * math.pi * outline.area / outline.perimeter**2,
        shapes=tuple(sorted(FITS[len(ring)].items(), key=lambda f: -f[1])),
        hole=0.0,
        touches_border=False,
    )
    return Candidate(f"c{name}", outline, replace(attributes, **changes), 0.9)


def found(things: list[Candidate], *by: str, place: int = 1, **query: Any) -> Selection:
    picks = tuple(Pick.model_validate({"by": b, "place": place}) for b in by)
    selection = select(things, Query(picks=picks, **query), WIDTH, HEIGHT)
    assert selection.settled == (not selection.doubt)
    assert not selection.settled or len(selection.matches) == 1
    return selection


def ids(selection: Selection) -> list[str]:
    return [m.id for m in selection.matches]


def answer(things: list[Candidate], *by: str, place: int = 1) -> str:
    """The id it settles on, else all that are to choose from, the best first, with a "?"."""
    selection = found(things, *by, place=place)
    return " ".join(ids(selection)) + ("" if selection.settled else "?")


# Rankings: (pick, the winner, one just clearly behind, one too near)
CASES: list[tuple[str, dict[str, Any], dict[str, Any], dict[str, Any]]] = [
    ("largest", {"area": 5210.0}, {"area": 4500.0}, {"area": 4600.0}),
    ("smallest", {"area": 1000.0}, {"area": 1160.0}, {"area": 1140.0}),
    ("longest", {"scale": 1.2}, {"scale": 1.0}, {"scale": 1.1}),
    ("roundest", {"roundness": 0.91}, {"roundness": 0.85}, {"roundness": 0.87}),
    ("lightest", {"lab": (80, 0, 0)}, {"lab": (71, 0, 0)}, {"lab": (73, 0, 0)}),
    ("darkest", {"lab": (20, 0, 0)}, {"lab": (29, 0, 0)}, {"lab": (27, 0, 0)}),
    ("leftmost", {"x": 100}, {"x": 121}, {"x": 119}),
    ("rightmost", {"x": 900}, {"x": 879}, {"x": 881}),
    ("topmost", {"y": 100}, {"y": 117}, {"y": 115}),
    ("bottommost", {"y": 700}, {"y": 683}, {"y": 685}),
    ("upper_left", {"x": 100, "y": 0}, {"x": 155, "y": 0}, {"x": 145, "y": 0}),
    ("upper_right", {"x": 899, "y": 0}, {"x": 845, "y": 0}, {"x": 855, "y": 0}),
    ("lower_left", {"x": 100, "y": 799}, {"x": 155, "y": 799}, {"x": 145, "y": 799}),
    ("lower_right", {"x": 899, "y": 799}, {"x": 845, "y": 799}, {"x": 855, "y": 799}),
    ("middle", {"x": 510, "y": 400}, {"x": 435, "y": 400}, {"x": 550, "y": 400}),
    ("farthest_from_border", {"y": 300}, {"y": 283}, {"y": 285}),
    ("nearest_to_border", {"y": 100}, {"y": 117}, {"y": 115}),
]


@pytest.mark.parametrize(("by", "winner", "behind", "near"), CASES, ids=[c[0] for c in CASES])
def test_a_pick_is_won_by_a_clear_margin_only(by: str, winner: Any, behind: Any, near: Any) -> None:
    base = {"x": 500, "y": 400, "ring": BAR if by == "longest" else DISC}
    best, second, close = (thing(i, **(base | c)) for i, c in enumerate((winner, behind, near), 5))
    assert answer([second, best], by) == "c5"
    assert answer([close, best], by) == "c5 c7?"
    assert answer([second, best], by, place=2) == "c6"
    assert answer([close, best], by, place=2) == "c7 c5?"
    assert answer([best, second], by, place=3) == "?"


def test_the_reason_has_both_numbers() -> None:
    things = [thing(1, 100, 90, area=5210), thing(2, 200, 90, area=3900), thing(3, 300, 90)]
    assert found(things, "largest").matches[0].reasons == ("area 5,210 px, the next 3,900 px",)
    assert found(things, "largest", place=2).matches[0].reasons == (
        "area 3,900 px, the one before 5,210 px, the next 1,256 px",
    )
    close = found([*things, thing(4, 400, 90, area=5050)], "largest")
    assert close.doubt == "two things are almost equally large: c1 5,210 px, c4 5,050 px"
    assert close.matches[1].reasons == ("area 5,050 px, c1 5,210 px",)


def test_there_is_no_third_of_two() -> None:
    things = [thing(1, 100, 90), thing(2, 200, 90)]
    assert found(things, "leftmost", place=3).doubt == (
        "there are 2 things to pick from, so there is no place 3"
    )
    assert "only 1 thing" in found(things[:1], "leftmost", place=2).doubt
    assert answer(things[:1], "leftmost") == "c1"


def test_a_side_is_won_by_the_edge_as_well_as_by_the_centre() -> None:
    large, small = thing(1, 200, 400, scale=5), thing(2, 150, 400)
    assert answer([large, small], "leftmost") == "c2 c1?"
    assert answer([large, thing(2, 105, 400)], "leftmost") == "c2"


def test_a_plate_longer_than_a_pencil_leaves_doubt() -> None:
    plate, pencil = thing(1, 300, 300, scale=3), thing(2, 600, 300, BAR)
    assert answer([plate, pencil], "longest") == "c1 c2?"
    assert answer([plate, thing(3, 600, 600)], "longest") == "c1"


def test_the_middle_of_a_row_at_one_side_leaves_doubt() -> None:
    row = [thing(i, 60 + 90 * i, 400) for i in (1, 2, 3)]
    assert answer(row, "middle") == "c3 c2?"
    centred = [thing(i, 140 + 120 * i, 400) for i in (1, 2, 3, 4, 5)]
    assert answer(centred, "middle") == "c3"
    reaching = [thing(i, 140 + 80 * i, 400) for i in (1, 2, 3)]
    assert answer(reaching, "middle") == "c3", "it is near enough to the picture's centre"
    assert answer([thing(i, 120 + 80 * i, 400) for i in (1, 2, 3)], "middle") == "c3 c2?"


def test_what_the_others_lie_on_may_not_be_one_of_them() -> None:
    coins = [thing(1, 300, 300, scale=2), thing(2, 360, 360), thing(3, 300, 400)]
    tray = thing(4, 320, 340, SQUARE, scale=6)
    assert answer([*coins, tray], "largest") == "c1 c4?"
    assert found([*coins, tray], "largest").doubt == (
        "c4 may be meant too (3 of the others lie within its outline)"
    )
    assert answer([*coins, tray], "smallest") == "c2 c3?"
    assert answer([coins[0], tray], "largest") == "c4"
    assert answer([*coins, tray], "leftmost") == "c1 c3 c4?"


def test_picks_must_not_contradict_each_other() -> None:
    things = [thing(1, 100, 100, scale=2), thing(2, 300, 100), thing(3, 500, 100)]
    assert answer(things, "largest", "leftmost") == "c1"
    other = [thing(1, 800, 100, scale=2), *things[1:]]
    assert answer(other, "largest", "leftmost") == "c1 c2?"
    assert found(other, "largest", "leftmost").doubt == "c1 is largest, but leftmost is c2"
    tie = [thing(1, 800, 100), thing(2, 100, 100), thing(3, 300, 100, scale=0.5)]
    assert answer(tie, "largest", "leftmost") == "c2 c1?", "the leftmost large one comes first"


def test_a_possible_rival_unsettles_only_what_it_could_win() -> None:
    half = (("green", 0.6), ("red", 0.4))
    things = [thing(1, 100, 400), thing(2, 300, 400)]
    left, right = thing(3, 50, 600, colours=half), thing(3, 200, 600, colours=half)
    selection = found([*things, left], "leftmost", colours=["red"])
    assert (ids(selection), selection.settled) == (["c1", "c3"], False)
    assert selection.doubt.startswith("c3 may be red too (red 40 %")
    assert found([*things, right], "leftmost", colours=["red"]).settled
    second = found([*things, left], "leftmost", place=2, colours=["red"])
    assert (ids(second), second.settled) == (["c2", "c1"], False)


@pytest.mark.parametrize(("gap", "settled"), [(160, True), (155, False), (110, False)])
def test_alone_is_far_from_its_nearest_neighbour(gap: int, settled: bool) -> None:
    pair = [thing(1, 100, 400), thing(2, 240, 400)]  # 100 px apart
    selection = found([*pair, thing(3, 280 + gap, 400)], "alone")
    assert (selection.settled, ids(selection)[0]) == (settled, "c3")
    assert ("none stands alone" in selection.doubt) == (gap == 110)
    assert (
        selection.matches[0].reasons[0].startswith(f"nearest neighbour at {gap} px, the next 100")
    )


# The odd one out


def crowd(count: int, first: int = 1, y: float = 100, **same: Any) -> list[Candidate]:
    return [thing(first + i, 60 + 90 * i, y, **same) for i in range(count)]


JUNK = [
    thing(50, 100, 700, TRIANGLE, scale=4, lab=GREEN),
    thing(51, 400, 700, BAR, scale=3, lab=BLUE),
    thing(52, 700, 700, SQUARE, scale=0.3),
]
ODD: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    ("odd_colour", {"lab": (50, 65, 63.1)}, {"lab": (50, 65, 62.9)}),
    ("odd_size", {"scale": 1.23}, {"scale": 1.22}),
    ("odd_size", {"scale": 0.81}, {"scale": 0.82}),
    ("odd_shape", {"roundness": 0.87}, {"roundness": 0.89}),
    ("odd_shape", {"elongation": 1.31}, {"elongation": 1.29}),
    ("odd_shape", {"hole": 0.13}, {"hole": 0.11}),
    ("odd_shape", {"ring": SQUARE}, {"ring": DISC}),
]


@pytest.mark.parametrize(("by", "odd", "alike"), ODD)
def test_the_odd_one_differs_by_a_clear_step(by: str, odd: Any, alike: Any) -> None:
    things = [*crowd(4), *JUNK]
    assert answer([*things, thing(9, 800, 300, **odd)], by) == "c9"
    assert answer([*things, thing(9, 800, 300, **odd)], "odd") == "c9"
    selection = found([*things, thing(9, 800, 300, **alike)], by)
    assert (selection.matches, selection.lacking) == ((), "")
    assert selection.doubt.startswith("none of 8 things stands out by")
    for other in {"odd_colour", "odd_size", "odd_shape", "askew"} - {by}:
        assert answer([*things, thing(9, 800, 300, **odd)], other) == "?"


def test_the_reasons_have_the_aspect_and_its_numbers() -> None:
    def reason(by: str, **odd: Any) -> str:
        return found([*crowd(4), thing(9, 800, 300, **odd)], by).matches[0].reasons[0]

    assert reason("odd_colour", lab=(50, 65, 75)).startswith(
        "its colour is 30 CIE76 units from the 4 things like it"
    )
    assert reason("odd_size", scale=2).startswith("its area is 4.00 times that of the 4 things")
    assert "(square, roundness 0.79" in reason("odd_shape", ring=SQUARE)


def test_three_alike_are_needed_and_two_leave_doubt() -> None:
    odd = thing(9, 800, 300, lab=BLUE)
    assert answer([*crowd(3), odd], "odd_colour") == "c9"
    assert answer([*crowd(2), odd], "odd_colour") == "c9?"
    assert "c9 may stand out, not clearly: its colour is" in found([*crowd(2), odd], "odd").doubt
    assert answer([*crowd(1), odd], "odd_colour") == "?"


def test_a_few_alike_among_many_things_may_be_chance() -> None:
    many = [thing(60 + i, 60 + 90 * i, 600, TRIANGLE, scale=1.4**i) for i in range(9)]
    odd = thing(9, 800, 300, lab=BLUE)
    assert answer([*crowd(3), odd, *many[:2]], "odd_colour") == "c9"
    assert answer([*crowd(3), odd, *many], "odd_colour") == "c9"
    assert answer([*crowd(3), odd, *many, *JUNK], "odd_colour") == "c9?"


def test_two_odd_ones_are_asked_about_and_two_camps_have_none() -> None:
    two = [thing(8, 800, 300, lab=BLUE), thing(9, 800, 500, lab=BLUE)]
    assert answer([*crowd(5), *two], "odd") == "c8 c9?"
    assert found([*crowd(5), *two], "odd").doubt == "2 things stand out: c8, c9"
    assert answer([*crowd(5), *crowd(5, 21, 300, lab=BLUE)], "odd_colour") == "?"
    assert answer([*crowd(8), *crowd(3, 21, 300, lab=BLUE)], "odd_colour") == "?"
    assert answer([*crowd(9), *crowd(3, 21, 300, lab=BLUE)], "odd_colour") == "c21 c22 c23?"


def test_the_larger_group_decides_by_half_as_many_more() -> None:
    bars = crowd(3, 31, 500, ring=BAR)
    things = [*bars, thing(8, 800, 500, BAR, lab=BLUE), thing(9, 800, 300, lab=BLUE)]
    assert answer([*crowd(5), *things], "odd") == "c9"
    assert answer([*crowd(4), *things], "odd") == "c9 c8?"


def test_colours_that_vary_by_nature_hide_a_small_difference() -> None:
    def leaves(odd: float) -> list[Candidate]:
        spread = [thing(i, 60 + 90 * i, 100, lab=(50 + 5 * (i - 4), -30, 30)) for i in range(1, 8)]
        return [*spread, thing(9, 800, 300, lab=(50, -30 + odd, 30))]

    assert answer(leaves(19), "odd_colour") != "c9"
    assert answer(leaves(60), "odd_colour") == "c9"


@pytest.mark.parametrize(("step", "answers"), [(0.52, True), (0.48, False)])
def test_the_odd_one_lies_two_and_a_half_spreads_out(step: float, answers: bool) -> None:
    sizes = [thing(i, 60 + 90 * i, 100, area=1000 * math.exp(0.2 * (i - 2))) for i in (1, 2, 3)]
    odd = thing(9, 800, 300, area=1000 * math.exp(step))
    assert (answer([*sizes, odd], "odd_size") == "c9") == answers
    lights = [thing(i, 60 + 90 * i, 100, lab=(50 + 20 * (i - 2), 0, 0)) for i in (1, 2, 3)]
    odd = thing(9, 800, 300, lab=(50, 0, 100 * step))
    assert (answer([*lights, odd], "odd_colour") == "c9") == answers


def test_sizes_that_run_through_have_no_odd_one() -> None:
    run = [thing(i, 60 + 90 * i, 100, scale=1.15**i) for i in range(1, 8)]
    assert not found(run, "odd_size").settled


def test_colour_counts_for_size_and_turn_in_no_way() -> None:
    labs = [RED, GREEN, BLUE, (80.0, 0.0, 0.0), (20.0, 0.0, 0.0)]
    cars = [thing(i, 60 + 90 * i, 100, BAR, lab=lab) for i, lab in enumerate(labs, 1)]
    assert answer([*cars, thing(9, 800, 300, BAR, lab=(60, 30, 0), turn=31)], "askew") == "c9"
    assert answer([*cars, thing(9, 800, 300, BAR, lab=(60, 30, 0), scale=2)], "odd_size") == "c9"


@pytest.mark.parametrize(
    ("ring", "turn", "odd"),
    [(BAR, 12.1, True), (BAR, 11.9, False), (BAR, 90, True), (BAR, 179, False), (BAR, -40, True),
     (SQUARE, 45, True), (SQUARE, 91, False), (SQUARE, 80, False), (TRIANGLE, 30, True),
     (TRIANGLE, 60, False), (PENTAGON, 18, True), (PENTAGON, 36, False), (DISC, 45, False)],
)  # fmt: skip
def test_askew_minds_what_a_turn_leaves_unchanged(ring: FloatArray, turn: float, odd: bool) -> None:
    things = [*crowd(5, ring=ring), *JUNK, thing(9, 800, 300, ring, turn)]
    assert answer(things, "askew") == ("c9" if odd else "?")
    if odd and ring is BAR:
        reason = found(things, "askew").matches[0].reasons[0]
        assert reason.startswith(f"turned {min(turn % 180, -turn % 180):.0f} degrees from the 5")


def test_askew_must_beat_three_times_the_spread() -> None:
    loose = [thing(i, 60 + 90 * i, 100, BAR, turn=6 * (i - 3)) for i in range(1, 6)]
    assert answer([*loose, thing(9, 800, 300, BAR, 30)], "askew") != "c9"
    assert answer([*loose, thing(9, 800, 300, BAR, 60)], "askew") == "c9"


def test_odd_is_decided_among_what_fits_and_one_left_is_it() -> None:
    green = (("green", 1.0),)
    things = [*crowd(4), *crowd(4, 21, 300, colours=green), thing(9, 800, 100, scale=2)]
    large = thing(29, 800, 300, scale=2, colours=green)
    assert not found([*things, large], "odd_size").settled
    selection = found([*things, large], "odd_size", colours=["green"])
    assert (ids(selection), selection.settled) == (["c29"], True)
    alone = [*crowd(4), thing(9, 800, 100, colours=green, lab=GREEN)]
    assert found(alone, "odd", colours=["green"]).settled


@given(
    st.lists(st.tuples(st.integers(30, 970), st.integers(30, 770)), min_size=2, max_size=8),
    st.sampled_from(["odd", "alone", "middle", "longest", "topmost", "farthest_from_border"]),
    st.sampled_from([DISC, BAR, SQUARE]),
)
@FEW
def test_a_mirror_changes_no_other_pick(
    places: list[tuple[int, int]], by: str, ring: FloatArray
) -> None:
    seen = [thing(i, x, y, ring, 7 * i, 1 + i % 3) for i, (x, y) in enumerate(places)]
    swapped = [
        thing(i, WIDTH - 1 - x, y, ring, -7 * i, 1 + i % 3) for i, (x, y) in enumerate(places)
    ]
    assert sorted(answer(seen, by)) == sorted(answer(swapped, by))


def test_two_hundred_things_are_decided() -> None:
    random = np.random.default_rng(0)
    places = random.uniform(30, 770, (200, 2))
    things = [thing(i, *at, lab=tuple(random.normal(50, 3, 3))) for i, at in enumerate(places)]
    things[77] = replace(things[77], attributes=replace(things[77].attributes, lab=(90, 0, 0)))
    assert answer(things, "odd") == "c77"
