"""Several groups: nobody stands in another group's way, or it is said who would."""

from itertools import combinations

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.group_conflicts import CrowdedError, conflict, shifted_places
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.curves import Frame, ring
from formup.tools.geometry.outline import distances, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st

BRICK = make_outline([(200, 160), (400, 160), (400, 280), (200, 280)])
POST = make_outline([(440, 150), (500, 150), (500, 330), (440, 330)])
T = np.arange(60) / 60 * 2 * np.pi
COIN = make_outline(np.stack([np.cos(T), np.sin(T)], axis=1) * 60 + (250, 380))
SITE = Site({"t1": BRICK, "t2": POST, "t3": COIN}, 640, 480)
MANY = settings(derandomize=True, deadline=None, max_examples=80)
OF_THEIR_OWN = frozenset(
    {"keep_out", "opening", "opening_at_border", "not_enclosed", "out_of_picture"}
)
"""What a group is found fault with alone as well: its ring meets another thing, or the border."""


def planned(radius: float, *groups: dict[str, object]) -> Plan:
    made = tuple(Group.model_validate({"targets": ("t1",)} | group) for group in groups)
    return make_plan(Contract(groups=made, robot_radius=radius), SITE, "s")


PAIRS: list[tuple[dict[str, object], ...]] = [
    ({"relation": "around", "robots": 8}, {"relation": "around", "robots": 8}),
    ({"relation": "around", "robots": 4}, {"relation": "around", "robots": 6, "fit": "wide"}),
    ({"relation": "inside", "robots": 5}, {"relation": "cage", "robots": 8}),
    ({"relation": "inside", "robots": 5}, {"relation": "inside", "robots": 7}),
    ({"relation": "centre", "robots": 3}, {"relation": "inside", "robots": 7}),
    ({"relation": "inside", "robots": 4}, {"relation": "centre", "robots": 4}),
    ({"relation": "corners", "robots": 2}, {"relation": "corners", "robots": 2}),
    ({"relation": "along", "robots": 5, "side": "top"}, {"relation": "around", "robots": 9}),
    ({"relation": "around", "robots": 9}, {"relation": "along", "robots": 5, "side": "top"}),
    ({"relation": "around", "robots": 9}, {"relation": "around", "robots": 9, "targets": ("t2",)}),
]


@pytest.mark.parametrize("groups", PAIRS, ids=str)
@pytest.mark.parametrize("radius", [0.0, 4.0])
def test_two_groups_find_places_apart(radius: float, groups: tuple[dict[str, object], ...]) -> None:
    plan = planned(radius, *groups)
    assert [f for f in plan.verdict.findings if f.kind not in OF_THEIR_OWN] == []


def test_a_group_that_is_in_nobodys_way_stands_as_if_alone() -> None:
    alone = planned(4, {"relation": "around", "robots": 7}).formation.positions
    both = planned(4, {"relation": "inside", "robots": 4}, {"relation": "around", "robots": 7})
    assert both.formation.positions[4:] == alone


def test_where_there_is_no_room_for_both_it_is_said_which() -> None:
    ring_of: dict[str, object] = {"relation": "around", "robots": 26, "clearance": (20, 20)}
    with pytest.raises(CrowdedError, match=r"group 1 and of group 2.*20.0 px or more") as caught:
        planned(10, ring_of, ring_of)
    assert "another clearance" in str(caught.value)


THROUGH_A_POST: list[dict[str, object]] = [
    {"relation": "around", "robots": 12, "fit": "wide"},
    {"relation": "around", "robots": 12, "clearance": (30, 60)},
    {"relation": "cage", "robots": 9, "fit": "wide"},
]


@pytest.mark.parametrize("ring_of", THROUGH_A_POST, ids=str)
@pytest.mark.parametrize("radius", [0.0, 4.0])
def test_a_ring_leaves_out_the_thing_another_group_stands_around(
    ring_of: dict[str, object], radius: float
) -> None:
    alone = planned(radius, ring_of).formation.points
    assert (distances(POST.filled, alone) <= radius).any()
    post: dict[str, object] = {"relation": "around", "robots": 4, "targets": ("t2",)}
    plan = planned(radius, ring_of, post | {"fit": "tight"})
    assert plan.verdict.certified, plan.verdict.findings
    assert (distances(POST.filled, plan.formation.points) > radius).all()


def test_a_line_that_cannot_leave_it_out_is_told_of() -> None:
    line: dict[str, object] = {"relation": "along", "side": "right", "clearance": (45, 60)}
    post: dict[str, object] = {"relation": "around", "robots": 4, "targets": ("t2",)}
    plan = planned(4, line | {"robots": 5}, post)
    said = [f.sentence for f in plan.verdict.findings if f.kind == "keep_out"]
    assert said
    assert all("t2" in sentence for sentence in said)


@st.composite
def groups(draw: st.DrawFn) -> dict[str, object]:
    relation = draw(st.sampled_from(["around", "cage", "along", "inside", "centre", "corners"]))
    made: dict[str, object] = {
        "relation": relation,
        "targets": (draw(st.sampled_from(["t1", "t1", "t2", "t3"])),),
        "robots": draw(st.integers(3, 9)),
        "fit": draw(st.sampled_from(["tight", "normal", "wide"])),
    }
    if relation == "along":
        made["side"] = draw(st.sampled_from(["left", "right", "top", "bottom"]))
    return made


@given(st.lists(groups(), min_size=2, max_size=3), st.sampled_from([0.0, 3.0, 7.0]))
@MANY
def test_groups_are_placed_apart_or_refused(wanted: list[dict[str, object]], radius: float) -> None:
    try:
        plan = planned(radius, *wanted)
    except ToolError as error:
        assert str(error).endswith(".")
        return
    assert [f.sentence for f in plan.verdict.findings if f.kind not in OF_THEIR_OWN] == []
    ends = np.cumsum([g.robots for g in plan.formation.contract.groups])[:-1]
    for a, b in combinations(np.split(plan.formation.points, ends), 2):
        apart = np.linalg.norm(a[:, None] - b[None], axis=2).min()
        assert apart >= max(2 * radius, 2.0) - 0.005


@given(st.integers(2, 40), st.sampled_from([Frame(640, 480), Frame(430, 480), Frame(410, 300)]))
@MANY
def test_places_slid_along_a_curve_stay_even(n: int, frame: Frame) -> None:
    curve = ring(BRICK, 20, 30, frame)
    found = list(shifted_places(curve, n))
    assert found
    for points in found:
        assert len(points) == n
        if curve.closed:
            gaps = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
            assert gaps.max() <= curve.length / n + 1e-6


def test_conflicts_are_with_the_first_group_that_is_too_near() -> None:
    plan = planned(0, {"relation": "around", "robots": 5})
    from formup.tools.formation.placement.group_conflicts import Stand

    (group,) = plan.formation.contract.groups
    stand = Stand(group, plan.formation.points)
    far = Stand(group, plan.formation.points + 5)
    assert conflict(stand, [far]) is None
    assert conflict(stand, [far, stand]) == (1, 0.0, 2.0)
