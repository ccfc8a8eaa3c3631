"""The table of faults: what goes wrong, at which provider, and how the run ends, messages kept.

Rows that need an interrupted or killed process are run as one, through the command line.
"""

import asyncio
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.fold import read_messages
from formup.agent.limits import Limits
from formup.agent.messages import History, Result
from formup.agent.outcomes import Answered, Outcome, Stopped
from formup.agent.session import Run
from formup.agent.store.folder import PICTURES, FolderArtefacts, log_path, read_events
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.perception.image import Picture, load_picture
from formup.tools.tool import ToolResult, tool
from PIL import Image

LOOK: tuple[str, str, dict[str, Any]] = ("c1", "locate_object", {})
PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}
released = threading.Event()


@tool("read")
def breaks(context: Context) -> ToolResult:
    """Have a mistake in it."""
    raise ZeroDivisionError("by nothing")


@tool("read")
def hangs(context: Context) -> ToolResult:
    """Never end."""
    released.wait(60)
    return ToolResult({})


@tool("actuate")
async def moves_long(context: Context) -> ToolResult:
    """Move robots for longer than other tools may take."""
    await asyncio.sleep(0.4)
    return ToolResult({"moved": True})


@pytest.fixture(scope="module", autouse=True)
def let_go() -> Iterator[None]:
    yield
    released.set()


@pytest.fixture
def picture(tmp_path: Path) -> Picture:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    return load_picture(tmp_path / "scene.png")


def calls(name: str, **arguments: Any) -> list[tuple[str, str, dict[str, Any]]]:
    return [("c9", name, arguments)]


def done(say: Any) -> list[bytes]:
    return [say("Done.")]


Script = Callable[[Any, Any, Any], list[bytes]]
Row = tuple[type[Outcome], str | None, str, int, str]
"""Outcome, kind of stop, status, exit code, and words of the message or of the last result."""
FAILED: tuple[type[Outcome], str, str, int] = (Stopped, "model", "failed", 4)
MENDED: tuple[type[Outcome], None, str, int] = (Answered, None, "answered", 0)
FAILING: tuple[type[Outcome], None, str, int] = (Answered, None, "impossible", 3)
TABLE: dict[str, tuple[Script, Row]] = {
    "429": (lambda say, d, http: [http.response(d.error("busy"), 429)] * 4, (*FAILED, "busy")),
    "429 with Retry-After": (
        lambda say, d, http: [http.response(d.error("busy"), 429, retry_after="9"), *done(say)],
        (*MENDED, "Done."),
    ),
    "500": (lambda say, d, http: [http.response(d.error("broken"), 500)] * 2, (*FAILED, "broken")),
    "200 with an error body": (
        lambda say, d, http: [http.response(d.error("not now", "overloaded_error"))] * 4,
        (*FAILED, "not now"),
    ),
    "malformed JSON": (lambda say, d, http: [http.response(b'{"a":')] * 2, (*FAILED, "not JSON")),
    "truncated stream": (
        lambda say, d, http: [http.stream(d.events("Done."), cut=3)] * 4,
        (*FAILED, "dropped the connection"),
    ),
    "truncated stream, once": (
        lambda say, d, http: [http.stream(d.events("Done."), cut=3), *done(say)],
        (*MENDED, "Done."),
    ),
    "unknown tool": (
        lambda say, d, http: [say("", calls("fly"), "calls"), *done(say)],
        (*FAILING, "Unknown tool 'fly'"),
    ),
    "arguments of the wrong shape": (
        lambda say, d, http: [say("", calls("segment", box="here"), "calls"), *done(say)],
        (*FAILING, "segment: box"),
    ),
    "a tool that raises": (
        lambda say, d, http: [say("", calls("breaks"), "calls")],
        (Stopped, "tool", "failed", 4, "breaks broke (ZeroDivisionError: by nothing)"),
    ),
    "a tool that hangs": (
        lambda say, d, http: [say("", calls("hangs"), "calls"), *done(say)],
        (*FAILING, "did not end within 0.2 s"),
    ),
    "a move that takes long": (
        lambda say, d, http: [say("", calls("moves_long"), "calls"), *done(say)],
        (*MENDED, '"moved":true'),
    ),
}


