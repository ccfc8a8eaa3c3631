"""As many as fit where they stand, the same elsewhere, and from between two things to one."""

from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.editing.edit_kinds import Edit
from formup.tools.formation.editing.edits import Edited, edited
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import distances, make_outline
from formup.tools.geometry.sampling import nearest
from pydantic import TypeAdapter

BOX = make_outline([(200, 260), (330, 260), (330, 400), (200, 400)])
POST = make_outline([(700, 250), (760, 250), (760, 430), (700, 430)])
ANGLE = np.linspace(0, 2 * np.pi, 120, endpoint=False)
DISC = make_outline(np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1) * 50 + (500, 200))
SITE = Site({"t1": BOX, "t2": POST, "t3": DISC}, 1000, 700)
RADIUS = 4.0
READ: TypeAdapter[Any] = TypeAdapter(Edit)


def standing(relation: str = "around", n: int = 8, **more: Any) -> Plan:
    group = Group.model_validate({"relation": relation, "targets": ("t1",), "robots": n} | more)
    plan = make_plan(Contract(groups=(group,), robot_radius=RADIUS), SITE, "s")
    assert plan.verdict.certified
    return plan


def after(plan: Plan, *edits: dict[str, Any]) -> Edited:
    return edited(plan, [READ.validate_python(e) for e in edits], SITE, lambda _: "s")


def groups(found: Edited) -> list[tuple[str, tuple[str, ...], int]]:
    contract = found.plan.formation.contract
    return [(g.relation, g.targets, g.robots) for g in contract.groups]


@pytest.mark.parametrize("px", [15, 30, 70])
@pytest.mark.parametrize(
    "group",
    [
        {"relation": "around", "clearance": (20, 60)},
        {"relation": "cage"},
        {"relation": "along", "side": "left"},
        {"relation": "around", "pitch": 60, "n": 10},
        {"relation": "shape", "line": (100, 60, 900, 60)},
    ],
    ids=str,
)
def test_as_many_as_fit_so_far_apart_stay_as_far_from_the_thing(
    group: dict[str, Any], px: float
) -> None:
    plan = standing(**group)
    found = after(plan, {"kind": "spacing", "px": px}, {"kind": "count", "robots": "fit"})
    assert found.plan.verdict.certified
    at = found.plan.formation.points
    apart = nearest(at, at, 2)[0][:, 1]
    assert apart.min() >= px - 0.01
    assert apart.mean() < px * (1 + 2 / len(at)) + 2
    if group["relation"] != "shape":
        was, now = (distances(BOX.filled, p.formation.points) for p in (plan, found.plan))
        assert now.min() == pytest.approx(was.min(), abs=0.1)
    one_more = after(found.plan, {"kind": "add", "n": 1}).plan.verdict
    assert "too_close" in {f.kind for f in one_more.findings}


@pytest.mark.parametrize("relation", ["around", "cage", "along"])
@pytest.mark.parametrize("px", [14, 24])
@pytest.mark.parametrize("robots", [None, 3])
def test_the_same_around_another_thing_is_as_near_to_it(
    relation: str, px: float, robots: int | None
) -> None:
    more: dict[str, Any] = {"side": "left"} if relation == "along" else {}
    plan = after(standing(relation, **more), {"kind": "distance", "px": px}).plan
    usual = standing(relation, **more).formation.contract.groups[0].clearance
    group = plan.formation.contract.groups[0].model_copy(update={"clearance": usual})
    contract = plan.formation.contract.model_copy(update={"groups": (group,)})
    plan = make_plan(contract, SITE, "s", plan.formation.points)
    found = after(plan, {"kind": "target", "to": "t2", "robots": robots})
    assert found.plan.verdict.certified
    there = found.plan.formation.points[-(robots or 8) :]
    assert distances(POST.filled, there).min() - RADIUS == pytest.approx(px, abs=0.2)


@pytest.mark.parametrize("relation", ["around", "cage", "corners", "inside", "centre"])
@pytest.mark.parametrize("start", ["between", "centre"])
def test_from_between_or_the_middle_to_about_the_first_or_the_one_named(
    start: str, relation: str
) -> None:
    targets = ("t1", "t2") if start == "between" else ("t1",)
    plan = standing(start, targets=targets, n=4)
    found = after(plan, {"kind": "arrange", "demands": {"relation": relation}})
    assert groups(found) == [(relation, ("t1",), 4)]
    assert found.plan.verdict.certified
    named = {"relation": relation, "targets": ["t2"]}
    assert groups(after(plan, {"kind": "arrange", "demands": named})) == [(relation, ("t2",), 4)]


def test_who_stands_between_two_goes_to_one_of_them_or_between_it_and_a_third() -> None:
    plan = standing("between", targets=("t1", "t2"), n=4)
    around = after(plan, {"kind": "target", "to": "t2"})
    assert groups(around) == [("around", ("t2",), 4)]
    third = after(plan, {"kind": "target", "to": "t3"})
    assert groups(third) == [("between", ("t1", "t3"), 4)]
    for found in (around, third):
        assert found.plan.verdict.certified


def test_so_far_from_what_they_are_gathered_in_is_round_it() -> None:
    found = after(standing("centre", n=5), {"kind": "distance", "px": 20})
    assert groups(found) == [("around", ("t1",), 5)]
    away = distances(BOX.filled, found.plan.formation.points) - RADIUS
    assert away == pytest.approx(np.full(5, 20.0), abs=1)
    assert found.plan.verdict.certified


def test_more_robots_stand_around_another_thing_as_those_that_are_there() -> None:
    plan = standing()
    found = after(plan, {"kind": "add", "n": 3, "to": "t2"})
    assert found.plan.verdict.certified
    assert groups(found) == [("around", ("t1",), 8), ("around", ("t2",), 3)]
    assert np.array_equal(found.plan.formation.points[:8], plan.formation.points)
    joined = after(found.plan, {"kind": "add", "n": 2, "to": "t2"})
    assert groups(joined) == [("around", ("t1",), 8), ("around", ("t2",), 5)]
    with pytest.raises(ToolError, match="no group 4"):
        after(found.plan, {"kind": "add", "n": 1, "to": "t2", "group": 4})


HEXAGON = {"relation": "shape", "shape": {"kind": "polygon", "corners": 6, "where": "around"}}


@pytest.mark.parametrize(
    ("more", "demands", "told"),
    [
        ({"opening": 40.0, "opening_towards": "right"}, HEXAGON, ("the opening",)),
        ({"clearance": (25.0, 26.0)}, HEXAGON, ("the distance",)),
        ({"sides": ("left",)}, {"relation": "inside"}, ("the sides",)),
        ({"opening": 40.0}, {"relation": "cage", "closure": "ring"}, ()),
        ({"clearance": (25.0, 26.0)}, {"relation": "cage", "closure": "ring"}, ()),
        ({}, HEXAGON, ()),
    ],
)
def test_what_another_arrangement_has_no_place_for_is_told(
    more: dict[str, Any], demands: dict[str, Any], told: tuple[str, ...]
) -> None:
    found = after(standing(**more), {"kind": "arrange", "demands": demands})
    lost = [n for n in found.plan.verdict.notes if n.startswith("Not carried over")]
    assert len(lost) == bool(told), lost
    assert all(words in note for note in lost for words in told)
