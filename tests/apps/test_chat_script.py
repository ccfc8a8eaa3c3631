"""`formup chat --script`: what a program gives and gets, an object a line, and exit codes."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.store.places import store_at
from formup.apps.main import main
from PIL import Image

Chat = Callable[..., subprocess.CompletedProcess[str]]
SURROUND = "Surround the red thing with 5 robots"
KEYS = {"turn", "status", "message", "instruction", "plan_id", "parent", "positions", "files"}


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    pixels = np.full((220, 360, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    pixels[120:170, 240:300] = (40, 60, 210)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    return tmp_path / "scene.png"


@pytest.fixture
def chat(tmp_path: Path, picture: Path) -> Chat:
    """Runs a chat about that picture: lines, or a script's bytes, and options."""
    environment = os.environ | {"XDG_DATA_HOME": str(tmp_path / "data")}

    def run(
        lines: list[str] | bytes, *options: str, piped: bool = False
    ) -> subprocess.CompletedProcess[str]:
        text = lines if isinstance(lines, bytes) else "\n".join(lines).encode()
        (tmp_path / "talk.txt").write_bytes(text)
        source = [] if piped else ["--script", "talk.txt"]
        command = [sys.executable, "-m", "formup", "chat", *source, *options]
        return subprocess.run(
            command,
            cwd=tmp_path,
            env=environment,
            input=text.decode() if piped else None,
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
        )

    return run


def objects(done: subprocess.CompletedProcess[str], code: int = 0) -> list[dict[str, Any]]:
    assert done.returncode == code, done.stdout + done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_an_object_a_line(chat: Chat, tmp_path: Path) -> None:
    lines = ["# what is said", SURROUND, "", "/robots", "/go", "  /quit"]
    made = objects(chat([*lines, "not read"], "scene.png", "--json", "--out", "out"))
    assert [o["turn"] for o in made] == [1, 2, 3, 4]
    assert [o["status"] for o in made] == ["planned", "answered", "deployed", "answered"]
    assert [o["instruction"] for o in made] == [SURROUND, "/robots", "/go", "/quit"]
    assert all(o.keys() >= KEYS for o in made)
    assert len({o["plan_id"] for o in made}) == 1
    assert made[0]["positions"] == made[3]["positions"]
    assert "robot 5: place (" in made[1]["message"]
    assert made[0]["files"]["picture"] == "plan-1.png"
    assert made[2]["files"]["animation"] == "deploy-3.gif"
    assert made[1]["files"] is None
    plan = json.loads((tmp_path / "out/plan-1.json").read_bytes())
    assert made[0]["plan_id"] in json.dumps(plan)


def test_nothing_moves_without_go_but_with_auto(chat: Chat) -> None:
    assert objects(chat([SURROUND], "scene.png", "--json"))[0]["arrival"] is None
    moved = objects(chat([SURROUND], "scene.png", "--json", "--auto"))[0]
    assert (moved["status"], moved["arrival"]["arrived"]) == ("deployed", True)


def test_the_next_line_is_the_answer(chat: Chat) -> None:
    made = objects(chat(["Surround the thing with 6 robots", "2"], "scene.png", "--json"))
    assert [o["status"] for o in made] == ["question", "planned"]
    asked = made[0]["candidates"]
    assert made[1]["targets"][-1]["box"] == pytest.approx(asked[1]["box"], abs=3)


def test_a_go_leaves_a_question_open_and_nothing_moves(chat: Chat) -> None:
    lines = ["Surround the thing with 6 robots", "2", "keep clear of the flurb", "go"]
    made = objects(chat([*lines, "never mind", "go"], "scene.png", "--json"))
    assert [o["status"] for o in made[1:]] == [
        "planned", "question", "question", "answered", "deployed"
    ]  # fmt: skip
    assert "A question is open" in made[3]["message"]


def test_a_point_answers_or_goes_with_what_is_said_next(chat: Chat) -> None:
    lines = ["Surround the thing with 6 robots", "/point 270,145"]
    made = objects(chat(lines, "scene.png", "--json"))
    assert made[1]["status"] == "planned"
    x0, y0, x1, y1 = made[1]["targets"][-1]["box"]
    assert x0 < 270 < x1 and y0 < 145 < y1
    made = objects(chat(["/point 270,145", "Surround it with 6 robots"], "scene.png", "--json"))
    assert [o["status"] for o in made] == ["answered", "planned"]
    assert made[1]["targets"][-1]["box"] == pytest.approx([x0, y0, x1, y1], abs=3)


def test_a_person_is_told_how_to_show_the_thing_that_is_meant(chat: Chat) -> None:
    done = chat(["Surround the thing with 6 robots"], "scene.png")
    assert done.stdout.count("\nchoice: ") == 2
    assert "or: /point X,Y, the thing's place in the picture\n" in done.stdout


def test_things_are_numbered_in_the_order_given(chat: Chat) -> None:
    options = ["--box", "235,115,305,175", "--point", "90,65", "--json"]
    made = objects(chat(["Put 3 robots between them"], "scene.png", *options))[0]
    boxes = {target["id"]: target["box"] for target in made["targets"]}
    assert boxes["t1"][0] > 200 > boxes["t2"][0]


def test_undo_and_redo_are_turns_with_plans(chat: Chat) -> None:
    lines = [SURROUND, "further out", "/undo", "/redo", "/diff"]
    made = objects(chat(lines, "scene.png", "--json"))
    first, second = made[0]["plan_id"], made[1]["plan_id"]
    assert first != second == made[3]["plan_id"] and made[2]["plan_id"] == first
    assert (made[0]["parent"], made[1]["parent"]) == (None, first)
    assert made[4]["message"].count("moves") == 5