def written(path: Path) -> History:
    """The messages of a log."""
    lines = [event.data for event in read_events(path) if event.kind == "message"]
    return read_messages(lines, FolderArtefacts(log_path(path).parent / PICTURES))


def kept(run: Run, trace: Path) -> bool:
    """Whether all that came before the fault is there, in memory and on disk."""
    messages = run.outcome.messages
    names = [m.name for m in messages if isinstance(m, Result)]
    return names[:1] == ["locate_object"] and written(trace) == messages


@pytest.mark.parametrize("fault", TABLE)
def test_the_table(
    fault: str, server: Any, dialect: Any, say: Any, http: Any, picture: Picture, tmp_path: Path
) -> None:
    script, (ends, kind, status, code, words) = TABLE[fault]
    server.script = [say("", [LOOK], "calls"), *script(say, dialect, http)]
    agent = Agent(
        server.model(dialect.name, streamed="stream" in fault),
        tools=(*TOOLS, breaks, hangs, moves_long),
        limits=Limits(tool_seconds=0.2 if "hangs" in fault or "long" in fault else None),
    )
    run = agent.run(picture, "Surround it", trace=tmp_path / "trace.jsonl")
    assert isinstance(run.outcome, ends), run.outcome
    assert getattr(run.outcome, "kind", None) == kind
    assert (run.report.status, run.report.exit_code) == (status, code)
    last = [m.text for m in run.outcome.messages if isinstance(m, Result)][-1]
    assert words in run.report.message + last
    assert kept(run, tmp_path / "trace.jsonl")
    assert not server.script


def test_connection_refused(server: Any, dialect: Any, picture: Picture, tmp_path: Path) -> None:
    model = server.model(dialect.name, url="http://127.0.0.1:1/v1")
    run = Agent(model).run(picture, "Surround it", trace=tmp_path / "trace.jsonl")
    assert isinstance(run.outcome, Stopped)
    assert (run.outcome.kind, run.report.status, run.report.exit_code) == ("model", "failed", 4)
    assert "could not be reached" in run.report.message
    assert written(tmp_path / "trace.jsonl") == run.outcome.messages


def formup(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "formup", *arguments],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def started(server: Any, dialect: Any, cwd: Path) -> subprocess.Popen[str]:
    """A run that has looked, and now waits for a server that is silent."""
    name = ("--model", f"{dialect.name}:m", "--base-url", server.url)
    run = formup("run", "scene.png", "Surround it", *name, "--json", "--out", "out", cwd=cwd)
    while len(server.requests) < 2:
        assert run.poll() is None, run.communicate()
        time.sleep(0.02)
    return run


def ended(run: subprocess.Popen[str]) -> tuple[int, dict[str, Any], str]:
    out, err = run.communicate(timeout=60)
    assert "Traceback" not in err
    return run.returncode, json.loads(out or "{}"), err


POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")


@POSIX
@pytest.mark.parametrize("how", ["SIGINT", "SIGKILL"])
def test_interrupted_or_killed_then_resumed(
    how: str, server: Any, dialect: Any, http: Any, picture: Picture, tmp_path: Path
) -> None:
    server.script = [http.response(dialect.body("", [LOOK], "calls")), b"silence"]
    run = started(server, dialect, tmp_path)
    run.send_signal(getattr(signal, how))
    code, data, err = ended(run)
    if how == "SIGINT":
        assert (code, data["status"]) == (130, "stopped")
        assert "interrupted" in err
    else:
        assert (code, data) == (-signal.SIGKILL, {})
    messages = written(tmp_path / "out")
    assert [m.role for m in messages] == ["user", "assistant", "tool"]
    server.script = [
        http.response(dialect.body("", [("c2", "propose_formation", PLAN)], "calls")),
        http.response(dialect.body("Six robots have a place.")),
    ]
    code, data, err = ended(formup("resume", "out", "--json", cwd=tmp_path))
    assert (code, data["status"], data["message"]) == (0, "planned", "Six robots have a place."), (
        err
    )
    assert len(data["positions"]) == 6
    after = written(tmp_path / "out")
    assert after[:3] == messages
    assert data["usage"]["requests"] == 3
