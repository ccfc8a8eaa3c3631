"""What was pointed at is measured when an id names it; an outline is looked at once."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from formup.tools.errors import ToolError
from formup.tools.perception.target_prompt import TargetPrompt

from .test_editing import BOX, picture

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]


@pytest.fixture
def pointed(tool_calls: Begin) -> "ToolCalls":
    """The block is pointed at, and not measured yet."""
    calls = tool_calls(picture(), robots=8)
    calls.keep(calls.world.having(pointed=(TargetPrompt(box=BOX),)))
    return calls


def group(**more: object) -> dict[str, object]:
    return {"relation": "around", "targets": ["t1"], "robots": 8, **more}


def test_a_contract_and_a_question_measure_what_they_name(pointed: "ToolCalls") -> None:
    asked = pointed.call("measure", a="t1", b=[10, 10])
    assert asked.data["nearest_px"] > 100
    assert [t.id for t in pointed.world.targets] == ["t1"]
    made = pointed.call("propose_formation", contract={"groups": [group()]})
    assert made.data["certified"]
    with pytest.raises(ToolError, match="There is no target 't2'"):
        pointed.call("measure", a="t2", b=[10, 10])


def test_an_outline_that_a_named_distance_is_measured_from_is_looked_at_once(
    pointed: "ToolCalls",
) -> None:
    exact = {"groups": [group(clearance=[20, 20.5])]}
    first = pointed.call("propose_formation", contract=exact)
    assert "look_first" in first.data
    assert len(first.images) == 1
    again = pointed.call("propose_formation", contract={"groups": [group(clearance=[30, 30.5])]})
    assert "look_first" not in again.data
    assert again.images == ()


def test_a_robot_is_measured_alone_and_go_needs_no_id_for_what_stands(pointed: "ToolCalls") -> None:
    pointed.call("propose_formation", contract={"groups": [group()]})
    plan = pointed.world.plan().plan
    row = pointed.call("measure", a="r3").data
    assert row["place"] == pytest.approx(plan.formation.positions[2], abs=0.06)
    pointed.context = replace(pointed.context, proposed=None, steps=(pointed.world.step,))
    assert pointed.call("deploy").data["arrived"]
    assert pointed.world.arrivals[plan.id].arrived


def test_undo_can_end_the_turn(pointed: "ToolCalls") -> None:
    pointed.call("propose_formation", contract={"groups": [group()]})
    pointed.call("edit_formation", edits=[{"kind": "out", "px": 4}])
    told = pointed.call("undo", to="first", tell="As it was; nobody moves by that.")
    assert told.message == "As it was; nobody moves by that."
