"""Who goes where when a team is parted, joined, counted, kept off things, or told to stay."""

from dataclasses import replace
from itertools import count
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
from formup.tools.formation.site import Other
from formup.tools.geometry.outline import FloatArray, distances, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

BOX = make_outline([(200, 260), (330, 260), (330, 400), (200, 400)])
POST = make_outline([(700, 250), (760, 250), (760, 430), (700, 430)])
ANGLE = np.linspace(0, 2 * np.pi, 120, endpoint=False)
DISC = make_outline(np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1) * 50 + (500, 200))
SITE = Site({"t1": BOX, "t2": POST, "t3": DISC}, 1000, 700)
MANY = settings(derandomize=True, deadline=None, max_examples=15)
RADIUS = 4.0
READ: TypeAdapter[Any] = TypeAdapter(Edit)
FLEET = ("4", "7", "1", "2", "9", "12", "3", "5", "20", "6", "31", "32")
"""Which robot takes which place is any order, and ids have gaps."""


def standing(relation: str = "around", target: str = "t1", n: int = 8, **more: Any) -> Plan:
    group = {"relation": relation, "targets": (target,) if target else (), "robots": n, **more}
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=RADIUS)
    plan = make_plan(contract, SITE, "s")
    assert plan.verdict.certified
    return plan.for_robots(FLEET[:n], sorted(FLEET[:n], key=int))


def after(
    plan: Plan, *edits: dict[str, Any], site: Site = SITE, stay: tuple[int, ...] = ()
) -> Edited:
    read = [READ.validate_python(edit) for edit in edits]
    found = edited(plan, read, site, lambda _: "s", stay)
    used = set(plan.formation.robots)
    free = (str(k) for k in count(1) if str(k) not in used)
    names = [name or next(free) for name in found.robots]
    if not found.plan.verdict.certified:
        return found
    return found.model_copy(update={"plan": found.plan.for_robots(names, sorted(names, key=rank))})


def rank(name: str) -> tuple[int, str]:
    return (int(name), "") if name.isdecimal() else (0, name)


def places(found: Plan | Edited) -> dict[str, FloatArray]:
    """Where each robot stands that was there before."""
    if isinstance(found, Plan):
        formation = found.formation
        return dict(zip(formation.robot_of_place, formation.points, strict=True))
    pairs = zip(found.robots, found.plan.formation.points, strict=True)
    return {name: point for name, point in pairs if name is not None}


def groups(found: Edited) -> list[tuple[str, tuple[str, ...], int]]:
    contract = found.plan.formation.contract
    return [(g.relation, g.targets, g.robots) for g in contract.groups]


def unmoved(found: Edited, before: Plan, names: set[str]) -> bool:
    old, new = places(before), places(found)
    return all(np.linalg.norm(old[n] - new[n]) < 1e-6 for n in names)


@given(st.sampled_from(["around", "cage", "inside"]), st.sampled_from(["t2", "t3"]))
@MANY
def test_the_same_around_another_thing(relation: str, to: str) -> None:
    plan = standing(relation)
    found = after(plan, {"kind": "target", "to": to})
    assert groups(found) == [(relation, (to,), 8)]
    assert found.plan.verdict.certified
    assert set(found.robots) == set(plan.formation.robots)
    back = after(found.plan, {"kind": "target", "to": "t1"})
    if relation != "inside":
        off = [distances(BOX.filled, p.formation.points).min() for p in (plan, back.plan)]
        assert off[0] == pytest.approx(off[1], abs=1.5)


def test_a_distance_goes_along_a_usual_one_as_far_as_there_is_room() -> None:
    named = after(standing(clearance=(30, 34)), {"kind": "target", "to": "t2"})
    assert named.plan.formation.contract.groups[0].clearance == (30, 34)
    usual = after(standing(), {"kind": "target", "to": "t3"})
    old, new = standing().formation.points, usual.plan.formation.points
    kept = distances(BOX.filled, old).min()
    assert distances(DISC.filled, new).min() == pytest.approx(kept, abs=1.5)


