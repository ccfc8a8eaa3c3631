"""Changes of the plan that stands: robots keep their numbers, what is not named stays."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.perception.image import Picture, picture_from_array

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]
BOX = (150, 120, 250, 200)


def picture() -> Picture:
    """A red block on grey."""
    pixels = np.full((400, 480, 3), 150, np.uint8)
    cv2.rectangle(pixels, BOX[:2], BOX[2:], (200, 40, 40), -1)
    return picture_from_array(pixels)


@pytest.fixture
def work(tool_calls: Begin) -> "ToolCalls":
    """Eight robots around the block."""
    calls = tool_calls(picture(), robots=8)
    group = {"relation": "around", "targets": ["t1"], "robots": 8}
    calls.call(
        "propose_formation", contract={"groups": [group]}, targets=[{"id": "t1", "box": BOX}]
    )
    calls.context = replace(calls.context, steps=(calls.world.having(current=None), calls.world))
    return calls


def edit(work: "ToolCalls", *edits: dict[str, Any], **more: Any) -> dict[str, Any]:
    return work.call("edit_formation", edits=list(edits), **more).data


def places(work: "ToolCalls") -> dict[str, tuple[float, float]]:
    formation = work.world.plan().plan.formation
    return dict(zip(formation.robots, formation.positions, strict=True))


def test_who_leaves_takes_their_number_away_and_the_next_one_gets_it(work: "ToolCalls") -> None:
    before, parent = places(work), work.world.current
    data = edit(work, {"kind": "remove", "robots": [3]})
    assert data["removed"] == ["3"]
    assert set(places(work)) == set(before) - {"3"}
    node = work.world.plan()
    assert (data["parent"], node.parent) == (parent, parent)
    assert node.edit == '[{"kind":"remove","robots":[3]}]'
    moved = {n for n in places(work) if np.hypot(*np.subtract(places(work)[n], before[n])) > 0.05}
    assert data["moving"] == len(moved)
    assert edit(work, {"kind": "add", "n": 1})["added"] == ["3"]
    work.call("deploy", plan_id=work.world.current)
    assert {pose.id for pose in work.world.robots} == set(before)


def test_edits_of_one_call_are_one_step_and_robots_are_called_by_number(work: "ToolCalls") -> None:
    before = places(work)
    edit(work, {"kind": "swap", "a": 2, "b": 5}, {"kind": "skip", "robots": [2]})
    left = places(work)
    assert set(left) == set(before) - {"2"}
    assert left["5"] == pytest.approx(before["2"], abs=0.01)
    with pytest.raises(ToolError, match="no robot 2: there are 1, 3, 4"):
        edit(work, {"kind": "skip", "robots": [2]})
    assert places(work) == left


def test_what_cannot_be_certified_changes_nothing(work: "ToolCalls") -> None:
    before, world = places(work), work.world
    with pytest.raises(ToolError, match="Nothing was changed") as caught:
        edit(work, {"kind": "shift", "dx": 5000})
    assert caught.value.kind == "edit"
    assert caught.value.facts["findings"]
    assert places(work) == before
    assert work.world.current == world.current


def test_undo_goes_back_and_forward_and_to_the_first_and_robots_stay(work: "ToolCalls") -> None:
    first = work.world.current
    work.call("deploy", plan_id=first)
    stood = work.world.robots
    edit(work, {"kind": "out", "px": 8})
    second = work.world.current
    assert work.call("undo").data["plan_id"] == first
    work.context = replace(work.context, steps=(*work.context.steps, work.world))
    assert work.world.robots == stood
    assert work.world.undone == 1
    with pytest.raises(ToolError, match="nothing to undo: 1 of 5"):
        work.call("undo", steps=5)
    assert second != first


def test_undo_before_the_first_plan_leaves_none(work: "ToolCalls") -> None:
    assert work.call("undo").data["plan_id"] is None
    assert work.world.current is None
    with pytest.raises(ToolError, match="There is no plan"):
        edit(work, {"kind": "out", "px": 3})
    with pytest.raises(ToolError, match="to go back to; plans: p-"):
        work.call("undo", to="p-x")
    assert work.call("undo", to="first").data["plan_id"] is not None
    with pytest.raises(ToolError, match="Nothing was undone: 0 of 1"):
        work.call("undo", steps=-1)


def test_the_plan_is_measured_robot_by_robot(work: "ToolCalls") -> None:
    data = work.call("measure", a="plan").data
    assert [row["robot"] for row in data["each"]] == [str(i) for i in range(1, 9)]
    (group,) = data["groups"]
    assert group["closed"] is True
    assert group["widest_opening_px"] < group["min_width_px"]
    near = data["each"][2]
    exact = work.call("measure", a="r3", b="t1").data
    assert exact["nearest_px"] == pytest.approx(near["target_px"], abs=0.06)
    edit(work, {"kind": "remove", "n": 5})
    (group,) = work.call("measure", a="plan").data["groups"]
    assert group["closed"] is False
    assert group["robots_to_close"] > 3
    with pytest.raises(ToolError, match=r"no robot 'r9'\. Robots: r1, r2, r3"):
        work.call("measure", a="r9", b="t1")
    with pytest.raises(ToolError, match="b is missing"):
        work.call("measure", a="t1")


def test_how_much_of_a_way_there_is_room_for_is_said(work: "ToolCalls") -> None:
    x, y = places(work)["1"]
    by = [(BOX[0] + BOX[2]) / 4 - x / 2, (BOX[1] + BOX[3]) / 4 - y / 2]
    with pytest.raises(ToolError, match="25% of that way would do") as refused:
        edit(work, {"kind": "place", "robot": 1, "by": by})
    assert "stands on t1" in str(refused.value)
    quarter = [0.25 * v for v in by]
    assert edit(work, {"kind": "place", "robot": 1, "by": quarter})["moving"] == 1
