"""Targets that follow from others: several as one, the gap between two, a bay, a part."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from formup.tools.errors import ToolError
from formup.tools.perception.image import picture_from_array

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]


@pytest.fixture
def work(tool_calls: Begin) -> "ToolCalls":
    """On grey: a red and a blue box, a small green disc between them, and a white U below."""
    pixels = np.full((400, 600, 3), 90, np.uint8)
    pixels[60:160, 80:180] = (200, 40, 40)
    pixels[60:160, 340:440] = (40, 40, 220)
    y, x = np.ogrid[:400, :600]
    pixels[(x - 250) ** 2 + (y - 110) ** 2 < 16**2] = (40, 190, 60)
    pixels[220:360, 80:260] = 235
    pixels[220:310, 140:200] = 90
    made = tool_calls(picture_from_array(pixels))
    made.call("segment", id="t1", label="red box", box=(75, 55, 185, 165))
    made.call("segment", id="t2", label="blue box", box=(335, 55, 445, 165))
    return made


def candidate(work: "ToolCalls", colour: str) -> str:
    """The id of the one candidate of a colour."""
    found = work.call("locate_object", query={"colours": [colour]}).data["candidates"]
    assert len(found) == 1
    return found[0]["id"]


def derived(work: "ToolCalls", kind: str, *of: str, **more: Any) -> dict[str, Any]:
    return work.call("derive_target", kind=kind, of=of, id="t9", **more).data


def test_a_group_is_one_target_and_says_which_outline(work: "ToolCalls") -> None:
    made = derived(work, "group", "t1", "t2", label="the boxes")
    assert made["label"] == "the boxes"
    assert made["box"] == pytest.approx([79.5, 59.5, 439.5, 159.5], abs=2)
    green = candidate(work, "green")
    assert made["note"] == (
        f"Its outline is the convex hull of t1 and t2. It takes in {green} too."
    )
    group = {"relation": "around", "targets": ["t9"], "robots": 12}
    plan = work.call("propose_formation", contract={"groups": [group]})
    assert plan.data["certified"]


def test_a_group_does_not_cut_through_another_thing(work: "ToolCalls") -> None:
    green, white = candidate(work, "green"), candidate(work, "white")
    with pytest.raises(ToolError, match=f"of t2 and {white} cuts through {green}"):
        derived(work, "group", "t2", white)


def test_candidates_are_measured_for_it_and_leave_no_target(work: "ToolCalls") -> None:
    green = candidate(work, "green")
    derived(work, "group", "t1", green, "t2")
    assert [t.id for t in work.context.world.targets] == ["t1", "t2", "t9"]


def test_the_gap_between_two_is_free_of_what_lies_in_it(work: "ToolCalls") -> None:
    made = derived(work, "gap", "t1", "t2")
    assert made["note"].startswith("Free between t1 and t2, 160 px at its narrowest.")
    assert made["note"].endswith(f"Cut out of it: {candidate(work, 'green')}.")
    gap = work.context.world.target("t9").outline.polygon
    disc = shapely.Point(250, 110).buffer(15)
    boxes = shapely.union_all([work.context.world.target(t).outline.filled for t in ("t1", "t2")])
    assert gap.intersection(disc | boxes).area == pytest.approx(0, abs=1)
    group = {"relation": "inside", "targets": ["t9"], "robots": 6}
    plan = work.call("propose_formation", contract={"groups": [group]}).data
    assert plan["certified"]
    stood = [shapely.Point(p) for p in work.context.world.latest.plan.formation.positions]
    assert all(gap.covers(p) and not disc.covers(p) for p in stood)


def test_a_bay_is_a_free_place(work: "ToolCalls") -> None:
    white = candidate(work, "white")
    made = derived(work, "bay", white, where="top")
    assert made["box"] == pytest.approx([139.5, 219.5, 199.5, 309.5], abs=4)
    assert made["note"] == f"Free in a bay of {white}."


def test_a_part_is_cut_by_geometry_and_says_so(work: "ToolCalls") -> None:
    made = derived(work, "part", "t1", where="left half")
    assert made["label"] == "the left half of red box"
    assert made["box"] == pytest.approx([79.5, 59.5, 129.5, 159.5], abs=2)
    assert made["note"].startswith("Cut by geometry alone: 50 % of t1;")


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"kind": "group", "of": ["t1"]}, "a group is of 2 or more things; got 1"),
    ({"kind": "gap", "of": ["t1"]}, "a gap is between 2 things; got 1"),
    ({"kind": "gap", "of": ["t1", "t1"]}, "each thing is named once"),
    ({"kind": "part", "of": ["t1"]}, "where of a part is left half, right half"),
    ({"kind": "bay", "of": ["t1"], "where": "left half"}, "where of a bay is left, right, top"),
    ({"kind": "bay", "of": ["t1"]}, "no bay"),
    ({"kind": "part", "of": ["t1"], "where": "top end"}, "name a half"),
    ({"kind": "gap", "of": ["t1", "t7"]}, "no target 't7'"),
    ({"kind": "gap", "of": ["t1", "c99"]}, "c99"),
    ({"kind": "gap", "of": ["t1", "t2"], "id": "x"}, "id"),
]


@pytest.mark.parametrize(("arguments", "said"), WRONG)
def test_what_cannot_be_derived_is_refused_in_a_sentence(
    work: "ToolCalls", arguments: dict[str, Any], said: str
) -> None:
    before = work.context.world
    with pytest.raises(ToolError, match=said):
        work.call("derive_target", **arguments)
    assert work.context.world == before
