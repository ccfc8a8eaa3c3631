"""Other things in a picture: found once, kept off, driven around, and named where they are not."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
import shapely
from formup.tools.builtin.motions import ways_ahead
from formup.tools.builtin.others import with_keep_outs, with_others
from formup.tools.builtin.tracks import read_track
from formup.tools.context import Context, Services, Settings
from formup.tools.errors import InputError, ToolError
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.formation.contract import Contract, Group
from formup.tools.perception.detectors.candidates import StandoutDetector
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from formup.tools.store import plan_file, read_world
from shapely.geometry import LineString

if TYPE_CHECKING:
    from pathlib import Path

    from ..conftest import ToolCalls

RED = (130, 130, 270, 270)
NEAR = (292, 160, 332, 240)
Begin = Callable[..., "ToolCalls"]


def picture(*boxes: tuple[int, int, int, int]) -> Picture:
    """A red square at (130, 130) to (270, 270) and blue boxes, on grey."""
    pixels = np.full((400, 560, 3), 150, np.uint8)
    cv2.rectangle(pixels, RED[:2], RED[2:], (200, 40, 40), -1)
    for box in boxes:
        cv2.rectangle(pixels, box[:2], box[2:], (40, 40, 200), -1)
    return picture_from_array(pixels)


def group(relation: str, robots: int, *targets: str, **more: Any) -> dict[str, Any]:
    return {"relation": relation, "targets": targets or ("t1",), "robots": robots, **more}


def propose(work: "ToolCalls", *groups: dict[str, Any], **more: Any) -> dict[str, Any]:
    targets = [{"id": "t1", "label": "red square", "box": (126, 126, 274, 274)}]
    contract = {"groups": groups, **more}
    return work.call("propose_formation", contract=contract, targets=targets).data


def test_robots_are_placed_and_driven_off_things_that_nobody_named(tool_calls: Begin) -> None:
    work = tool_calls(picture(NEAR, (20, 20, 60, 60), (300, 330, 400, 370)))
    assert propose(work, group("around", 8))["notes"] == []
    work.call("deploy")
    node = work.world.plan()
    site = work.world.site(node.plan.formation.contract)
    solid = shapely.union_all([thing.region for thing in site.others])
    assert len(site.others) == 3
    assert solid.distance(shapely.MultiPoint(node.plan.formation.points)) > 4
    assert node.encounters == ()


def test_what_has_the_target_in_its_hole_is_kept_off(tool_calls: Begin) -> None:
    pixels = np.full((600, 800, 3), 150, np.uint8)
    cv2.rectangle(pixels, (60, 60), (340, 340), (40, 40, 200), 24)
    cv2.rectangle(pixels, (150, 150), (250, 250), (200, 40, 40), -1)
    work = tool_calls(picture_from_array(pixels))
    (note,) = propose(work, group("around", 8))["notes"]
    assert "drive over c2 (blue thing): no way around it" in note
    (frame,) = work.world.site(work.world.plan().plan.formation.contract).others
    assert np.abs(work.world.plan().plan.formation.points - 200).max() < 126
    tight = propose(work, group("along", 3, side="right", clearance=(84, 90)))
    assert f"stand on or right beside {frame.id} (blue thing)" in " ".join(tight["notes"])
    work.keep(with_keep_outs(work.context, [TargetPrompt(candidate=frame.id)]))
    assert propose(work, group("around", 8))["certified"]
    assert np.abs(work.world.plan().plan.formation.points - 200).max() < 126
    tight = propose(work, group("along", 3, side="right", clearance=(84, 90)))
    assert not tight["certified"]
    assert any("k1" in finding for finding in tight["findings"])


def test_where_they_cannot_be_robot_and_thing_are_named_and_certified_all_the_same(
    tool_calls: Begin,
) -> None:
    work = tool_calls(picture((290, 60, 330, 340)))
    data = propose(work, group("along", 3, side="right", clearance=(38, 42)))
    node = work.world.plan()
    assert data["certified"]
    assert [(e.how, len(e.robots)) for e in node.encounters] == [("on", 3)]
    assert f"on or right beside {node.encounters[0].thing} (blue thing)" in data["notes"][-1]


def test_who_stands_at_the_border_is_named(tool_calls: Begin) -> None:
    work = tool_calls(picture())
    places = [(0.0, 50.0), (50.0, 50.0)]
    targets = [{"id": "t1", "box": (126, 126, 274, 274)}]
    contract = {"groups": [{"relation": "shape", "robots": 2}]}
    sent = work.call("propose_formation", contract=contract, targets=targets, positions=places)
    assert any("border" in note and note.startswith("Robot ") for note in sent.data["notes"])


def test_another_measured_target_is_such_a_thing_too(tool_calls: Begin) -> None:
    work = tool_calls(picture(NEAR))
    work.call("segment", id="t2", label="blue", box=(288, 156, 336, 244))
    propose(work, group("around", 6))
    others = work.world.site(work.world.plan().plan.formation.contract).others
    assert [thing.id for thing in others] == ["t2"]


def test_a_picture_is_searched_once_by_all_who_share_what_was_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searched: list[Picture] = []
    found = StandoutDetector.detect

    def detect(self: StandoutDetector, picture: Picture) -> Any:
        searched.append(picture)
        return found(self, picture)

    monkeypatch.setattr(StandoutDetector, "detect", detect)
    one, other = picture(NEAR, (5, 5, 40, 40)), picture(NEAR, (5, 5, 40, 41))
    for shown in (one, one, other):
        with_others(Context.of(shown))
    assert [p.sha256 for p in searched] == [one.sha256, other.sha256]
    with_others(replace(Context.of(one), services=Services({one.sha256: one}, found={})))
    assert len(searched) == 3


@pytest.mark.parametrize(
    "prompt",
    [
        TargetPrompt(box=(280, 140, 340, 260)),
        TargetPrompt(outline=((280, 140), (340, 140), (340, 260), (280, 260))),
        TargetPrompt(points=((310, 200),)),
    ],
    ids=lambda p: p.how,
)
def test_a_hard_keep_out_is_entered_by_neither_places_nor_paths(
    tool_calls: Begin, prompt: TargetPrompt
) -> None:
    work = tool_calls(picture(NEAR), robot_radius=3.0)
    work.keep(with_keep_outs(work.context, [prompt]))
    data = propose(work, group("around", 7))
    assert data["certified"]
    work.call("deploy")
    contract = work.world.plan().plan.formation.contract
    region = work.world.outline("k1").filled
    assert contract.keep_out == ("k1",)
    assert region.distance(shapely.MultiPoint(work.world.plan().plan.formation.points)) > 3
    arrival = work.world.arrivals[data["plan_id"]]
    assert arrival.track is not None
    track = read_track(work.context.services.artefacts.get(arrival.track))
    ways = [LineString(track.points[:, i]) for i in range(track.points.shape[1])]
    assert min(region.distance(way) for way in ways) > 2


def test_a_way_out_of_the_picture_is_taken_where_there_is_no_other_and_told(
    tool_calls: Begin,
) -> None:
    work = tool_calls(picture(), robot_radius=6.0)
    work.keep(with_keep_outs(work.context, [TargetPrompt(box=(300, 2, 320, 398))]))
    notes = propose(work, group("around", 6))["notes"]
    assert any("leave the picture on the way" in note for note in notes)
    (met,) = (e for e in work.world.plan().encounters if e.how == "beyond")
    assert set(met.robots) < set(work.world.plan().plan.formation.robots)


def test_a_long_way_round_a_line_on_the_floor_is_told(tool_calls: Begin) -> None:
    work = tool_calls(picture((310, 8, 316, 340)), starts=((345, 200),))
    (note,) = propose(work, group("along", 1, side="right"))["notes"]
    assert "times as far to get round c2 (blue thing) as over it" in note
    (met,) = work.world.plan().encounters
    assert (met.how, met.robots) == ("round", ("1",))


def test_the_ways_of_a_plan_are_known_until_its_robots_move(tool_calls: Begin) -> None:
    work = tool_calls(picture(NEAR))
    propose(work, group("around", 4))
    plan = work.world.plan().plan
    ways = ways_ahead(work.context, work.world, plan)
    places = dict(zip(plan.formation.robots, plan.formation.positions, strict=True))
    assert {pose.id: (pose.x, pose.y) for pose in work.world.robots} == {
        robot: tuple(way[0].tolist()) for robot, way in ways.items()
    }
    assert all(way[-1].tolist() == pytest.approx(places[robot]) for robot, way in ways.items())
    work.call("deploy")
    assert ways_ahead(work.context, work.world, plan) == {}


def test_a_plan_that_enters_a_keep_out_is_not_certified_and_the_region_changes_the_version(
    tool_calls: Begin,
) -> None:
    work = tool_calls(picture())
    stated = Contract(groups=(Group(relation="shape", line=(9, 9, 99, 9), robots=2),))
    free = work.world.version_of(stated)
    work.keep(with_keep_outs(work.context, [TargetPrompt(box=(280, 0, 559, 399))]))
    assert work.world.version_of(stated) != free
    data = propose(work, group("along", 4, side="right", clearance=(20, 22)))
    assert not data["certified"]
    assert all("k1" in finding for finding in data["findings"])


def test_a_keep_out_survives_in_a_plan_file(tool_calls: Begin, tmp_path: "Path") -> None:
    shown = picture(NEAR)
    work = tool_calls(shown)
    work.keep(with_keep_outs(work.context, [TargetPrompt(box=(20, 300, 80, 380))]))
    plan_id = propose(work, group("around", 5))["plan_id"]
    (tmp_path / "plan.json").write_bytes(plan_file(work.world, plan_id, "words", shown))
    again = read_world(tmp_path / "plan.json").world
    contract = again.plan(plan_id).plan.formation.contract
    assert contract.keep_out == ("k1",)
    assert again.outline("k1").bounds == (20, 300, 80, 380)
    assert [t.id for t in again.site(contract).others] == [
        t.id for t in work.world.site(contract).others
    ]


@pytest.mark.parametrize(
    ("prompt", "why"),
    [
        (TargetPrompt(box=(900, 900, 950, 950)), "outside the picture"),
        (TargetPrompt(candidate="c77"), "no candidate"),
        (TargetPrompt(points=((30, 380),)), "Insufficient segmentation accuracy"),
    ],
)
def test_a_keep_out_that_is_not_there_is_refused(prompt: TargetPrompt, why: str) -> None:
    context = Context.of(picture(NEAR), Settings(threshold=0.99))
    with pytest.raises(InputError, match=why):
        with_keep_outs(context, [prompt])


@pytest.mark.parametrize("shape", [None, {"kind": "circle", "where": "on"}])
def test_keeping_out_of_what_is_to_be_stood_on_is_refused(
    tool_calls: Begin, shape: dict[str, Any] | None
) -> None:
    work = tool_calls(picture())
    entering = (
        [group(relation, 3) for relation in ("inside", "centre")]
        if shape is None
        else [group("shape", 5, shape=shape)]
    )
    for one in entering:
        with pytest.raises(ToolError, match="t1, which keep_out forbids"):
            propose(work, one, keep_out=("t1",))
    assert propose(work, group("around", 5), keep_out=("t1",))["certified"]


def test_real_robots_that_the_picture_shows_are_none_of_its_things(
    tool_calls: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts = ((40.0, 40.0), (500.0, 40.0), (350.0, 350.0))
    boxes = [(x - 9, y - 9, x + 9, y + 9) for x, y in np.array(starts[:2], dtype=int).tolist()]
    seen = picture(*boxes, (300, 330, 400, 370))
    for real, things in ((False, 4), (True, 2)):  # the target and a box beside them
        monkeypatch.setattr(SimulatedFleet, "real", real)
        work = tool_calls(seen, starts=starts)
        propose(work, group("around", 3), robot_radius=10)
        assert len([k for k in work.world.keep_out if not k.hard]) == things, real
