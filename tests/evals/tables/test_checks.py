"""What may not be tabled: edited, dropped, repeated or moved rows, edited transcripts, others."""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from formup.agent import agent as agent_module
from formup.agent.messages import Reply
from formup.agent.model import Model
from formup.agent.wrappers.doubles import FunctionModel
from formup.evals.experiments.journal import Journal, Manifest, merge, read_rows
from formup.evals.experiments.methods import Method
from formup.evals.experiments.runner import run_trials
from formup.evals.experiments.trials import Trial, TrialRow
from formup.evals.tables.checks import checked_rows
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import InputError

write_folder: Callable[[Path, int], Path] = import_module("synthetic").write_folder
work_of: Callable[..., Any] = import_module("trying").work_of

SUITE = "0" * 64
Change = Callable[[list[bytes]], list[bytes]]
TABLED: dict[str, set[str]] = {"methods": {"alone"}, "tasks": {"ring_00", "ring_01", "ring_02"}}
ALONE = Method("alone", "openai:x")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, list[Trial]]:
    """A run of a model alone: three tasks of two trials, with their transcripts."""

    def named(model: str, base_url: str | None = None, *show: object) -> Model:
        return FunctionModel(lambda request: Reply(text='{"positions": [[1, 1]]}'), model)

    monkeypatch.setattr(agent_module, "model_named", named)
    folder = write_folder(tmp_path / "pictures", 3)
    (tmp_path / "run" / "attempts").mkdir(parents=True)
    tasks = load_suite(str(folder)).tasks
    work, trials = work_of(tasks, ALONE, folder, 2, tmp_path / "run" / "attempts")
    run_trials(trials, work, tmp_path / "run")
    return tmp_path / "run", trials


def refused(run: tuple[Path, list[Trial]], said: str, suite: str = SUITE) -> None:
    with pytest.raises(InputError, match=said):
        checked_rows(run[0], suite, run[1], **TABLED)


def changed(one: Trial, **change: Any) -> Trial:
    return Trial.model_validate(one.model_dump() | change)


def rewritten(folder: Path, change: Change) -> None:
    path = folder / "trials.jsonl"
    path.write_bytes(b"".join(change(path.read_bytes().splitlines(keepends=True))))


def test_what_a_runner_left_is_tabled(run: tuple[Path, list[Trial]]) -> None:
    folder, trials = run
    assert {row.key for row in checked_rows(folder, SUITE, trials, **TABLED)} == {
        trial.key for trial in trials
    }
    assert checked_rows(folder / "none", SUITE, trials, **TABLED) == []


TAMPERED: list[tuple[Change, str]] = [
    (lambda rows: [rows[0].replace(b'"fail"', b'"model_invalid"'), *rows[1:]], "1 .* edited"),
    (lambda rows: [rows[0], *rows[2:]], r"line 2 .*: a trial is missing"),
    (lambda rows: [rows[1], rows[0], *rows[2:]], "line 1 .* or moved"),
    (lambda rows: [*rows, rows[-1]], "is of a trial that is scored already"),
    (lambda rows: rows[:-1], "has lost the trials it ended with"),
    (lambda rows: [], "has lost the trials it ended with"),
]


@pytest.mark.parametrize(("change", "said"), TAMPERED)
def test_rows_that_were_tampered_with(
    run: tuple[Path, list[Trial]], change: Change, said: str
) -> None:
    rewritten(run[0], change)
    refused(run, said)


def test_a_transcript_that_was_edited_or_is_gone(run: tuple[Path, list[Trial]]) -> None:
    trace, *_ = sorted((run[0] / "attempts").glob("*.jsonl"))
    before = trace.read_text("utf-8")
    assert "[[1, 1]]" in before
    trace.write_text(before.replace("[[1, 1]]", "[[2, 2]]"), "utf-8")
    refused(run, rf"attempts keeps of task ring_00, trial 0 \({trace.stem}\) was edited")
    trace.unlink()
    refused(run, "was edited or is gone")
    (run[0] / "trials.jsonl").unlink()
    refused(run, "its trials are gone")


def test_trials_of_another_suite_prompt_or_number(run: tuple[Path, list[Trial]]) -> None:
    folder, trials = run
    refused(run, "another suite .000000000000, not 111111111111", suite="1" * 64)
    refused((folder, [t for t in trials if t.trial == 0]), "trial 1 of task ring_00, which is one")
    arm = trials[0].arm
    for change, said in (
        ({"sha256": "e" * 64}, f"of the prompt {arm.prompt} with another text .#.*, not #eeeeee"),
        (
            {"model": "openai:y"},
            "trials of alone .* openai:x, which are not of this table",
        ),
    ):
        other = arm.model_copy(update=change)
        planned = [changed(trial, arm=other) for trial in trials]
        refused((folder, planned), said)


def test_a_killed_runner_leaves_what_can_be_tabled(run: tuple[Path, list[Trial]]) -> None:
    folder, trials = run
    head = (folder / "head").read_text("utf-8")
    rows = read_rows(folder)
    more = TrialRow.model_validate(rows[0].model_dump() | {"trial": 2, "files": None})
    with Journal(folder, Manifest.of(trials)) as journal:
        journal.append(more)
    (folder / "head").write_text(head)  # as a runner leaves it that did not get to its end
    planned = [*trials, changed(trials[0], trial=2)]
    found = checked_rows(folder, SUITE, planned, **TABLED)
    assert len(found) == len(trials) + 1
    assert all(json.loads(row.line)["seal"] for row in found)


def test_shards_are_sealed_anew_and_tampered_ones_are_not_merged(
    run: tuple[Path, list[Trial]], tmp_path: Path
) -> None:
    assert merge([run[0]], tmp_path / "merged") == 6
    rewritten(run[0], lambda rows: rows[1:])
    with pytest.raises(InputError, match="does not follow"):
        merge([run[0]], tmp_path / "again")
