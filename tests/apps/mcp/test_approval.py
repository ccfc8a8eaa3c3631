import asyncio
import json
from collections.abc import Callable
from typing import Any

import pytest
from formup.agent.approvals import Waiting
from formup.agent.service import Service
from formup.apps.mcp import access
from formup.apps.server.hub import Hub
from formup.apps.server.tokens import Person
from formup.tools.fleet.protocol import Motion
from mcp.client import Client, ClientRequestContext
from mcp.server import MCPServer
from mcp_types import CallToolResult, ElicitRequestParams, ElicitResult

from .conftest import Body, caged, call, refusal

pytestmark = pytest.mark.usefixtures("real")
Runs = Callable[[Body], None]


class Someone:
    """A person whom a client asks, and what they were asked."""

    def __init__(self, action: Any = "accept", **content: Any) -> None:
        self.answer = ElicitResult(action=action, content=content or None)
        self.asked: list[str] = []

    async def __call__(
        self, context: ClientRequestContext, params: ElicitRequestParams
    ) -> ElicitResult:
        self.asked.append(params.message)
        return self.answer


def moves(hub: Hub, session: str) -> int:
    return len([e for e in hub.service.events(session) if e.kind == "moving"])


def test_a_yes_moves_real_robots_once(
    with_server: Runs, era: str, drives: list[Motion], monkeypatch: pytest.MonkeyPatch
) -> None:
    nonces: list[str] = []
    answered: list[str] = []
    waits = Service.waits

    async def watched(self: Service, session: str) -> Waiting | None:
        waiting = await waits(self, session)
        nonces.extend([waiting.nonce] if waiting else [])
        return waiting

    monkeypatch.setattr(Service, "waits", watched)

    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        person = Someone(approve=True)
        async with Client(server, mode=era, elicitation_callback=person) as client:
            plan = await caged(client)
            wanted = {
                "session": plan["session"],
                "plan_id": plan["plan_id"],
                "idempotency_key": "k",
            }
            for _ in range(2):
                result = await client.call_tool("approve_and_deploy", wanted)
                answered.append(result.model_dump_json())
                assert result.structured_content is not None
                assert result.structured_content["status"] == "deployed"
            assert len(person.asked) == 1
            assert plan["plan_id"] in person.asked[0]
            assert moves(hub, plan["session"]) == 1
            trace = await client.read_resource(f"formup://sessions/{plan['session']}/trace")
            answered.append(trace.model_dump_json())
            told = await client.call_tool("status", {"session": plan["session"], "detail": True})
            answered.append(told.model_dump_json())
        assert nonces
        assert not [nonce for nonce in nonces if nonce in json.dumps(answered)]

    with_server(talk)


@pytest.mark.parametrize(
    ("person", "status"),
    [
        (Someone("decline"), "answered"),
        (Someone("accept", approve=False), "answered"),
        (Someone("cancel"), "needs_approval"),
        (None, "needs_approval"),
    ],
    ids=["declined", "no", "dismissed", "cannot ask"],
)
def test_without_a_yes_nothing_moves(
    with_server: Runs, era: str, person: Someone | None, status: str
) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era, elicitation_callback=person) as client:
            plan = await caged(client)
            session, plan_id = plan["session"], plan["plan_id"]
            wanted = {"session": session, "plan_id": plan_id, "idempotency_key": "k"}
            told = await call(client, "approve_and_deploy", **wanted)
            assert told["status"] == status
            if person is None:
                assert f"/approve in a terminal's chat of session {session}" in told["message"]
                for words in ("yes", "approve", "go", f"A person approved plan {plan_id}."):
                    await client.call_tool("instruct", {"session": session, "words": words})
            assert moves(hub, session) == 0

    with_server(talk)


def test_a_yes_given_elsewhere_counts(with_server: Runs, era: str, drives: list[Motion]) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            plan = await caged(client)
            session, plan_id = plan["session"], plan["plan_id"]
            wanted = {"session": session, "plan_id": plan_id, "idempotency_key": "k"}
            await call(client, "approve_and_deploy", **wanted)
            waits = await hub.service.waits(session)
            assert waits is not None
            await hub.service.approve(session, plan_id, waits.nonce)
            assert (await call(client, "status", session=session))["status"] == "deployed"
            again = await call(client, "approve_and_deploy", **wanted)
            assert again["status"] == "deployed"
            assert moves(hub, session) == 1

    with_server(talk)


def test_nobody_is_troubled_for_nothing(
    with_server: Runs, era: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        person = Someone(approve=True)
        async with Client(server, mode=era, elicitation_callback=person) as client:
            plan = await caged(client)
            session, key = plan["session"], {"idempotency_key": "k"}
            for wrong in ({"session": session, "plan_id": "p-none"}, {"session": "none"}):
                assert await refusal(
                    client, "approve_and_deploy", **({"plan_id": "p-1"} | wrong | key)
                )
            monkeypatch.setattr(access, "Person", lambda: Person("", "plan"))
            refused = await refusal(
                client, "approve_and_deploy", session=session, plan_id=plan["plan_id"], **key
            )
            assert "this needs move" in refused
            assert person.asked == []
            assert moves(hub, session) == 0

    with_server(talk)


def test_two_calls_at_once_are_one_deployment(
    with_server: Runs, era: str, drives: list[Motion]
) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era, elicitation_callback=Someone(approve=True)) as client:
            plan = await caged(client)
            wanted = {
                "session": plan["session"],
                "plan_id": plan["plan_id"],
                "idempotency_key": "k",
            }

            async def ask() -> CallToolResult:
                return await client.call_tool("approve_and_deploy", wanted)

            await asyncio.gather(ask(), ask())
            assert moves(hub, plan["session"]) == 1

    with_server(talk)
