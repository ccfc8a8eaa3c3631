"""Shapes and facing sides through the contract: placed, certified, and refused when spoilt."""

import math
from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.errors import ToolError
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group, ShapeSpec
from formup.tools.formation.placement.figure import figure_of
from formup.tools.formation.placement.place import CapacityError, Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

WIDTH, HEIGHT = 640.0, 480.0
T = np.arange(90) / 90 * 2 * math.pi
DISC = make_outline(np.stack([np.cos(T), np.sin(T)], axis=1) * 50 + (300, 230))
BRICK = make_outline([(420, 200), (520, 200), (520, 260), (420, 260)])
SITE = Site({"t1": DISC, "t2": BRICK}, WIDTH, HEIGHT)
BOX = (60.0, 40.0, 560.0, 420.0)
FORMS: list[dict[str, Any]] = [
    {"kind": "letters", "text": "UP", "box": BOX},
    {"kind": "letters", "text": "7", "where": "left"},
    {"kind": "outlined_letters", "text": "a7", "where": "right"},
    {"kind": "letters", "text": "ok", "where": "inside"},
    {"kind": "star", "where": "around"},
    {"kind": "star", "where": "on", "corners": 6},
    {"kind": "polygon", "where": "around", "corners": 3},
    {"kind": "circle", "box": BOX},
    {"kind": "arc", "box": BOX, "angles": (180, 360)},
    {"kind": "arc", "where": "around", "angles": (-60, 200)},
    {"kind": "arc", "where": "around", "opens": "right"},
    {"kind": "arc", "where": "below"},
    {"kind": "v", "where": "around"},
    {"kind": "v", "where": "left"},
    {"kind": "v", "box": BOX, "opens": "down"},
    {"kind": "u", "where": "around", "opens": "left"},
    {"kind": "u", "where": "inside"},
    {"kind": "u", "where": "above"},
    {"kind": "grid", "box": BOX},
    {"kind": "grid", "where": "right", "rows": 4},
    {"kind": "grid", "where": "inside"},
    {"kind": "line", "where": "below"},
    {"kind": "line", "where": "left"},
    {"kind": "polyline", "points": ((50, 50), (200, 90), (220, 300), (600, 310))},
    {"kind": "polyline", "points": ((0, 0), (1, 1), (2, 0)), "where": "above"},
]


def drawn(n: int, shape: dict[str, Any], radius: float = 0.0, **more: Any) -> Plan:
    targets = ("t1",) if "where" in shape else ()
    group = {"relation": "shape", "targets": targets, "robots": n, "shape": shape} | more
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=radius)
    return make_plan(contract, SITE, "s")


@pytest.mark.parametrize("shape", FORMS, ids=lambda s: f"{s['kind']}-{s.get('where', '')}")
@pytest.mark.parametrize("n", [1, 2, 5, 12, 40])
@pytest.mark.parametrize("radius", [0.0, 2.0])
def test_every_form_is_certified_or_does_not_fit(
    shape: dict[str, Any], n: int, radius: float
) -> None:
    try:
        plan = drawn(n, shape, radius)
    except CapacityError as error:
        assert n > error.fits >= 1
        assert drawn(error.fits, shape, radius).verdict.certified
        for more in range(error.fits + 1, min(n, error.fits + 12)):
            with pytest.raises(CapacityError):
                drawn(more, shape, radius)
        return
    assert plan.verdict.findings == ()
    assert len(plan.formation.points) == n


def farthest_off(plan: Plan, places: FloatArray) -> FloatArray:
    """The one of some places that is farthest from the drawn lines."""
    (group,) = plan.formation.contract.groups
    assert group.shape is not None
    lines = figure_of(group, group.shape, SITE, plan.formation.contract.robot_radius).lines
    drawing = shapely.MultiLineString([shapely.LineString(line) for line in lines])
    return places[shapely.distance(drawing, shapely.points(places)).argmax()]


