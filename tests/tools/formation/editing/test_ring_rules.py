"""Distances, spacings, sides, openings and closures of a ring that stands."""

from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.errors import ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.editing.edit_kinds import Edit
from formup.tools.formation.editing.edits import Edited, edited
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import FloatArray, distances, make_outline
from formup.tools.geometry.sampling import nearest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

ELL = make_outline([(250, 220), (330, 220), (330, 340), (460, 340), (460, 420), (250, 420)])
POST = make_outline([(700, 250), (760, 250), (760, 430), (700, 430)])
ANGLE = np.linspace(0, 2 * np.pi, 120, endpoint=False)
DISC = make_outline(np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1) * 70 + (450, 350))
SITE = Site({"t1": ELL, "t2": POST, "t3": DISC}, 1000, 700)
MANY = settings(derandomize=True, deadline=None, max_examples=15)
RADIUS = 4.0
READ: TypeAdapter[Any] = TypeAdapter(Edit)


def standing(relation: str = "around", target: str = "t3", n: int = 9, **more: Any) -> Plan:
    group = {"relation": relation, "targets": (target,), "robots": n, **more}
    return make_plan(
        Contract(groups=(Group.model_validate(group),), robot_radius=RADIUS), SITE, "s"
    )


def after(plan: Plan, *edits: dict[str, Any]) -> Edited:
    return edited(plan, [READ.validate_python(e) for e in edits], SITE, lambda _: "s")


def points(found: Plan | Edited) -> FloatArray:
    return (found.plan if isinstance(found, Edited) else found).formation.points


def ways(found: Edited, plan: Plan) -> list[float]:
    """How far each robot that was there goes, px."""
    old = dict(zip(plan.formation.robot_of_place, points(plan), strict=True))
    new = zip(found.robots, points(found), strict=True)
    return [float(np.linalg.norm(at - old[name])) for name, at in new if name is not None]


def group_of(found: Edited) -> Group:
    return found.plan.formation.contract.groups[0]


def angles(found: Plan | Edited) -> FloatArray:
    x, y = (points(found) - (450, 350)).T
    return np.degrees(np.arctan2(y, x))


@given(
    st.sampled_from(["around", "cage", "corners", "along"]),
    st.sampled_from(["t1", "t2"]),
    st.floats(3, 60),
)
@MANY
def test_an_exact_distance_is_kept_by_everybody(relation: str, target: str, px: float) -> None:
    more = {"side": "left"} if relation == "along" else {}
    plan = standing(relation, target, 4, **more)
    found = after(plan, {"kind": "distance", "px": px})
    assert found.plan.verdict.findings == ()
    away = distances(SITE.outlines[target].filled, points(found)) - RADIUS
    assert np.abs(away - px).max() <= max(1.0, 0.05 * px) + 0.01
    assert found.robots == plan.formation.robot_of_place


def test_the_distance_that_is_kept_already_moves_nobody() -> None:
    plan = standing(clearance=(20, 20))
    found = after(plan, {"kind": "distance", "px": 20})
    assert max(ways(found, plan)) < 0.05


@given(st.floats(0.8, 1.6), st.integers(6, 12))
@MANY
def test_wider_on_a_closed_ring_is_further_out(factor: float, n: int) -> None:
    for relation in ("around", "cage"):
        plan = standing(relation, n=n)
        found = after(plan, {"kind": "spacing", "factor": factor})
        assert found.plan.verdict.certified
        before, now = (nearest(points(p), points(p), 2)[0][:, 1].mean() for p in (plan, found))
        assert now / before == pytest.approx(factor, rel=0.03)
        assert group_of(found).relation == relation


def test_an_exact_spacing_is_demanded_from_then_on_and_gives_way_to_a_distance() -> None:
    found = after(standing(), {"kind": "spacing", "px": 90})
    assert group_of(found).pitch == 90
    assert found.plan.verdict.certified
    further = after(found.plan, {"kind": "out", "px": 15})
    assert group_of(further).pitch is None
    assert further.plan.verdict.certified
    assert ways(further, found.plan) == pytest.approx([15] * 9, abs=0.5)