def test_what_points_at_the_new_thing_points_back_at_the_old_one() -> None:
    opens = after(standing(opening_towards="t2"), {"kind": "target", "to": "t2"})
    assert opens.plan.formation.contract.groups[0].opening_towards == "t1"
    along = standing("along", n=4, facing="t2")
    assert after(along, {"kind": "target", "to": "t2"}).plan.verdict.certified
    edges = after(standing("along", n=3, edges=(0,)), {"kind": "target", "to": "t2"})
    assert edges.plan.formation.contract.groups[0].side is not None


@given(st.integers(1, 7), st.booleans())
@MANY
def test_some_go_there_and_the_rest_close_up_or_stay(n: int, stay: bool) -> None:
    plan = standing()
    found = after(plan, {"kind": "target", "to": "t2", "robots": n, "stay": stay})
    assert groups(found) == [("around", ("t1",), 8 - n), ("around", ("t2",), n)]
    assert found.plan.verdict.certified
    assert sorted(map(str, found.robots)) == sorted(plan.formation.robots)
    if stay:
        assert unmoved(found, plan, {str(r) for r in found.robots[: 8 - n]})
    nearest = sorted(
        places(plan), key=lambda r: float(distances(POST.filled, places(plan)[r][None])[0])
    )
    assert {str(r) for r in found.robots[8 - n :]} == set(nearest[:n])
    whole = after(found.plan, {"kind": "merge"})
    assert groups(whole) == [("around", ("t1",), 8)]
    assert whole.plan.verdict.certified


def test_those_named_go_join_who_is_there_and_may_come_back() -> None:
    found = after(standing(), {"kind": "target", "to": "t2", "robots": [12, 4]})
    assert set(found.robots[6:]) == {"12", "4"}
    more = after(found.plan, {"kind": "target", "to": "t2", "robots": [7]})
    assert groups(more) == [("around", ("t1",), 5), ("around", ("t2",), 3)]
    assert more.plan.verdict.certified
    back = after(more.plan, {"kind": "target", "to": "t1", "robots": [7, 12]})
    assert groups(back) == [("around", ("t1",), 7), ("around", ("t2",), 1)]
    all_ = after(back.plan, {"kind": "target", "to": "t3"})
    assert groups(all_) == [("around", ("t3",), 8)]
    assert all_.plan.verdict.certified


@given(st.integers(1, 12), st.sampled_from(["around", "cage", "along"]))
@MANY
def test_so_many_in_all(n: int, relation: str) -> None:
    more = {"side": "left"} if relation == "along" else {}
    plan = standing(relation, n=8, **more)
    if relation == "cage" and n < 3:
        with pytest.raises(ToolError, match="a cage takes 3"):
            after(plan, {"kind": "count", "robots": n})
        return
    found = after(plan, {"kind": "count", "robots": n})
    assert found.plan.formation.contract.robots == n
    assert found.plan.verdict.certified
    leaves = sorted(plan.formation.robots, key=int)[n:]
    assert set(places(found)) == set(plan.formation.robots) - set(leaves)
    if n == 8:
        assert unmoved(found, plan, set(plan.formation.robots))


def test_as_many_as_close_the_ring_and_as_many_as_fit() -> None:
    needed = after(standing(n=3), {"kind": "count", "robots": "needed"})
    assert needed.plan.verdict.certified
    widest = needed.plan.verdict.measures["widest_opening_px"]
    assert isinstance(widest, float)
    assert widest <= BOX.min_width
    one_less = after(needed.plan, {"kind": "add", "n": 2}, {"kind": "count", "robots": "needed"})
    assert one_less.plan.formation.contract.robots == needed.plan.formation.contract.robots
    fit = after(standing(n=4, min_spacing=40), {"kind": "count", "robots": "fit"})
    assert fit.plan.verdict.certified
    assert not after(fit.plan, {"kind": "add", "n": 1}).plan.verdict.certified


