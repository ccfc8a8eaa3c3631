"""Cages in contracts: what is certified, what a model is told, and where the robots are put."""

import math

import numpy as np
import pytest
from formup.tools.draw import draw_plan
from formup.tools.errors import ToolError
from formup.tools.formation.checking.check import certify
from formup.tools.formation.checking.verdict import Verdict
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.caging import CageError
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import Outline, make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.world import Target, World
from pydantic import ValidationError

ELL = make_outline([(250, 150), (400, 150), (400, 200), (300, 200), (300, 300), (250, 300)])
SQUARE = make_outline([(250, 180), (350, 180), (350, 280), (250, 280)])


def planned(thing: Outline, n: int, radius: float = 3.0, **more: object) -> Plan:
    group = Group.model_validate({"relation": "cage", "targets": ["t1"], "robots": n} | more)
    contract = Contract(groups=(group,), robot_radius=radius)
    return make_plan(contract, Site({"t1": thing}, 640, 480), "s")


@pytest.mark.parametrize(
    ("thing", "n", "state"), [(SQUARE, 4, "gets out"), (SQUARE, 9, "certified")]
)
def test_of_a_ring_it_is_reported_whether_it_holds_and_no_fault_found(
    thing: Outline, n: int, state: str
) -> None:
    verdict = planned(thing, n).verdict
    assert verdict.certified
    assert verdict.measures["escape_proof"] == state
    assert verdict.measures.get("escape_test") == ("disc" if state == "certified" else None)
    assert (verdict.escape is not None) == (state == "gets out")
    assert Verdict.model_validate_json(verdict.model_dump_json()) == verdict


def test_a_verdict_of_before_cages_were_judged_still_loads() -> None:
    old = '{"certified": true, "findings": [], "measures": {"min_spacing_px": 3.5}, "notes": []}'
    assert Verdict.model_validate_json(old).escape is None


@pytest.mark.parametrize("thing", [SQUARE, ELL])
@pytest.mark.parametrize("n", [4, 12])
def test_escape_proof_is_placed_certified_or_refused_with_a_number(thing: Outline, n: int) -> None:
    try:
        plan = planned(thing, n, closure="escape-proof")
    except CageError as error:
        assert error.needed is not None
        assert error.needed > n
        assert f"{error.needed} robots would do" in str(error)
        again = planned(thing, error.needed, closure="escape-proof")
        assert again.verdict.certified
        return
    assert plan.verdict.certified
    assert plan.verdict.measures["escape_proof"] == "certified"
    assert plan.verdict.escape is None


def test_escape_proof_where_nobody_can_stand_is_refused_in_words() -> None:
    edge = make_outline([(0, 100), (300, 100), (300, 300), (0, 300)])
    with pytest.raises(ToolError, match="no other number is known"):
        planned(edge, 5, closure="escape-proof")


def test_what_escape_proof_lacks_is_said_so_that_one_turn_mends_it() -> None:
    loose = planned(SQUARE, 4)
    group = loose.formation.contract.groups[0].model_copy(update={"closure": "escape-proof"})
    contract = loose.formation.contract.model_copy(update={"groups": (group,)})
    site = Site({"t1": SQUARE}, 640, 480)
    verdict = certify(loose.formation.points, contract, site)
    (finding,) = verdict.findings
    assert (finding.kind, finding.about, len(finding.others)) == ("gets_out", "t1", 2)
    said = finding.sentence
    assert said.startswith("t1 can get out between the robots, on a way that was checked")
    assert "leave a gap of" in said
    assert finding.limit == pytest.approx(100, rel=0.01), "the diameter of the inscribed disc"
    assert finding.needed is not None
    assert f"{finding.needed} robots evenly on the ring do" in said
    assert planned(SQUARE, finding.needed).verdict.measures["escape_test"] == "disc"


