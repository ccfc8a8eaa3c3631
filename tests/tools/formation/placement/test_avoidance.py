"""Places move off other things where the contract allows it, and stay as they are where not."""

from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.encounters import TOUCHING, room_of
from formup.tools.formation.headings import headings_of
from formup.tools.formation.placement.avoidance import off_others
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.site import Other, Site
from formup.tools.geometry.outline import distances, outline_of
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

DISC = outline_of(shapely.Point(320, 240).buffer(60))
FIELD = outline_of(shapely.box(100, 80, 540, 400))


def site(*regions: BaseGeometry, confidence: float = 1.0, field: bool = False) -> Site:
    others = tuple(
        Other(f"c{k}", "grey thing", outline_of(region).filled, confidence)
        for k, region in enumerate(regions, start=1)
    )
    return Site({"t1": FIELD if field else DISC}, 640, 480, others=others)


def planned(where: Site, **fields: object) -> tuple[Plan, Plan]:
    group = Group.model_validate({"relation": "around", "targets": ("t1",), "robots": 6} | fields)
    plan = make_plan(Contract(groups=(group,)), where, "s")
    return plan, off_others(plan, where)


def standing(plan: Plan, where: Site, within: float = 0.0) -> int:
    """How many robots are on things or as near to one."""
    solid = shapely.union_all([t.region for t in where.others])
    radius = plan.formation.contract.robot_radius
    return int((distances(solid, plan.formation.points) <= radius + within).sum())


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["around", "cage", "along", "inside"]),
    st.integers(3, 14),
    st.sampled_from([0.0, 3.0]),
)
def test_a_plan_stays_certified_and_never_stands_on_more_things(
    seed: int, relation: str, robots: int, radius: float
) -> None:
    rng = np.random.default_rng(seed)
    centres = rng.uniform((40, 40), (600, 440), (6, 2))
    discs = [shapely.Point(c).buffer(rng.uniform(5, 25)) for c in centres]
    where = site(*discs, field=relation == "inside")
    side = {"side": "left"} if relation == "along" else {}
    fields = {"relation": relation, "targets": ("t1",), "robots": robots}
    contract = Contract(groups=(Group.model_validate(fields | side),), robot_radius=radius)
    before = make_plan(contract, where, "s")
    after = off_others(before, where)
    formation = after.formation
    assert after.verdict.certified == before.verdict.certified
    assert certify(formation.points, formation.contract, where).certified == after.verdict.certified
    assert standing(after, where, 2.0) <= standing(before, where, 2.0)
    assert formation.contract == before.formation.contract


def test_a_ring_is_turned_off_things_and_stays_even() -> None:
    before, _ = planned(site())
    points = before.formation.points
    where = site(*(shapely.Point(p).buffer(6) for p in points[::2]))
    before, after = planned(where)
    assert (standing(before, where), standing(after, where, 2.0)) == (3, 0)
    assert float(after.verdict.measures["spacing_ratio"]) > 0.95


@pytest.mark.parametrize(
    "fields",
    [
        {"pitch": 80.0},
        {"radius": 120.0},
        {"opening": 90.0, "opening_towards": "left", "clearance": (20, 60)},
        {"sides": ("top", "right half"), "clearance": (20, 60)},
        {"heading": "towards"},
        {"pitch": 80.0, "heading": "t1"},
    ],
)
def test_what_else_a_ring_is_to_be_holds_at_its_new_places(fields: dict[str, Any]) -> None:
    points = planned(site(), **fields)[0].formation.points
    where = site(*(shapely.Point(p).buffer(6) for p in points[::2]))
    before, after = planned(where, **fields)
    formation = after.formation
    assert standing(after, where) < standing(before, where)
    assert (after.verdict.certified, formation.contract) == (True, before.formation.contract)
    assert formation.headings_deg == headings_of(formation.contract, formation.points, where)
    assert certify(formation.points, formation.contract, where, formation.headings_deg).certified
    assert bool(formation.headings_deg) == ("heading" in fields)