@pytest.mark.parametrize(
    "group",
    [
        {"relation": "along", "target": "t1", "n": 4, "side": "bottom"},
        {"relation": "inside", "target": "t1", "n": 8},
        {"relation": "centre", "target": "t3", "n": 4},
        {"target": "t3", "n": 6, "sides": ("left",)},
        {"target": "t3", "n": 6, "opening_towards": "top"},
    ],
    ids=str,
)
def test_tighter_is_nearer_together_where_they_stand(group: dict[str, Any]) -> None:
    plan = standing(**group)
    found = after(plan, {"kind": "spacing", "factor": 0.8})
    assert found.plan.verdict.certified
    before, now = (nearest(points(p), points(p), 2)[0][:, 1].mean() for p in (plan, found))
    assert 0.65 <= now / before <= 0.95


@given(st.sampled_from(["left", "right", "top", "bottom"]), st.sampled_from(["around", "cage"]))
@MANY
def test_only_one_side_or_all_but_it(side: str, relation: str) -> None:
    plan = standing(relation, n=8)
    only = after(plan, {"kind": "sides", "only": [side]})
    rest = after(plan, {"kind": "sides", "without": [side]})
    middle = {"left": 180, "right": 0, "top": -90, "bottom": 90}[side]
    assert only.plan.verdict.certified
    assert rest.plan.verdict.certified
    assert (np.abs((angles(only) - middle + 180) % 360 - 180) <= 46).all()
    assert (np.abs((angles(rest) - middle + 180) % 360 - 180) >= 44).all()
    assert set(only.robots) == set(plan.formation.robot_of_place)
    half = after(plan, {"kind": "sides", "without": [f"{side} half"]})
    assert (np.abs((angles(half) - middle + 180) % 360 - 180) >= 89).all()


def test_no_side_at_all_is_refused() -> None:
    with pytest.raises(ToolError, match="No part of the way round"):
        after(standing(), {"kind": "sides", "without": ["left", "right", "top", "bottom"]})


@given(st.sampled_from(["left", "top", "t2", 30.0]), st.sampled_from([None, 60.0, 120.0]))
@MANY
def test_an_opening_is_where_it_is_wanted_and_closes_again(towards: Any, px: float | None) -> None:
    plan = standing("cage", n=10)
    found = after(plan, {"kind": "opening", "towards": towards, "px": px})
    assert found.plan.verdict.certified
    middle = {"left": 180, "top": -90, "t2": 0, 30.0: 30}[towards]
    free = np.abs((angles(found) - middle + 180) % 360 - 180).min()
    assert free > 1.4 * 360 / 10 / 2
    wider = after(found.plan, {"kind": "opening", "factor": 1.4})
    assert group_of(wider).opening_towards == towards
    assert np.abs((angles(wider) - middle + 180) % 360 - 180).min() > free + 2
    closed = after(wider.plan, {"kind": "close"})
    assert closed.plan.verdict.certified
    assert group_of(closed).relation == "cage"
    turned = after(found.plan, {"kind": "rotate", "degrees": 90})
    assert turned.plan.verdict.certified
    assert np.abs((angles(turned) - middle - 90 + 180) % 360 - 180).min() == pytest.approx(
        free, abs=1.0
    )


def test_a_cage_that_is_opened_moves_nobody_and_what_is_none_is_not_opened() -> None:
    plan = standing("cage")
    found = after(plan, {"kind": "open"})
    assert group_of(found).relation == "around"
    assert not np.any(ways(found, plan))
    with pytest.raises(ToolError, match="no closed ring"):
        after(found.plan, {"kind": "open"})


def test_escape_proof_is_certified_as_that_or_says_how_many_would_do() -> None:
    found = after(standing(n=9), {"kind": "escape-proof"})
    assert found.plan.verdict.certified
    assert group_of(found).closure == "escape-proof"
    with pytest.raises(ToolError, match="would do") as caught:
        after(standing(target="t2", n=3), {"kind": "escape-proof"})
    assert caught.value.facts["robots_needed"] > 3


@pytest.mark.parametrize("heading", ["towards", "away", "t2", 45.0, None])
def test_who_looks_elsewhere_stands_where_they_stood(heading: Any) -> None:
    plan = standing(heading=90.0)
    found = after(plan, {"kind": "heading", "to": heading})
    assert not np.any(ways(found, plan))
    assert group_of(found).heading == heading
    assert (found.plan.formation.headings_deg == ()) == (heading is None)
    assert found.plan.verdict.certified


