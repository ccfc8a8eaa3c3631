"""Robots that an edit puts onto other things are slid off them; the distance it gave stays."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.editing.edit_kinds import Edit
from formup.tools.formation.editing.edits import Edited, edited
from formup.tools.formation.encounters import encounters_of
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.site import Other
from formup.tools.geometry.outline import FloatArray, distances, make_outline
from pydantic import TypeAdapter

ANGLE = np.linspace(0, 2 * np.pi, 120, endpoint=False)
MIDDLE = np.array([500, 350])
DISC = make_outline(np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1) * 70 + MIDDLE)
CRATE = make_outline([(430, 300), (570, 300), (570, 400), (430, 400)])
BARE = Site({"t1": DISC, "t2": CRATE}, 1000, 700)
RADIUS = 3.0
READ: TypeAdapter[Any] = TypeAdapter(Edit)


def standing(relation: str, **more: Any) -> Plan:
    group = Group.model_validate({"relation": relation, "robots": 10, "targets": ("t1",)} | more)
    return make_plan(Contract(groups=(group,), robot_radius=RADIUS), BARE, "s")


def after(plan: Plan, site: Site, *edits: dict[str, Any], stay: tuple[int, ...] = ()) -> Edited:
    return edited(plan, [READ.validate_python(e) for e in edits], site, lambda _: "s", stay)


def points(found: Plan | Edited) -> FloatArray:
    return (found.plan if isinstance(found, Edited) else found).formation.points


def with_thing(at: FloatArray, size: float = 8.0, confidence: float = 1.0) -> Site:
    thing = Other("c1", "stone", shapely.Point(at).buffer(size), confidence)
    return replace(BARE, others=(thing,))


def away(found: Edited, target: str = "t1") -> FloatArray:
    return distances(BARE.outlines[target].filled, points(found)) - RADIUS


STANDS: dict[str, dict[str, Any]] = {
    "around": {"clearance": (9, 36)},
    "cage": {"clearance": (9, 36)},
    "along": {"side": "left", "targets": ("t2",), "robots": 4},
}


@pytest.mark.parametrize("relation", STANDS)
@pytest.mark.parametrize(
    "edit",
    [{"kind": "out", "factor": 1.25}, {"kind": "in", "px": 4}, {"kind": "distance", "px": 30}],
)
@pytest.mark.parametrize("robot", [0, 2])
def test_a_distance_that_an_edit_gives_is_kept_beside_other_things(
    relation: str, edit: dict[str, Any], robot: int
) -> None:
    plan = standing(relation, **STANDS[relation])
    target = STANDS[relation].get("targets", ("t1",))[0]
    bare = after(plan, BARE, edit)
    site = with_thing(points(bare)[robot])
    found = after(plan, site, edit)
    assert found.plan.verdict.certified
    assert encounters_of(found.plan, site, {}, 0.0) == ()
    np.testing.assert_allclose(away(found, target), away(bare, target), atol=0.1)
    moved = np.linalg.norm(points(found) - points(bare), axis=1) > 0.01
    assert moved.tolist() == [i == robot for i in range(len(moved))]


def test_each_bit_more_goes_as_much_further_beside_other_things() -> None:
    plan = standing("around", clearance=(9, 36))
    edit = {"kind": "out", "factor": 1.25}
    bare = after(plan, BARE, edit, edit)
    site = with_thing(points(after(plan, BARE, edit))[4])
    found = after(after(plan, site, edit).plan, site, edit)
    assert away(found).mean() == pytest.approx(away(bare).mean(), abs=0.3)


def test_a_thing_wider_than_a_gap_turns_the_ring() -> None:
    plan = standing("cage", clearance=(9, 36))
    edit = {"kind": "out", "px": 5}
    bare = after(plan, BARE, edit)
    site = with_thing(points(bare)[3], size=21)
    found = after(plan, site, edit)
    assert found.plan.verdict.certified
    assert encounters_of(found.plan, site, {}, 0.0) == ()
    np.testing.assert_allclose(away(found), away(bare), atol=0.1)


def test_where_no_place_is_off_a_thing_the_distance_stays_and_the_robot_is_named() -> None:
    plan = standing("around", clearance=(9, 36))
    edit = {"kind": "out", "px": 5}
    bare = after(plan, BARE, edit)
    site = with_thing(points(bare)[3], size=60)
    found = after(plan, site, edit)
    np.testing.assert_allclose(away(found), away(bare), atol=0.1)
    (met,) = encounters_of(found.plan, site, {}, 0.0)
    assert met.thing == "c1"
    assert met.how == "on"


def test_nobody_is_slid_who_stays_or_for_what_may_be_no_thing() -> None:
    plan = standing("around", clearance=(9, 36))
    edit = {"kind": "distance", "px": 30}
    bare = after(plan, BARE, edit)
    faint = after(plan, with_thing(points(bare)[3], confidence=0.45), edit)
    np.testing.assert_array_equal(points(faint), points(bare))
    near = with_thing(points(bare)[3] + (points(bare)[3] - MIDDLE) * 0.2)
    np.testing.assert_array_equal(points(after(plan, near, edit)), points(bare))
    more = {"kind": "add", "n": 1}
    site = with_thing(points(plan)[2])
    kept = after(plan, site, more, stay=(3,))
    np.testing.assert_array_equal(points(kept)[kept.robots.index("3")], points(plan)[2])
