"""`formup eval run`, `suites` and `add`, as a person meets them."""

import json
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.cli import app
from formup.benchmarks.false_blocks import PLANTED, REGRESSION, planted
from formup.evals.experiments.journal import read_rows
from formup.evals.experiments.simulated_model import DUTIES
from formup.prompts import PromptLibrary, load_prompt
from formup.tools.errors import InputError
from formup.tools.perception import measure as measure_module
from formup.tools.perception.detectors import candidates as detector
from formup.tools.perception.referring.attributes import Candidate
from numpy.typing import NDArray

write_folder: Callable[[Path, int], Path] = import_module("synthetic").write_folder

GOOD, BAD = load_prompt("former").name, "former@draft-forgetful"
TASKS, TRIALS = 12, 20
LAPSE = "the picture's orders"
"""Befalls one trial in ten of a prompt that does not say what words in the picture are."""


def formup(*arguments: str | Path) -> int:
    return app([*map(str, arguments)], standalone_mode=False) or 0


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_folder(tmp_path_factory.mktemp("pictures"), TASKS)
    assert formup("eval", "add", folder, "--name", "Squares") == 0
    return folder


@pytest.fixture
def forgetful(tmp_path: Path) -> Path:
    """A folder with a draft of the prompt that lacks one sentence a test model goes by."""
    folder = tmp_path / "mine"
    folder.mkdir()
    assert formup("prompts", "new", BAD, "--prompts", folder) == 0
    (draft,) = folder.glob("*/draft-forgetful.prompt.md")
    duty = next(d for d in DUTIES if d.kind == LAPSE)
    text = draft.read_text("utf-8")
    sentence = re.search(r"Words in the picture[^.]*[.]", text)
    assert sentence is not None
    draft.write_text(text.replace(sentence[0], ""), "utf-8")
    told = " ".join(PromptLibrary(folder).load(BAD).render().lower().split())
    assert not any(said in told for said in duty.sentences)
    return folder


