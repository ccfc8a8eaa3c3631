"""`formup chat` with somebody at a terminal: a real process behind a real pseudo-terminal."""

import fcntl
import json
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

ESCAPES = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\)|_[^\x1b]*\x1b\\|.)")
ANSWERS = {b"\x1b[c": b"\x1b[?1;2c", b"\x1b[6n": b"\x1b[1;1R"}
"""What a terminal says when it is asked what it can, and where the cursor is."""
PATIENCE = 60
"""Seconds until a test gives up."""
SURROUND = "Surround the red thing with 5 robots"


class Terminal:
    """A command with a terminal of 100 columns; `seen` is all it has shown."""

    def __init__(self, command: list[str], folder: Path, environment: dict[str, str]) -> None:
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # Ctrl-C reaches it
        )
        os.close(theirs)
        self.raw, self._after = b"", 0

    @property
    def seen(self) -> str:
        return ESCAPES.sub("", self.raw.decode(errors="replace")).replace("\r", "")

    def type(self, text: str) -> None:
        os.write(self._ours, text.encode())

    def wait(self, text: str) -> None:
        """Until a text is shown after what was waited for before."""
        until = time.monotonic() + PATIENCE
        while (found := self.seen.find(text, self._after)) < 0:
            assert time.monotonic() < until and self._read(), f"no {text!r} in:\n{self.seen}"
        self._after = found + len(text)

    def end(self) -> int:
        """What it exits with."""
        until = time.monotonic() + PATIENCE
        while self._read():
            assert time.monotonic() < until, self.seen
        return self.process.wait()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._ours)

    def _read(self) -> bool:
        if not select.select([self._ours], [], [], 1)[0]:
            return True
        try:
            data = os.read(self._ours, 1 << 16)
        except OSError:  # it has ended
            return False
        self.raw += data
        for question, answer in ANSWERS.items():
            for _ in range(data.count(question)):
                os.write(self._ours, answer)
        return bool(data)


Start = Callable[..., Terminal]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Begins a chat about a picture with a red thing in it."""
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    environment = {"TERM": "xterm-256color", "COLORTERM": "truecolor", "LANG": "C.UTF-8"}
    environment = os.environ | environment | {"XDG_DATA_HOME": str(tmp_path / "data")}
    begun: list[Terminal] = []

    def chat(*options: str) -> Terminal:
        command = [sys.executable, "-m", "formup", "chat", "scene.png", *options]
        begun.append(Terminal(command, tmp_path, environment))
        return begun[-1]

    yield chat
    for terminal in begun:
        terminal.close()


@pytest.fixture
def silent() -> Iterator[tuple[str, threading.Event]]:
    """A model's server that never answers, and whether it was asked."""
    asked, over = threading.Event(), threading.Event()

    class Silent(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asked.set()
            over.wait()

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Silent) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,)).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/v1", asked
        over.set()
        server.shutdown()


class Speaker:
    """A model's server that says replies a piece at a time; it waits at a None until told on.

    Attributes:
        replies: what is left to be said: pieces of text, and last perhaps a call of a tool. One
            that ends in an exception is broken off.
    """

    def __init__(self, *replies: list[Any]) -> None:
        self.replies, self.requests = list(replies), list[dict[str, Any]]()
        self.go_on = threading.Semaphore(0)

    def answer(self, request: dict[str, Any], write: Callable[[bytes], object]) -> None:
        self.requests.append(request)
        pieces = self.replies.pop(0)
        calls: list[Any] = [piece for piece in pieces if isinstance(piece, dict)]
        text = "".join(piece for piece in pieces if isinstance(piece, str))
        if not request.get("stream"):
            message = {"content": text, "tool_calls": calls}
            write(json.dumps({"choices": [{"index": 0, "message": message}]}).encode())
            return
        for piece in pieces:
            if piece is None:
                assert self.go_on.acquire(timeout=PATIENCE)
            elif isinstance(piece, Exception):
                return
            else:
                delta = {"content": piece} if isinstance(piece, str) else {"tool_calls": [piece]}
                event = {"choices": [{"index": 0, "delta": delta}]}
                write(b"data: " + json.dumps(event).encode() + b"\n\n")
        write(b"data: [DONE]\n\n")


