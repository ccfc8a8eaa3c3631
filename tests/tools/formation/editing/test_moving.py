"""Motions are as said, also where what the arrangement itself demands does not hold then."""

from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.editing.edit_kinds import Edit
from formup.tools.formation.editing.edits import Edited, edited
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import FloatArray, distances, make_outline
from pydantic import TypeAdapter

BED = make_outline([(440, 300), (560, 300), (560, 420), (500, 420), (500, 380), (440, 380)])
POST = make_outline([(800, 320), (850, 320), (850, 400), (800, 400)])
SITE = Site({"t1": BED, "t2": POST}, 1000, 700)
READ: TypeAdapter[Any] = TypeAdapter(Edit)
FREE = "places of their own"
GROUPS: dict[str, dict[str, Any]] = {
    "row": {"relation": "along", "side": "right", "robots": 5},
    "edge": {"relation": "along", "edges": [0], "robots": 4},
    "corners": {"relation": "corners", "robots": 4},
    "ring": {"relation": "around", "robots": 9},
    "half": {"relation": "around", "robots": 6, "sides": ["left half"]},
    "inside": {"relation": "inside", "robots": 5},
    "middle": {"relation": "centre", "robots": 4},
    "between": {"relation": "between", "targets": ["t1", "t2"], "robots": 4},
    "v": {"relation": "shape", "shape": {"kind": "v", "where": "left"}, "robots": 7},
    "square": {"relation": "shape", "shape": {"kind": "polygon", "corners": 4, "where": "below"}},
    "letter": {"relation": "shape", "shape": {"kind": "letters", "text": "L", "where": "above"}},
}
each = pytest.mark.parametrize("name", GROUPS)


def standing(name: str, **more: Any) -> Plan:
    group = {"targets": ["t1"], "robots": 8, **GROUPS[name], **more}
    plan = make_plan(Contract(groups=(Group.model_validate(group),), robot_radius=2), SITE, "s")
    assert plan.verdict.certified
    return plan


def after(plan: Plan, *edits: dict[str, Any]) -> Edited:
    return edited(plan, [READ.validate_python(e) for e in edits], SITE, lambda _: "s")


def points(found: Plan | Edited) -> FloatArray:
    return (found.plan if isinstance(found, Edited) else found).formation.points


def form(found: Plan | Edited) -> FloatArray:
    return points(found) - points(found).mean(axis=0)


def notes(found: Edited) -> str:
    return " ".join(found.plan.verdict.notes)


def off(found: Plan | Edited) -> float:
    return float(distances(BED.filled, points(found)).min())


@each
def test_a_formation_is_moved_as_far_as_was_said(name: str) -> None:
    plan = standing(name)
    found = after(plan, {"kind": "shift", "dx": -240, "dy": 130})
    np.testing.assert_allclose(
        points(found) - points(plan), [[-240, 130]] * len(points(plan)), atol=2e-3
    )
    assert found.plan.verdict.certified
    assert (FREE in notes(found)) == (name not in ("v", "square", "letter"))
    assert found.robots == plan.formation.robot_of_place


@each
@pytest.mark.parametrize("degrees", [90, -35])
def test_a_form_is_turned_as_far_as_was_said(name: str, degrees: float) -> None:
    plan = after(standing(name), {"kind": "shift", "dx": -240, "dy": 80}).plan
    found = after(plan, {"kind": "rotate", "degrees": degrees})
    assert found.plan.verdict.certified
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    np.testing.assert_allclose(form(plan) @ np.array([[c, s], [-s, c]]), form(found), atol=1e-2)


@pytest.mark.parametrize("name", ["row", "edge", "v", "square", "letter"])
@pytest.mark.parametrize(
    "edit",
    [
        {"kind": "rotate", "degrees": 90},
        {"kind": "rotate", "degrees": -50},
        {"kind": "scale", "factor": 1.2},
    ],
)
def test_what_turns_or_grows_beside_a_thing_is_kept_off_it(name: str, edit: dict[str, Any]) -> None:
    plan = standing(name)
    found = after(plan, edit)
    assert found.plan.verdict.certified
    assert off(found) > 2
    was, now = (p.mean(axis=0) - (500, 360) for p in (points(plan), points(found)))
    assert was @ now > 0


@pytest.mark.parametrize("name", ["row", "v", "square", "letter", "between"])
@pytest.mark.parametrize("factor", [0.5, 0.75])
def test_a_smaller_form_is_smaller_about_its_own_middle(name: str, factor: float) -> None:
    plan = standing(name)
    found = after(plan, {"kind": "scale", "factor": factor})
    assert found.plan.verdict.certified
    np.testing.assert_allclose(form(found), form(plan) * factor, atol=0.01)
    np.testing.assert_allclose(points(found).mean(axis=0), points(plan).mean(axis=0), atol=0.01)
    again = after(found.plan, {"kind": "scale", "factor": 1 / factor})
    np.testing.assert_allclose(points(again), points(plan), atol=0.01)


