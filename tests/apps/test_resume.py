"""Limits, policy, recording, resuming and reading a run, all by the command line."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from formup.agent.store.folder import read_events

COINS = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"
CAGE = ("run", COINS, "Cage the largest coin", "-n", 6, "--out", "out")


def formup(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "formup", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def report(*arguments: object, cwd: Path, code: int) -> dict[str, Any]:
    done = formup(*arguments, "--json", cwd=cwd)
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def waiting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that waits for leave to move."""
    folder = tmp_path_factory.mktemp("waiting")
    data = report(*CAGE, "--policy", "deploy=ask", cwd=folder, code=3)
    assert data["status"] == "needs_approval"
    assert data["arrival"] is None
    return folder


@pytest.fixture
def copy(waiting: Path, tmp_path: Path) -> Path:
    shutil.copytree(waiting / "out", tmp_path / "out")
    return tmp_path


def test_a_yes_moves_the_robots(copy: Path) -> None:
    data = report("resume", "out", "--approve", cwd=copy, code=0)
    assert data["status"] == "deployed"
    assert data["arrival"]["arrived"] is True
    names = {p.name for p in (copy / "out").iterdir()}
    assert names == {"plan.json", "plan.png", "deploy.gif", "trace.jsonl", "pictures"}
    kinds = [event.kind for event in read_events(copy / "out")]
    assert kinds.count("resume") == 1
    for more in ("--approve", "--answer=x"):
        again = formup("resume", "out", more, cwd=copy)
        assert (again.returncode, "asked nothing: it is deployed" in again.stderr) == (2, True)


def test_a_run_that_is_over_is_shown_again(copy: Path) -> None:
    data = report("resume", "out", "--approve", cwd=copy, code=0)
    log = (copy / "out/trace.jsonl").read_bytes()
    again = report("resume", "out", cwd=copy, code=0)
    for shown in (data, again):
        shown["usage"]["seconds"] = 0
    assert again == data
    assert (copy / "out/trace.jsonl").read_bytes() == log


def test_a_no_moves_nothing_and_says_why(copy: Path) -> None:
    data = report("resume", "out", "--refuse", "--answer", "too close", cwd=copy, code=0)
    assert data["status"] == "planned"
    assert data["arrival"] is None
    assert "too close" in data["message"]


def test_without_an_answer_it_goes_on_waiting(copy: Path) -> None:
    before = (copy / "out/trace.jsonl").read_bytes()
    done = formup("resume", "out", cwd=copy)
    assert done.returncode == 2
    assert "Say yes or no" in done.stderr
    assert (copy / "out/trace.jsonl").read_bytes() == before


def test_it_tells_how_to_go_on(tmp_path: Path) -> None:
    done = formup(*CAGE, "--policy", "deploy=ask", cwd=tmp_path)
    assert "formup resume out --approve, or --refuse" in done.stdout


def test_a_limit_stops_and_another_lets_it_go_on(tmp_path: Path) -> None:
    stopped = report(*CAGE, "--limit", "requests=1", cwd=tmp_path, code=4)
    assert (stopped["status"], stopped["message"]) == (
        "stopped",
        "The limit of 1 request was reached.",
    )
    again = report("resume", "out", cwd=tmp_path, code=4)
    assert again["status"] == "stopped"
    data = report("resume", "out", "--limit", "requests=none", cwd=tmp_path, code=0)
    assert data["status"] == "deployed"


def test_a_recording_replays_to_the_same_report(tmp_path: Path) -> None:
    first = report(*CAGE, "--record", "run.jsonl", cwd=tmp_path, code=0)
    assert (tmp_path / "run.jsonl").read_bytes() == (tmp_path / "out/trace.jsonl").read_bytes()
    again = report(*CAGE, "--model", "replay:run.jsonl", cwd=tmp_path, code=0)
    for data in (first, again):
        data["usage"]["seconds"] = 0
    assert first == again
    other = report(
        "run", COINS, "Cage the coin", "-n", 7, "--model", "replay:run.jsonl", cwd=tmp_path, code=4
    )
    assert "parts from this run" in other["message"]


def test_a_trace_reads_step_by_step(waiting: Path, tmp_path: Path) -> None:
    done = formup("trace", "out", cwd=waiting)
    assert done.returncode == 0
    for word in ("Cage the largest coin", "offline", "call    deploy", "person", "needs_approval:"):
        assert word in done.stdout
    whole = (waiting / "out/trace.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "killed.jsonl").write_text("".join(whole[:-3]))
    killed = formup("trace", "killed.jsonl", cwd=tmp_path)
    assert "killed: broken off" in killed.stdout


MISTAKES = [
    (("--limit", "x"), "--limit 'x'"),
    (("--limit", "requests=0"), "--limit 'requests=0'"),
    (("--limit", "requests=1.5"), "'requests=1.5'"),
    (("--limit", "seconds=-1"), "seconds"),
    (("--limit", "seconds=nan"), "'seconds=nan'"),
    (("--policy", "deploy"), "--policy 'deploy'"),
    (("--policy", "deploy=maybe"), "GLOB=allow"),
    (("--record", "nowhere/x"), "nowhere/x cannot be written"),
    (("--record", "."), "--record . cannot be written"),
    (("--model", "replay:nothing"), "nothing cannot be read"),
    (("--model", "replay:"), "Unknown model 'replay:'"),
    (("--model", "replay:x", "--base-url", "http://127.0.0.1:1"), "A replay asks no server"),
]


@pytest.mark.parametrize(("arguments", "words"), MISTAKES)
def test_mistakes_are_one_sentence(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    done = formup(*CAGE, *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_run_that_is_not_there(tmp_path: Path) -> None:
    for command in ("resume", "trace"):
        done = formup(command, "nowhere", cwd=tmp_path)
        assert (done.returncode, "nowhere cannot be read" in done.stderr) == (2, True)
