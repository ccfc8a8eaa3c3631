"""A prompt engineer's half hour from its first command to its last: a page and a notebook.

One of its two models is asked over HTTP, at a server that answers as the simulated model does.
"""

import asyncio
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any
from zlib import crc32

import pytest
from formup.agent.messages import Call, Message, Reply, Result, User
from formup.agent.model import Request
from formup.apps.cli import app
from formup.evals.experiments.journal import read_rows
from formup.evals.experiments.simulated_model import SimulatedModel
from formup.prompts import PromptLibrary, load_prompt

write_folder: Callable[[Path, int], Path] = import_module("synthetic").write_folder

ROOT = Path(__file__).parents[2]
SAID, FORGOTTEN = "call deploy with `tell` alone", "Hand it over with `tell` alone"
"""What the draft says and the version before it does not: without it half of the trials stop."""
SHOWN = {
    "prompts new": ".prompt.md",
    "prompts release": "brisk@v00",
    "prompts lint": "0 errors",
    "prompts diff": f"-3. In the same reply {FORGOTTEN}",
    "eval run": "openai:gpt-5-nano",
    "eval compare": "difference: better",
    "eval report": "brisk.html",
    "eval gate": "gate: pass",
    "prompts promote": "brisk is now brisk@v00",
    "prompts log": "brisk@v002",
}
"""What each command prints, by its name."""


def edit(draft: Path, number: int) -> None:
    """What the person writes: the first version forgets a sentence, the next one has it."""
    old, new = (SAID, FORGOTTEN) if number == 1 else (FORGOTTEN, SAID)
    text = draft.read_text("utf-8")
    assert old in text
    text = text.replace("hypothesis:", "hypothesis: It goes on to deploy.")
    draft.write_text(text.replace(old, new), "utf-8")


def as_message(said: Mapping[str, Any]) -> Message:
    """A message of a request as formup has it."""
    content: Any = said.get("content") or ""
    if said["role"] == "tool":
        error = None if content.startswith("{") else "tool"
        return Result(call_id=said["tool_call_id"], name="", text=content, error=error)
    if said["role"] == "assistant":
        calls = [(c["id"], c["function"]) for c in said.get("tool_calls", ())]
        made = [Call(id=i, name=f["name"], arguments=json.loads(f["arguments"])) for i, f in calls]
        return Reply(text=content, calls=tuple(made))
    return User(text="".join(part["text"] for part in content if part["type"] == "text"))


def formup(*words: str) -> None:
    """Run a command that succeeds."""
    assert not app(words, standalone_mode=False)


class Provider(BaseHTTPRequestHandler):
    """The rules under the prompt they are sent; where they lapse is up to the words."""

    def do_POST(self) -> None:
        asked = json.loads(self.rfile.read(int(self.headers["content-length"])))
        system, *said = asked["messages"]
        history = list(map(as_message, said))
        names = {c.id: c.name for m in history if isinstance(m, Reply) for c in m.calls}
        told = [
            m.model_copy(update={"name": names[m.call_id]}) if isinstance(m, Result) else m
            for m in history
        ]
        model = SimulatedModel(crc32(told[0].text.encode()))
        reply = asyncio.run(model.reply(Request(system["content"], tuple(told), ())))
        calls = [
            {
                "id": f"{c.id}-{len(told)}",
                "type": "function",
                "function": {"name": c.name, "arguments": json.dumps(c.arguments)},
            }
            for c in reply.calls
        ]
        message = {"role": "assistant", "content": reply.text, "tool_calls": calls or None}
        usage = {"prompt_tokens": 1000, "completion_tokens": 100}
        choice = {"message": message, "finish_reason": "stop"}
        body = json.dumps({"choices": [choice], "usage": usage}).encode()
        self.send_response(200)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder with pictures in it, beside a provider."""
    write_folder(tmp_path / "my-pictures", 8)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("OPENAI_API_KEY", "k")
    with ThreadingHTTPServer(("127.0.0.1", 0), Provider) as server:
        Thread(target=server.serve_forever, args=(0.01,)).start()
        monkeypatch.setenv("OPENAI_BASE_URL", f"http://127.0.0.1:{server.server_address[1]}/v1")
        yield
        server.shutdown()


@pytest.mark.usefixtures("provider")
def test_the_page_from_its_first_command_to_its_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs/prompts.md").read_text("utf-8")
    section = page.partition("## Half an hour\n")[2].partition("\n## ")[0]
    blocks = "".join(re.findall(r"```console\n(.*?)```", section, re.DOTALL))
    said, shown = list[str](), ""
    for line in blocks.splitlines():
        program, *words = line.removeprefix("$ ").split(" ", 1)
        if program != "formup":
            assert line == "$ export FORMUP_PROMPTS=mine"
            monkeypatch.setenv("FORMUP_PROMPTS", "mine")
            continue
        name = " ".join(words[0].split()[:2])
        said.append(name)
        formup(*shlex.split(words[0]))
        shown = capsys.readouterr().out
        assert SHOWN[name] in shown, shown
        if name == "prompts new":
            number = said.count(name)
            edit(tmp_path / f"mine/brisk/draft-{number}.prompt.md", number)
    assert set(said) == set(SHOWN)
    rows = read_rows(tmp_path / "runs/brisk")
    assert len(rows) == 8 * 2 * 2 * 2 and all(row.scored for row in rows)
    assert {row.arm.model for row in rows} == {"simulated", "openai:gpt-5-nano"}
    html = (tmp_path / "brisk.html").read_text("utf-8")
    assert "Hand it over" in html  # what the two prompts differ in
    library = PromptLibrary(tmp_path / "mine")
    assert library.load("brisk").name == "brisk@v001"  # rolled back
    assert "forced: asks too often" in shown and "v002 current: passed on" in shown


@pytest.mark.usefixtures("provider")
def test_the_notebook_from_its_first_cell_to_its_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORMUP_PROMPTS", "mine")
    formup("prompts", "new", "brisk@draft-1", "--from", "former")
    edit(tmp_path / "mine/brisk/draft-1.prompt.md", 1)
    formup("prompts", "release", "brisk@draft-1", "--why", "to begin with")
    text = load_prompt("former").text
    (tmp_path / "draft.txt").write_text(text, "utf-8")
    known = {"SUITE": "my-pictures", "TRIALS": "2", "ROLL_BACK": "asks too often"}
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples/half_hour.py")],
        env=os.environ | known,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for told in ("all: 32 trials; about 0.00 USD", "gate: pass", "brisk is now brisk@v002"):
        assert told in done.stdout
    assert (tmp_path / "half-hour-0.html").stat().st_size > 10_000
    library = PromptLibrary(tmp_path / "mine")
    assert library.load("brisk").name == "brisk@v001"
    assert library.load("brisk@v002").text == text
