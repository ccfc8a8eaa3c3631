import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from mcp.client import Client
from mcp.client.stdio import StdioServerParameters

from .conftest import COIN, PHOTOS, caged, call, refusal

SLOWLY = """
import asyncio, sys
from formup.apps.main import main
from formup.tools.fleet.simulated import SimulatedFleet
drive = SimulatedFleet.drive
async def slow(self, motion):
    async for poses in drive(self, motion):
        yield poses
        await asyncio.sleep(0.1)
SimulatedFleet.drive = slow
print("what a library prints")
main()
"""
HELLO = {
    "protocolVersion": "2025-11-25",
    "capabilities": {},
    "clientInfo": {"name": "test", "version": "1"},
}


def test_from_a_picture_to_robots_that_arrived(tmp_path: Path, era: str) -> None:
    command = ["-m", "formup", "mcp", "--store", str(tmp_path), "--pictures", str(PHOTOS)]
    program = StdioServerParameters(command=sys.executable, args=command, env=dict(os.environ))

    async def talk() -> None:
        async with Client(program, mode=era) as client:
            plan = await caged(client)
            arrived = await call(
                client,
                "approve_and_deploy",
                session=plan["session"],
                plan_id=plan["plan_id"],
                idempotency_key="k",
            )
            assert arrived["status"] == "deployed"
            outside = await refusal(client, "open_scene", image=str(Path(__file__).resolve()))
            assert f"is not inside {PHOTOS.resolve()}" in outside

    asyncio.run(talk())


class Program:
    """`formup mcp` by hand: lines in, lines out. Its robots are slow."""

    def __init__(self, store: Path) -> None:
        command = [sys.executable, "-c", SLOWLY, "mcp", "--store", str(store)]
        self.run = subprocess.Popen(
            [*command, "--pictures", str(PHOTOS)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.number = 0

    def send(self, method: str, **params: Any) -> int:
        assert self.run.stdin is not None
        self.number += 1
        said = {"jsonrpc": "2.0", "id": self.number, "method": method, "params": params}
        self.run.stdin.write(json.dumps(said) + "\n")
        self.run.stdin.flush()
        return self.number

    def call(self, tool: str, **arguments: Any) -> dict[str, Any]:
        number = self.send("tools/call", name=tool, arguments=arguments)
        return self.answer(number)["structuredContent"]

    def answer(self, number: int) -> dict[str, Any]:
        """The result with that id; every line before it is the protocol's."""
        assert self.run.stdout is not None
        for line in self.run.stdout:
            told = json.loads(line)
            assert told["jsonrpc"] == "2.0"
            if told.get("id") == number:
                return told["result"]
        raise AssertionError(self.run.stderr and self.run.stderr.read())


@pytest.fixture
def program(tmp_path: Path) -> Generator[Program]:
    made = Program(tmp_path)
    with made.run:
        assert made.run.stdout is not None
        assert made.run.stdout.readline() == "what a library prints\n", "before it is served"
        yield made
        made.run.kill()


@pytest.mark.parametrize("end", ["closed", signal.SIGTERM, signal.SIGINT])
def test_the_end_holds_robots_and_leaves_the_session_whole(
    program: Program, tmp_path: Path, end: Any
) -> None:
    program.answer(program.send("initialize", **HELLO))
    session = program.call("open_scene", image="us_coins.jpg", robots=10)["session"]
    words = {"session": session, "words": "Cage the coin", "points": [COIN]}
    plan = program.call("instruct", **words)["plan_id"]
    wanted = {"session": session, "plan_id": plan, "idempotency_key": "k"}
    program.send("tools/call", name="approve_and_deploy", arguments=wanted)
    while program.call("status", session=session)["message"].find("driving") < 0:
        pass
    assert program.run.stdin is not None
    if end == "closed":
        program.run.stdin.close()
    else:
        program.run.send_signal(end)
    assert program.run.wait() == (130 if end == signal.SIGINT else 0)

    async def go_on() -> None:
        service = Service(Agent(), store_at(tmp_path))
        last = service.events(session)[-1]
        assert (last.kind, last.data["status"]) in (("end", "stopped"), ("end", "failed"))
        assert (await service.say(session, "further out")).report.status == "planned"
        await service.close()

    asyncio.run(go_on())


def test_only_its_command_loads_the_libraries_of_a_server() -> None:
    code = "import sys, formup.apps.cli; print({'mcp', 'fastapi', 'starlette'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_a_folder_that_is_none() -> None:
    command = [sys.executable, "-m", "formup", "mcp", "--pictures", "nowhere"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "nowhere is not a folder" in done.stderr


def test_without_its_extra() -> None:
    code = "import sys; sys.modules['mcp'] = None; from formup.apps.main import main; main()"
    command = [sys.executable, "-c", code, "mcp"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pip install 'formup[mcp]'" in done.stderr