def walled(*reach: float) -> Site:
    """A site with a thin wall all round the disc, in two halves."""
    wall = DISC.filled.buffer(reach[1]).difference(DISC.filled.buffer(reach[0]))
    halves = ((0, 0, 640, 239), (0, 241, 640, 480))
    return site(*(wall.intersection(shapely.box(*half)) for half in halves))


def test_a_ring_draws_in_or_out_where_things_are_all_round() -> None:
    where = walled(8, 13)
    before, after = planned(where, clearance=(5, 40), robots=8)
    assert (standing(before, where) > 4, standing(after, where)) == (True, 0)
    assert after.verdict.certified


def test_an_exact_clearance_is_kept_though_things_are_in_the_way() -> None:
    where = walled(5, 20)
    before, after = planned(where, clearance=(12, 12))
    assert after.formation.contract == before.formation.contract
    assert after.verdict.certified
    assert standing(after, where) >= 4


def test_robots_that_fill_a_field_stand_beside_what_stands_on_it() -> None:
    bare, _ = planned(site(field=True), relation="inside", robots=12)
    where = site(*(shapely.Point(p).buffer(9) for p in bare.formation.points[:4]), field=True)
    before, after = planned(where, relation="inside", robots=12)
    assert (standing(before, where), standing(after, where)) == (4, 0)
    assert after.verdict.certified


def test_a_robot_at_a_corner_is_moved_alone_and_no_further_than_the_contract_allows() -> None:
    square = outline_of(shapely.box(260, 180, 380, 300))
    bare = make_plan(
        Contract(groups=(Group(relation="corners", targets=("t1",), robots=4),)),
        Site({"t1": square}, 640, 480),
        "s",
    )
    corner = bare.formation.points[0]
    where = Site(
        {"t1": square},
        640,
        480,
        others=(Other("c1", "dot", shapely.Point(corner).buffer(2), 1.0),),
    )
    after = off_others(bare, where)
    moved = np.linalg.norm(after.formation.points - bare.formation.points, axis=1)
    assert np.count_nonzero(moved) <= 1
    assert after.verdict.certified


def test_what_is_too_faint_to_tell_turns_a_ring_but_moves_nobody_out_of_line() -> None:
    for relation, field, left in (("around", False, 0), ("inside", True, 3)):
        bare, _ = planned(site(field=field), relation=relation)
        spots = [shapely.Point(p).buffer(8) for p in bare.formation.points[:3]]
        where = site(*spots, confidence=0.45, field=field)
        after = planned(where, relation=relation)[1]
        assert standing(after, where) == left
        assert float(after.verdict.measures["spacing_ratio"]) > 0.95


def test_a_plan_that_fails_on_a_keep_out_is_mended_where_it_can_be() -> None:
    bare, _ = planned(site())
    region = outline_of(shapely.Point(bare.formation.points[0]).buffer(8))
    where = Site({"t1": DISC, "k1": region}, 640, 480)
    group = Group(relation="around", targets=("t1",), robots=6)
    contract = Contract(groups=(group,), keep_out=("k1",))
    stuck = make_plan(contract, where, "s", bare.formation.points)
    assert {f.kind for f in stuck.verdict.findings} == {"keep_out"}
    assert off_others(stuck, where).verdict.certified


def test_what_is_kept_off_is_not_touched_where_there_is_room() -> None:
    bare, _ = planned(site())
    beside = shapely.Point(bare.formation.points[0] + (0, 9)).buffer(8)  # 1 px from the robot
    where = Site({"t1": DISC, "k1": outline_of(beside)}, 640, 480)
    group = Group(relation="around", targets=("t1",), robots=6)
    contract = Contract(groups=(group,), keep_out=("k1",))
    near = make_plan(contract, where, "s", bare.formation.points)
    assert near.verdict.certified
    after = off_others(near, where)
    assert after.verdict.certified
    assert distances(beside, after.formation.points).min() > TOUCHING


def test_a_thing_nearby_is_given_room_where_that_costs_nothing() -> None:
    bare, _ = planned(site())
    beside = bare.formation.points[0] + (0, 9)
    where = site(shapely.Point(beside).buffer(4))
    before, after = planned(where)
    assert standing(before, where, 0.6 * room_of(where)) == 1
    assert standing(after, where, 0.6 * room_of(where)) == 0
