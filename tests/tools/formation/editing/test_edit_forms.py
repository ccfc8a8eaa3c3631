"""Drawn forms that are edited stay what they are, as far as a contract can say it."""

from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.contract import Contract, Group, ShapeSpec
from formup.tools.formation.editing.edit_kinds import (
    Add,
    Edit,
    Mirror,
    Offset,
    Remove,
    Rotate,
    Scale,
    Shift,
    SideOnly,
    Skip,
)
from formup.tools.formation.editing.edits import Edited, edited
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import make_outline
from pydantic import TypeAdapter

SITE = Site(
    {
        "t1": make_outline([(400, 250), (560, 250), (560, 380), (400, 380)]),
        "t2": make_outline([(760, 300), (800, 300), (800, 340), (760, 340)]),
    },
    1000,
    700,
)
BOX = (120.0, 120.0, 320.0, 300.0)
FORMS: dict[str, dict[str, Any]] = {
    "letters": {"kind": "letters", "text": "HI", "where": "left"},
    "outlined": {"kind": "outlined_letters", "text": "R2", "box": BOX},
    "star": {"kind": "star", "where": "around"},
    "polygon": {"kind": "polygon", "corners": 3, "where": "inside"},
    "grid": {"kind": "grid", "rows": 3, "where": "right"},
    "wide grid": {"kind": "grid", "rows": 4, "box": BOX},
    "arc": {"kind": "arc", "angles": (180, 300), "box": BOX},
    "circle": {"kind": "circle", "where": "on"},
    "v": {"kind": "v", "where": "around"},
    "half circle": {"kind": "arc", "where": "left"},
    "line": {"kind": "line", "where": "below"},
    "polyline": {"kind": "polyline", "points": ((120, 150), (200, 90), (300, 260))},
    "hook": {"kind": "polyline", "points": ((0, 0), (1, 1), (2, 0)), "where": "above"},
}
each = pytest.mark.parametrize("name", FORMS)


def standing(name: str, n: int = 12) -> Plan:
    targets = ("t1",) if "where" in FORMS[name] else ()
    group = {"relation": "shape", "targets": targets, "robots": n, "shape": FORMS[name]}
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=2)
    return make_plan(contract, SITE, "s")


def after(name: str, edit: Edit) -> tuple[Plan, Edited]:
    plan = standing(name)
    assert plan.verdict.certified
    return plan, edited(plan, (edit,), SITE, lambda _: "s")


def form(found: Edited) -> ShapeSpec | None:
    return found.plan.formation.contract.groups[0].shape


@each
def test_a_shifted_form_is_the_same_form_elsewhere(name: str) -> None:
    plan, found = after(name, Shift(dx=13, dy=-9))
    assert found.plan.verdict.findings == ()
    moved = found.plan.formation.points - plan.formation.points
    assert np.allclose(moved, (13, -9), atol=1e-3)
    shape = form(found)
    assert shape is not None
    assert shape.kind in (FORMS[name]["kind"], "polyline")


@each
@pytest.mark.parametrize("factor", [0.8, 1.15])
def test_a_form_scaled_there_and_back_is_itself(name: str, factor: float) -> None:
    plan, found = after(name, Scale(factor=factor))
    assert found.plan.verdict.findings == ()
    assert form(found) is not None
    again = edited(found.plan, (Scale(factor=1 / factor),), SITE, lambda _: "s")
    assert again.plan.verdict.findings == ()
    before, now = (np.ptp(p.formation.points, axis=0) for p in (plan, again.plan))
    assert np.allclose(before, now, atol=0.01)


@each
def test_a_turned_form_is_exact_and_named_where_a_contract_can(name: str) -> None:
    plan, found = after(name, Rotate(degrees=-20))
    assert found.plan.verdict.findings == ()
    a, b = (p.formation.points - p.formation.points.mean(axis=0) for p in (plan, found.plan))
    c, s = np.cos(np.radians(-20)), np.sin(np.radians(-20))
    assert np.allclose(a @ np.array([[c, s], [-s, c]]), b, atol=1e-3)
    nameless = FORMS[name]["kind"] in ("letters", "outlined_letters", "grid")
    assert (form(found) is None) == nameless