ROW: list[tuple[int, int]] = [(60 + 40 * k, 60) for k in range(8)]
DEMANDS: list[dict[str, Any]] = [
    {"relation": "inside"},
    {"relation": "cage"},
    {"relation": "centre"},
    {"relation": "along", "side": "left"},
    {"relation": "between", "targets": ("t1", "t2")},
    {"relation": "shape", "shape": {"kind": "circle", "where": "around"}},
    {"relation": "shape", "line": (100, 60, 900, 60)},
    {"relation": "at", "points": ROW},
]


@pytest.mark.parametrize("demands", DEMANDS, ids=str)
def test_another_arrangement_of_the_same_robots_and_back(demands: dict[str, Any]) -> None:
    plan = standing(heading="towards")
    found = after(plan, {"kind": "arrange", "demands": demands})
    assert found.plan.verdict.findings == ()
    group = found.plan.formation.contract.groups[0]
    assert (group.relation, group.robots, group.heading) == (demands["relation"], 8, "towards")
    assert set(found.robots) == set(plan.formation.robots)
    old, new = places(plan), places(found)
    names = list(old)
    ways = np.array([[np.sum((old[a] - new[b]) ** 2) for b in names] for a in names])
    alone = np.diag(ways)
    assert (alone[:, None] + alone <= ways + ways.T + 0.1).all(), "two would rather change places"
    back = {"kind": "arrange", "demands": {"relation": "around", "targets": ("t1",)}}
    assert after(found.plan, back).plan.verdict.certified


def test_what_an_arrangement_does_not_say_stays() -> None:
    plan = standing("along", n=4, side="left", min_spacing=20)
    found = after(plan, {"kind": "arrange", "demands": {"side": "right"}})
    group = found.plan.formation.contract.groups[0]
    assert (group.side, group.min_spacing, group.clearance) == (
        "right",
        20,
        plan.formation.contract.groups[0].clearance,
    )
    with pytest.raises(ToolError, match="cannot be changed so"):
        after(plan, {"kind": "arrange", "demands": {"relation": "corners", "side": "left"}})
    with pytest.raises(ToolError, match="group cannot be changed so"):
        after(plan, {"kind": "arrange", "demands": {"colour": "red"}})


@given(st.floats(-60, 60), st.floats(-60, 60), st.sampled_from(["around", "cage", "inside"]))
@MANY
def test_one_robot_goes_elsewhere_and_nobody_else_moves(dx: float, dy: float, name: str) -> None:
    plan = standing(name)
    found = after(plan, {"kind": "place", "robot": 9, "by": [dx, dy]})
    assert unmoved(found, plan, set(plan.formation.robots) - {"9"})
    assert places(found)["9"] - places(plan)["9"] == pytest.approx([dx, dy], abs=2e-3)
    assert groups(found)[-1][0] == "at"
    assert any("Robot 9 stands by itself" in note for note in found.plan.verdict.notes)
    if not found.plan.verdict.certified:
        on_it = BOX.filled.covers(shapely.Point(places(found)["9"]))
        assert on_it or any(f.kind == "too_close" for f in found.plan.verdict.findings)
        assert {f.robot for f in found.plan.verdict.findings} <= {9, *map(int, FLEET)}


def test_a_robot_apart_is_moved_again_goes_out_with_the_others_and_comes_back() -> None:
    plan = standing()
    apart = after(plan, {"kind": "place", "robot": 1, "to": [450, 500]})
    assert places(apart)["1"] == pytest.approx([450, 500])
    again = after(apart.plan, {"kind": "place", "robot": 1, "by": [5, 0]})
    assert places(again)["1"] == pytest.approx([455, 500])
    out = after(apart.plan, {"kind": "out", "px": 10})
    away = [float(distances(BOX.filled, places(p)["1"][None])[0]) for p in (apart, out)]
    assert away[1] - away[0] == pytest.approx(10, abs=0.1)
    assert out.plan.verdict.certified
    total = after(apart.plan, {"kind": "count", "robots": 6})
    assert total.plan.formation.contract.robots == 6
    merged = after(apart.plan, {"kind": "merge"})
    assert groups(merged) == [("around", ("t1",), 8)]
    assert merged.plan.verdict.certified
    beside = after(plan, {"kind": "place", "robot": 1, "target": "t2"})
    assert beside.plan.verdict.certified
    assert 5 < float(distances(POST.filled, places(beside)["1"][None])[0]) < 60


