"""The tools of the MCP server: few, each one thing that a person wants of the whole team.

No tool takes a person's approval as an argument: words plan here and never move robots, and real
ones drive only after a person was asked, through the client if it can ask. The nonce that an
approval must name never leaves the server.
"""

import asyncio
from typing import Annotated, Any

from mcp.server import MCPServer
from mcp.server.mcpserver import (
    AcceptedElicitation,
    CancelledElicitation,
    DeclinedElicitation,
    Elicit,
    Resolve,
)
from mcp_types import ToolAnnotations
from pydantic import BaseModel, Field, WithJsonSchema

from ...agent.turns import Asked
from ...tools.context import Context as ToolContext
from ...tools.errors import InputError
from ...tools.formation.editing.edit_kinds import EDIT_SCHEMA
from ..server.forms import Key, Pointed, Words
from ..server.hub import asked_by, require_scope
from ..server.sessions import check_room
from .access import Access, Ctx, authorize, caller, picture_named, with_error_messages
from .state import StateResult, await_turn, plan_node, session_state, state_after

NO_GO = (
    "Nothing was done: words move no robots here. Leave out the go, then drive the certified "
    "plan with approve_and_deploy."
)
NO_FORM = "This client cannot ask a person: let one approve the plan with "
OVER_HTTP = f"{NO_FORM}POST /api/sessions/{{}}/approvals; then call status. "
OVER_STDIO = f"{NO_FORM}/approve in a terminal's chat of session {{}}, once this client has ended. "
ASession = Annotated[str, Field(max_length=100, description="id from open_scene")]
AKey = Annotated[Key, Field(description="of your choice; reuse it only to repeat this very call")]
Detail = Annotated[bool, Field(description="also contract, positions, certificate, arrival")]
Shown = Annotated[bool, Field(description="also the current picture")]
Things = Annotated[Pointed, Field(description="targets, pointed at in px of the picture")]
Answer = AcceptedElicitation[Any] | DeclinedElicitation | CancelledElicitation
Edits = Annotated[
    list[Annotated[dict[str, Any], WithJsonSchema(EDIT_SCHEMA)]], Field(min_length=1, max_length=20)
]


@with_error_messages
async def open_scene(
    ctx: Ctx,
    image: Annotated[str, Field(description="file path, over HTTP a session id; or a data URL")],
    robots: Annotated[int | None, Field(ge=1, le=10_000)] = None,
    metres_per_pixel: Annotated[float | None, Field(gt=0, le=1e6)] = None,
    robot_radius: Annotated[float | None, Field(ge=0, le=1e5, description="px")] = None,
    clearance: Annotated[float | None, Field(ge=0, le=1e5, description="px")] = None,
    picture: Shown = False,
) -> StateResult:
    """Begin a session about a picture taken from above; other tools need its id."""
    hub, person = caller(ctx)
    require_scope(person, "plan")
    await asyncio.to_thread(check_room, hub, person)
    seen = await picture_named(ctx, image)
    settings = hub.settings.of_session(
        robots=robots,
        metres_per_pixel=metres_per_pixel,
        robot_radius=robot_radius,
        clearance=clearance,
    )
    ToolContext.of(seen, settings)  # raises before anything is stored
    made = hub.service.open(seen, settings=settings, owner=person.name)
    return await session_state(ctx, made, picture=picture)


@with_error_messages
async def instruct(
    ctx: Ctx,
    session: ASession,
    words: Words,
    points: Things = (),
    idempotency_key: AKey | None = None,
    detail: Detail = False,
    picture: Shown = False,
) -> StateResult:
    """Tell the team, in the person's own words, what to do or change; also questions and answers.

    It plans and certifies; no robot moves. "Surround the coin with 6 robots", "a bit further out",
    "undo", "how far is robot 4?".
    """
    service, person = await authorize(ctx, session, "plan")
    asked = Asked(by=person.name, key=idempotency_key, may_move=False)
    turn = service.say(session, words, asked, pointed=points)
    try:
        return await state_after(ctx, session, turn, detail=detail, picture=picture)
    except InputError as error:
        if error.kind != "not_allowed":
            raise
        raise InputError(NO_GO) from None