@each
@pytest.mark.parametrize("axis", ["left-right", "top-bottom"])
def test_a_mirrored_form_stands_in_the_mirrored_place(name: str, axis: Any) -> None:
    plan, found = after(name, Mirror(axis=axis))
    assert found.plan.verdict.findings == ()
    k = 0 if axis == "left-right" else 1
    targets = plan.formation.contract.groups[0].targets
    middle = np.asarray((480.0, 315.0)) if targets else plan.formation.points.mean(axis=0)
    old, new = plan.formation.points[:, k], found.plan.formation.points[:, k]
    written = FORMS[name]["kind"] in ("letters", "outlined_letters")
    off = 12 if written else 0.01  # robots do not stand at all ends of letters
    assert 2 * middle[k] - old.max() == pytest.approx(new.min(), abs=off)
    shape = form(found)
    assert shape is not None
    if written:  # and can still be read
        assert (shape.kind, shape.text) == (FORMS[name]["kind"], FORMS[name]["text"])


@each
@pytest.mark.parametrize("edit", [Add(n=5), Remove(robots=(2, 7)), Remove(n=1)])
def test_more_or_fewer_robots_share_the_form(name: str, edit: Add | Remove) -> None:
    _, found = after(name, edit)
    assert found.plan.verdict.findings == ()
    assert form(found) is not None
    assert len(found.plan.formation.points) == found.plan.formation.contract.robots


@each
def test_a_skipped_place_of_a_form_stays_empty(name: str) -> None:
    plan, found = after(name, Skip(robots=(4,)))
    assert found.plan.verdict.findings == ()
    assert np.array_equal(found.plan.formation.points, np.delete(plan.formation.points, 3, axis=0))


def test_a_form_inside_goes_out_towards_the_edge() -> None:
    plan, found = after("polygon", Offset(kind="out", px=2))
    assert found.plan.verdict.findings == ()
    before, now = (np.ptp(p.formation.points, axis=0) for p in (plan, found.plan))
    assert (now > before).all()


def test_a_form_does_not_leave_the_picture() -> None:
    with pytest.raises(ToolError, match="out of the 1000 x 700 px picture"):
        after("star", Shift(dx=900))


def test_the_side_that_faced_another_thing_gives_way_to_one_that_is_named() -> None:
    group = {"relation": "along", "targets": ("t1",), "robots": 4, "facing": "t2"}
    plan = make_plan(Contract(groups=(Group.model_validate(group),)), SITE, "s")
    found = edited(plan, (SideOnly(side="left"),), SITE, lambda _: "s")
    assert found.plan.verdict.findings == ()
    assert (found.plan.formation.points[:, 0] < 400).all()


def test_a_thing_that_is_its_own_mirror_image_keeps_its_ring() -> None:
    cup = make_outline([(420, 140), (600, 140), (600, 180), (460, 180), (460, 290), (600, 290),
                        (600, 330), (420, 330)])  # fmt: skip
    site = Site({"t1": cup}, 1000, 700)
    group = Group(relation="around", targets=("t1",), robots=8)
    plan = make_plan(Contract(groups=(group,)), site, "s")
    found = edited(plan, (Mirror(axis="top-bottom"),), site, lambda _: "s")
    assert found.plan.verdict.certified


def test_edges_are_those_on_the_other_side_of_the_mirror() -> None:
    group = Group(relation="along", targets=("t1",), robots=4, edges=(0,))
    plan = make_plan(Contract(groups=(group,)), SITE, "s")
    wide, high = np.ptp(plan.formation.points, axis=0)
    axis = "top-bottom" if wide > high else "left-right"
    found = edited(
        plan,
        (TypeAdapter(Edit).validate_python({"kind": "mirror", "axis": axis}),),
        SITE,
        lambda _: "s",
    )
    assert found.plan.formation.contract.groups[0].edges == (2,)
    assert found.plan.verdict.findings == ()