def test_a_robot_put_on_the_thing_or_on_another_robot_is_found_by_its_number() -> None:
    plan = standing()
    on_it = after(plan, {"kind": "place", "robot": 12, "to": [260, 330]})
    assert [(f.kind, f.robot) for f in on_it.plan.verdict.findings] == [("on_target", 12)]
    x, y = places(plan)["7"]
    crowd = after(plan, {"kind": "place", "robot": 12, "to": [x + 2, y]})
    (finding,) = crowd.plan.verdict.findings
    assert {finding.robot, *finding.others} == {7, 12}
    assert "obot 12" in finding.sentence


def test_robots_are_called_by_their_ids_and_who_is_gone_is_not_there() -> None:
    plan = standing(n=4)  # 4, 7, 1, 2
    found = after(plan, {"kind": "remove", "robots": [7]})
    assert set(map(str, found.robots)) == {"4", "1", "2"}
    with pytest.raises(ToolError, match="no robot 7: there are 1, 2, 4"):
        after(found.plan, {"kind": "skip", "robots": [7]})
    with pytest.raises(ToolError, match="no robot 3"):
        after(plan, {"kind": "swap", "a": 3, "b": 1})
    named = plan.for_robots(["ann", "bob", "cy", "di"], ["di", "cy", "bob", "ann"])
    gone = after(named, {"kind": "remove", "robots": [1]})
    assert "di" not in gone.robots


def test_two_of_different_groups_change_places_and_duties() -> None:
    parted = after(standing(), {"kind": "target", "to": "t2", "robots": 3})
    a, b = str(parted.robots[0]), str(parted.robots[-1])
    found = after(parted.plan, {"kind": "swap", "a": int(a), "b": int(b)})
    assert found.plan.verdict.certified
    old, new = places(parted), places(found)
    assert np.array_equal(old[a], new[b])
    assert np.array_equal(old[b], new[a])
    assert unmoved(found, parted.plan, set(old) - {a, b})


@given(st.sampled_from(["around", "cage"]), st.sampled_from(FLEET[:8]), st.integers(1, 4))
@MANY
def test_who_stays_stays_and_the_others_close_up(relation: str, name: str, n: int) -> None:
    plan = standing(relation)
    found = after(plan, {"kind": "remove", "n": n}, stay=(int(name),))
    assert found.plan.verdict.certified
    assert unmoved(found, plan, {name})
    assert groups(found) == [(relation, ("t1",), 8 - n)]


@given(st.sets(st.sampled_from(FLEET[:8]), min_size=1, max_size=4), st.floats(5, 30))
@MANY
def test_who_stays_stays_while_the_others_go_out(names: set[str], px: float) -> None:
    plan = standing()
    found = after(plan, {"kind": "out", "px": px}, stay=tuple(map(int, names)))
    assert found.plan.verdict.certified
    assert unmoved(found, plan, names)
    old, new = places(plan), places(found)
    for name in set(old) - names:
        assert float(np.linalg.norm(new[name] - old[name])) >= px - 0.1
    assert any("stay" in note for note in found.plan.verdict.notes)
    with pytest.raises(ToolError, match="cannot stay"):
        after(
            plan, {"kind": "remove", "robots": list(map(int, names))}, stay=tuple(map(int, names))
        )


