"""What each part of the tools is worth, on models that need it, and that robots stay out of it."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from formup.agent import agent as agent_module
from formup.agent.messages import Call, Reply, Result
from formup.agent.model import Model, Request
from formup.agent.wrappers.doubles import FunctionModel
from formup.evals.experiments.ablation import Part, tools_without
from formup.evals.experiments.methods import Method
from formup.evals.experiments.trials import TrialRow
from formup.evals.tasks.suites import load_suite
from formup.tools.builtin import TOOLS
from formup.tools.fleet.simulated import SimulatedFleet

write_folder: Callable[[Path, int], Path] = import_module("synthetic").write_folder
tried: Callable[..., list[TrialRow]] = import_module("trying").tried

SQUARE = {"id": "t1", "box": [60, 40, 99, 79]}
DONE = {"tell": "They stand there."}
Calls = list[list[tuple[str, dict[str, Any]]]]
Try = Callable[[Part | None, Calls], TrialRow]


def proposal(group: dict[str, Any], **more: Any) -> tuple[str, dict[str, Any]]:
    groups = [{"targets": ["t1"], "robots": 6, **group}]
    return "propose_formation", {"contract": {"groups": groups}, "targets": [SQUARE], **more}


@pytest.fixture
def heard() -> list[Result]:
    return []


@pytest.fixture
def carry_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, heard: list[Result]) -> Try:
    """The trial of "Surround the red square with 6 robots" by a model that makes these calls."""
    folder = write_folder(tmp_path / "pictures", 1)

    def trial(part: Part | None, replies: Calls) -> TrialRow:
        def says(request: Request) -> Reply:
            heard[:] = [m for m in request.messages if isinstance(m, Result)]
            number = sum(isinstance(m, Reply) for m in request.messages)
            calls = replies[number] if number < len(replies) else []
            made = [Call(id=f"{number}-{n}", name=c, arguments=a) for n, (c, a) in enumerate(calls)]
            return Reply(calls=tuple(made), text="" if made else "That is all.")

        def named(model: str, base_url: str | None = None, *show: object) -> Model:
            return FunctionModel(says, model)

        monkeypatch.setattr(agent_module, "model_named", named)
        arm = Method("agent", "openai:x", "former", without=part)
        (row,) = tried(load_suite(str(folder)).tasks, arm, folder)
        assert row.arm.without == part
        return row

    return trial


def test_every_part_leaves_names_and_schemas_as_they_are() -> None:
    for part in ("certificate", "doubts", "look"):
        less = tools_without(part)
        assert [(t.name, t.schema, t.kind) for t in less] == [
            (t.name, t.schema, t.kind) for t in TOOLS
        ]
        assert less != TOOLS
    assert tools_without(None) == TOOLS


def test_without_the_certificate_a_wrong_plan_counts_as_driven_to_and_nothing_is_driven(
    carry_out: Try, heard: list[Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    row_of_six = [[10.0 + 5 * i, 10.0] for i in range(6)]
    calls: Calls = [[proposal({"relation": "around"}, positions=row_of_six), ("deploy", {})]]
    whole = carry_out(None, calls)
    assert (whole.sr, whole.placed) == (False, False)
    assert [r.error for r in heard] == [None, "tool"]  # it hears that it may not be driven to

    async def driven(*_: object, **__: object) -> None:
        raise AssertionError("a fleet was asked to drive")

    monkeypatch.setattr(SimulatedFleet, "drive", driven)
    less = carry_out("certificate", [[*calls[0][:1], ("deploy", DONE)]])
    assert (less.sr, less.placed, less.requests) == (False, True, 1)
    carry_out("certificate", calls)
    assert '"certified":true' in heard[0].text and '"findings":[]' in heard[0].text
    assert '"arrived":true' in heard[1].text and '"worst_residual_px":0.0' in heard[1].text


def test_without_the_certificate_a_right_plan_is_driven_to_as_ever(carry_out: Try) -> None:
    calls: Calls = [[proposal({"relation": "around"}), ("deploy", DONE)]]
    assert [carry_out(part, calls).sr for part in (None, "certificate")] == [True, True]


def test_without_doubts_a_contract_is_taken_for_what_the_words_say(
    carry_out: Try, heard: list[Result]
) -> None:
    calls: Calls = [[proposal({"relation": "inside"}), ("deploy", DONE)]]
    whole = carry_out(None, calls)
    assert (whole.placed, heard[0].cause) == (False, "doubt")
    less = carry_out("doubts", calls)
    assert (less.sr, less.placed, less.requests) == (False, True, 1)
    wrong: Calls = [[("propose_formation", {"contract": {"groups": []}})]]
    carry_out("doubts", wrong)
    assert heard[0].error == "arguments"  # all else is refused as ever


def test_without_the_look_the_first_certified_plan_is_carried_out(
    carry_out: Try, heard: list[Result]
) -> None:
    named = proposal({"relation": "around", "clearance": [5.0, 6.0]})
    whole = carry_out(None, [[named, ("deploy", DONE)], [("report_impossible", {"reason": "No"})]])
    assert (whole.outcome, whole.requests) == ("impossible", 2)
    assert "look_first" in heard[0].text
    less = carry_out("look", [[named, ("deploy", DONE)]])
    assert (less.outcome, less.requests) == ("deployed", 1)


def test_nothing_but_the_methods_of_the_evaluation_leads_there() -> None:
    root = Path(__file__).parents[3]
    files = [
        path for room in ("agent", "apps", "evals", "tools") for path in (root / room).rglob("*.py")
    ]
    named = {str(p.relative_to(root)) for p in files if "tools_without" in p.read_text("utf-8")}
    assert named == {"evals/experiments/ablation.py", "evals/experiments/methods.py"}
