import asyncio
import base64
import json
from collections.abc import Callable
from typing import Any

import pytest
from formup.apps.mcp import state, tools
from formup.apps.server.hub import Hub
from formup.tools.fleet.protocol import Motion
from mcp.client import Client
from mcp.server import MCPServer
from mcp.shared.exceptions import MCPError
from mcp_types import ImageContent, ResourceLink, TextResourceContents

from .conftest import COIN, Body, caged, call, refusal

Runs = Callable[[Body], None]


def moves(hub: Hub, session: str) -> int:
    return len([e for e in hub.service.events(session) if e.kind == "moving"])


def test_from_a_picture_to_robots_that_arrived(with_server: Runs, era: str) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            opened = await call(client, "open_scene", image="us_coins.jpg", robots=10)
            assert opened["status"] == "open"
            session = opened["session"]
            result = await client.call_tool(
                "instruct",
                {"session": session, "words": "Cage the coin", "points": [COIN], "picture": True},
            )
            text, link, image = result.content
            assert isinstance(image, ImageContent)
            assert isinstance(link, ResourceLink)
            planned = result.structured_content
            assert planned is not None
            assert (planned["status"], planned["certified"], planned["robots"]) == (
                "planned",
                True,
                10,
            )
            assert image.data not in json.dumps(planned), "a picture is told once"
            assert image.data not in str(text)
            further = await call(
                client, "edit", session=session, edits=[{"kind": "out", "px": 5}], detail=True
            )
            assert len(further["detail"]["positions"]) == 10
            arrived = await call(
                client,
                "approve_and_deploy",
                session=session,
                plan_id=further["plan_id"],
                idempotency_key="k1",
            )
            assert arrived["status"] == "deployed"
            assert arrived == await call(client, "status", session=session)
            seen = (await client.read_resource(link.uri)).contents[0]
            assert seen.mime_type == "image/jpeg"
            root = f"formup://sessions/{session}"
            for name in ("scene", f"plans/{planned['plan_id']}/certificate", "trace"):
                assert (await client.read_resource(f"{root}/{name}")).contents
            plan = (await client.read_resource(f"{root}/plans/{planned['plan_id']}")).contents[0]
            assert isinstance(plan, TextResourceContents)
            assert json.loads(plan.text)["plan"]["verdict"]["certified"] is True

    with_server(talk)


def test_tools_say_what_they_answer(with_server: Runs, era: str) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            offered = (await client.list_tools()).tools
            assert {tool.name for tool in offered} == {
                *("open_scene", "instruct", "edit", "status", "approve_and_deploy", "stop")
            }
            for tool in offered:
                assert tool.output_schema is not None
                assert "answer" not in tool.input_schema["properties"], "no argument is a yes"
            assert len((await client.list_resource_templates()).resource_templates) == 5
            [prompt] = (await client.list_prompts()).prompts
            told = await client.get_prompt(prompt.name, {"image": "a.jpg", "wish": "a ring"})
            assert "a ring" in str(told.messages[0].content)

    with_server(talk)


def test_the_picture_of_a_question_shows_what_it_offers(with_server: Runs) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server) as client:
            session = (await caged(client))["session"]
            turn = {"session": session, "words": "around another coin", "picture": True}
            _, link, image = (await client.call_tool("instruct", turn)).content
            run = hub.service.session(session).run
            assert isinstance(link, ResourceLink)
            assert isinstance(image, ImageContent)
            assert run is not None
            assert run.report.candidates
            assert run.report.plan_id, "a plan stands, and is not what is asked about"
            assert link.uri == f"formup://sessions/{session}/scene"
            assert base64.b64decode(image.data) == run.view()

    with_server(talk)


@pytest.mark.parametrize("words", ["go", "yes", "Cage the coin and go", "approve"])
def test_words_move_no_robots(with_server: Runs, words: str) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server) as client:
            session = (await caged(client))["session"]
            await client.call_tool("instruct", {"session": session, "words": words})
            assert moves(hub, session) == 0
            if words == "go":
                refused = await refusal(client, "instruct", session=session, words=words)
                assert refused.endswith(tools.NO_GO)

    with_server(talk)


def test_a_key_is_one_deployment(with_server: Runs, drives: list[Motion], era: str) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            first = await caged(client)
            session = first["session"]
            wanted = {"session": session, "plan_id": first["plan_id"], "idempotency_key": "k"}
            both = await asyncio.gather(
                *(call(client, "approve_and_deploy", **wanted) for _ in range(2))
            )
            assert [told["status"] for told in both] == ["deployed", "deployed"]
            again = await call(client, "approve_and_deploy", **wanted)
            assert again["message"].startswith("That was done before")
            further = await call(client, "instruct", session=session, words="a bit further out")
            other = wanted | {"plan_id": further["plan_id"]}
            refused = await refusal(client, "approve_and_deploy", **other)
            assert "was used for something else" in refused
            assert moves(hub, session) == 1

    with_server(talk)


