"""The answers of the tools: a session's state in brief; positions and pictures on demand."""

import asyncio
from typing import Annotated, Any, Literal

from mcp.server.mcpserver import Image
from mcp_types import CallToolResult, ContentBlock, ResourceLink, TextContent
from pydantic import BaseModel

from ...agent.conversation import Session
from ...agent.report import Report, Status
from ...agent.turns import Turn
from ...tools.draw import draw_view
from ...tools.errors import InputError
from ...tools.world import World
from .access import Ctx, caller, own_session

HEARTBEAT = 5.0
"""Seconds between progress reports while a turn goes on."""
PATIENCE = 18.0
"""Seconds after which a call answers that its turn goes on; many clients give up after 60."""
DETAIL = {"contract", "positions", "headings_deg", "robots", "targets", "verdict", "arrival"}
"""Fields of a report that are sent on demand."""
JPEG = "image/jpeg"


class State(BaseModel):
    """State of a session.

    Status open: nothing was said yet. running: call status again. question: answer with instruct.
    needs_approval: a person must approve. Show the message to the person unchanged. certified:
    whether the plan is proven as asked. candidates: choices of a question. detail, on demand:
    contract, positions in px in robot order, certificate, arrival.
    """

    session: str
    status: Status | Literal["open", "running"]
    message: str
    plan_id: str | None = None
    certified: bool | None = None
    robots: int | None = None
    candidates: list[dict[str, Any]] | None = None
    detail: dict[str, Any] | None = None


StateResult = Annotated[CallToolResult, State]


async def await_turn(ctx: Ctx, turn: Turn) -> str:
    """Wait for the end of a turn, `PATIENCE` seconds at most, reporting progress meanwhile.

    Returns:
        Text to put before the state's message if the turn repeats an earlier one; else "".

    Raises:
        InputError: the turn could not begin.
    """
    beats, left = 0, PATIENCE
    while left > 0:
        await asyncio.wait({turn.task}, timeout=min(HEARTBEAT, left))
        if turn.task.done():
            break
        beats, left = beats + 1, left - HEARTBEAT
        doing = "The robots are driving" if turn.moving.is_set() else "Working"
        await ctx.report_progress(beats, message=f"{doing} ({beats * HEARTBEAT:g} s).")
    try:
        if turn.task.done():
            await turn.ended()
    except InputError as error:
        if error.kind != "repeated":
            raise
        return f"{error} Now: "
    return ""


async def state_after(
    ctx: Ctx, session: str, turn: Turn, *, detail: bool = False, picture: bool = False
) -> CallToolResult:
    """Wait for a turn, then return the session's state, even if the turn still goes on."""
    before = await await_turn(ctx, turn)
    return await session_state(ctx, session, before, detail=detail, picture=picture)


async def session_state(
    ctx: Ctx, session: str, before: str = "", *, detail: bool = False, picture: bool = False
) -> CallToolResult:
    """Return the session's current state.

    Args:
        before: text to put before its message.
    """
    service, held = caller(ctx)[0].service, await own_session(ctx, session)
    now = service.turn(session)
    if now is not None or await asyncio.to_thread(service.is_written, session):
        driving = now is not None and now.moving.is_set()
        doing = "The robots are driving" if driving else "A turn is under way"
        state = State(session=session, status="running", message=f"{doing}; call status again.")
    elif held.run is None:
        size = "{} by {} px".format(*held.picture.size)
        message = f"The picture is open, {size}. Say what to do with instruct."
        state = State(session=session, status="open", message=message)
    else:
        state = _reported(session, held.run.report, detail=detail)
    state.message = before + state.message
    content: list[ContentBlock] = [TextContent(text=state.model_dump_json(exclude_none=True))]
    plan_id = None if state.candidates else state.plan_id  # a question is about what it offers
    name = f"plans/{plan_id}/picture" if plan_id else "scene"
    uri = f"formup://sessions/{session}/{name}"
    content.append(ResourceLink(uri=uri, name=name, mime_type=JPEG))
    if picture:
        data = await asyncio.to_thread(view, held, plan_id)
        content.append(Image(data=data, format="jpeg").to_image_content())
    return CallToolResult(
        content=content, structured_content=state.model_dump(mode="json", exclude_none=True)
    )


def _reported(session: str, report: Report, *, detail: bool) -> State:
    more = report.model_dump(mode="json", include=DETAIL) if detail else None
    return State(
        session=session,
        status=report.status,
        message=report.message,
        plan_id=report.plan_id,
        certified=None if report.verdict is None else report.verdict.certified,
        robots=None if report.positions is None else len(report.positions),
        candidates=None if report.candidates is None else list(report.candidates),
        detail=more,
    )


def view(held: Session, plan_id: str | None = None) -> bytes:
    """Return the picture with rulers, as JPEG, and a plan's robots or a question's choices on it.

    Raises:
        InputError: there is no such plan.
    """
    run = held.run
    plan = None if plan_id is None else plan_node(held, plan_id).plan
    if run is None:
        return draw_view(held.picture, World.of(held.picture))
    if plan is not None:
        return draw_view(run.context.picture, run.world, plan=plan)
    shown = run.view() if run.report.candidates else None
    return shown or draw_view(run.context.picture, run.world.having(targets=()))


def plan_node(held: Session, plan_id: str) -> Any:
    """Return a plan of a session as a node, with the plan that it was made from.

    Raises:
        InputError: there is no such plan (`missing`).
    """
    plans = {} if held.run is None else held.run.world.plans
    if plan_id not in plans:
        known = ", ".join(list(plans)[-8:]) or "none"
        raise InputError(
            f"There is no plan {plan_id!r} in this session; its latest plans: {known}.", "missing"
        )
    return plans[plan_id]