def test_another_picture_voids_plans(chat: Chat, picture: Path) -> None:
    Image.open(picture).point(lambda value: value + 9).save(picture.parent / "b.png")
    lines = [SURROUND, "/image b.png", "/go", "/plan", "/show", SURROUND, "/sessions"]
    made = objects(chat(lines, "scene.png", "--json"))
    first, last = made[0]["plan_id"], made[5]["plan_id"]
    assert [o["plan_id"] for o in made] == [first, None, None, None, None, last, last]
    assert made[2]["arrival"] is None
    assert first in made[3]["message"] and "void" in made[3]["message"]
    assert first != last is not None
    assert made[5]["image"]["sha256"] != made[0]["image"]["sha256"]


def test_a_session_goes_on_in_another_process(chat: Chat) -> None:
    begun = chat([SURROUND, "/sessions"], "scene.png", "--json")
    session = re.search(r"--session (\w+)", begun.stderr)
    assert session is not None and session[1] in objects(begun)[1]["message"]
    made = objects(chat(["further out"], "--session", session[1], "--json"))
    assert made[0]["parent"] == objects(begun)[0]["plan_id"]


def test_lines_for_a_person_have_no_escapes(chat: Chat) -> None:
    for piped in (False, True):
        done = chat([SURROUND, "/robots"], "scene.png", "--out", f"out{piped}", piped=piped)
        assert done.returncode == 0, done.stderr
        assert f"you: {SURROUND}\n" in done.stdout
        assert "formup: planned: " in done.stdout
        assert re.search(r"^step: propose_formation, \d+\.\d\d s$", done.stdout, re.MULTILINE)
        assert f"picture: out{piped}/plan-1.png\n" in done.stdout
        assert "\x1b" not in done.stdout


@pytest.mark.parametrize(
    ("lines", "options", "words"),
    [
        (b"/nothing", ["scene.png"], "There is no command '/nothing'"),
        (b"/s", ["scene.png"], "/show, /stop, /save, /sessions"),
        (b"/image missing.png", ["scene.png"], "missing.png"),
        (b"/undo x", ["scene.png"], "/undo 'x'"),
        (b"/go", ["scene.png"], "Say what to do first"),
        (b"/point here", ["scene.png"], "/point 'here'"),
        (b"hello", [], "Give a picture to talk about"),
        (b"hello", ["--session", "nothere"], "'nothere'"),
        (b"hello", ["missing.png"], "missing.png"),
        (b"hello", ["scene.png", "--auto", "--plan-only"], "--auto"),
        (b"hello", ["scene.png", "--segmenter", "none"], "'none'"),
        (b"\xff\xfe\x00\xd8", ["scene.png"], "talk.txt"),
    ],
)
def test_mistakes_exit_with_2_and_end_in_one_object(
    lines: bytes,
    options: list[str],
    words: str,
    picture: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(picture.parent)
    (picture.parent / "talk.txt").write_bytes(lines)
    script = ["--script", "talk.txt", "--json", "--store", "talks"]
    monkeypatch.setattr(sys, "argv", ["formup", "chat", *script, *options])
    with pytest.raises(SystemExit) as ended:
        main()
    made = json.loads(capsys.readouterr().out)
    assert (ended.value.code, made["status"]) == (2, "failed")
    assert words in made["message"]
    left = store_at("talks").sessions()
    assert not left  # nothing was said


def test_a_mistake_ends_a_script(chat: Chat) -> None:
    made = objects(chat(["/nothing", SURROUND], "scene.png", "--json"), code=2)
    assert len(made) == 1


def test_a_model_out_of_reach_exits_with_4(chat: Chat) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{free.getsockname()[1]}/v1"
    options = ["--model", "openai:any", "--base-url", address, "--json"]
    made = objects(chat([SURROUND, "/robots"], "scene.png", *options), code=4)
    assert [o["status"] for o in made] == ["failed"]


def test_ctrl_c_exits_with_130(picture: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        (picture.parent / "talk.txt").write_text(f"{SURROUND}\n/robots\n")
        address = f"http://127.0.0.1:{server.getsockname()[1]}/v1"
        options = ["--script", "talk.txt", "--json", "--model", "openai:any", "--base-url", address]
        command = [sys.executable, "-m", "formup", "chat", "scene.png", *options]
        environment = os.environ | {"XDG_DATA_HOME": str(picture.parent / "data")}
        with subprocess.Popen(
            command, cwd=picture.parent, env=environment, stdout=subprocess.PIPE
        ) as talking:
            asked, _ = server.accept()
            threading.Timer(0, talking.send_signal, [signal.SIGINT]).start()
            out = talking.communicate()[0]
            asked.close()
    assert talking.returncode == 130
    assert [json.loads(line)["status"] for line in out.splitlines()] == ["stopped"]


def test_ctrl_c_ends_the_wait_for_a_line(picture: Path) -> None:
    command = [sys.executable, "-m", "formup", "chat", "scene.png", "--store", "talks"]
    with subprocess.Popen(
        command,
        cwd=picture.parent,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as talking:
        assert talking.stdin is not None and talking.stdout is not None
        talking.stdin.write(b"what can you do?\n\xff\n")
        talking.stdin.flush()
        while "you: \N{REPLACEMENT CHARACTER}" not in talking.stdout.readline().decode():
            pass
        assert talking.stdout.readline().startswith(b"formup: ")
        talking.send_signal(signal.SIGINT)
        out, said = talking.communicate()
    assert (talking.returncode, out) == (130, b"")
    assert b"interrupted" in said
    assert len(store_at(picture.parent / "talks").sessions()) == 1