@given(
    st.sampled_from([s for s in FORMS if s["kind"] != "grid"]), st.integers(8, 30),
    st.integers(0, 2**32 - 1),
)  # fmt: skip
@settings(derandomize=True, deadline=None, max_examples=40)
def test_a_spoilt_form_is_not_certified(shape: dict[str, Any], n: int, seed: int) -> None:
    try:
        plan = drawn(n, shape)
    except CapacityError:
        return
    contract, points = plan.formation.contract, plan.formation.points
    random = np.random.default_rng(seed)
    pushed, stacked = points.copy(), points.copy()
    k = int(random.integers(n))
    pushed[k] = farthest_off(plan, points[k] + 55 * np.stack([np.cos(T), np.sin(T)], axis=1))
    other = (k + 1 + int(random.integers(n - 1))) % n
    stacked[k] = points[other] + (0.5, 0)
    shuffled = points[random.permutation(n)]
    assert not certify(stacked, contract, SITE).certified
    assert certify(shuffled, contract, SITE).certified
    kinds = {f.kind for f in certify(pushed, contract, SITE).findings}
    assert kinds & {
        "off_curve",
        "bare_end",
        "too_close",
        "crowded_figure",
        "out_of_picture",
        "on_target",
    }


def test_a_robot_off_its_place_in_a_grid_is_named() -> None:
    plan = drawn(12, {"kind": "grid", "box": BOX, "rows": 3})
    points = plan.formation.points.copy()
    points[4] += (60, 0)
    (finding,) = certify(points, plan.formation.contract, SITE).findings
    assert (finding.kind, finding.robot) == ("off_grid", 5)
    points[4] = plan.formation.points[7] + (3, 0)
    (finding,) = certify(points, plan.formation.contract, SITE).findings
    assert (finding.kind, finding.robot, finding.others) == ("same_place", 8, (5,))


def test_a_form_by_a_target_keeps_off_it_or_stays_in_it() -> None:
    around = drawn(20, {"kind": "star", "where": "around"}, clearance=(10, 20))
    assert around.verdict.measures["min_clearance_px"] == pytest.approx(math.sqrt(200), abs=0.2)
    within = drawn(9, {"kind": "letters", "text": "X", "where": "inside"}, clearance=(8, 60))
    reach = np.linalg.norm(within.formation.points - (300, 230), axis=1)
    assert 36 < reach.max() <= 42
    left = drawn(6, {"kind": "line", "where": "left"}, clearance=(10, 10))
    assert left.formation.points[:, 0] == pytest.approx(240, abs=0.3)


@pytest.mark.parametrize("where", ["left", "right", "above", "below"])
def test_a_form_beside_a_target_comes_as_near_as_is_demanded(where: str) -> None:
    """A disc falls short of its box, so that a form beside the box alone would stand too far."""
    plan = drawn(5, {"kind": "v", "where": where}, clearance=(20, 21))
    assert plan.verdict.certified
    assert 19.99 <= float(plan.verdict.measures["min_clearance_px"]) <= 21.01
    further = plan.formation.contract.model_dump()
    further["groups"][0]["clearance"] = (5.0, 6.0)
    verdict = certify(plan.formation.points, Contract.model_validate(further), SITE)
    assert not verdict.certified


def test_what_has_no_room_says_so() -> None:
    with pytest.raises(ToolError, match="out of the 640 x 480 px picture"):
        drawn(20, {"kind": "star", "where": "around"}, clearance=(90, 90))
    with pytest.raises(ToolError, match="no room above"):
        drawn(5, {"kind": "line", "where": "above"}, clearance=(200, 200))
    with pytest.raises(CapacityError, match="fit:"):
        drawn(400, {"kind": "circle", "where": "inside"})


