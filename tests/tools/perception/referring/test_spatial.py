"""Things found by where others are, and what happens when those others are in doubt."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.geometry.outline import FloatArray, make_outline
from formup.tools.perception.referring.attributes import Attributes, Candidate
from formup.tools.perception.referring.relations import Query, Relation, Selection, select
from hypothesis import given, settings
from hypothesis import strategies as st

FEW = settings(derandomize=True, deadline=None, max_examples=60)
WIDTH, HEIGHT = 1000, 800


def disc(radius: float) -> FloatArray:
    t = np.linspace(0, 2 * math.pi, 144, endpoint=False)
    return np.stack([np.cos(t), np.sin(t)], axis=1) * radius


def box(x0: float, y0: float, x1: float, y1: float) -> FloatArray:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)


def thing(
    name: str, ring: FloatArray, blue: float = 0.0, gap: FloatArray | None = None
) -> Candidate:
    """A thing whose pixels are blue by this share and else grey."""
    outline = make_outline(ring, () if gap is None else (gap,))
    middle = outline.polygon.centroid
    colours = sorted([("blue", blue), ("grey", 1 - blue)], key=lambda c: -c[1])
    attributes = Attributes(
        colours=tuple(colours),  # pyright: ignore[reportArgumentType]
        lab=(50, 0, 0),
        area=outline.area,
        centre=(middle.x, middle.y),
        orientation=0,
        elongation=1,
        roundness=1,
        shapes=(("circle", 0.97),),
        hole=1 - outline.area / outline.filled.area,
        touches_border=False,
    )
    return Candidate(name, outline, attributes, 0.9)


def coin(name: str, x: float, y: float, radius: float = 10, blue: float = 0.0) -> Candidate:
    return thing(name, disc(radius) + np.array([x, y]), blue)


def found(candidates: list[Candidate], kind: str, *others: Any, **query: Any) -> Selection:
    relation = Relation.model_validate({"kind": kind, "things": others})
    return select(candidates, Query(relations=(relation,), **query), WIDTH, HEIGHT)


def ids(selection: Selection) -> list[str]:
    return [m.id for m in selection.matches]


def verdict(selection: Selection, name: str) -> str:
    """What is known of a thing: yes (it is the one), maybe or no."""
    if name not in ids(selection):
        return "no"
    return "yes" if selection.settled else "maybe"


BLUE = {"colours": ["blue"]}


# Nearest


@pytest.mark.parametrize(("gap", "settled"), [(60, True), (58, False)])
def test_nearest_goes_by_edges_and_a_fifth_more_is_clear(gap: float, settled: bool) -> None:
    pond = thing("c1", box(400, 300, 600, 500), blue=1)
    large = thing("c2", box(200, 300, 350, 500))  # 50 px from the pond, its centre far off
    small = thing("c3", box(600 + gap, 390, 610 + gap, 400))
    selection = found([pond, large, small], "nearest", BLUE)
    assert (selection.settled, ids(selection)[0]) == (settled, "c2")
    assert selection.matches[0].reasons == (f"distance to c1 50 px, the next {gap} px",)
    if not settled:
        assert selection.doubt == "two things are almost equally near to c1: c2 50 px, c3 58 px"


def test_things_that_touch_are_equally_near() -> None:
    pond = thing("c1", box(400, 300, 600, 500))
    both = [thing("c2", box(380, 300, 400, 320)), thing("c3", box(601, 300, 620, 320))]
    assert sorted(ids(found([pond, *both], "nearest", "c1"))) == ["c2", "c3"]


def test_nearest_is_decided_among_what_fits() -> None:
    things = [coin("c1", 100, 100), coin("c2", 140, 100), coin("c3", 300, 100, blue=1)]
    assert ids(found(things, "nearest", "c1")) == ["c2"]
    selection = found(things, "nearest", "c1", colours=["blue"])
    assert (ids(selection), selection.settled) == (["c3"], True)


# Inside


@pytest.mark.parametrize(
    ("x", "answer"), [(500, "yes"), (591, "yes"), (595, "maybe"), (609, "no"), (700, "no")]
)
def test_inside_is_nine_tenths_of_the_area(x: float, answer: str) -> None:
    plate = thing("c1", box(400, 300, 600, 500))
    selection = found([plate, coin("c2", x, 400, 10)], "inside", "c1")
    assert verdict(selection, "c2") == answer
    if not selection.matches:
        assert selection.doubt == "the one thing that fits otherwise is not inside c1"


def test_in_the_hole_of_a_ring_is_inside_but_on_its_material_is_not_clear() -> None:
    ring = thing("c1", disc(100) + 400, gap=disc(70) + 400)
    assert verdict(found([ring, coin("c2", 400, 420)], "inside", "c1"), "c2") == "yes"
    assert verdict(found([ring, coin("c2", 400, 485)], "inside", "c1"), "c2") == "maybe"
    plate = thing("c1", disc(100) + 400)
    assert verdict(found([plate, coin("c2", 400, 485)], "inside", "c1"), "c2") == "yes"


def test_the_thing_seen_twice_is_not_inside_itself() -> None:
    plate, again = thing("c1", disc(100) + 400), thing("c2", disc(98) + 400)
    assert found([plate, again], "inside", "c1").matches == ()


# Beside


@pytest.mark.parametrize(("gap", "answer"), [(5, "yes"), (99, "yes"), (120, "maybe"), (151, "no")])
def test_beside_is_within_the_size_of_the_other(gap: float, answer: str) -> None:
    crate = thing("c1", box(300, 300, 400, 400))
    assert verdict(found([crate, coin("c2", 410 + gap, 350)], "beside", "c1"), "c2") == answer


def test_what_is_on_a_thing_is_not_beside_it() -> None:
    crate = thing("c1", box(300, 300, 400, 400))
    things = [crate, coin("c2", 350, 350), coin("c3", 450, 350)]
    assert ids(found(things, "beside", "c1")) == ["c3"]


# Between


@given(st.integers(215, 785), st.integers(-300, 300))
@FEW
def test_between_is_a_lens_around_the_gap(x: int, off: int) -> None:
    ends = [thing("c1", box(180, 395, 200, 405)), thing("c2", box(800, 395, 820, 405))]
    answer = verdict(found([*ends, coin("c3", x, 400 + off)], "between", "c1", "c2"), "c3")
    share = (x - 200) / 600
    if 0.12 <= share <= 0.88 and abs(off) <= 0.15 * min(x - 200, 800 - x):
        assert answer == "yes"
    if abs(off) > 310 or share * (1 - share) * 600**2 < (abs(off) - 6) ** 2:
        assert answer == "no"
    if off == 0 and 0.03 < share < 0.08:
        assert answer == "maybe", "beside an end"


def test_between_two_banks_counts_wherever_along_them() -> None:
    banks = [thing("c1", box(100, 100, 900, 200)), thing("c2", box(100, 400, 900, 500))]
    for x in (120, 500, 880):
        assert verdict(found([*banks, coin("c3", x, 300)], "between", "c1", "c2"), "c3") == "yes"
    assert verdict(found([*banks, coin("c3", 980, 300)], "between", "c1", "c2"), "c3") == "maybe"
    assert verdict(found([*banks, coin("c3", 500, 150)], "between", "c1", "c2"), "c3") == "no"


def test_two_things_between_are_asked_about() -> None:
    ends = [coin("c1", 100, 400, blue=1), coin("c2", 900, 400, blue=1)]
    things = [*ends, coin("c3", 400, 400), coin("c4", 600, 400)]
    selection = found(things, "between", "c2", "c1")
    assert (selection.settled, selection.doubt) == (False, "2 things fit: c3, c4")
    assert verdict(found(things[:3], "between", BLUE, BLUE), "c3") == "yes"


# Others in doubt


def test_an_other_in_doubt_is_told_unless_all_readings_agree() -> None:
    blue = [coin("c1", 200, 200, blue=1), coin("c2", 800, 200, blue=0.4)]
    apart = [*blue, coin("c3", 260, 200), coin("c4", 740, 200)]
    selection = found(apart, "nearest", BLUE)
    assert (sorted(ids(selection)), selection.settled) == (["c3", "c4"], False)
    assert selection.doubt == (
        "the blue one could be c1 or c2 (c2 may be blue too (blue 40 % of its pixels))"
    )
    same = [*blue, coin("c3", 500, 200)]
    assert verdict(found(same, "nearest", BLUE), "c3") == "yes"


def test_an_other_that_only_possibly_exists_settles_nothing() -> None:
    things = [coin("c1", 200, 200, blue=0.4), coin("c2", 500, 200)]
    selection = found(things, "nearest", BLUE)
    assert verdict(selection, "c2") == "maybe"
    assert selection.doubt.startswith("the blue one could be c1 (c1 may be blue")
    two = [*things, coin("c3", 800, 200, blue=0.4)]
    assert verdict(found(two, "nearest", BLUE, shapes=["circle"], count=3), "c2") == "maybe"


def test_an_other_that_is_not_there_is_told() -> None:
    selection = found([coin("c1", 200, 200), coin("c2", 500, 200)], "nearest", BLUE)
    assert (selection.matches, selection.lacking) == ((), "")
    assert selection.doubt == (
        "nearest: the blue one is not there: none of 2 things is blue; there are grey 2"
    )


def test_a_thing_is_never_its_own_other() -> None:
    assert found([coin("c1", 200, 200)], "nearest", "c1").doubt == (
        "nothing but c1 itself fits otherwise"
    )
    pair = [coin("c1", 200, 200, blue=1), coin("c2", 500, 200, blue=1)]
    selection = found(pair, "nearest", BLUE, colours=["blue"])
    assert (sorted(ids(selection)), selection.settled) == (["c1", "c2"], False)


def test_too_many_readings_are_asked_about() -> None:
    crowd = [coin(f"c{i}", 20 + 10 * (i % 90), 20 + 30 * (i // 90), 3, 1) for i in range(1, 80)]
    selection = found([*crowd, coin("c900", 500, 700)], "below", BLUE)
    assert not selection.settled
    assert "c900" in ids(selection)


def test_an_unknown_candidate_is_an_error_the_model_can_mend() -> None:
    things = [coin("c1", 200, 200), coin("c2", 500, 200)]
    with pytest.raises(ToolError, match=r"There is no candidate c7; there are 2: c1, c2\."):
        found(things, "inside", "c7")
    with pytest.raises(ToolError, match="none"):
        found([], "inside", "c7")
    with pytest.raises(ToolError, match="two different things; got c1 twice"):
        found(things, "between", "c1", "c1")
    only = [replace(things[0], id="c1"), coin("c2", 500, 200, blue=1)]
    assert "one and the same" in found(only, "between", BLUE, "c2").doubt