def test_uneven_robots_are_no_fault_of_an_escape_proof_cage_but_of_a_ring() -> None:
    even = planned(SQUARE, 12)
    points = np.delete(even.formation.points, 3, axis=0)
    site = Site({"t1": SQUARE}, 640, 480)
    for closure, certified in (("ring", False), ("escape-proof", True)):
        group = even.formation.contract.groups[0].model_copy(
            update={"closure": closure, "robots": 11}
        )
        contract = even.formation.contract.model_copy(update={"groups": (group,)})
        assert certify(points, contract, site).certified is certified


def test_the_pictures_border_is_a_wall_only_where_that_is_said() -> None:
    edge = make_outline([(2, 200), (102, 200), (102, 260), (2, 260)])
    plan = planned(edge, 8, closure="escape-proof", walls=True)
    assert plan.verdict.certified
    group = plan.formation.contract.groups[0].model_copy(update={"walls": None})
    contract = plan.formation.contract.model_copy(update={"groups": (group,)})
    found = certify(plan.formation.points, contract, Site({"t1": edge}, 640, 480))
    assert [f.kind for f in found.findings] == ["gets_out"]
    with pytest.raises(ValidationError, match="walls belong to the closure escape-proof"):
        Group(relation="cage", targets=("t1",), robots=4, walls=True)
    with pytest.raises(ValidationError, match="walls belongs to cage"):
        Group(relation="around", targets=("t1",), robots=4, walls=False)


@pytest.mark.parametrize("side", [3.0, 60.0])
@pytest.mark.parametrize("radius", [0.0, 5.0])
def test_walls_never_take_more_robots(side: float, radius: float) -> None:
    """What cages without walls does so with them: they only take ways away."""
    thing = make_outline(
        [(300, 200), (300 + side, 200), (300 + side, 200 + side), (300, 200 + side)]
    )
    needed: dict[bool | None, int] = {}
    for walls in (None, True):
        with pytest.raises(CageError) as caught:
            planned(thing, 3, radius, closure="escape-proof", walls=walls)
        assert caught.value.needed is not None
        needed[walls] = caught.value.needed
    assert needed[True] <= needed[None]
    plan = planned(thing, needed[None], radius, closure="escape-proof", walls=True)
    assert plan.verdict.certified


@pytest.mark.parametrize("radius", [0.0, 5.0])
@pytest.mark.parametrize("thing", [SQUARE, ELL], ids=["square", "ell"])
def test_too_few_for_the_openings_that_are_named_say_how_many_would_do(
    thing: Outline, radius: float
) -> None:
    few = planned(thing, 7, radius, max_gap=20)
    assert not few.verdict.certified
    enough = few.verdict.findings[0].needed
    assert enough is not None
    assert f"; {enough} robots evenly would do" in few.verdict.findings[0].sentence
    assert planned(thing, enough, radius, max_gap=20).verdict.certified
    assert not planned(thing, enough - 3, radius, max_gap=20).verdict.certified


def test_robots_that_have_no_room_on_the_ring_are_counted() -> None:
    speck = make_outline([(300, 200), (303, 200), (303, 203), (300, 203)])
    with pytest.raises(CageError, match=r"no more than [3-9] have room there") as caught:
        planned(speck, 13, 5.0, closure="escape-proof")
    assert planned(speck, caught.value.fits, 5.0, closure="escape-proof").verdict.certified


def test_a_way_out_is_drawn_on_the_plan() -> None:
    pixels = np.full((480, 640, 3), 120, dtype=np.uint8)
    target = Target(
        id="t1", label="thing", box=ELL.bounds, confidence=0.9, outline=ELL, prompt="box"
    )
    picture = picture_from_array(pixels)
    world = World.of(picture).with_target(target)
    orange = (255, 128, 14)
    for n, shown in ((5, True), (14, False)):
        plan = planned(ELL, n)
        assert (plan.verdict.escape is not None) is shown
        image = np.asarray(draw_plan(picture, world, plan, "Cage it"), dtype=int)
        near = np.abs(image - orange).max(axis=2) < 30
        assert near.any() == shown
    escape = planned(ELL, 5).verdict.escape
    assert escape is not None
    x, y, turn = escape.poses[0]
    assert turn == 0
    assert math.dist((x, y), ELL.centre) < 120
