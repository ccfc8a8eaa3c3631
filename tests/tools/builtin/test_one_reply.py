"""Propose and deploy in one reply, doubts about the contract, and masks that must be looked at."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from formup.tools.builtin.targets import CLEAR
from formup.tools.errors import ToolError
from formup.tools.perception.image import picture_from_array
from formup.tools.store import StoredWorld, read_world
from formup.tools.tool import ToolResult
from formup.tools.world import World

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]

TARGET = {"id": "t1", "label": "the box", "box": [55, 35, 125, 95]}

DRAWN = [[60, 40], [119, 40], [119, 60], [150, 65], [119, 70], [119, 89], [60, 89]]
MENDED = {"id": "t1", "label": "the box", "outline": DRAWN, "points": [[140, 65]]}


@pytest.fixture
def begin(tool_calls: Begin) -> Begin:
    """Calls on a red 60 x 50 rectangle at (60, 40) on grey."""
    pixels = np.full((140, 200, 3), 90, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return partial(tool_calls, picture_from_array(pixels))


def stored(world: World, folder: Path) -> World:
    """The world written to a file and read back."""
    path = folder / "state.json"
    path.write_bytes(StoredWorld(world=world).to_bytes())
    return read_world(path).world


def propose(
    work: "ToolCalls", relation: str = "around", robots: int = 6, **more: Any
) -> ToolResult:
    groups = [{"relation": relation, "targets": ["t1"], "robots": robots}]
    given = {"targets": [TARGET]} | more
    return work.call("propose_formation", contract={"groups": groups, "reading": ""}, **given)


def test_deploy_takes_the_plan_proposed_last_and_tells_what_was_observed(begin: Begin) -> None:
    work = begin()
    propose(work, "corners", 4)
    plan = propose(work, "around", 6).data["plan_id"]
    result = work.call("deploy", tell="Six robots stand around the box.")
    assert result.data["plan_id"] == plan
    assert list(work.world.arrivals) == [plan]
    assert result.message is not None
    said, observed = result.message.split("box. ")
    assert said == "Six robots stand around the "
    worst = max(work.world.arrivals[plan].residual_px)
    assert f"within {max(worst, 0.1):.1f} px" in observed
    assert observed.startswith("All 6 robots")


def test_how_robots_were_assigned_is_said_only_where_it_is_approximate(
    begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "assignment" not in str(propose(begin()).data["notes"])
    for module in ("geometry.assignment", "builtin.motions"):
        monkeypatch.setattr(f"formup.tools.{module}.EXACT", 3)
    work = begin()
    data = propose(work).data
    text = data["notes"][-1]
    assert text.startswith("Which robot takes which place is approximate: another assignment")
    assert "could save 0.00% of" in text
    assert work.world.plan(data["plan_id"]).plan.verdict.notes[-1] == text


def test_without_words_for_the_person_the_run_goes_on(begin: Begin) -> None:
    work = begin()
    propose(work)
    assert work.call("deploy").message is None


def test_there_must_be_a_plan_and_it_must_be_certified(begin: Begin) -> None:
    work = begin()
    with pytest.raises(
        ToolError, match=r"No plan was made in this reply; name plan_id\. Plans: none yet"
    ):
        work.call("deploy")
    crowded = propose(work, positions=[[10, 10]] * 6)
    assert not crowded.data["certified"]
    with pytest.raises(ToolError, match="is not certified"):
        work.call("deploy", tell="done")
    assert work.world.arrivals == {}


def test_a_doubtful_outline_must_be_looked_at_before_robots_move(begin: Begin) -> None:
    work = begin()
    made = propose(work)
    (target,) = work.world.targets
    assert target.confidence > CLEAR
    assert made.images == ()
    doubtful = target.model_copy(update={"confidence": CLEAR - 0.01})
    work.keep(work.world.with_target(doubtful))
    again = propose(work, robots=5, targets=[])
    assert len(again.images) == 1
    held = work.call("deploy", tell="done")
    assert held.data["deployed"] is False
    assert "t1 was measured with confidence 0.69. If the outline shown follows" in held.data["why"]
    assert held.message is None
    assert work.world.arrivals == {}
    assert work.call("deploy", plan_id=again.data["plan_id"]).data["arrived"]


def test_a_mask_that_is_refused_is_shown(begin: Begin) -> None:
    work = begin(threshold=1.0)
    for name, arguments in (
        ("segment", {"box": TARGET["box"]}),
        (
            "propose_formation",
            {
                "targets": [TARGET | {"points": [[90, 60]]}],
                "contract": {
                    "groups": [{"relation": "around", "targets": ["t1"], "robots": 4}],
                },
            },
        ),
    ):
        with pytest.raises(ToolError, match="Insufficient segmentation accuracy") as caught:
            work.call(name, **arguments)
        (image,) = caught.value.images
        assert image.startswith(b"\xff\xd8")


def test_an_error_that_is_about_no_mask_shows_none(begin: Begin) -> None:
    with pytest.raises(ToolError, match="inverted") as caught:
        begin().call("segment", box=[9, 9, 3, 3])
    assert caught.value.images == ()
    with pytest.raises(ToolError, match="inverted"):
        begin().call("look", region=[9, 9, 3, 3])


def test_a_contract_against_the_plain_words_is_asked_about(begin: Begin) -> None:
    work = begin("Put 6 robots at the corners of the box")
    with pytest.raises(ToolError, match=r"A doubt: .*'corners'.*`reading`") as caught:
        propose(work)
    assert "speaks of" not in str(caught.value)
    assert work.world.plans == {}
    with pytest.raises(ToolError, match=r"speaks of 6 robots, the contract has 4; .*'corners'"):
        propose(work, robots=4)


def test_deploy_without_an_id_takes_no_plan_of_an_earlier_reply(begin: Begin) -> None:
    work = begin()
    plan = propose(work).data["plan_id"]
    work.context = replace(work.context, proposed=None)
    with pytest.raises(ToolError, match=rf"name plan_id\. Plans: {plan}\."):
        work.call("deploy", tell="done")
    assert work.moved == []


def test_a_reading_given_before_any_doubt_settles_nothing(begin: Begin) -> None:
    work = begin("Put 6 robots at the corners of the box")
    group = {"relation": "around", "targets": ["t1"], "robots": 6}
    contract: dict[str, Any] = {"groups": [group], "reading": "A ring is what is meant."}
    for robots in (6, 4):  # the second has a doubt of its own beside the one that was answered
        contract["groups"] = [group | {"robots": robots}]
        with pytest.raises(ToolError, match="A doubt") as caught:
            work.call("propose_formation", contract=contract, targets=[TARGET])
        assert caught.value.kind == "doubt"
    assert work.world.plans == {}


def test_a_reading_settles_the_doubt_and_stays_in_the_contract(begin: Begin) -> None:
    work = begin("Put 6 robots at the corners of the box", robots=6)
    with pytest.raises(ToolError, match="A doubt"):
        propose(work)
    contract = {
        "groups": [{"relation": "around", "targets": ["t1"], "robots": 6}],
        "reading": "The box has four corners; the person said a ring will do.",
    }
    made = work.call("propose_formation", contract=contract, targets=[TARGET]).data
    assert made["certified"]
    kept = work.world.plans[made["plan_id"]].plan.formation.contract
    assert kept.reading == contract["reading"]


def test_where_a_distance_is_named_the_outline_is_seen_first(begin: Begin, tmp_path: Path) -> None:
    work = begin()
    groups = [{"relation": "around", "targets": ["t1"], "robots": 6, "clearance": [9, 9]}]
    made = work.call("propose_formation", contract={"groups": groups}, targets=[TARGET])
    assert made.data["certified"]
    assert len(made.images) == 1
    held = work.call("deploy", tell="They stand.")
    assert held.message is None
    assert "t1 has an edge that a named distance is measured from" in held.data["why"]
    call = f'call deploy {{"plan_id": "{made.data["plan_id"]}", "tell": "..."}}.'
    assert f"within about 3 px, {call}" in held.data["why"]
    assert held.data["why"] == f"Look first: {made.data['look_first']}"
    assert work.world.arrivals == {}
    again = begin(world=stored(work.world, tmp_path))
    again.context = replace(again.context, proposed=made.data["plan_id"])
    assert again.call("deploy", tell="They stand.").data == held.data
    assert work.call("deploy", plan_id=made.data["plan_id"], tell="They stand.").message


def test_a_plan_that_is_proposed_again_is_valid_again_and_deployed_by_its_id(begin: Begin) -> None:
    work = begin()
    groups = [{"relation": "around", "targets": ["t1"], "robots": 6, "clearance": [9, 9]}]
    first = work.call("propose_formation", contract={"groups": groups}, targets=[TARGET])
    other = work.call("propose_formation", contract={"groups": groups}, targets=[MENDED])
    assert other.data["plan_id"] != first.data["plan_id"]
    with pytest.raises(ToolError, match=r"is void: the picture or its scale is another"):
        work.call("deploy", plan_id=first.data["plan_id"])
    again = work.call("propose_formation", contract={"groups": groups}, targets=[TARGET])
    assert again.data["plan_id"] == first.data["plan_id"]
    assert work.call("deploy", tell="They stand.").data["deployed"] is False
    assert work.call("deploy", plan_id=again.data["plan_id"]).data["arrived"]


def test_words_for_the_person_end_the_turn_where_nothing_is_to_move(begin: Begin) -> None:
    work = begin(may_deploy=False)
    assert propose(work, tell="Six would stand around the box.").message == (
        "Six would stand around the box."
    )
    assert propose(work).message is None
    assert propose(work, positions=[[10, 10]] * 6, tell="Done.").message is None
    assert propose(begin(), tell="Done.").message is None
    unseen = propose(begin(may_deploy=False, clearance=9), tell="Done.")
    assert unseen.data["certified"]
    assert unseen.message is None
    assert "deploy" not in unseen.data["look_first"]
    assert "within about 3 px, reply with `tell` as text" in unseen.data["look_first"]


def test_a_small_thing_is_shown_whatever_comes_of_the_proposal(tool_calls: Begin) -> None:
    pixels = np.full((300, 400, 3), 90, np.uint8)
    pixels[140:170, 100:200] = (200, 40, 40)
    work = tool_calls(picture_from_array(pixels))
    thing = {"id": "t1", "box": [95, 135, 205, 175]}
    placed = propose(work, targets=[thing])
    assert (placed.data["certified"], len(placed.images)) == (True, 1)
    assert "look_first" not in placed.data
    assert propose(work, robots=5, targets=[]).images == ()
    with pytest.raises(ToolError) as refused:
        propose(work, "inside", 5000, targets=[thing])
    assert len(refused.value.images) == 1
    assert len(work.call("segment", **thing).images) == 1


def test_a_distance_the_person_fixed_has_the_outline_shown_first_too(begin: Begin) -> None:
    work = begin(clearance=9)
    made = propose(work)
    assert len(made.images) == 1
    assert work.call("deploy").data["deployed"] is False


def test_so_many_points_correct_an_outline_at_most(begin: Begin, tmp_path: Path) -> None:
    work = begin()
    work.call("segment", id="t1", outline=DRAWN, points=[[70, 50]] * 15)
    with pytest.raises(ToolError, match=r"t1 would have 25 points .* 20 at most"):
        work.call("segment", id="t1", points=[[70, 50]] * 10)
    assert stored(work.world, tmp_path) == work.world


def test_points_alone_correct_an_outline_that_was_drawn(begin: Begin, tmp_path: Path) -> None:
    work = begin()
    first = propose(work, targets=[{"id": "t1", "label": "the box", "outline": DRAWN}])
    assert "points" in first.data["look_first"]
    mended = propose(work, targets=[{"id": "t1", "points": [[140, 65]]}])
    assert mended.data["targets"][0]["label"] == "the box"
    assert "leaves_out_of_yours" not in mended.data["targets"][0]
    assert mended.data["corrected"]["t1"]["added_px"] > 30
    assert mended.data["corrected"]["t1"]["removed_px"] == 0
    assert len(mended.images) == 1
    at_once = propose(begin(), targets=[MENDED])
    assert mended.data["targets"] == at_once.data["targets"]
    cut = propose(work, targets=[{"id": "t1", "negative": [[130, 65]]}])
    assert cut.data["targets"][0]["area_px"] < mended.data["targets"][0]["area_px"]
    assert stored(work.world, tmp_path).targets == work.world.targets
    with pytest.raises(ToolError, match="Negative points alone correct an outline that was drawn"):
        propose(work, targets=[{"id": "t2", "negative": [[140, 65]]}])


def test_what_was_drawn_and_is_left_out_holds_a_deployment_back(begin: Begin) -> None:
    work = begin()
    outlined = {"id": "t1", "outline": DRAWN}
    made = propose(work, targets=[outlined])
    (left,) = made.data["targets"][0]["leaves_out_of_yours"]
    assert (left["x"], left["y"]) == (150, 65)
    assert left["px"] == pytest.approx(6, abs=2)
    assert len(made.images) == 1
    assert "t1 as measured leaves out your (150, 65) by" in work.call("deploy").data["why"]
    assert work.call("deploy", plan_id=made.data["plan_id"]).data["arrived"]
    clear = propose(begin(), targets=[outlined | {"outline": DRAWN[:3] + DRAWN[4:]}])
    assert "leaves_out_of_yours" not in clear.data["targets"][0]
    assert clear.images == ()
