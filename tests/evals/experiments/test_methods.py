"""Methods: what a model's replies become, and whose fault it is when nothing comes."""

import json
import pickle
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from formup.agent import agent as agent_module
from formup.agent.messages import Call, Reply
from formup.agent.model import Model
from formup.agent.wrappers.doubles import FunctionModel
from formup.evals.experiments.executors import attempt, executor
from formup.evals.experiments.journal import read_rows
from formup.evals.experiments.methods import Method, check_method
from formup.evals.experiments.runner import run_trials
from formup.evals.experiments.simulated_model import DUTIES, lapses_of
from formup.evals.experiments.trials import Arm, Trial, TrialRow
from formup.evals.grading.reference_answers import reference
from formup.evals.tasks.suites import load_suite, write_suite
from formup.prompts import load_prompt
from formup.tools.errors import InputError, ModelError

write_folder: Callable[[Path, int], Path] = import_module("synthetic").write_folder
work_of: Callable[..., Any] = import_module("trying").work_of

FIRST = Trial(suite="0" * 64, task="t", trial=0, arm=Arm(method="rules", model="offline"))
ASKED = {"question": "Which one?"}


def work_for(folder: Path, arm: Method, attempts: Path | None = None) -> Any:
    return work_of(load_suite(str(folder)).tasks, arm, folder, 1, attempts)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = write_folder(tmp_path_factory.mktemp("pictures"), 3)
    write_suite(made, "squares")
    return made


def row_of(
    folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, reply: Reply | ModelError
) -> TrialRow:
    """The row of the first task for a model that always says the same."""

    def says(request: Any) -> Reply:
        if isinstance(reply, ModelError):
            raise reply
        return reply

    def named(model: str, base_url: str | None = None, *show: object) -> Model:
        return FunctionModel(says, model)

    monkeypatch.setattr(agent_module, "model_named", named)
    arm = Method(name, "openai:x", "former-direct@v001")
    work, trials = work_for(folder, arm, folder)
    return attempt(work, trials[0])


def written(folder: Path, **change: Any) -> str:
    task = load_suite(str(folder)).tasks[0]
    return json.dumps({"positions": reference(task.goals[0]).tolist()} | change)


def test_a_model_alone_is_graded_by_what_it_writes(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = row_of(folder, monkeypatch, "alone", Reply(text=f"Here: {written(folder)}"))
    assert (right.status, right.gcr, right.arm.tools) == ("pass", 1.0, None)
    few = row_of(folder, monkeypatch, "alone", Reply(text=written(folder, positions=[[1, 1]])))
    assert few.status == "fail"
    for text in ("I cannot see a square.", '{"positions": "all"}', '<tool_call>{"x": 1}'):
        lost = row_of(folder, monkeypatch, "alone", Reply(text=text))
        assert (lost.status, lost.gcr) == ("model_invalid", 0.0)


@pytest.mark.parametrize(
    ("text", "status"),
    [
        ('{"positions": [], "question": "Which car?"}', "question"),
        ('I cannot. {"positions": [], "reason": "no giraffe"}', "impossible"),
        ('{"positions": []}', "impossible"),
    ],
)
def test_a_model_alone_asks_and_refuses_as_it_is_told_to(
    folder: Path, monkeypatch: pytest.MonkeyPatch, text: str, status: str
) -> None:
    told = load_prompt("former-direct").text
    assert all(f'{{"positions": [], "{key}": "..."}}' in told for key in ("question", "reason"))
    row = row_of(folder, monkeypatch, "alone", Reply(text=text))
    assert (row.status, row.feedback) == ("fail", f"{status}: {text}")


def test_a_provider_that_fails_says_nothing_about_the_model(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = row_of(folder, monkeypatch, "agent", ModelError("503: overloaded"))
    assert (row.status, row.sr, row.gcr) == ("infra_error", None, None)
    assert "503" in row.feedback


def test_an_agent_that_makes_no_call_is_invalid_and_one_that_asks_is_not(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = row_of(folder, monkeypatch, "agent", Reply(text="Done."))
    assert words.status == "model_invalid"
    unknown = Reply(calls=(Call(id="1", name="fly", arguments={}),))
    assert row_of(folder, monkeypatch, "agent", unknown).status == "model_invalid"
    asks = Reply(calls=(Call(id="1", name="ask_user", arguments=ASKED),))
    asked = row_of(folder, monkeypatch, "agent", asks)
    assert (asked.status, asked.feedback) == ("fail", "question: Which one?")


def test_requests_to_a_model_keep_its_pace(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []

    async def sleep(seconds: float) -> None:
        slept.append(seconds)

    monkeypatch.setattr(
        "formup.evals.experiments.rate_limiter.asyncio", SimpleNamespace(sleep=sleep)
    )
    arm = Method("agent", "simulated", "former@v003", rate=0.01)
    work, trials = work_for(folder, arm)
    assert [work(trial).status for trial in trials[:2]] == ["pass", "pass"]
    assert slept[0] == 0
    assert len(slept) >= 6  # replies of both trials, one after the other
    assert slept == pytest.approx([6000 * i for i in range(len(slept))], abs=600)
    assert pickle.loads(pickle.dumps(arm)) == arm


def test_work_can_be_given_to_other_processes(folder: Path, tmp_path: Path) -> None:
    work, trials = work_for(folder, Method("circle", "none"))
    again = pickle.loads(pickle.dumps(work))
    assert again(trials[0]) == work(trials[0])
    run_trials(trials, work, tmp_path, executor=executor("pool", 1))
    assert [row.status for row in read_rows(tmp_path)] == ["fail"] * 3


def test_a_descriptor_is_part_of_the_arm() -> None:
    arms = [Method("rules", "offline", None, d).arm for d in ("edges", "matrix")]
    assert [arm.descriptor for arm in arms] == ["edges", "matrix"]
    assert arms[0] == arms[1].model_copy(update={"descriptor": "edges"})
    assert Method("rules", "offline", mode="box").arm.mode == "box"
    trials = [FIRST.model_copy(update={"arm": arm}) for arm in arms]
    assert len({Trial(**trial.model_dump()).key for trial in trials}) == 2
    assert [arm.name for arm in arms] == ["rules offline", "rules offline matrix"]
    assert check_method(Method("circle")).arm == Arm(method="circle", model="none")
    for arm, message in (
        (Method("circle", descriptor="matrix"), "--descriptor goes with the methods rules"),
        (Method("alone", "x:y", descriptor="matrix"), "--descriptor goes with the methods rules"),
        (Method("circle", mode="box"), "--mode goes with the methods rules and agent and alone"),
        (Method("rules", planner="x:y"), "--planner goes with the methods agent and zerocap"),
    ):
        with pytest.raises(InputError, match=message):
            check_method(arm)


def test_the_test_model_goes_by_the_sentences_of_its_prompt() -> None:
    for name in ("former@v001", "former@v002", "former"):
        text = load_prompt(name).text
        assert all(lapses_of(text, seed) == set() for seed in range(50))
        assert lapses_of(text.upper(), 3) == set()
    counts = {duty.kind: 0 for duty in DUTIES}
    for seed in range(2000):
        for kind in lapses_of("Do your best.", seed):
            counts[kind] += 1
    for duty in DUTIES:
        assert counts[duty.kind] / 2000 == pytest.approx(duty.share, abs=0.04)
