"""Propose and deploy in one reply, doubts about the contract, and masks that must be looked at."""

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from formup.tools.builtin import TOOLS
from formup.tools.builtin.seeing import CLEAR
from formup.tools.errors import ToolError
from formup.tools.perception.image import picture_from_array
from formup.tools.scene import Scene
from formup.tools.store import restore, store
from formup.tools.tool import ToolResult
from formup.tools.world import Settings, Workspace

TARGET = {"id": "t1", "label": "the box", "box": [55, 35, 125, 95]}

DRAWN = [[60, 40], [119, 40], [119, 60], [150, 65], [119, 70], [119, 89], [60, 89]]
MENDED = {"id": "t1", "label": "the box", "outline": DRAWN, "points": [[140, 65]]}


def workspace(instruction: str = "", **settings: Any) -> Workspace:
    """A red 60 x 50 rectangle at (60, 40) on grey."""
    pixels = np.full((140, 200, 3), 90, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    picture = picture_from_array(pixels)
    return Workspace(Scene(picture), Settings(**settings), instruction=instruction)


def answer(work: Workspace, name: str, **arguments: Any) -> ToolResult:
    chosen = next(t for t in TOOLS if t.name == name)
    return asyncio.run(chosen.call(work, arguments))


def propose(work: Workspace, relation: str = "around", robots: int = 6, **more: Any) -> ToolResult:
    groups = [{"relation": relation, "targets": ["t1"], "robots": robots}]
    given = {"targets": [TARGET]} | more
    return answer(work, "propose_formation", contract={"groups": groups, "reading": ""}, **given)


def test_deploy_takes_the_plan_proposed_last_and_tells_what_was_observed() -> None:
    work = workspace()
    propose(work, "corners", 4)
    plan = propose(work, "around", 6).data["plan_id"]
    result = answer(work, "deploy", tell="Six robots stand around the box.")
    assert result.data["plan_id"] == plan
    assert list(work.arrivals) == [plan]
    assert result.told is not None
    said, observed = result.told.split("box. ")
    assert said == "Six robots stand around the "
    worst = max(work.arrivals[plan].residual_px)
    assert f"within {max(worst, 0.1):.1f} px" in observed
    assert observed.startswith("All 6 robots")


def test_how_robots_were_assigned_is_told_only_where_it_is_approximate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    work = workspace()
    propose(work)
    assert "assignment" not in answer(work, "deploy").data
    monkeypatch.setattr("formup.tools.geometry.assignment.EXACT", 3)
    again = workspace()
    propose(again)
    told = answer(again, "deploy").data["assignment"]
    assert told.startswith("approximate: another could have saved 0.00% of")


def test_without_words_for_the_person_the_run_goes_on() -> None:
    work = workspace()
    propose(work)
    assert answer(work, "deploy").told is None


def test_there_must_be_a_plan_and_it_must_be_certified() -> None:
    work = workspace()
    with pytest.raises(ToolError, match=r"no plan\. Plans: none yet"):
        answer(work, "deploy")
    crowded = propose(work, positions=[[10, 10]] * 6)
    assert not crowded.data["certified"]
    with pytest.raises(ToolError, match="is not certified"):
        answer(work, "deploy", tell="done")
    assert work.arrivals == {}


def test_a_doubtful_outline_must_be_looked_at_before_robots_move() -> None:
    work = workspace()
    made = propose(work)
    (target,) = work.scene.targets
    assert target.confidence > CLEAR
    assert made.images == ()
    work.scene = replace(work.scene, targets=(replace(target, confidence=CLEAR - 0.01),))
    again = propose(work, robots=5, targets=[])
    assert len(again.images) == 1
    held = answer(work, "deploy", tell="done")
    assert held.data["deployed"] is False
    assert "t1 was measured with confidence 0.69. If the outline shown follows" in held.data["why"]
    assert held.told is None
    assert work.arrivals == {}
    assert answer(work, "deploy", plan_id=again.data["plan_id"]).data["arrived"]


def test_a_mask_that_is_refused_is_shown() -> None:
    work = workspace(threshold=1.0)
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
            answer(work, name, **arguments)
        (image,) = caught.value.images
        assert image.startswith(b"\xff\xd8")


def test_an_error_that_is_about_no_mask_shows_none() -> None:
    with pytest.raises(ToolError, match="inverted") as caught:
        answer(workspace(), "segment", box=[9, 9, 3, 3])
    assert caught.value.images == ()
    with pytest.raises(ToolError, match="inverted"):
        answer(workspace(), "look", region=[9, 9, 3, 3])


def test_a_contract_against_the_plain_words_is_asked_about() -> None:
    work = workspace("Put 6 robots at the corners of the box")
    with pytest.raises(ToolError, match=r"A doubt: .*'corners'.*`reading`") as caught:
        propose(work)
    assert "speaks of" not in str(caught.value)
    assert work.plans == {}
    with pytest.raises(ToolError, match=r"speaks of 6 robots, the contract has 4; .*'corners'"):
        propose(work, robots=4)


def test_a_reading_settles_the_doubt_and_stays_in_the_contract() -> None:
    work = workspace("Put 6 robots at the corners of the box", robots=6)
    contract = {
        "groups": [{"relation": "around", "targets": ["t1"], "robots": 6}],
        "reading": "The box has four corners; the person said a ring will do.",
    }
    made = answer(work, "propose_formation", contract=contract, targets=[TARGET]).data
    assert made["certified"]
    kept = work.plans[made["plan_id"]].formation.contract
    assert kept.reading == contract["reading"]


def test_where_a_distance_is_named_the_outline_is_seen_first() -> None:
    work = workspace()
    groups = [{"relation": "around", "targets": ["t1"], "robots": 6, "clearance": [9, 9]}]
    made = answer(work, "propose_formation", contract={"groups": groups}, targets=[TARGET])
    assert made.data["certified"]
    assert len(made.images) == 1
    held = answer(work, "deploy", tell="They stand.")
    assert held.told is None
    assert "t1 has an edge that a named distance is measured from" in held.data["why"]
    assert f"within about 3 px, deploy plan_id {made.data['plan_id']}" in held.data["why"]
    assert held.data["why"] == f"Look first: {made.data['look_first']}"
    assert work.arrivals == {}
    again = restore(store(work), work.scene.picture, work.settings)
    assert answer(again, "deploy", tell="They stand.").data == held.data
    assert answer(work, "deploy", plan_id=made.data["plan_id"], tell="They stand.").told


def test_a_plan_that_is_proposed_again_is_valid_again_and_deployed_by_its_id() -> None:
    work = workspace()
    groups = [{"relation": "around", "targets": ["t1"], "robots": 6, "clearance": [9, 9]}]
    first = answer(work, "propose_formation", contract={"groups": groups}, targets=[TARGET])
    other = answer(work, "propose_formation", contract={"groups": groups}, targets=[MENDED])
    assert other.data["plan_id"] != first.data["plan_id"]
    with pytest.raises(ToolError, match=r"is void: what it is about was measured again since"):
        answer(work, "deploy", plan_id=first.data["plan_id"])
    again = answer(work, "propose_formation", contract={"groups": groups}, targets=[TARGET])
    assert again.data["plan_id"] == first.data["plan_id"]
    assert answer(work, "deploy", tell="They stand.").data["deployed"] is False
    assert answer(work, "deploy", plan_id=again.data["plan_id"]).data["arrived"]


def test_a_distance_the_person_fixed_has_the_outline_shown_first_too() -> None:
    work = workspace(clearance=9)
    made = propose(work)
    assert len(made.images) == 1
    assert answer(work, "deploy").data["deployed"] is False


def test_so_many_points_correct_an_outline_at_most() -> None:
    work = workspace()
    answer(work, "segment", id="t1", outline=DRAWN, points=[[70, 50]] * 15)
    with pytest.raises(ToolError, match=r"t1 would have 25 points .* 20 at most"):
        answer(work, "segment", id="t1", points=[[70, 50]] * 10)
    assert restore(store(work), work.scene.picture, work.settings).scene == work.scene


def test_points_alone_correct_an_outline_that_was_drawn() -> None:
    work = workspace()
    first = propose(work, targets=[{"id": "t1", "label": "the box", "outline": DRAWN}])
    assert "points" in first.data["look_first"]
    mended = propose(work, targets=[{"id": "t1", "points": [[140, 65]]}])
    assert mended.data["targets"][0]["label"] == "the box"
    assert "leaves_out_your_vertices" not in mended.data["targets"][0]
    at_once = propose(workspace(), targets=[MENDED])
    assert mended.data["targets"] == at_once.data["targets"]
    cut = propose(work, targets=[{"id": "t1", "negative": [[130, 65]]}])
    assert cut.data["targets"][0]["area_px"] < mended.data["targets"][0]["area_px"]
    again = restore(store(work), work.scene.picture, work.settings)
    assert again.scene.targets == work.scene.targets
    with pytest.raises(ToolError, match="Negative points alone correct an outline that was drawn"):
        propose(work, targets=[{"id": "t2", "negative": [[140, 65]]}])


def test_what_was_drawn_and_is_left_out_holds_a_deployment_back() -> None:
    work = workspace()
    outlined = {"id": "t1", "outline": DRAWN}
    made = propose(work, targets=[outlined])
    assert made.data["targets"][0]["leaves_out_your_vertices"] == ((150.0, 65.0),)
    assert len(made.images) == 1
    assert "t1 as measured leaves out your (150, 65) by 1" in answer(work, "deploy").data["why"]
    assert answer(work, "deploy", plan_id=made.data["plan_id"]).data["arrived"]
    clear = propose(workspace(), targets=[outlined | {"outline": DRAWN[:3] + DRAWN[4:]}])
    assert "leaves_out_your_vertices" not in clear.data["targets"][0]
    assert clear.images == ()