@pytest.fixture
def seen_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The one picture is searched and measured once instead of in every trial, for the time."""
    search, measure = detector.find_candidates, measure_module.segment_candidate
    found, measured = dict[bytes, Any](), dict[tuple[bytes, str], Any]()

    def searched(pixels: NDArray[np.uint8]) -> Any:
        key = pixels.tobytes()
        if key not in found:
            found[key] = search(pixels)
        return found[key]

    def closely(segment: Callable[..., Any], candidate: Candidate, **how: Any) -> Any:
        key = candidate.outline.polygon.wkb, candidate.id
        if key not in measured:
            measured[key] = measure(segment, candidate, **how)
        return measured[key]

    monkeypatch.setattr(detector, "find_candidates", searched)
    monkeypatch.setattr(measure_module, "segment_candidate", closely)


def test_rules_run_with_nothing_else(
    suite: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert formup("eval", "run", suite, "--out", out) == 0
    printed = capsys.readouterr().out
    assert f"{TASKS}/{TASKS}" in printed
    assert "chance" in printed
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    (cells,) = summary["arms"].values()
    total = cells[-1]
    assert (total["name"], total["passed"], total["scored"]) == ("total", TASKS, TASKS)
    assert 0 < total["chance"]["gcr"] < 1
    assert {cell["name"] for cell in cells} >= {"general single", "caging single", "caging"}
    attempt = json.loads(next((out / "attempts").glob("*.json")).read_text("utf-8"))
    assert attempt["observed"]
    assert attempt["graded"]["measures"]["planned_gcr"] == 1
    assert formup("eval", "run", suite, "--out", out) == 0  # all there already
    assert len((out / "trials.jsonl").read_text("utf-8").splitlines()) == TASKS


def test_some_tasks_are_pointed_at_and_the_whole_goes_on(
    suite: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    box: list[Any] = ["eval", "run", suite, "--mode", "box", "--out", out]
    assert formup(*box, "--task", "ring_03") == 0
    shown = capsys.readouterr().out
    assert "if placed" in shown
    assert "e95" in shown
    assert [(row.task, row.trial) for row in read_rows(out)] == [("ring_03", n) for n in range(3)]
    assert formup("eval", "run", suite, "--out", out) == 0
    assert formup(*box, "--task", "ring_03") == 0
    assert formup("eval", "report", out) == 0
    arms = {row.arm.name for row in read_rows(out)}
    assert arms == {"rules offline", "rules offline box"}
    with pytest.raises(InputError, match="Unknown task 'nobody'"):
        formup(*box, "--task", "nobody")


def test_a_policy_is_a_method_and_scores_its_chance(suite: Path, tmp_path: Path) -> None:
    for name in ("circle", "pile"):
        assert formup("eval", "run", suite, "--method", name, "--out", tmp_path / name) == 0
    rows = [*read_rows(tmp_path / "circle"), *read_rows(tmp_path / "pile")]
    assert not any(row.sr for row in rows)
    assert all(row.feedback for row in rows)


def test_shards_are_the_whole_and_merge(suite: Path, tmp_path: Path) -> None:
    for part in ("1/2", "2/2"):
        out = tmp_path / part[0]
        assert formup("eval", "run", suite, "--method", "line", "--shard", part, "--out", out) == 0
    merged = tmp_path / "merged"
    assert formup("eval", "merge", tmp_path / "1", tmp_path / "2", "--out", merged) == 0
    assert len(read_rows(merged)) == TASKS


@pytest.mark.usefixtures("seen_once")
def test_a_planted_regression_of_ten_points_is_blocked(
    suite: Path, tmp_path: Path, forgetful: Path
) -> None:
    (lost,) = (duty.share for duty in DUTIES if duty.kind == LAPSE)
    assert lost == REGRESSION == 0.1
    assert (TASKS, TRIALS) in PLANTED
    assert planted(TASKS, TRIALS, lost, comparisons=400).blocked > 0.75 * 400  # power .8
    run: list[Any] = ["eval", "run", suite, "--method", "agent", "--model", "simulated"]
    more: list[Any] = ["--prompt", GOOD, "--prompt", BAD, "--prompts", forgetful]
    assert formup(*run, *more, "--trials", str(TRIALS), "--out", tmp_path / "both") == 0
    rows = read_rows(tmp_path / "both")
    rates = {p: [bool(r.sr) for r in rows if r.arm.prompt == p] for p in (GOOD, BAD)}
    assert {len(successes) for successes in rates.values()} == {TRIALS * TASKS}
    assert sum(rates[GOOD]) == TRIALS * TASKS
    assert all(row.input_tokens for row in rows)
    gate: list[Any] = ["eval", "gate", tmp_path / "both", tmp_path / "both"]
    assert formup(*gate, "--arm-a", GOOD, "--arm-b", BAD) == 1
    assert formup(*gate, "--arm-a", BAD, "--arm-b", GOOD) == 0


def test_the_test_split_shows_scores_and_writes_the_look_down(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_folder(tmp_path / "pictures", 4)
    item = "tasks: [{folder: ., family: squares}]\nsplits: {test: [squares]}\n"
    (folder / "suite.yaml").write_text(f"name: held\ndescription: Held out.\n{item}")
    out = tmp_path / "runs" / "one"
    with pytest.raises(InputError, match="It has: test"):
        formup("eval", "run", folder, "--out", out)
    assert formup("eval", "run", folder, "--split", "test", "--out", out, "--method", "pile") == 0
    assert "look 1" in capsys.readouterr().err
    assert not any(row.feedback for row in read_rows(out))
    assert not (out / "attempts").exists()
    assert not (out / "pictures").exists()
    ledger = (tmp_path / "runs" / "heldout-ledger.jsonl").read_text("utf-8")
    assert json.loads(ledger)["suite"] == "held"


def test_suites_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert formup("eval", "suites") == 0
    printed = capsys.readouterr().out
    assert "zerocap15" in printed
    assert "infeasible" in printed


def test_a_task_with_a_wrong_truth_is_not_added(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "bad", 2)
    path = folder / "annotations.json"
    path.write_text(path.read_text("utf-8").replace('"max_gap_px": 70.0', '"max_gap_px": 7.0'))
    with pytest.raises(InputError, match="ring_00: a right answer fails: a gap of"):
        formup("eval", "add", folder)
    assert not (folder / "suite.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--method", "magic"], "There are: rules, agent, alone, zerocap, segment-only, rl, pile"),
        (["--method", "agent"], "takes a --model"),
        (["--method", "alone", "--model", "offline"], "--method rules"),
        (["--method", "alone", "--model", "simulated"], "writes no coordinates alone"),
        (["--method", "rules", "--prompt", GOOD], "--prompt goes with"),
        (["--method", "agent", "--model", "simulated", "--prompt", "x@v001"], "Unknown prompt"),
        (["--trials", "0"], "--trials '0'"),
        (["--budget", "-1"], "--budget '-1'"),
        (["--shard", "3/2"], "--shard '3/2'"),
        (["--descriptor", "poem"], "poem"),
        (["--rate", "x=5"], "--rate 'x=5' cannot be used; give MODEL=N.*run: none"),
        (["--method", "agent", "--model", "simulated", "--rate", "simulated=0"], "N above 0"),
    ],
)
def test_what_cannot_be_run_is_said(
    suite: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        formup("eval", "run", suite, "--out", tmp_path / "x", *arguments)


def test_what_it_would_cost_is_said_before_anything_is_run(
    suite: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run: list[str | Path] = ["eval", "run", suite, "--method", "agent", "--trials", "10"]
    run += ["--model", "openai:gpt-5", "--model", "ollama:x", "--model", "simulated"]
    assert formup(*run, "--dry-run", "--out", tmp_path / "run") == 0
    dear, own, free, total = capsys.readouterr().out.splitlines()
    count = 10 * TASKS
    assert re.fullmatch(rf"agent openai:gpt-5: {count} trials; about 0\.\d\d USD", dear)
    assert own.startswith(f"agent ollama:x: {count} trials; about 420,000 tokens in and ")
    assert own.endswith(" at a price that is not known")
    assert free == f"agent simulated: {count} trials"
    assert re.fullmatch(
        rf"all: {3 * count} trials; about 0\.\d\d USD, and what has no known price", total
    )
    assert not (tmp_path / "run").exists()
