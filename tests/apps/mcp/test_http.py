import asyncio
import base64
import os
import re
import signal
import subprocess
import sys
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import httpx2
import pytest
import uvicorn
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from formup.apps.server.app import make_app
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens
from mcp.client import Client
from mcp.client.streamable_http import streamable_http_client
from mcp.shared.exceptions import MCPError

from .conftest import COIN, PHOTOS, caged, call, refusal
from .test_approval import Someone

PHOTO = (PHOTOS / "us_coins.jpg").read_bytes()
URL = f"data:image/jpeg;base64,{base64.b64encode(PHOTO).decode()}"


@dataclass
class Place:
    """A server with tokens, by their names."""

    url: str
    tokens: dict[str, str]
    service: Service

    def http(self, name: str) -> httpx2.AsyncClient:
        headers = {"Authorization": f"Bearer {self.tokens[name]}"}
        return httpx2.AsyncClient(base_url=self.url, headers=headers, timeout=60)

    @asynccontextmanager
    async def client(self, name: str, era: str, **options: Any) -> AsyncGenerator[Client]:
        async with self.http(name) as http:
            transport = streamable_http_client(f"{self.url}/mcp", http_client=http)
            async with Client(transport, mode=era, **options) as client:
                yield client


@asynccontextmanager
async def served(folder: Path, made: dict[str, str] | None = None) -> AsyncGenerator[Place]:
    tokens = Tokens(folder / "tokens.json")
    made = made or {
        name: tokens.add(name, scope)
        for name, scope in (("ann", "move"), ("bob", "move"), ("pat", "plan"), ("rae", "read"))
    }
    service = Service(Agent(), store_at(folder / "store"))
    app = make_app(service, ServerSettings.of({}), tokens)
    config = uvicorn.Config(
        app, port=0, lifespan="on", log_level="critical", timeout_graceful_shutdown=1
    )
    server = uvicorn.Server(config)
    running = asyncio.ensure_future(server.serve())
    while not server.started:
        await asyncio.sleep(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        yield Place(f"http://127.0.0.1:{port}", made, service)
    finally:
        server.should_exit = True
        await running


@pytest.fixture
def place(tmp_path: Path) -> Callable[[Callable[[Place], Any]], None]:
    async def run(body: Callable[[Place], Any]) -> None:
        async with served(tmp_path) as there:
            await body(there)

    return lambda body: asyncio.run(run(body))


Places = Callable[[Callable[[Place], Any]], None]


def test_from_a_picture_to_robots_that_arrived(place: Places, era: str) -> None:
    async def talk(there: Place) -> None:
        async with there.client("ann", era) as client:
            plan = await caged(client, URL)
            assert plan["session"].startswith("ann-")
            arrived = await call(
                client,
                "approve_and_deploy",
                session=plan["session"],
                plan_id=plan["plan_id"],
                idempotency_key="k",
            )
            assert arrived["status"] == "deployed"

    place(talk)


def test_a_picture_is_uploaded_and_named(place: Places, era: str) -> None:
    async def talk(there: Place) -> None:
        async with there.http("ann") as http:
            made = (await http.post("/api/sessions", content=PHOTO)).json()["id"]
        async with there.client("ann", era) as client:
            plan = await caged(client, made)
            assert plan["session"] != made
            again = await call(
                client, "instruct", session=made, words="Cage the coin with 6 robots", points=[COIN]
            )
            assert again["robots"] == 6
            path = await refusal(client, "open_scene", image=str(PHOTOS / "us_coins.jpg"))
            assert "cannot be opened" in path
        async with there.client("bob", era) as client:
            assert "cannot be opened" in await refusal(client, "open_scene", image=made)

    place(talk)


def test_two_clients_are_apart(place: Places, era: str) -> None:
    async def talk(there: Place) -> None:
        async with there.client("ann", era) as ann, there.client("bob", era) as bob:
            hers, his = await asyncio.gather(caged(ann, URL), caged(bob, URL))
            assert hers["session"] != his["session"]
            for tool, more in (
                ("status", {}),
                ("stop", {}),
                ("instruct", {"words": "undo"}),
                ("edit", {"edits": [{"kind": "close"}]}),
                ("approve_and_deploy", {"plan_id": hers["plan_id"], "idempotency_key": "k"}),
            ):
                refused = await refusal(bob, tool, session=hers["session"], **more)
                assert refused.endswith(f"There is no session {hers['session']!r}.")
            for name in ("scene", "trace", f"plans/{hers['plan_id']}"):
                with pytest.raises(MCPError, match="There is no session"):
                    await bob.read_resource(f"formup://sessions/{hers['session']}/{name}")

    place(talk)


def test_what_a_token_may(place: Places, era: str) -> None:
    async def talk(there: Place) -> None:
        async with there.client("pat", era) as client:
            plan = await caged(client, URL)
            refused = await refusal(
                client,
                "approve_and_deploy",
                session=plan["session"],
                plan_id=plan["plan_id"],
                idempotency_key="k",
            )
            assert "this needs move" in refused
            assert (await call(client, "stop", session=plan["session"]))["status"]
        async with there.client("rae", era) as client:
            assert "this needs plan" in await refusal(client, "open_scene", image=URL)

    place(talk)


@pytest.mark.usefixtures("real")
def test_a_person_is_asked_over_http(place: Places, era: str) -> None:
    async def talk(there: Place) -> None:
        person = Someone(approve=True)
        async with there.client("ann", era, elicitation_callback=person) as client:
            plan = await caged(client, URL)
            arrived = await call(
                client,
                "approve_and_deploy",
                session=plan["session"],
                plan_id=plan["plan_id"],
                idempotency_key="k",
            )
            assert arrived["status"] == "deployed"
            assert len(person.asked) == 1
        async with there.client("ann", era) as client, there.http("ann") as http:
            session = (await caged(client, URL))["session"]
            plan = await call(client, "instruct", session=session, words="a bit further out")
            wanted = {"session": session, "plan_id": plan["plan_id"], "idempotency_key": "k"}
            told = await call(client, "approve_and_deploy", **wanted)
            assert told["status"] == "needs_approval"
            waits = (await http.get(f"/api/sessions/{session}")).json()["waits"]
            yes = {"plan_id": waits["plan_id"], "nonce": waits["nonce"]}
            done = await http.post(f"/api/sessions/{session}/approvals", json=yes)
            assert done.status_code == 202
            while (now := await call(client, "status", session=session, wait=True))["status"] == (
                "running"
            ):
                pass
            assert now["status"] == "deployed"

    place(talk)


def test_nobody_gets_in_without_a_token(place: Places) -> None:
    async def talk(there: Place) -> None:
        hello = {
            "jsonrpc": "2.0",
            "id": 1,
            "method": "initialize",
            "params": {
                "protocolVersion": "2025-11-25",
                "capabilities": {},
                "clientInfo": {"name": "x", "version": "1"},
            },
        }
        accept = {"Accept": "application/json, text/event-stream"}
        async with httpx2.AsyncClient(base_url=there.url) as http:
            assert (await http.post("/mcp", json=hello, headers=accept)).status_code == 401
        async with there.http("ann") as ann, there.http("bob") as bob:
            page = accept | {"Origin": "https://elsewhere.example"}
            assert (await ann.post("/mcp", json=hello, headers=page)).status_code == 403
            begun = await ann.post("/mcp", json=hello, headers=accept)
            assert begun.status_code == 200
            hers = accept | {"Mcp-Session-Id": begun.headers["mcp-session-id"]}
            ping = {"jsonrpc": "2.0", "id": 2, "method": "ping"}
            assert (await bob.post("/mcp", json=ping, headers=hers)).status_code == 404
            assert (await ann.post("/mcp", json=ping, headers=hers)).status_code == 200

    place(talk)


@pytest.mark.usefixtures("real")
def test_behind_a_balancer_that_changes_the_process(tmp_path: Path, era: str) -> None:
    async def talk(there: Place, http: httpx2.AsyncClient) -> None:
        transport = streamable_http_client(f"{there.url}/mcp", http_client=http)
        person = Someone(approve=True)
        async with Client(transport, mode=era, elicitation_callback=person) as client:
            if era == "legacy":
                with pytest.raises(MCPError, match="a balancer sent the request to another"):
                    await caged(client, URL)
                return
            plan = await caged(client, URL)
            wanted = {"session": plan["session"], "plan_id": plan["plan_id"]}
            told = await call(client, "approve_and_deploy", idempotency_key="k", **wanted)
            assert "is used by" in told["message"], "real robots are had by the process that asked"

    async def balanced() -> None:
        async with served(tmp_path) as one, served(tmp_path, one.tokens) as two:
            ports = cycle(httpx2.URL(place.url).port for place in (one, two))

            async def balance(request: httpx2.Request) -> None:
                request.url = request.url.copy_with(port=next(ports))

            async with one.http("ann") as http:
                http.event_hooks = {"request": [balance]}
                await talk(one, http)

    asyncio.run(balanced())


def test_the_command_serves_what_formup_serve_does(tmp_path: Path, era: str) -> None:
    command = [sys.executable, "-m", "formup", "mcp", "--http", "--port", "0"]
    home = os.environ | {"XDG_DATA_HOME": str(tmp_path)}

    async def talk(url: str) -> None:
        async with Client(url, mode=era) as client:
            assert (await caged(client, URL))["status"] == "planned"

    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=home) as run:
        assert run.stderr is not None
        lines = iter(run.stderr.readline, "")
        [url] = next(found for line in lines if (found := re.findall(r"http://[0-9.:]+", line)))
        try:
            asyncio.run(talk(f"{url}/mcp"))
        finally:
            run.terminate()
            run.communicate()
    assert run.returncode in (0, -signal.SIGTERM), "uvicorn passes the signal on at its end"
