"""Which way robots look: computed, certified, kept with their robots, refused when wrong."""

import math

import numpy as np
import pytest
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.headings import headings_of, off_heading
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import make_outline
from hypothesis import given
from hypothesis import strategies as st

BOX = make_outline([(200, 150), (400, 150), (400, 250), (200, 250)])
SITE = Site(
    {"t1": BOX, "t2": make_outline([(560, 180), (600, 180), (600, 220), (560, 220)])}, 640, 480
)


def planned(**group: object) -> Plan:
    made = {"relation": "around", "targets": ("t1",), "robots": 6} | group
    return make_plan(Contract(groups=(Group.model_validate(made),)), SITE, "s")


def looked_at(
    points: list[tuple[float, float]], heading: object, targets: tuple[str, ...] = ("t1",)
) -> list[float | None]:
    group = Group.model_validate(
        {"relation": "shape", "targets": targets, "robots": len(points), "heading": heading}
    )
    return list(headings_of(Contract(groups=(group,)), np.array(points), SITE))


def test_a_robot_looks_at_the_nearest_point_or_from_on_it_at_the_centre() -> None:
    points = [(150.0, 160.0), (300.0, 300.0), (430.0, 280.0), (390.0, 200.0), (300.0, 200.0)]
    assert looked_at(points, "towards") == [0, 270, 225, 180, 0]
    assert looked_at(points, "away") == [180, 90, 45, 0, 180]
    assert looked_at(points, "t2")[4] == pytest.approx(0)
    assert looked_at(points, -90) == [270] * 5
    assert looked_at([(0, 0), (10, 0)], "towards", targets=()) == [0, 180]
    assert looked_at([(0, 0), (10, 0)], "away", targets=()) == [180, 0]


@given(st.floats(-1e4, 1e4), st.floats(-360, 360), st.integers(-5, 5))
def test_how_far_off_a_heading_is_does_not_depend_on_turns(
    heading: float, by: float, turns: int
) -> None:
    off = off_heading(heading + by + 360 * turns, heading)
    assert 0 <= off <= 180
    assert math.cos(math.radians(off)) == pytest.approx(math.cos(math.radians(by)), abs=1e-6)


def test_a_plan_holds_headings_and_its_certificate_looks_at_them() -> None:
    plan = planned(heading="away")
    assert plan.verdict.certified
    contract, points = plan.formation.contract, plan.formation.points
    turned = [(angle or 0.0) + 5 for angle in plan.formation.headings_deg]
    for wrong in (turned, ()):
        found = certify(points, contract, SITE, wrong)
        assert [f.kind for f in found.findings] == ["wrong_heading"] * 6
    assert "5 degrees past" in certify(points, contract, SITE, turned).findings[0].sentence
    assert planned().formation.headings_deg == ()
    assert planned().id != planned(heading="away").id != planned(heading="towards").id


def test_headings_stay_with_the_robots_that_take_the_places() -> None:
    first = Group(relation="around", targets=("t1",), robots=3, heading="towards")
    second = Group(relation="along", targets=("t2",), robots=2, side="right")
    plan = make_plan(Contract(groups=(first, second)), SITE, "s")
    assert [angle is None for angle in plan.formation.headings_deg] == [False] * 3 + [True] * 2
    named = plan.for_robots(["d", "a", "e", "c", "b"], ["a", "b", "c", "d", "e"]).formation
    h = plan.formation.headings_deg
    assert named.headings_deg == (h[1], None, None, h[0], h[2])
    assert named.place_headings == h
    assert certify(named.points, named.contract, SITE, named.place_headings).certified


def test_what_is_looked_at_is_a_target_that_has_to_be_there() -> None:
    assert planned(heading="t2").formation.contract.target_ids == ("t1", "t2")
    assert planned(heading="towards").formation.contract.target_ids == ("t1",)
