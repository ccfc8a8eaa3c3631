"""Model servers that others wrote, started once on free ports of this machine and asked by formup.

`make test-servers` installs them and sets FORMUP_TEST_SERVERS to the folder of their environments.
"""

import asyncio
import os
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from formup.agent.messages import Reply
from formup.agent.model import Request
from formup.agent.providers.remote import RemoteModel, remote_model
from formup.prompts import load_prompt
from formup.tools.builtin import TOOLS

HERE = Path(__file__).parent
READY_S = 300.0
"""The first start on a machine compiles some thousand files of Python."""
STOPPED_S = 20.0
LOG_CHARACTERS = 6_000
LOGS = pytest.StashKey[dict[str, Path]]()
KEEPER = 'exec 3<&0; (read -r _ <&3; kill $$ 2>/dev/null) & exec "$@"'
"""Runs a command that ends when its standard input does: the system closes that even if the tests
are killed."""
QUIET = {
    "HF_HUB_OFFLINE": "1",
    "HF_HUB_DISABLE_TELEMETRY": "1",
    "DO_NOT_TRACK": "1",
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",
    # Whatever they would ask elsewhere meets a closed door.
    "HTTP_PROXY": "http://127.0.0.1:9",
    "HTTPS_PROXY": "http://127.0.0.1:9",
    "NO_PROXY": "127.0.0.1",
}


@dataclass(frozen=True)
class Server:
    """A running server; `key` is None where it asks for none."""

    url: str
    key: str | None = None


@dataclass(frozen=True)
class Place:
    """One language at one server.

    Attributes:
        key_in: the environment variable that formup reads the key from.
        moves_images: an image in a tool's result reaches the model as a person's message.
        counts_streams: it says how many tokens a streamed reply took.
    """

    server: str
    provider: str
    path: str
    key_in: str
    moves_images: bool = False
    counts_streams: bool = True


PLACES = {
    f"{place.server}-{place.provider}": place
    for place in (
        Place("transformers", "openai", "/v1", "OPENAI_API_KEY", moves_images=True),
        Place("transformers", "openai-responses", "/v1", "OPENAI_API_KEY"),
        Place("litellm", "openai", "/v1", "OPENAI_API_KEY", moves_images=True),
        Place("litellm", "anthropic", "", "ANTHROPIC_API_KEY", moves_images=True),
        Place("litellm", "gemini", "", "GEMINI_API_KEY", counts_streams=False),
    )
}


class Asked:
    """A place whose server runs, and its answers to formup."""

    name = "scripted"

    def __init__(self, place: Place, server: Server) -> None:
        self.place, self.server = place, server
        self.url = server.url + place.path
        self.shown: list[str | None] = []

    def model(self, name: str = name, *, streamed: bool = False) -> RemoteModel:
        """The model as a person would name it."""
        show = self.shown.append if streamed else None
        return remote_model(self.place.provider, name, self.url, show=show)

    def reply(self, model: RemoteModel, *messages: Any) -> Reply:
        """What the model says with formup's own prompt and tools."""
        return self.ask(model, Request(load_prompt("former@v001").text, messages, TOOLS))

    def ask(self, model: RemoteModel, request: Request) -> Reply:
        """What the model says; the connection is closed."""

        async def asking() -> Reply:
            try:
                return await model.reply(request)
            finally:
                await model.aclose()

        return asyncio.run(asking())


@pytest.fixture(scope="session")
def environments() -> Path:
    folder = os.environ.get("FORMUP_TEST_SERVERS")
    if not folder:
        pytest.skip("model servers are started by `make test-servers` alone")
    return Path(folder).resolve()


@pytest.fixture(scope="session")
def transformers(
    environments: Path, tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config
) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("transformers")
    subprocess.run([sys.executable, HERE / "checkpoint.py", folder / "scripted"], check=True)
    port = _free_port()
    command = ["serve", "scripted", "--device=cpu", "--host=127.0.0.1", f"--port={port}"]
    program = environments / "transformers/bin/transformers"
    with _running([str(program), *command], port, "/health", folder, {}, pytestconfig) as url:
        yield Server(url)


