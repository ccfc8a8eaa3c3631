"""What cannot be met in full: the number that would do, and a plan that says it is partial."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.fleet.arrival import Arrival
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.caging import CUT_SHORT, CageError
from formup.tools.formation.placement.group_conflicts import CrowdedError
from formup.tools.formation.placement.partial import best_partial
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.site import CapacityError, Site
from formup.tools.geometry.cages import cages
from formup.tools.geometry.cages.budget import search_budget
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.world import Target, World

if TYPE_CHECKING:
    from ...conftest import ToolCalls

BRICK = make_outline([(200, 160), (400, 160), (400, 280), (200, 280)])
SITE = Site({"t1": BRICK}, 640, 480)
RADIUS = 8.0


def contract(*groups: dict[str, object], radius: float = RADIUS) -> Contract:
    made = tuple(Group.model_validate({"targets": ("t1",)} | group) for group in groups)
    return Contract(groups=made, robot_radius=radius)


def partial(*groups: dict[str, object], radius: float = RADIUS) -> Plan:
    wanted = contract(*groups, radius=radius)
    try:
        make_plan(wanted, SITE, "s")
        refusal = None
    except (CapacityError, CageError, CrowdedError) as error:
        refusal = error
    plan = best_partial(wanted, SITE, "s", refusal)
    assert plan is not None and plan.partial is not None
    assert plan.verdict.certified
    assert certify(plan.formation.points, plan.formation.contract, SITE).certified
    assert plan.partial.asked == wanted.robots
    assert plan.partial.placed == len(plan.formation.positions)
    return plan


CROWDS: list[dict[str, object]] = [
    {"relation": "around", "robots": 200},
    {"relation": "cage", "robots": 200},
    {"relation": "cage", "robots": 200, "closure": "escape-proof"},
    {"relation": "inside", "robots": 200},
    {"relation": "along", "side": "top", "robots": 90},
    {"relation": "corners", "robots": 6},
    {"relation": "centre", "robots": 80},
]


@pytest.mark.parametrize("group", CROWDS, ids=str)
def test_as_many_as_fit_are_certified_as_partial(group: dict[str, object]) -> None:
    plan = partial(group)
    assert plan.partial is not None
    with pytest.raises((CapacityError, CageError)) as caught:
        make_plan(contract(group), SITE, "s")
    assert plan.partial.placed <= caught.value.fits < plan.partial.asked
    assert plan.partial.placed >= 0.9 * caught.value.fits
    assert plan.partial.short(None) == f"{plan.partial.placed} of {plan.partial.asked}"
    assert plan.partial.short(None).replace("of", "of the") in plan.partial.sentence


def test_each_group_gets_what_fits() -> None:
    plan = partial({"relation": "corners", "robots": 5}, {"relation": "inside", "robots": 300})
    held = plan.formation.contract.groups
    assert (held[0].robots, plan.partial and plan.partial.asked) == (4, 305)
    assert 40 < held[1].robots < 300


RING: dict[str, object] = {"relation": "around", "clearance": (20, 20)}
CORNERS: dict[str, object] = {"relation": "corners", "robots": 4}
IN_EACH_OTHERS_WAY: list[tuple[dict[str, object], dict[str, object], int]] = [
    (RING | {"robots": 26}, RING | {"robots": 26}, 36),
    (RING | {"robots": 26}, RING | {"robots": 10}, 28),
    (RING | {"robots": 26}, RING | {"relation": "cage", "robots": 12}, 14),
    (CORNERS, CORNERS, 4),
    ({"relation": "inside", "robots": 30}, {"relation": "inside", "robots": 30}, 30),
    ({"relation": "centre", "robots": 4}, {"relation": "centre", "robots": 4}, 4),
]


@pytest.mark.parametrize(("first", "second", "least"), IN_EACH_OTHERS_WAY, ids=str)
def test_groups_that_crowd_each_other_give_way(
    first: dict[str, object], second: dict[str, object], least: int
) -> None:
    with pytest.raises(CrowdedError):
        make_plan(contract(first, second, radius=10), SITE, "s")
    plan = partial(first, second, radius=10)
    assert plan.partial is not None
    assert least <= plan.partial.placed < plan.partial.asked
    assert f"{plan.partial.placed} of the {plan.partial.asked} robots" in plan.partial.sentence
    assert "in group" in plan.partial.sentence


@pytest.mark.parametrize(
    ("group", "least", "greatest"),
    [
        ({"relation": "around", "clearance": (500, 510)}, 120, 160),
        ({"relation": "cage", "clearance": (300, 310)}, 120, 160),
        ({"relation": "inside", "clearance": (90, 1000)}, 40, 53),
        ({"relation": "along", "side": "top", "clearance": (200, 210)}, 130, 153),
    ],
)
def test_the_nearest_clearance_that_can_be_held(
    group: dict[str, object], least: float, greatest: float
) -> None:
    plan = partial(group | {"robots": 4})
    assert plan.partial is not None and plan.partial.clearance is not None
    assert plan.partial.placed == 4
    assert least < plan.partial.clearance[0] < greatest
    assert f"{plan.partial.clearance[0]:.1f}" in plan.partial.sentence


def test_too_few_for_a_cage_get_the_number_and_no_partial_cage() -> None:
    group: dict[str, object] = {"relation": "cage", "robots": 3, "closure": "escape-proof"}
    with pytest.raises(CageError, match=r"\d+ robots would do") as caught:
        make_plan(contract(group), SITE, "s")
    assert caught.value.needed is not None
    assert best_partial(contract(group), SITE, "s", caught.value) is None
    enough = contract(group | {"robots": caught.value.needed})
    assert make_plan(enough, SITE, "s").verdict.certified


def test_the_id_covers_the_shortfall_and_whole_plans_keep_theirs() -> None:
    plan = partial({"relation": "corners", "robots": 6})
    assert plan.id != plan.formation.id
    whole = plan.model_copy(update={"partial": None})
    assert whole.id == plan.formation.id
    assert Plan.model_validate_json(whole.model_dump_json()) == whole
    assert Plan.model_validate_json(plan.model_dump_json()).id == plan.id
    assert plan.partial is not None
    other = plan.partial.model_copy(update={"asked": 7})
    assert plan.model_copy(update={"partial": other}).id != plan.id


@pytest.fixture
def work(tool_calls: Callable[..., "ToolCalls"]) -> "ToolCalls":
    picture = picture_from_array(np.full((480, 640, 3), 90, np.uint8))
    target = Target(
        id="t1", label="brick", box=BRICK.bounds, confidence=1.0, outline=BRICK, prompt="outline"
    )
    return tool_calls(picture, world=World.of(picture, targets=(target,)))


def test_what_one_group_leaves_no_place_for_is_said_by_name(work: "ToolCalls") -> None:
    group = {"relation": "centre", "targets": ["t1"], "robots": 4}
    said = r"group 1 and of group 2.*certified as partial: .*0 of 4 in group 2"
    with pytest.raises(ToolError, match=said):
        wanted = {"groups": [group, group], "robot_radius": 10}
        work.call("propose_formation", contract=wanted)
    (node,) = work.world.plans.values()
    plan = node.plan
    assert plan.partial is not None and plan.partial.asked == 8


def test_a_proposal_names_the_partial_plan_which_only_a_person_may_have_driven(
    work: "ToolCalls",
) -> None:
    group = {"relation": "corners", "targets": ["t1"], "robots": 6}
    with pytest.raises(ToolError, match=r"only 4 robots fit.*4 of the 6 robots") as caught:
        work.call("propose_formation", contract={"groups": [group]})
    (node,) = work.world.plans.values()
    plan = node.plan
    assert caught.value.kind == "capacity"
    assert (caught.value.facts["robots_that_fit"], caught.value.facts["partial_plan"]) == (
        4,
        plan.id,
    )
    assert str(caught.value).startswith(caught.value.facts["plain"])
    with pytest.raises(ToolError, match=r"partial \(4 of 6\)"):
        work.call("deploy", plan_id=plan.id)
    assert not work.world.arrivals
    work.fix(approved="p-0123456789")
    with pytest.raises(ToolError, match="partial"):
        work.call("deploy", plan_id=plan.id)
    work.fix(approved=plan.id)
    work.call("deploy", plan_id=plan.id)
    assert isinstance(work.world.arrivals[plan.id], Arrival)
    assert work.world.arrivals[plan.id].arrived


def test_a_ring_the_picture_cuts_open_is_offered_nearer(work: "ToolCalls") -> None:
    group = {"relation": "cage", "targets": ["t1"], "robots": 9, "clearance": [190, 200]}
    data = work.call("propose_formation", contract={"groups": [group]}).data
    assert data["certified"] is False
    partial_id, shown = list(work.world.plans)
    assert shown == data["plan_id"]
    assert data["partial"]["plan_id"] == partial_id


def test_a_search_among_cages_in_each_others_way_is_cut_short_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[int] = []
    whole = cages.flood

    def counted(*args: Any, **more: Any) -> Any:
        made.append(1)
        return whole(*args, **more)

    monkeypatch.setattr(cages, "flood", counted)
    cup = [(200, 150), (240, 150), (240, 270), (380, 270), (380, 150), (420, 150), (420, 330)]
    site = Site({"t1": make_outline([*cup, (200, 330)])}, 640, 480)
    ring: dict[str, object] = {"relation": "around", "robots": 40, "clearance": (10, 30)}
    cage: dict[str, object] = {
        "relation": "cage",
        "closure": "escape-proof",
        "robots": 10,
        "clearance": (18, 22),
    }
    cage["min_spacing"] = 12
    held = contract(ring, cage, radius=0)
    with search_budget():
        with pytest.raises(CrowdedError) as caught:
            make_plan(held, site, "s")
        plan = best_partial(held, site, "s", caught.value)
    assert len(made) < 150
    assert plan is not None
    assert plan.partial is not None
    assert plan.partial.sentence.endswith(CUT_SHORT)