def test_signs_of_life_and_what_still_drives(
    with_server: Runs, drives: list[Motion], era: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(state, "HEARTBEAT", 0.02)
    monkeypatch.setattr(state, "PATIENCE", 0.2)
    told: list[tuple[float, str | None]] = []

    async def hear(progress: float, total: float | None, message: str | None) -> None:
        told.append((progress, message))

    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            opened = await call(client, "open_scene", image="us_coins.jpg", robots=10)
            session = opened["session"]
            turn = {"session": session, "words": "Cage the coin", "points": [COIN]}
            await client.call_tool("instruct", turn)
            while (now := await call(client, "status", session=session, wait=True))["status"] == (
                "running"
            ):
                pass
            result = await client.call_tool(
                "approve_and_deploy",
                {"session": session, "plan_id": now["plan_id"], "idempotency_key": "k"},
                progress_callback=hear,
            )
            assert result.structured_content is not None
            assert result.structured_content["status"] == "running"
            assert [beat for beat, _ in told] == list(range(1, len(told) + 1))
            assert len(told) > 2
            busy = await refusal(client, "edit", session=session, edits=[{"kind": "close"}])
            assert "A turn is under way" in busy
            held = await call(client, "stop", session=session)
            assert held["status"] in ("stopped", "failed")
            assert hub.service.turn(session) is None

    with_server(talk)


def test_refusals_are_one_sentence(with_server: Runs, era: str) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            for image in ("../../../etc/passwd", "/etc/passwd", "a\0b", "~/x.png"):
                refused = await refusal(client, "open_scene", image=image)
                assert "is not inside" in refused or "does not exist" in refused
            for image in ("data:image/png;base64,?", "data:image/png;base64,aGVsbG8="):
                assert await refusal(client, "open_scene", image=image)
            gone = await refusal(client, "status", session="ann-0123456789")
            assert gone == "Error executing tool status: There is no session 'ann-0123456789'."
            lacking = await refusal(client, "instruct", session="x", points=[{"ring": 1}])
            assert lacking == (
                "instruct cannot be called with these arguments: words: is missing; "
                "points.0.ring: Extra inputs are not permitted (got 1)."
            )
            first = await caged(client)
            wanted = {"session": first["session"], "idempotency_key": "k"}
            wrong = await refusal(client, "approve_and_deploy", plan_id="p-none", **wanted)
            assert first["plan_id"] in wrong
            for uri in ("plans/p-none", "nothing"):
                with pytest.raises(MCPError):
                    await client.read_resource(f"formup://sessions/{first['session']}/{uri}")

    with_server(talk)


def test_unknown_arguments_are_refused_by_name(with_server: Runs, era: str) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server, mode=era) as client:
            session = (await caged(client))["session"]
            before = hub.service.events(session)
            refused = await refusal(
                client, "instruct", session=session, words="a bit further out", robot=3, text="x"
            )
            assert refused == (
                "instruct does not know 'robot', 'text'; nothing was done. Its arguments are "
                "session, words, points, idempotency_key, detail, picture: leave out the others, "
                "or call them so."
            )
            yes = {"plan_id": "p", "idempotency_key": "k", "answer": {"approve": True}}
            refused = await refusal(client, "approve_and_deploy", session=session, **yes)
            assert refused.startswith("approve_and_deploy does not know 'answer';")
            assert hub.service.events(session) == before

    with_server(talk)


def test_what_is_our_fault_is_masked(
    with_server: Runs, era: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        def fails(*what: object, **more: object) -> None:
            raise RuntimeError("a secret")

        monkeypatch.setattr(hub.service, "open", fails)
        async with Client(server, mode=era) as client:
            refused = await refusal(client, "open_scene", image="us_coins.jpg")
            assert refused == "Error executing tool open_scene"

    with_server(talk)


def test_several_things_are_pointed_at(with_server: Runs) -> None:
    async def talk(server: MCPServer[Any], hub: Hub) -> None:
        async with Client(server) as client:
            opened = await call(client, "open_scene", image="us_coins.jpg", robots=6)
            told = await call(
                client,
                "instruct",
                session=opened["session"],
                words="Place 6 robots between them",
                points=[COIN, {"box": [330, 30, 470, 165]}],
                detail=True,
            )
            assert len(told["detail"]["targets"]) == 2

    with_server(talk)