@with_error_messages
async def edit(
    ctx: Ctx,
    session: ASession,
    edits: Edits,
    idempotency_key: AKey | None = None,
    detail: Detail = False,
    picture: Shown = False,
) -> StateResult:
    """Change the current plan by exact edits, without words; all else stays as it is."""
    service, person = await authorize(ctx, session, "plan")
    asked = Asked(by=person.name, key=idempotency_key, may_move=False)
    turn = service.edit(session, *edits, asked=asked)
    return await state_after(ctx, session, turn, detail=detail, picture=picture)


@with_error_messages
async def status(
    ctx: Ctx,
    session: ASession,
    wait: Annotated[bool, Field(description="wait some seconds for the turn to end")] = False,
    detail: Detail = False,
    picture: Shown = False,
) -> StateResult:
    """State of a session: its plan, what waits for a person, whether robots drive or arrived."""
    service, _ = await authorize(ctx, session)
    turn = service.turn(session)
    if wait and turn is not None:
        return await state_after(ctx, session, turn, detail=detail, picture=picture)
    return await session_state(ctx, session, detail=detail, picture=picture)


class Yes(BaseModel):
    """A person's answer."""

    approve: bool = Field(description="Yes: the real robots drive to exactly this plan, now")


def _key_of_yes(idempotency_key: str) -> str:
    """Return the idempotency key of the turn that follows a person's answer to a call."""
    return f"{idempotency_key}/answer"


@with_error_messages
async def ask_person(
    ctx: Ctx, session: str, plan_id: str, idempotency_key: str
) -> Elicit[Yes] | str:
    """Begin to drive; if a person has to approve it first, ask them.

    Returns:
        The question, or, if nobody is asked, text to put before the message of the session's state.
    """
    service, person = await authorize(ctx, session, "move")
    plan_node(service.session(session), plan_id)
    now = service.turn(session)
    if now is not None and now.asked.key == _key_of_yes(idempotency_key):
        return await await_turn(ctx, now)
    waits = None if now is not None else await service.waits(session)
    if waits is None or waits.plan_id != plan_id:
        before = await await_turn(
            ctx, service.go(session, plan_id, asked=asked_by(person, idempotency_key))
        )
        waits = None if before else await service.waits(session)
        if waits is None or waits.plan_id != plan_id:
            return before
    if _can_ask(ctx):
        return Elicit(waits.message, Yes)
    way = OVER_STDIO if ctx.request_context.request is None else OVER_HTTP
    return way.format(session)


def _can_ask(ctx: Ctx) -> bool:
    """Return whether the client shows forms to a person; one that names no kind shows forms."""
    declared = ctx.client_capabilities
    offers = None if declared is None else declared.elicitation
    return offers is not None and (offers.form is not None or offers.url is None)


@with_error_messages
async def approve_and_deploy(
    ctx: Ctx,
    session: ASession,
    plan_id: Annotated[str, Field(min_length=1, max_length=100)],
    idempotency_key: AKey,
    answer: Annotated[Answer, Resolve(ask_person)],
) -> StateResult:
    """Drive the robots to a certified plan; for real ones, a person is asked to approve first.

    If they still drive after some seconds: status "running"; call status again.
    """
    said = answer.data if isinstance(answer, AcceptedElicitation) else None
    if isinstance(said, str):
        return await session_state(ctx, session, said)
    service, person = await authorize(ctx, session, "move")
    waits = await service.waits(session)
    if waits is None or waits.plan_id != plan_id or isinstance(answer, CancelledElicitation):
        return await session_state(ctx, session)
    asked = asked_by(person, _key_of_yes(idempotency_key))
    if isinstance(said, Yes) and said.approve:
        turn = service.approve(session, plan_id, waits.nonce, asked=asked)
    else:
        turn = service.say(session, "no", asked)
    return await state_after(ctx, session, turn)


@with_error_messages
async def stop(ctx: Ctx, session: ASession) -> StateResult:
    """Hold all robots where they are, at once, and end the turn."""
    service, person = await authorize(ctx, session)
    await service.stop(session, asked_by(person))
    return await session_state(ctx, session)


def add_tools(server: MCPServer[Access]) -> None:
    """Register the tools with the server."""
    for tool in (open_scene, instruct, edit, stop):
        hints = ToolAnnotations(destructive_hint=False, open_world_hint=False)
        server.add_tool(tool, annotations=hints)
    server.add_tool(status, annotations=ToolAnnotations(read_only_hint=True))
    hints = ToolAnnotations(destructive_hint=True, idempotent_hint=True)
    server.add_tool(approve_and_deploy, annotations=hints)
