"""`formup eval table`: run, killed, gone on with, printed in all forms, asked of a real server."""

import csv
import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from formup.apps.cli import app
from formup.evals.experiments.coordinate_frame import MARKS, SIZE
from formup.evals.experiments.journal import read_rows
from formup.evals.grading.reference_answers import reference
from formup.evals.tables.definition import table_named
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import InputError

FORMS = ("md", "csv", "json", "tex")
SOME = ["--task", "us_coins_t1", "--task", "scene_000904_t1"]
CHANCE = ["eval", "table", "1", "--method", "boundary", "--method", "scatter", *SOME]
TASKS = {task.id: task for task in load_suite("zerocap15").tasks}


def formup(*arguments: str | Path) -> int:
    return app([*map(str, arguments)], standalone_mode=False) or 0


def cells(folder: Path) -> dict[tuple[str, str], dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return {(line["row"], line["column"]): line for line in csv.DictReader(file)}


@pytest.fixture(scope="module")
def chance_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "chance"
    assert formup(*CHANCE, "--out", out) == 0
    return out


def test_each_cell_is_counts_with_an_interval_beside_the_papers_figure(
    chance_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = cells(chance_run)
    total = found["policy: scatter", "total"]
    assert (total["scored"], total["planned"]) == ("20", "20")
    assert 0 <= float(total["low"]) <= int(total["passed"]) / 20 <= float(total["high"]) < 0.2
    assert {row for row, _ in found} == {"policy: boundary", "policy: scatter"}
    assert formup("eval", "table", "1", "--dry-run", "--format", "markdown") == 0
    shown = capsys.readouterr().out
    assert "paper .71 / .85" in shown
    assert "not run: 150 trials for want of --models whose" in shown
    assert ".22, which is their sum" in shown
    assert "stand-ins" in shown
    page = (chance_run / "table.html").read_text("utf-8")
    assert "policy: scatter" in page
    assert page.count("data:image/jpeg") >= 2


def test_killed_in_the_middle_and_gone_on_with_it_is_the_same_table(
    chance_run: Path, tmp_path: Path
) -> None:
    out = tmp_path / "killed"
    command = [sys.executable, "-m", "formup", *CHANCE, "--out", str(out)]
    rows = out / "trials.jsonl"
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
        while not rows.exists() or rows.read_bytes().count(b"\n") < 5:
            assert run.poll() is None
            time.sleep(0.01)
        run.send_signal(signal.SIGKILL)
    done = rows.read_bytes().rpartition(b"\n")[0]
    assert 5 <= done.count(b"\n") + 1 < 40
    assert formup(*CHANCE, "--out", out) == 0
    assert rows.read_bytes().startswith(done)
    for form in FORMS:
        name = f"table.{form}"
        assert (out / name).read_bytes() == (chance_run / name).read_bytes()


def test_the_latest_run_of_a_table_is_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    one: list[str] = ["eval", "table", "1", "--method", "circle", "--task", "us_coins_t1"]
    with pytest.raises(InputError, match="There is no run of table 1 in formup-runs"):
        formup(*one, "--resume")
    assert formup(*one) == formup(*one, "--resume") == 0
    (folder,) = Path("formup-runs").iterdir()
    assert len(read_rows(folder)) == 1


def test_what_is_not_tabled_is_refused_by_name(chance_run: Path, tmp_path: Path) -> None:
    for given, said in (
        (["4"], "Unknown table '4'. There are: 1, 2, 3, hard, ablations."),
        (["1", "--format", "pdf"], "Unknown format 'pdf'. There are: terminal, markdown"),
        (["1", "--segmenter", "clipseg"], "No row of this table is for the segmenter 'clipseg'"),
        (["1", *CHANCE[3:], "--trials", "2", "--out", str(chance_run)], "one more than are tabled"),
    ):
        with pytest.raises(InputError, match=re.escape(said)):
            formup("eval", "table", *given)


def test_tables_name_tasks_there_are() -> None:
    assert set(table_named("1").stand_ins) == set(TASKS)
    hard = load_suite("formup-hard").tasks
    assert set(table_named("hard").columns.values()) >= {t.style for t in hard} - {
        t.style for t in hard if t.dialogue
    }
    assert all(20 <= (t.robots or 0) <= 100 for t in hard if t.style in ("rings", "infills"))


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, list[str]]]:
    """A server that sees all, and writes y before x on a grid of 1,000 where it is alone."""
    asked = list[str]()

    class Seer(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            request = json.loads(self.rfile.read(int(self.headers["content-length"])))
            asked.append(json.dumps(request))
            message = {"role": "assistant", "content": _answer(asked[-1])}
            usage = {"prompt_tokens": 1000, "completion_tokens": 100}
            choice = {"message": message, "finish_reason": "stop"}
            body = json.dumps({"choices": [choice], "usage": usage}).encode()
            self.send_response(200)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing."""

    monkeypatch.setenv("OPENAI_API_KEY", "k")
    with ThreadingHTTPServer(("127.0.0.1", 0), Seer) as made:
        Thread(target=made.serve_forever, args=(0.01,)).start()
        yield f"http://127.0.0.1:{made.server_address[1]}/v1", asked
        made.shutdown()


def _answer(asked: str) -> str:
    """By the stage of the request, and the task whose words are in it."""
    if "exactly on the middle of each disc" in asked:
        marks = [[1000 * y, 1000 * x] for x, y in MARKS.values()]
        return f"Discs {{of five colours}}. {json.dumps({'positions': marks})}"
    task = next(t for t in TASKS.values() if t.instruction in asked)
    (goal,) = task.goals
    places = reference(goal)
    if "Write no coordinates of" in asked:
        box = list(goal.target.outline.bounds)
        found = {"object": "the coin", "box": box, "pattern": task.instruction}
        return f"It is a coin. {json.dumps(found)}"
    if "Pattern: " in asked:
        return f"Around it. {json.dumps({'positions': places.tolist()})}"
    grid = 1000 * places[:, ::-1] / np.array(goal.size)[::-1]
    return json.dumps({"positions": grid.tolist()})


def test_models_are_asked_in_the_papers_way_and_in_their_own_frame(
    server: tuple[str, list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    url, asked = server
    models = ["--models", "openai:gpt-seer", "--base-url", url, "--method", "alone"]
    run: list[str | Path] = ["eval", "table", "1", *models, "--method", "zerocap", *SOME]
    out = tmp_path / "run"
    assert formup(*run, "--trials", "1", "--out", out) == 0
    found = cells(out)
    for row in ("vision model alone (paper: GPT-4 Vision)", "ZeroCAP (paper: GPT-4)"):
        cell = found[row, "total"]
        assert (cell["model"], cell["passed"], cell["scored"]) == ("openai:gpt-seer", "2", "2")
    alone, *_ = [row for row in read_rows(out) if row.arm.method == "alone"]
    assert alone.arm.frame == "y before x, 0 to 1000"
    assert len(asked) == 1 + 2 + 2 * 2  # marks, alone, two stages
    blind = [request for request in asked if "image_url" not in request]
    assert len(blind) == 2
    assert all("Shape: " in request and "edges" in request for request in blind)
    assert "2 of 15 tasks" in capsys.readouterr().out
    assert formup(*run, "--trials", "1", "--out", out) == 0
    assert len(asked) == 7  # nothing twice
    with pytest.raises(
        InputError, match=r"trials of alone former-direct@.* are not of this table: name"
    ):
        formup("eval", "table", "1", "--method", "alone", *SOME, "--out", out)


def test_descriptors_are_counted_in_tokens_beyond_edges(
    server: tuple[str, list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    url, asked = server
    run: list[str | Path] = ["eval", "table", "3", "--models", "openai:seer", "--base-url", url]
    run += ["--method", "zerocap", "--task", "us_coins_t1", "--trials", "1"]
    assert formup(*run, "--out", tmp_path / "run") == 0
    shapes = [request for request in asked if "Shape: " in request]
    assert len(shapes) == 3
    assert len({len(shape) for shape in shapes}) == 3
    shown = capsys.readouterr().out
    assert "+0% tokens beyond edges" in shown  # this server counts alike whatever it is sent
    assert "paper +400% tokens" in shown
    assert cells(tmp_path / "run")["ZeroCAP: edges", "total"]["paper_sr"] == "0.77"


def test_marks_are_not_where_any_frame_has_them(
    server: tuple[str, list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    url, asked = server
    monkeypatch.setitem(MARKS, "red", (0.5, 0.5))  # answered so, drawn elsewhere
    monkeypatch.setattr("formup.evals.experiments.coordinate_frame.SIZE", SIZE)
    drawn = {**MARKS, "red": (0.12, 0.17)}
    monkeypatch.setattr("formup.evals.experiments.coordinate_frame.MARKS", drawn)
    run: list[str | Path] = ["eval", "table", "1", "--models", "openai:gpt-x", "--base-url", url]
    assert formup(*run, "--method", "alone", *SOME, "--out", tmp_path / "run") == 0
    cell = cells(tmp_path / "run")["vision model alone (paper: GPT-4 Vision)", "total"]
    assert "openai:gpt-x is not comparable: marks are off by" in cell["remarks"]
    assert cell["scored"] == "0"
    assert len(asked) == 1


def test_ablations_are_compared_with_the_whole_on_the_same_trials(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run: list[str | Path] = ["eval", "table", "ablations", "--method", "agent", "--trials", "1"]
    run += ["--models", "simulated", "--models", "replay:tests/recordings/photos"]
    run += ["--models", "replay:tests/recordings/two-stages", "--prompt", "former@v001"]
    run += ["--task", "us_coins_t1", "--out", tmp_path / "run"]
    assert formup(*run) == 0
    found = cells(tmp_path / "run")
    rows = [line["row"] for line in json.loads(read_table(tmp_path / "run"))["cells"]]
    whole, less = rows[0], list(dict.fromkeys(rows))[1:5]
    assert whole.startswith("formup: tools")
    assert less[:3] == list(dict.fromkeys(rows))[1:4]
    assert less[3] == "with the prompt former@v001"
    assert found[whole, "total"]["difference"] == ""
    for head in (*less, "in two stages, or one where the whole has two"):
        cell = found[head, "total"]
        assert (cell["passed"], cell["scored"], cell["difference"]) == ("1", "1", "0.0")
        assert float(cell["difference_low"]) < 0 < float(cell["difference_high"])
    assert "0 sent to wrong places" in capsys.readouterr().out
    before = read_table(tmp_path / "run")
    assert formup(*run, "--format", "json") == 0
    assert read_table(tmp_path / "run") == before == capsys.readouterr().out
    with pytest.raises(InputError, match="No row of this table is for the prompt 'former@v001'"):
        formup("eval", "table", "3", "--prompt", "former@v001")


def read_table(folder: Path) -> str:
    return (folder / "table.json").read_text("utf-8")