def test_a_group_that_stays_as_a_whole_is_left_alone() -> None:
    parted = after(standing(), {"kind": "target", "to": "t2", "robots": 3})
    mine = tuple(int(str(r)) for r in parted.robots[5:])
    found = after(parted.plan, {"kind": "out", "px": 12}, {"kind": "add", "n": 1}, stay=mine)
    assert groups(found) == [("around", ("t1",), 6), ("around", ("t2",), 3)]
    assert unmoved(found, parted.plan, set(map(str, mine)))


def thing_at(point: FloatArray, reach: float = 9.0) -> Other:
    return Other("c1", "a cup", shapely.Point(*point).buffer(reach))


def test_robots_that_come_to_stand_on_another_thing_move_off_it_where_they_may() -> None:
    plan = standing()
    further = after(plan, {"kind": "out", "px": 15})
    site = replace(SITE, others=(thing_at(further.plan.formation.points[2]),))
    found = after(plan, {"kind": "out", "px": 15}, site=site)
    assert found.plan.verdict.certified
    apart = distances(site.others[0].region, found.plan.formation.points)
    assert apart.min() > RADIUS
    exact = after(plan, {"kind": "swap", "a": 4, "b": 7}, site=site)
    assert unmoved(exact, plan, {"1", "2", "9"})
    target = replace(SITE, others=(Other("t2", "post", POST.filled),))
    there = after(plan, {"kind": "target", "to": "t2"}, site=target)
    plain = after(plan, {"kind": "target", "to": "t2"})
    assert np.array_equal(there.plan.formation.points, plain.plan.formation.points)


def test_a_thing_that_robots_stand_by_already_moves_nobody_who_is_not_asked_to() -> None:
    plan = standing("along", n=3, side="left")
    site = replace(SITE, others=(thing_at(plan.formation.points[0]),))
    found = after(plan, {"kind": "keep-out", "ids": ["t3"]}, site=site)
    assert unmoved(found, plan, set(plan.formation.robots))


def test_kept_off_a_region_robots_leave_it() -> None:
    plan = standing()
    spot = plan.formation.points[3]
    kept = shapely.get_coordinates(shapely.Point(*spot).buffer(8).exterior)[:-1]
    site = replace(SITE, outlines={**SITE.outlines, "k1": make_outline(kept)})
    found = after(plan, {"kind": "keep-out", "ids": ["k1"]}, site=site)
    assert found.plan.verdict.certified
    assert found.plan.formation.contract.keep_out == ("k1",)
    assert distances(site.outlines["k1"].filled, found.plan.formation.points).min() > RADIUS
    with pytest.raises(ToolError, match="which keep_out forbids"):
        after(standing("inside"), {"kind": "keep-out", "ids": ["t1"]})


def test_edits_one_after_another_are_one_change() -> None:
    plan = standing()
    both = after(plan, {"kind": "remove", "n": 2}, {"kind": "out", "px": 10})
    first = after(plan, {"kind": "remove", "n": 2})
    second = after(first.plan, {"kind": "out", "px": 10})
    a, b = places(both), places(second)
    assert a.keys() == b.keys()
    assert all(np.linalg.norm(a[n] - b[n]) < 0.05 for n in a)
    assert both.parent == plan.id
    assert len(both.robots) == len(plan.formation.robots) - 2


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ({"kind": "merge"}, "nothing to merge"),
        ({"kind": "target", "to": "t1"}, "at t1 already"),
        ({"kind": "target", "to": "t2", "robots": 9}, "9 robots cannot go to t2: only 8 could"),
        ({"kind": "place", "robot": 99, "by": [1, 1]}, "no robot 99"),
        ({"kind": "count", "robots": 3, "group": 2}, "no group 2"),
    ],
)
def test_what_makes_no_sense_says_why(edit: dict[str, Any], said: str) -> None:
    with pytest.raises(ToolError, match=said):
        after(standing(), edit)


def test_as_many_as_hold_a_thing_for_sure() -> None:
    found = after(standing(n=4), {"kind": "count", "robots": "held"})
    assert found.plan.verdict.certified
    (group,) = found.plan.formation.contract.groups
    assert (group.relation, group.closure) == ("cage", "escape-proof")