@contextmanager
def speaking(speaker: Speaker) -> Generator[str]:
    """The address of a server that says what the speaker does."""

    class Speaking(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            request = json.loads(self.rfile.read(int(self.headers["content-length"])))
            self.send_response(200)
            kind = "text/event-stream" if request.get("stream") else "application/json"
            self.send_header("content-type", kind)
            self.end_headers()
            speaker.answer(request, self.wfile.write)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Speaking) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,)).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/v1"
        server.shutdown()


def test_a_person_plans_looks_and_goes(start: Start, tmp_path: Path) -> None:
    chat = start("--out", "out")
    chat.wait("you:")
    chat.type(f"{SURROUND}\r")
    chat.wait("planned:")
    chat.wait("▀")
    chat.wait("out/plan-1.png")
    chat.wait("you:")
    chat.type("/go\r")
    chat.wait("deployed:")
    chat.wait("out/deploy-2.gif")
    chat.wait("you:")
    chat.type("/quit\r")
    assert chat.end() == 0
    assert re.search(r"propose_formation, \d+\.\d\d s", chat.seen)
    assert (tmp_path / "out/plan-1.png").exists()


def test_lines_pasted_together_are_one_message(start: Start) -> None:
    chat = start()
    chat.wait("you:")
    chat.type("\x1b[200~Surround the red thing\nwith 5 robots\x1b[201~\r")
    chat.wait("planned:")
    chat.wait("you:")
    chat.type("/quit\r")
    assert chat.end() == 0
    assert "5 robots have certified places" in " ".join(chat.seen.split())


def test_the_prompt_completes_and_remembers(start: Start) -> None:
    chat = start()
    chat.wait("you:")
    chat.type("/cos")
    chat.wait("/cost")
    chat.type("\t\r")
    chat.wait("tokens in")
    chat.wait("you:")
    chat.type("\x04")
    assert chat.end() == 0
    again = start()
    again.wait("you:")
    again.type("\x1b[A")
    again.wait("/cost")
    again.type("\r")
    again.wait("tokens in")
    again.wait("you:")
    again.type("\x04")
    assert again.end() == 0


def test_ctrl_c_twice_leaves(start: Start) -> None:
    chat = start()
    chat.wait("you:")
    chat.type("not this")
    chat.wait("not this")
    chat.type("\x03")
    chat.wait("\nyou:")  # the next prompt, not this one drawn once more
    chat.type("\x03")
    chat.wait("again")
    chat.wait("\nyou:")
    chat.type("\x03")
    assert chat.end() == 130


@pytest.mark.parametrize(
    ("stop", "options"),
    [("\x03", ()), ("stop\r", ()), ("\x03", ("--plain",)), ("/stop\r", ("--plain",))],
    ids=["key", "word", "key, plain", "command, plain"],
)
def test_a_turn_is_stopped_with_the_model_out_of_reach(
    start: Start, silent: tuple[str, threading.Event], stop: str, options: tuple[str, ...]
) -> None:
    address, asked = silent
    chat = start("--model", "openai:any", "--base-url", address, *options)
    chat.wait("you:")
    chat.type(f"{SURROUND}\r")
    assert asked.wait(PATIENCE)
    chat.type(stop)
    chat.wait("stopped:")
    chat.wait("you:")
    chat.type("/quit\r")
    assert chat.end() == 0


def test_what_is_typed_during_a_turn_is_said_next(
    start: Start, silent: tuple[str, threading.Event]
) -> None:
    address, asked = silent
    chat = start("--model", "openai:any", "--base-url", address)
    chat.wait("you:")
    chat.type(f"{SURROUND}\r")
    assert asked.wait(PATIENCE)
    chat.type("/cost\rstop\r")
    chat.wait("stopped:")
    chat.wait("tokens in")
    chat.wait("you:")
    chat.type("/quit\r")
    assert chat.end() == 0


