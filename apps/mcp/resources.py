"""MCP resources, through which a client reads a session, and a prompt that begins one."""

import asyncio
import json

from mcp.server import MCPServer

from .access import Access, Ctx, caller, own_session, with_error_messages
from .state import JPEG, plan_node, view

ROOT = "formup://sessions/{session}"
JSON = "application/json"


@with_error_messages
async def scene(ctx: Ctx, session: str) -> bytes:
    """The picture with rulers in px; choices of a question are outlined and numbered."""
    return await asyncio.to_thread(view, await own_session(ctx, session))


@with_error_messages
async def plan(ctx: Ctx, session: str, plan_id: str) -> str:
    """A plan: contract, positions, certificate, and the plan that it was made from."""
    return plan_node(await own_session(ctx, session), plan_id).model_dump_json()


@with_error_messages
async def certificate(ctx: Ctx, session: str, plan_id: str) -> str:
    """Whether a plan meets its contract: findings and measures."""
    return plan_node(await own_session(ctx, session), plan_id).plan.verdict.model_dump_json()


@with_error_messages
async def plan_picture(ctx: Ctx, session: str, plan_id: str) -> bytes:
    """A plan's robots, drawn on the picture."""
    return await asyncio.to_thread(view, await own_session(ctx, session), plan_id)


@with_error_messages
async def trace(ctx: Ctx, session: str) -> str:
    """All events, as JSON lines."""
    await own_session(ctx, session)
    events = await asyncio.to_thread(caller(ctx)[0].service.events, session)
    rows = ({"number": e.number, "kind": e.kind, "data": dict(e.data)} for e in events)
    return "\n".join(map(json.dumps, rows))


def formation(image: str, wish: str, robots: str = "as many as it takes") -> str:
    """Bring a team of robots into a formation, step by step, with the person deciding."""
    return (
        f"Open the scene {image} with open_scene. Then have robots placed with instruct, in my own "
        f"words: {wish!r}; robots: {robots}. Show me each message and picture unchanged. If there "
        "is a question, ask me, and pass my answer to instruct. Only when I say that it is right, "
        "call approve_and_deploy with that plan_id, then status until the robots have arrived."
    )


def add_resources(server: MCPServer[Access]) -> None:
    """Register the resources and the prompt with the server."""
    server.resource(f"{ROOT}/scene", mime_type=JPEG)(scene)
    server.resource(f"{ROOT}/plans/{{plan_id}}", mime_type=JSON)(plan)
    server.resource(f"{ROOT}/plans/{{plan_id}}/certificate", mime_type=JSON)(certificate)
    server.resource(f"{ROOT}/plans/{{plan_id}}/picture", mime_type=JPEG)(plan_picture)
    server.resource(f"{ROOT}/trace", mime_type="application/jsonl")(trace)
    server.prompt()(formation)