def test_a_row_that_left_its_side_is_a_row_still() -> None:
    plan = after(standing("row"), {"kind": "shift", "dx": 60}).plan
    assert plan.formation.contract.groups[0].line is not None
    closer = after(plan, {"kind": "spacing", "factor": 0.8})
    np.testing.assert_allclose(form(closer), form(plan) * 0.8, atol=0.01)
    further = after(plan, {"kind": "out", "px": 20})
    assert off(further) == pytest.approx(off(plan) + 20, abs=0.01)
    exact = after(plan, {"kind": "distance", "px": 33})
    assert off(exact) == pytest.approx(33 + 2, abs=0.01)
    for found in (closer, further, exact):
        assert found.plan.verdict.certified


@pytest.mark.parametrize(
    ("name", "stated", "edit", "said"),
    [
        ("row", {"clearance": (15, 15.5)}, {"kind": "shift", "dx": 60}, "too_far"),
        ("ring", {"clearance": (20, 1e5)}, {"kind": "shift", "dx": 30}, "too_near"),
        ("ring", {"radius": 140}, {"kind": "shift", "dx": 30}, "off_curve"),
        ("row", {"pitch": 24}, {"kind": "scale", "factor": 0.5}, "off_pitch"),
        ("row", {"min_spacing": 20}, {"kind": "scale", "factor": 0.5}, "too_close"),
    ],
)
def test_a_length_that_was_stated_is_not_given_up(
    name: str, stated: dict[str, Any], edit: dict[str, Any], said: str
) -> None:
    found = after(standing(name, **stated), edit)
    assert said in {f.kind for f in found.plan.verdict.findings}
    assert FREE not in notes(found)


def test_a_cage_that_nothing_gets_out_of_is_not_given_up() -> None:
    plan = standing("ring", relation="cage", closure="escape-proof", robots=14)
    found = after(plan, {"kind": "shift", "dx": 120})
    assert not found.plan.verdict.certified


@pytest.mark.parametrize("edit", [{"kind": "shift", "dx": -14}, {"kind": "shift", "dy": 200}])
def test_a_gap_moves_along_with_the_robots(edit: dict[str, Any]) -> None:
    plan = standing("ring", opening=90, opening_towards="top")
    found = after(plan, edit)
    assert found.plan.verdict.certified
    np.testing.assert_allclose(form(found), form(plan), atol=0.01)
    smaller = after(plan, {"kind": "scale", "factor": 0.8})
    assert not smaller.plan.verdict.certified


def test_a_row_further_out_than_usual_has_no_stated_distance() -> None:
    plan = after(standing("row"), {"kind": "out", "factor": 2}).plan
    found = after(plan, {"kind": "shift", "dx": 150})
    assert found.plan.verdict.certified
    assert "no longer" in notes(found)


@pytest.mark.parametrize("axis", ["left-right", "top-bottom"])
@pytest.mark.parametrize("name", ["row", "v", "ring", "half"])
def test_a_mirrored_formation_is_certified_though_its_thing_is_no_mirror_image(
    name: str, axis: str
) -> None:
    plan = standing(name)
    found = after(plan, {"kind": "mirror", "axis": axis})
    assert found.plan.verdict.certified
    k = 0 if axis == "left-right" else 1
    middle = BED.filled.centroid.coords[0][k]
    old, new = (p[:, k].mean() - middle for p in (points(plan), points(found)))
    assert new == pytest.approx(-old, abs=12)


def test_out_of_the_picture_is_a_sentence() -> None:
    found = after(standing("row"), {"kind": "shift", "dx": 600})
    assert {f.kind for f in found.plan.verdict.findings} >= {"out_of_picture"}


def test_a_row_at_a_stated_distance_slides_along_its_side() -> None:
    plan = standing("row", robots=3, clearance=(10, 11), pitch=20)
    found = after(plan, {"kind": "shift", "dx": 0, "dy": 15})
    assert found.plan.verdict.certified
    assert found.plan.formation.contract.groups[0].relation == "along"
    np.testing.assert_allclose(points(found) - points(plan), [[0, 15]] * 3, atol=0.1)


@pytest.mark.parametrize("name", ["ring", "v", "square"])
def test_robots_stand_as_wide_as_was_said(name: str) -> None:
    found = after(standing(name), {"kind": "scale", "px": 200})
    assert float(np.ptp(points(found)[:, 0])) == pytest.approx(200, abs=0.01)


def test_robots_above_one_another_have_no_width() -> None:
    with pytest.raises(ToolError, match="by a factor"):
        after(standing("row"), {"kind": "scale", "px": 200})