@pytest.mark.parametrize(
    "edit",
    [
        {"kind": "heading", "to": "t9"},
        {"kind": "opening", "towards": "t9"},
        {"kind": "target", "to": "t9"},
        {"kind": "keep-out", "ids": ["t9"]},
        {"kind": "place", "robot": 1, "target": "t9"},
    ],
    ids=str,
)
def test_a_thing_that_is_not_there_is_named(edit: dict[str, Any]) -> None:
    with pytest.raises(ToolError, match=r"no target 't9'\. Targets: t1, t2, t3"):
        after(standing(), edit)


@pytest.mark.parametrize("degrees", [90, 180, -90])
def test_sides_turn_by_quarters(degrees: float) -> None:
    plan = standing(n=5, sides=("left", "top half"))
    found = after(plan, {"kind": "rotate", "degrees": degrees})
    assert found.plan.verdict.certified
    back = after(found.plan, {"kind": "rotate", "degrees": -degrees})
    assert group_of(back).sides == ("left", "top half")
    turned = after(plan, {"kind": "rotate", "degrees": 30})
    assert turned.plan.verdict.certified
    assert any("no longer on their side of t3" in note for note in turned.plan.verdict.notes)
    assert (angles(turned) - angles(plan)) % 360 == pytest.approx(np.full(5, 30.0), abs=0.1)


def test_the_version_is_that_of_the_new_contract() -> None:
    def version(contract: Contract) -> str:
        return "+".join(contract.target_ids)

    edit = READ.validate_python({"kind": "target", "to": "t2"})
    found = edited(standing(), (edit,), SITE, version)
    assert found.plan.formation.scene_version == "t2"


def test_what_is_left_of_the_way_round_in_the_picture_is_enough_for_sides() -> None:
    site = Site({"t3": DISC}, 1000, 425)
    group = Group(relation="around", targets=("t3",), robots=6)
    plan = make_plan(Contract(groups=(group,)), site, "s")
    edit = READ.validate_python({"kind": "sides", "without": ["bottom"]})
    found = edited(plan, (edit,), site, lambda _: "s")
    assert found.plan.verdict.certified
    assert shapely.box(0, 0, 999, 424).covers(shapely.multipoints(points(found)))


@given(st.floats(-14, 14), st.floats(-14, 14), st.sampled_from(["around", "cage"]))
@MANY
def test_a_usual_distance_makes_room_for_a_shift_and_a_named_one_does_not(
    dx: float, dy: float, relation: str
) -> None:
    found = after(standing(relation), {"kind": "shift", "dx": dx, "dy": dy})
    assert found.plan.verdict.certified
    named = after(standing(relation, clearance=(19, 21)), {"kind": "shift", "dx": 12})
    assert {f.kind for f in named.plan.verdict.findings} == {"too_near", "too_far"}


@given(st.integers(4, 10), st.integers(1, 3))
@MANY
def test_a_ring_with_an_opening_keeps_it_with_fewer_and_with_more(n: int, k: int) -> None:
    plan = standing(n=n, opening_towards="left")
    for edit in ({"kind": "remove", "n": k}, {"kind": "add", "n": k}):
        if edit["kind"] == "add" or n - k > 1:
            assert after(plan, edit).plan.verdict.findings == ()


def widest(found: Plan | Edited) -> float:
    x, y = (points(found) - (450, 350)).T
    ordered = points(found)[np.argsort(np.arctan2(y, x))]
    return float(np.linalg.norm(np.roll(ordered, -1, axis=0) - ordered, axis=1).max()) - 2 * RADIUS


@pytest.mark.parametrize("n", [7, 9, 15])
@pytest.mark.parametrize("factor", [0.6, 0.85, 1.3])
def test_a_gap_becomes_as_much_narrower_or_wider_as_a_gap_can(n: int, factor: float) -> None:
    plan = after(standing(n=n), {"kind": "opening", "towards": "right"}).plan
    found = after(plan, {"kind": "opening", "factor": factor})
    assert found.plan.verdict.certified
    ratio = widest(found) / widest(plan)
    assert ratio == pytest.approx(factor, abs=0.03) or (factor < ratio < 0.95)


def test_a_gap_named_narrower_is_narrower_down_to_what_still_is_one() -> None:
    plan = after(standing(n=10), {"kind": "opening", "towards": "right", "px": 160}).plan
    found = after(plan, {"kind": "opening", "px": 110})
    assert found.plan.verdict.certified
    assert widest(found) == pytest.approx(110, abs=2)
    least = after(found.plan, {"kind": "opening", "px": 5})
    with pytest.raises(ToolError, match="narrower it would be as the other gaps"):
        after(least.plan, {"kind": "opening", "factor": 0.8})
