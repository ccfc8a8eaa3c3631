"""`formup eval compare`, `gate`, `merge` and the bar of a sweep, as a person meets them."""

import io
import json
from pathlib import Path
from typing import Any

import pytest
from formup.apps.cli import app
from formup.apps.eval_progress import sweep
from formup.evals.experiments.comparison import Comparison
from formup.evals.experiments.executors import Work
from formup.evals.experiments.journal import equal_lines, read_rows
from formup.evals.experiments.runner import run_trials
from formup.evals.experiments.trials import Arm, Trial, TrialRow
from formup.tools.errors import InputError
from rich.console import Console


def planned(*prompts: int, tasks: int = 12) -> list[Trial]:
    return [
        Trial(
            suite="5" * 64,
            task=f"t{task:02d}",
            trial=number,
            arm=Arm(
                method="agent",
                prompt=f"former@v{version:03d}",
                sha256=f"{version:064x}",
                model="offline",
            ),
            category=("caging", "infill")[task % 2],
        )
        for version in prompts
        for task in range(tasks)
        for number in range(10)
    ]


def passing(**counts: int) -> Work:
    """So many of ten trials pass, by prompt."""

    def work(trial: Trial) -> TrialRow:
        enough = counts[str(trial.arm.prompt)[-4:]] + int(trial.task[1:]) % 3 - 1
        return TrialRow.of(trial, "pass" if trial.trial < enough else "fail", cost_usd=0.5)

    return work


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of one prompt each, old, better and worse, and one of two prompts."""
    work, folder = passing(v001=6, v002=8, v003=4), tmp_path_factory.mktemp("runs")
    for name, prompts in (("old", (1,)), ("better", (2,)), ("worse", (3,)), ("both", (1, 2))):
        run_trials(planned(*prompts), work, folder / name)
    return folder


def formup(*arguments: str | Path) -> int:
    return app([*map(str, arguments)], standalone_mode=False) or 0


def test_gate_exits_by_its_verdict(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert formup("eval", "gate", runs / "old", runs / "better") == 0
    assert formup("eval", "gate", runs / "old", runs / "worse") == 1
    text = capsys.readouterr().out
    assert "pass" in text
    assert "block: success falls by more than 5 points: -20.0 points" in text
    few = runs / "few"
    run_trials(planned(2, tasks=1), passing(v002=8), few)
    assert formup("eval", "gate", few, few) == 3
    assert "inconclusive: success may fall by more than 5 points" in capsys.readouterr().out


def test_compare_says_by_how_much(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert formup("eval", "compare", runs / "old", runs / "better") == 0
    text = capsys.readouterr().out
    assert "B agent former@v002#000000000000 offline" in text
    (line,) = (line for line in text.splitlines() if line.startswith("all "))
    assert line.split()[:3] == ["all", "12", "+20.0"]
    assert line.split()[-1] == "better"
    assert {"caging", "infill"} <= set(text.split())
    assert max(map(len, text.splitlines())) <= 100


def test_compare_says_what_would_settle_it(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    uneven = runs / "uneven"
    run_trials(
        planned(2),
        lambda t: TrialRow.of(t, "pass" if t.trial < (9, 3)[int(t.task[1:]) % 2] else "fail"),
        uneven,
    )
    assert formup("eval", "compare", runs / "old", uneven) == 0
    text = capsys.readouterr().out
    assert "\ndifference: inconclusive\ngate: inconclusive: success may fall" in text
    assert "\nto settle the difference, detecting 5.0 points (power .8): " in text
    assert "\nto settle the gate, detecting " in text
    assert " tasks with 10 trials of each\n" in text


@pytest.mark.parametrize("new", ["better", "worse", "old"])
def test_compare_and_gate_say_the_same(
    new: str, runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert formup("eval", "compare", runs / "old", runs / new) == 0
    compared = capsys.readouterr().out
    formup("eval", "gate", runs / "old", runs / new)
    assert capsys.readouterr().out == compared
    assert "\ngate: " in compared


def test_the_report_is_one_object(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = runs / "report.json"
    made = "eval", "gate", runs / "old", runs / "worse", "--json", "--out", out
    assert formup(*made) == 1
    printed: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert printed == json.loads(out.read_text())
    assert Comparison.model_validate(printed).verdict == printed["verdict"] == "block"
    assert printed["b"]["prompt"] == "former@v003"
    assert printed["b"]["sha256"] == f"{3:064x}"


def test_arms_of_one_run_are_chosen_by_words(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = runs / "both"
    chosen = "--arm-a", "former@v001", "--arm-b", "offline former@v002"
    assert formup("eval", "compare", both, both, *chosen, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert [printed[side]["prompt"] for side in "ab"] == ["former@v001", "former@v002"]
    assert printed["outcome"] == "better"
    for wrong in ((), ("--arm-a", "offline"), ("--arm-a", "former@v009")):
        with pytest.raises(InputError, match=r"holds 2 arms; .*--arm-a.*former@v001#0"):
            formup("eval", "compare", both, both, *wrong)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere", "old"), "a run's folder is needed"),
        (("old", "old", "--metric", "luck"), "There are: sr, strict, gcr"),
        (("old", "old", "--metric", "gcr"), "was not graded by gcr"),
        (("old", "old", "--margin", "0"), "can never be passed"),
        (("old", "old", "--margin", "5"), "from 0 to 1"),
    ],
)
def test_mistakes_are_one_sentence(
    runs: Path, arguments: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(runs)
    with pytest.raises(InputError, match=said):
        formup("eval", "gate", *arguments)


def test_merge(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    merged = runs / "merged"
    assert formup("eval", "merge", runs / "old", runs / "better", "--out", merged) == 0
    assert "240 trials in" in capsys.readouterr().out
    assert equal_lines(read_rows(merged)) == equal_lines(read_rows(runs / "both"))


def test_the_bar_tells_time_left_and_cost(tmp_path: Path) -> None:
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True, width=100)
    work = passing(v001=6)
    run_trials(planned(1, tasks=2), work, tmp_path)
    swept = sweep(planned(1, tasks=4), work, tmp_path, console=console)
    assert (swept.scored, swept.cost_usd) == (40, 20.0)
    assert "40/40" in shown.getvalue()
    assert "20.0000 USD" in shown.getvalue()