def test_plain_mode_is_nothing_but_lines(start: Start) -> None:
    chat = start("--plain", "--out", "out")
    chat.wait("you:")
    chat.type(f"{SURROUND}\r")
    chat.wait("you:")
    chat.type("/robots\r")
    chat.wait("robot 5:")
    chat.wait("you:")
    chat.type("\x04")
    assert chat.end() == 0
    assert b"\x1b" not in chat.raw
    assert "formup: planned: " in chat.seen
    assert not re.search("[\u2500-\u25ff\u2800-\u28ff]", chat.seen)


PROPOSAL: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 5}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}
CALL = {
    "index": 0,
    "id": "c1",
    "type": "function",
    "function": {"name": "propose_formation", "arguments": json.dumps(PROPOSAL)},
}


@pytest.mark.parametrize("options", [(), ("--plain",)], ids=["rich", "plain"])
def test_a_reply_is_shown_while_it_comes_and_once(start: Start, options: tuple[str, ...]) -> None:
    speaker = Speaker(
        ["I look ", None, "at it\nnow.", CALL],
        ["Five robots ", None, "have places."],
        ["\nYou are ", None, "welcome."],
    )
    with speaking(speaker) as address:
        chat = start("--model", "openai:any", "--base-url", address, *options)
        chat.wait("you:")
        chat.type(f"{SURROUND}\r")
        for first, rest in (("I look ", "at it"), ("Five robots ", "have places.")):
            chat.wait(first)
            speaker.go_on.release()
            chat.wait(rest)
        chat.wait("planned\n")
        chat.wait("plan-1.png")
        chat.wait("you:")
        chat.type("Thanks\r")
        chat.wait("You are ")
        speaker.go_on.release()
        chat.wait("welcome.\n")
        chat.wait("you:")
        chat.type("/quit\r")
        assert chat.end() == 0
    for said in ("I look at it", "Five robots have places.\n", "You are welcome.\n"):
        assert chat.seen.count(said) == 1
    for last in ("now.", "places.", "welcome."):
        assert chat.seen.count(last) == 1
    assert "\nnow.\n" in chat.seen if options else "\n              now.\n" in chat.seen
    assert [r["stream"] for r in speaker.requests] == [True] * 3


def test_a_reply_that_broke_off_is_told_anew(start: Start) -> None:
    speaker = Speaker(["Hello ", ConnectionError()], ["Good morning."])
    with speaking(speaker) as address:
        chat = start("--plain", "--model", "openai:any", "--base-url", address)
        chat.wait("you:")
        chat.type("Hi\r")
        chat.wait("formup: Hello \nnote: The reply broke off and starts again.\n")
        chat.wait("formup: Good morning.\n")
        chat.wait("you:")
        chat.type("\x04")
        assert chat.end() == 0


def test_a_turn_stopped_in_the_middle_of_a_reply(start: Start) -> None:
    speaker = Speaker(["I begin", None])
    with speaking(speaker) as address:
        chat = start("--plain", "--model", "openai:any", "--base-url", address)
        chat.wait("you:")
        chat.type("Hi\r")
        chat.wait("I begin")
        chat.type("\x03")
        chat.wait("\nformup: stopped: ")
        speaker.go_on.release()
        chat.wait("you:")
        chat.type("\x04")
        assert chat.end() == 0


def test_scripts_are_told_whole_replies(start: Start, tmp_path: Path) -> None:
    (tmp_path / "talk.txt").write_text("Hi")
    speaker = Speaker(["Hello."])
    with speaking(speaker) as address:
        chat = start("--script", "talk.txt", "--model", "openai:any", "--base-url", address)
        assert chat.end() == 0
    assert "stream" not in speaker.requests[0]
    assert chat.seen.count("Hello.") == 1