BAD: list[tuple[dict[str, Any], str]] = [
    ({"kind": "letters", "box": BOX}, "A to Z"),
    ({"kind": "letters", "text": "Ü", "box": BOX}, "'Ü'"),
    ({"kind": "star"}, "either a box, or where"),
    ({"kind": "star", "box": BOX, "where": "on"}, "either a box, or where"),
    ({"kind": "grid", "where": "around"}, "go around a target, not grid"),
    ({"kind": "outlined_letters", "text": "A\u00e9", "box": BOX}, "'\u00e9' cannot be drawn"),
    ({"kind": "star", "box": BOX, "text": "A"}, "text belongs to letters"),
    ({"kind": "polyline", "box": BOX}, "takes points"),
    ({"kind": "circle", "box": (9, 9, 3, 12)}, "x0 <= x1"),
]


@pytest.mark.parametrize(("shape", "why"), BAD)
def test_a_form_that_means_nothing_is_refused_with_the_reason(
    shape: dict[str, Any], why: str
) -> None:
    with pytest.raises(ValidationError, match=why):
        drawn(5, shape)


def facing(n: int, **more: Any) -> Group:
    group = {"relation": "along", "targets": ["t2"], "robots": n, "facing": "t1"}
    return Group.model_validate(group | more)


def test_the_side_that_faces_the_other_is_lined() -> None:
    plan = make_plan(Contract(groups=(facing(3, clearance=(9, 11)),)), SITE, "s")
    assert plan.verdict.findings == ()
    assert plan.formation.points[:, 0] == pytest.approx(410, abs=0.2)
    turned = plan.formation.points * (-1, 1) + (940, 0)
    kinds = {f.kind for f in certify(turned, plan.formation.contract, SITE).findings}
    assert "wrong_side" in kinds


@given(st.floats(0, 6.28))
@settings(derandomize=True, deadline=None, max_examples=25)
def test_wherever_the_other_lies_its_side_is_certified_and_nearest(angle: float) -> None:
    other = make_outline(
        np.stack([np.cos(T), np.sin(T)], axis=1) * 20
        + (320 + 190 * math.cos(angle), 240 + 170 * math.sin(angle))
    )
    thing = make_outline([(280, 210), (360, 210), (360, 270), (280, 270)])
    site = Site({"t2": thing, "t1": other}, WIDTH, HEIGHT)
    plan = make_plan(Contract(groups=(facing(2),)), site, "s")
    assert plan.verdict.findings == ()
    middle = plan.formation.points.mean(axis=0) - (320, 240)
    assert middle @ (math.cos(angle), math.sin(angle)) > 0


def test_facing_needs_another_target_and_no_side() -> None:
    with pytest.raises(ValidationError, match="cannot face itself"):
        facing(2, facing="t2")
    with pytest.raises(ValidationError, match="facing: one of them"):
        facing(2, side="left")
    assert Contract(groups=(facing(2),)).target_ids == ("t2", "t1")


def test_groups_with_forms_and_faced_things_are_read_as_written() -> None:
    group = facing(2)
    assert Group.model_validate(group.model_dump(mode="json")) == group
    form = drawn(8, {"kind": "circle", "box": BOX}).formation.contract.groups[0]
    assert Group.model_validate_json(form.model_dump_json()) == form


THIN = make_outline([(310, 80), (330, 80), (330, 400), (310, 400)])
RING = make_outline(
    np.stack([np.cos(T), np.sin(T)], axis=1) * 100 + (320, 240),
    (np.stack([np.cos(T), np.sin(T)], axis=1) * 60 + (320, 240),),
)
CUP = make_outline(
    [(220, 140), (400, 140), (400, 180), (260, 180), (260, 290), (400, 290), (400, 330), (220, 330)]
)


