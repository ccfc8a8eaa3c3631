"""Sessions at the command line: the next turn, kills, moved folders, full disks, two processes."""

import json
import shutil
import subprocess
import sys
from collections.abc import AsyncGenerator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.session import load_run
from formup.agent.store.folder import FolderLog, read_events
from formup.apps import run_files, terminal_session
from formup.apps.main import main
from formup.tools.errors import StorageError
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from PIL import Image

Cli = Callable[..., tuple[int, str, str]]
RED = ("Surround the red thing", "-n", 5)
BLUE = "Now surround the blue thing with 7 robots"
FILES = {"plan.json", "plan.png", "deploy.gif", "trace.jsonl", "pictures"}


@pytest.fixture(scope="module")
def pixels() -> Any:
    made = np.full((220, 360, 3), 60, np.uint8)
    made[40:90, 60:120] = (200, 40, 40)
    made[120:170, 240:300] = (40, 60, 210)
    return made


@pytest.fixture
def picture(tmp_path: Path, pixels: Any) -> Path:
    (tmp_path / "home").mkdir()
    Image.fromarray(pixels).save(tmp_path / "home/scene.png")
    return tmp_path / "home/scene.png"


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, picture: Path) -> Cli:
    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.chdir(picture.parent)
        monkeypatch.setattr(sys, "argv", ["formup", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return code, out, err

    return run


def refused(outcome: tuple[int, str, str], *words: str) -> None:
    """Exit 2, nothing on stdout, one sentence on stderr with these words."""
    code, out, err = outcome
    assert (code, out) == (2, ""), err
    assert err.startswith("formup: ")
    assert err.count("\n") == 1, err
    for word in words:
        assert word in err, err


def report(outcome: tuple[int, str, str], code: int = 0) -> dict[str, Any]:
    assert outcome[0] == code, outcome[2]
    return json.loads(outcome[1])


def run(cli: Cli, *more: object, code: int = 0) -> dict[str, Any]:
    return report(cli("run", "scene.png", *RED, "--out", "out", "--json", *more), code)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_the_next_turn_goes_on_from_the_first(cli: Cli, picture: Path) -> None:
    first = run(cli)
    second = report(cli("resume", "out", BLUE, "--json"))
    assert (first["status"], second["status"]) == ("deployed", "deployed")
    assert second["instruction"] == BLUE
    assert [len(d["positions"]) for d in (first, second)] == [5, 7]
    assert {t["id"]: t["label"] for t in second["targets"]} == {
        "t1": "red thing",
        "t2": "blue thing",
    }
    assert second["contract"]["groups"][0]["targets"] == ["t2"]
    assert second["usage"]["requests"] == first["usage"]["requests"]
    left = load_run(picture.parent / "out")
    assert list(left.world.arrivals) == [first["plan_id"], second["plan_id"]]
    assert set(first["robots"]) < {pose.id for pose in left.world.robots}
    assert names(picture.parent / "out") == FILES
    plan = json.loads((picture.parent / "out/plan.json").read_text())
    assert plan["plan_id"] == second["plan_id"]
    shown = cli("trace", "out")[1]
    for words in (RED[0], BLUE):
        assert str(words) in shown
    assert shown.count("deployed:") == 2
    third = report(cli("resume", "out", "Surround the red thing with 4 robots", "--json"))
    assert (third["status"], third["contract"]["groups"][0]["targets"]) == ("deployed", ["t1"])


def test_limits_of_the_first_turn_hold_for_the_next_anew(cli: Cli) -> None:
    run(cli, "--limit", "requests=4")
    assert report(cli("resume", "out", BLUE, "--json"))["status"] == "deployed"
    again = "Now surround the red thing with 6 robots"
    fewer = report(cli("resume", "out", again, "--limit", "requests=1", "--json"), 4)
    assert "1 request " in fewer["message"]


def test_words_and_an_answer_are_not_given_together(cli: Cli) -> None:
    run(cli)
    for more in (("--answer", "x"), ("--approve",), ("--refuse",)):
        refused(cli("resume", "out", BLUE, *more), "not both")
    refused(cli("resume", "out", "  "), "empty")


def test_killed_anywhere_resume_finishes_it_with_its_files(cli: Cli, picture: Path) -> None:
    """In the middle of every line; the whole events before it are what counts."""
    whole = run(cli)
    out, cut = picture.parent / "out", picture.parent / "cut"
    lines = (out / "trace.jsonl").read_bytes().splitlines(keepends=True)
    begins = [event.kind for event in read_events(out)].index("message") + 1
    for count in range(len(lines) + 1):
        rest = lines[count][: len(lines[count]) // 2] if count < len(lines) else b""
        shutil.rmtree(cut, ignore_errors=True)
        cut.mkdir()
        (cut / "trace.jsonl").write_bytes(b"".join(lines[:count]) + rest)
        shutil.copytree(out / "pictures", cut / "pictures")
        if count < begins:
            refused(cli("resume", "cut"), "cut")
            continue
        done = report(cli("resume", "cut", "--json"))
        assert done["status"] == "deployed"
        assert done["positions"] == whole["positions"], count
        assert names(cut) == FILES
        assert load_run(cut).report.status == "deployed"


@pytest.mark.parametrize("missing", sorted(FILES - {"trace.jsonl", "pictures"}))
def test_files_that_are_missing_are_written_again(missing: str, cli: Cli, picture: Path) -> None:
    first = run(cli)
    out = picture.parent / "out"
    before = (out / missing).read_bytes()
    log = (out / "trace.jsonl").read_bytes()
    (out / missing).unlink()
    again = report(cli("resume", "out", "--json"))
    assert (again["status"], again["files"]) == (first["status"], first["files"])
    if missing != "deploy.gif":
        assert (out / missing).read_bytes() == before
    assert names(out) == FILES
    assert (out / "trace.jsonl").read_bytes() == log
    assert report(cli("deploy", "out/plan.json", "--json"))["plan_id"] == first["plan_id"]


@pytest.mark.parametrize("gone", [False, True])
def test_the_picture_of_a_question_is_written_again(gone: bool, cli: Cli, picture: Path) -> None:
    words = ("run", "scene.png", "Surround the thing", "-n", 4, "--out", "o")
    asked = report(cli(*words, "--json"), 3)
    assert asked["files"]["picture"] == "question.png"
    if gone:
        (picture.parent / "o/question.png").unlink()
    refused(cli("resume", "o"), "waits for an answer")
    assert names(picture.parent / "o") == {"question.png", "trace.jsonl", "pictures"}


OPENED = """
import sys
from pathlib import Path
from formup.agent.store.folder import FolderLog
log = FolderLog(Path(sys.argv[1]))
print("open", flush=True)
sys.stdin.read()
"""


def test_a_second_process_on_a_folder_is_refused(cli: Cli, picture: Path) -> None:
    run(cli, "--policy", "deploy=ask", code=3)
    trace = picture.parent / "out/trace.jsonl"
    before = trace.read_bytes()
    other = subprocess.Popen(
        [sys.executable, "-c", OPENED, str(trace)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "open\n"
    for more in (("--approve",), (BLUE,), ("--refuse",)):
        refused(cli("resume", "out", *more), "being written by another process")
    refused(cli("run", "scene.png", *RED, "--out", "out"), "being written by another process")
    assert trace.read_bytes() == before
    assert "needs_approval:" in cli("trace", "out")[1]
    other.communicate("")
    assert report(cli("resume", "out", "--approve", "--json"))["status"] == "deployed"


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Room for so many events; once there is none, nothing can be written, files neither."""
    room: list[int] = []
    append, write = FolderLog.append, run_files.write_whole

    def bounded(log: FolderLog, kind: Any, data: Any) -> int:
        if room and not room[0]:
            raise StorageError("the disk is full.")
        if room:
            room[0] -= 1
        return append(log, kind, data)

    def whole(path: Path, data: bytes) -> None:
        if room and not room[0]:
            raise StorageError("the disk is full.")
        write(path, data)

    monkeypatch.setattr(FolderLog, "append", bounded)
    for module in (run_files, terminal_session):
        monkeypatch.setattr(module, "write_whole", whole)
    return room


def test_a_disk_that_fills_hides_no_move(
    cli: Cli, picture: Path, disk: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    driven: list[Motion] = []
    drive = SimulatedFleet.drive

    def counted(fleet: SimulatedFleet, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        driven.append(motion)
        return drive(fleet, motion)

    monkeypatch.setattr(SimulatedFleet, "drive", counted)
    run(cli)
    out = picture.parent / "out"
    kinds = [event.kind for event in read_events(out)]
    moving = kinds.index("moving")
    for room in range(len(kinds)):
        shutil.rmtree(out)
        driven.clear()
        disk[:] = [room]
        outcome = cli("run", "scene.png", *RED, "--out", "out")
        if room <= moving:
            refused(outcome, "the disk is full.")
            assert driven == []
        else:
            assert driven
            code, shown, _ = outcome
            assert code == 0
            assert "deployed:" in shown
            assert "the disk is full." in " ".join(shown.split())
        disk.clear()


def test_a_folder_is_gone_on_with_elsewhere(cli: Cli, picture: Path, tmp_path: Path) -> None:
    first = run(cli, "--policy", "deploy=ask", code=3)
    shutil.move(picture.parent / "out", tmp_path / "moved")
    shutil.copytree(tmp_path / "moved", tmp_path / "copied")
    picture.unlink()
    moved = report(cli("resume", tmp_path / "moved", "--approve", "--json"))
    assert (moved["status"], moved["plan_id"]) == ("deployed", first["plan_id"])
    plan = tmp_path / "copied/plan.json"
    deployed = report(cli("deploy", plan, "--json"))
    assert (deployed["status"], deployed["plan_id"]) == ("deployed", first["plan_id"])
    assert (tmp_path / "copied/deploy.gif").exists()
    next_one = report(cli("resume", tmp_path / "moved", BLUE, "--json"), 3)
    assert (next_one["status"], len(next_one["targets"])) == ("needs_approval", 2)


def test_a_changed_picture_is_refused_and_the_old_one_can_be_named(
    cli: Cli, picture: Path, tmp_path: Path, pixels: Any
) -> None:
    run(cli, "--policy", "deploy=ask", code=3)
    out = picture.parent / "out"
    (tmp_path / "kept").mkdir()
    kept = shutil.copy(picture, tmp_path / "kept/other name.png")
    stored = read_events(out)[0].data["picture"]["file"]
    (beside,) = out.glob(f"pictures/{stored[:16]}.*")
    changed = pixels.copy()
    changed[0, 0] = 0
    Image.fromarray(changed).save(picture)
    for command in (("resume", "out", "--approve"), ("deploy", "out/plan.json")):
        refused(cli(*command, "--image", picture), "scene.png", "changed")
    beside.unlink()
    for command in (("resume", "out", "--approve"), ("deploy", "out/plan.json")):
        refused(cli(*command), "scene.png", "changed")
    picture.unlink()
    for command in (("resume", "out", "--approve"), ("deploy", "out/plan.json")):
        refused(cli(*command), "give it as the image")
    deployed = report(cli("deploy", "out/plan.json", "--image", kept, "--json"))
    assert deployed["status"] == "deployed"
    done = report(cli("resume", "out", "--approve", "--image", kept, "--json"))
    assert (done["status"], done["plan_id"]) == ("deployed", deployed["plan_id"])


def test_a_picture_beside_the_log_that_was_damaged_is_refused(cli: Cli, picture: Path) -> None:
    run(cli, "--policy", "deploy=ask", code=3)
    out = picture.parent / "out"
    stored = read_events(out)[0].data["picture"]["file"]
    (beside,) = out.glob(f"pictures/{stored[:16]}.*")
    with Image.open(beside) as image:
        pixels = np.asarray(image).copy()
    pixels[0, 0] += 1
    Image.fromarray(pixels).save(beside)
    picture.unlink()
    refused(cli("resume", "out", "--approve"))
    refused(cli("deploy", "out/plan.json"), "changed")