@pytest.fixture(scope="session")
def litellm(
    environments: Path,
    transformers: Server,
    tmp_path_factory: pytest.TempPathFactory,
    pytestconfig: pytest.Config,
) -> Iterator[Server]:
    port, key = _free_port(), f"sk-{secrets.token_hex(32)}"
    program = environments / "litellm/bin/litellm"
    command = [f"--config={HERE / 'litellm.yaml'}", "--host=127.0.0.1", f"--port={port}"]
    more = {"BEHIND": f"{transformers.url}/v1", "LITELLM_MASTER_KEY": key}
    folder = tmp_path_factory.mktemp("litellm")
    path = "/health/liveliness"
    with _running([str(program), *command], port, path, folder, more, pytestconfig) as url:
        yield Server(url, key)


@pytest.fixture(scope="session")
def served(
    environments: Path, tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config
) -> Iterator[str]:
    """formup's own server, for clients that others wrote; its URL."""
    port, folder = _free_port(), tmp_path_factory.mktemp("formup")
    command = [sys.executable, "-m", "formup", "serve", f"--port={port}", "--store=sessions"]
    more = {"PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    with _running(command, port, "/health/live", folder, more, pytestconfig) as url:
        yield url


@pytest.fixture
def python(environments: Path) -> Callable[[str, str, str], str]:
    """Runs code in one of the environments: its name, the code, its input; what it prints."""

    def run(name: str, code: str, given: str) -> str:
        command = [str(environments / name / "bin/python"), "-c", code]
        environment = {"PATH": os.environ["PATH"]} | QUIET
        done = subprocess.run(
            command, input=given, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(params=PLACES)
def asked(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Asked:
    place = PLACES[request.param]
    server: Server = request.getfixturevalue(place.server)
    monkeypatch.setenv(place.key_in, server.key or "")
    monkeypatch.delenv(f"{place.key_in}_FILE", raising=False)
    return Asked(place, server)


@pytest.fixture(params=[False, True], ids=["whole", "streamed"])
def streamed(request: pytest.FixtureRequest) -> bool:
    return request.param


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.failed:
        for name, path in item.config.stash.setdefault(LOGS, {}).items():
            report.sections.append((f"End of the log of {name}", _end(path)))
    return report


@contextmanager
def _running(
    command: list[str],
    port: int,
    ready: str,
    folder: Path,
    more: dict[str, str],
    config: pytest.Config,
) -> Generator[str]:
    """A server, from its first good answer until the tests are done with it; its URL."""
    # Nothing of the person's own settings: they may hold keys, and change what is tested.
    environment = {"PATH": os.environ["PATH"], "HOME": str(folder)} | QUIET | more
    log = folder / "log.txt"
    config.stash.setdefault(LOGS, {})[Path(command[0]).name] = log
    with log.open("wb") as output:
        process = subprocess.Popen(
            ["sh", "-c", KEEPER, "sh", *command],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        _wait(process, f"http://127.0.0.1:{port}{ready}", log)
        yield f"http://127.0.0.1:{port}"
    finally:
        _stop(process)


def _wait(process: subprocess.Popen[bytes], url: str, log: Path) -> None:
    deadline = time.monotonic() + READY_S
    while process.poll() is None and time.monotonic() < deadline:
        try:
            if httpx.get(url, trust_env=False, timeout=5).is_success:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.2)
    ended = process.poll()
    how = f"was not ready after {READY_S:.0f} s" if ended is None else f"ended with {ended}"
    pytest.fail(f"The server {how}. {_end(log)}", pytrace=False)


def _stop(process: subprocess.Popen[bytes]) -> None:
    assert process.stdin is not None
    process.stdin.close()  # what KEEPER waits for
    try:
        process.wait(STOPPED_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _end(log: Path) -> str:
    return log.read_text(encoding="utf-8", errors="replace")[-LOG_CHARACTERS:]