@pytest.mark.parametrize("outline", [THIN, RING, CUP], ids=["thin", "ring", "cup"])
@pytest.mark.parametrize("kind", ["star", "circle", "polygon", "grid", "line"])
def test_a_form_finds_room_inside_what_is_thin_or_hollow(outline: Outline, kind: str) -> None:
    shape = ShapeSpec.model_validate({"kind": kind, "where": "inside"})
    group = Group(relation="shape", targets=("t1",), robots=5, shape=shape)
    plan = make_plan(Contract(groups=(group,)), Site({"t1": outline}, WIDTH, HEIGHT), "s")
    assert plan.verdict.findings == ()
    assert shapely.intersects_xy(outline.polygon, plan.formation.points).all()
    if (outline, kind) == (RING, "circle"):  # round the hole, not beside it
        assert np.ptp(plan.formation.points, axis=0).min() > 120


@pytest.mark.parametrize("angles", [(0, 180), (0, 270), (-60, 200)])
def test_an_arc_goes_around_what_is_hollow(angles: tuple[float, float]) -> None:
    shape = ShapeSpec(kind="arc", where="around", angles=angles)
    group = Group(relation="shape", targets=("t1",), robots=9, shape=shape)
    plan = make_plan(Contract(groups=(group,)), Site({"t1": CUP}, WIDTH, HEIGHT), "s")
    assert plan.verdict.findings == ()
    x, y = plan.formation.points.T
    assert np.hypot(x - 310, y - 235).min() > 130


@pytest.mark.parametrize("clearance", [(15, 15), (30, 30), (60, 60)])
@pytest.mark.parametrize("radius", [0.0, 5.0])
def test_an_exact_distance_holds_where_the_picture_cuts_the_ring(
    clearance: tuple[float, float], radius: float
) -> None:
    edge = make_outline([(0, 150), (60, 150), (60, 300), (0, 300)])
    group = Group(relation="around", targets=("t1",), robots=8, clearance=clearance)
    contract = Contract(groups=(group,), robot_radius=radius)
    plan = make_plan(contract, Site({"t1": edge}, WIDTH, HEIGHT), "s")
    assert plan.verdict.certified
    off = shapely.distance(edge.filled, shapely.points(plan.formation.points)) - radius
    assert off == pytest.approx(clearance[0], abs=0.3)


@pytest.mark.parametrize("kind", ["v", "u", "arc"])
@pytest.mark.parametrize(
    ("opens", "axis", "sign"), [("left", 0, -1), ("right", 0, 1), ("up", 1, -1), ("down", 1, 1)]
)
def test_a_mouth_is_on_the_side_named_and_the_thing_within(
    kind: str, opens: str, axis: int, sign: int
) -> None:
    plan = drawn(9, {"kind": kind, "where": "around", "opens": opens})
    assert plan.verdict.certified
    points = plan.formation.points - (300, 230)
    assert len(np.unique(np.sign(points[np.abs(points[:, 1 - axis]) > 1, 1 - axis]))) == 2
    inner = points[np.abs(points[:, 1 - axis]) < 30, axis]
    assert len(inner) and (inner * sign < -50).all()  # nobody stands before the mouth


@pytest.mark.parametrize("kind", ["v", "u", "arc"])
@pytest.mark.parametrize("where", ["left", "right", "above", "below"])
def test_beside_a_target_a_mouth_is_towards_it(kind: str, where: str) -> None:
    shape = ShapeSpec.model_validate({"kind": kind, "where": where})
    explicit = {"left": "right", "right": "left", "above": "down", "below": "up"}[where]
    first, second = (
        drawn(7, {"kind": kind, "where": where} | more) for more in ({}, {"opens": explicit})
    )
    assert shape.mouth == explicit
    assert first.verdict.certified
    assert first.formation.positions == second.formation.positions


@pytest.mark.parametrize(
    "shape", [{"kind": "star", "opens": "up"}, {"kind": "arc", "opens": "up", "angles": (0, 90)}]
)
def test_what_has_no_mouth_of_its_own_is_refused(shape: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ShapeSpec.model_validate(shape | {"where": "around"})
