import asyncio
from collections.abc import AsyncGenerator, Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from formup.apps.mcp.server import make_server
from formup.apps.server.hub import Hub
from formup.apps.server.metrics import Metrics
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from mcp.client import Client
from mcp.server import MCPServer
from mcp_types import CallToolResult, TextContent

PHOTOS = Path(__file__).parents[3] / "evals/photos/images"
COIN = {"box": [175, 30, 314, 160]}
ERAS = ("legacy", "2026-07-28")
Body = Callable[[MCPServer[Any], Hub], Coroutine[Any, Any, None]]


@pytest.fixture(params=ERAS)
def era(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def with_server(tmp_path: Path) -> Callable[[Body], None]:
    """Runs a test with a server over a store of its own."""

    async def run(body: Body) -> None:
        service = Service(Agent(), store_at(tmp_path / "store"))
        hub = Hub(service, ServerSettings.of({}), Tokens(None), Metrics())
        try:
            await body(make_server(hub, [PHOTOS]), hub)
        finally:
            await service.close()

    return lambda body: asyncio.run(run(body))


@pytest.fixture
def drives(monkeypatch: pytest.MonkeyPatch) -> list[Motion]:
    """The motions that were driven; slowly, so that something can happen meanwhile."""
    begun: list[Motion] = []
    drive = SimulatedFleet.drive

    async def slow(self: SimulatedFleet, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        begun.append(motion)
        async for poses in drive(self, motion):
            yield poses
            await asyncio.sleep(0.02)

    monkeypatch.setattr(SimulatedFleet, "drive", slow)
    return begun


@pytest.fixture
def real(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots that want a person's yes."""
    monkeypatch.setattr(SimulatedFleet, "real", True)


async def call(client: Client, tool: str, **arguments: Any) -> dict[str, Any]:
    """What a tool answers, structured."""
    result = await client.call_tool(tool, arguments)
    assert not result.is_error, text_of(result)
    assert result.structured_content is not None
    return result.structured_content


async def refusal(client: Client, tool: str, **arguments: Any) -> str:
    """Why a tool refuses."""
    result = await client.call_tool(tool, arguments)
    assert result.is_error
    return text_of(result)


def text_of(result: CallToolResult) -> str:
    assert isinstance(result.content[0], TextContent)
    return result.content[0].text


async def caged(client: Client, image: str = "us_coins.jpg") -> dict[str, Any]:
    """A session with a certified plan on a photograph."""
    opened = await call(client, "open_scene", image=image, robots=10)
    return await call(
        client, "instruct", session=opened["session"], words="Cage the coin", points=[COIN]
    )
