"""The routes of turns: words, edits, undo, approvals, deployments; stop is always possible.

A turn is never lost with its request: it goes on to its end, and its number finds it again.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Request, Response

from ...agent.store.protocol import Event
from ...agent.turns import Asked, Turn
from ...tools.errors import InputError
from .forms import Approval, Deployment, Edits, Key, Message, TurnState, Undo
from .hub import AHub, APerson, Hub, asked_by, check_owner, check_seen, require_scope
from .sessions import ERRORS, PICTURE, picture_sent

router = APIRouter(prefix="/api/sessions/{session}", tags=["turns"], responses=ERRORS)
AKey = Annotated[Key | None, Header(alias="Idempotency-Key")]
Wait = Annotated[
    float, Query(ge=0, le=60, description="maximum seconds to wait for the turn to end")
]
RUNNING: dict[int | str, dict[str, Any]] = {
    202: {"model": TurnState, "description": "The turn is still running; get it by its number"}
}


@dataclass(frozen=True)
class Asking:
    """A request for a turn: who asks, in which session, and how long they wait for its end."""

    hub: Hub
    session: str
    asked: Asked
    wait: float
    response: Response

    async def answer(self, turn: Turn) -> TurnState:
        """Return the turn's state at its end, after the wait, or once robots drive."""
        return await _answer(self.hub, self.session, turn, self.wait, self.response)


def asking(
    session: str, hub: AHub, person: APerson, response: Response, key: AKey = None, wait: Wait = 30
) -> Asking:
    """Return who asks, once it is known that they may plan in that session."""
    require_scope(person, "plan")
    return Asking(hub, check_owner(session, person), asked_by(person, key), wait, response)


AnAsking = Annotated[Asking, Depends(asking)]


@router.post("/messages", responses=RUNNING)
async def say(said: Message, at: AnAsking) -> TurnState:
    """Send a message: an instruction, a change, a question, an answer, go or stop."""
    pointed, kept = said.pointed, said.keep_out
    turn = at.hub.service.say(at.session, said.words, at.asked, pointed=pointed, keep_out=kept)
    return await at.answer(turn)


@router.post("/edits", responses=RUNNING)
async def edit(wanted: Edits, at: AnAsking) -> TurnState:
    """Change the current plan by edits in the format of the tool `edit_formation`."""
    return await at.answer(at.hub.service.edit(at.session, *wanted.edits, asked=at.asked))


@router.post("/undo", responses=RUNNING)
async def undo(back: Undo, at: AnAsking) -> TurnState:
    """Go back to an earlier plan, or forward again; robots stay where they are."""
    return await at.answer(at.hub.service.undo(at.session, back.steps, back.to, at.asked))


@router.put("/picture", responses=RUNNING, openapi_extra=PICTURE)
async def image(
    request: Request, at: AnAsking, name: Annotated[str, Query(max_length=200)] = "picture"
) -> TurnState:
    """Continue with the picture in the request body; earlier plans become void."""
    picture = await picture_sent(request, at.hub, name)
    return await at.answer(at.hub.service.image(at.session, picture, at.asked))


@router.post("/deployments", status_code=202)
async def deploy(
    session: str,
    wanted: Deployment,
    hub: AHub,
    person: APerson,
    response: Response,
    key: Annotated[Key, Header(alias="Idempotency-Key")],
) -> TurnState:
    """Drive the robots to a plan, once per idempotency key; real robots wait for an approval."""
    require_scope(person, "move")
    asked, name = asked_by(person, key), check_owner(session, person)
    run = (await hub.service.fresh(name)).run
    known = run is not None and wanted.plan_id in run.world.plans
    if not known and not hub.service.was_asked(name, key):
        raise InputError(f"There is no plan {wanted.plan_id!r} in this session.", "missing")
    turn = hub.service.go(name, wanted.plan_id, asked=asked)
    state = await _answer(hub, session, turn, 0, response)
    response.status_code = 202
    return state


@router.post("/approvals", status_code=202)
async def approve(
    session: str, given: Approval, hub: AHub, person: APerson, response: Response
) -> TurnState:
    """Approve exactly the plan that waits; real robots then drive to it."""
    require_scope(person, "move")
    asked = asked_by(person)
    name = await check_seen(hub, session, person)
    turn = hub.service.approve(name, given.plan_id, given.nonce, asked=asked)
    state = await _answer(hub, session, turn, 0, response)
    response.status_code = 202
    return state


@router.post("/stop")
async def stop(session: str, hub: AHub, person: APerson) -> TurnState:
    """Hold all robots at once, and end the running turn."""
    now = hub.service.turn(session)
    mine = check_owner(session, person, now and now.asked.by)
    run = await hub.service.stop(mine, asked_by(person))
    if run is None:
        return TurnState(turn=0, status="answered", message="Nothing has moved yet.")
    return TurnState.of(run, hub.service.last_turn(session), person.name)


@router.get("/turns/{number}", responses=RUNNING)
async def turn(
    session: str, number: int, hub: AHub, person: APerson, response: Response, wait: Wait = 0
) -> TurnState:
    """Get a turn by the number of the event that began it."""
    if not person.may("approve"):
        check_owner(session, person)
    now = hub.service.turn(session)
    if now is not None and now.number == number:
        check_owner(session, person, now.asked.by)
        return await _answer(hub, session, now, wait, response, moving=False)
    state = await turn_state(hub, session, number)
    check_owner(session, person, state.by)
    response.status_code = 202 if state.status == "running" else 200
    return state


async def _answer(
    hub: Hub, session: str, turn: Turn, wait: float, response: Response, *, moving: bool = True
) -> TurnState:
    """Return a turn's state at its end, after `wait` seconds, or once robots drive if `moving`."""
    try:
        await turn.begin()
        run = await turn.wait(wait, moving=moving)
    except InputError as error:
        if error.kind != "repeated":
            raise
        return await turn_state(hub, session, error.facts["turn"])
    if run is not None:
        return TurnState.of(run, turn.number, turn.asked.by)
    response.status_code = 202
    moves = turn.moving.is_set()
    return TurnState(turn=turn.number, status="running", by=turn.asked.by, moving=moves)


async def turn_state(hub: Hub, session: str, number: int) -> TurnState:
    """Return a turn's state from the log; that of the last turn has its whole report.

    Raises:
        InputError: there is no turn of that number.
    """
    held = await hub.service.fresh(session)
    events = await asyncio.to_thread(hub.service.events, session)
    state = state_in(events, number)
    last = max(e.number for e in events if e.kind in ("session", "turn", "resume"))
    if held.run is not None and number == last and state.status == held.run.report.status:
        return state.model_copy(update={"report": held.run.report})
    written = state.status == "interrupted" and hub.service.is_written
    if written and await asyncio.to_thread(written, session):
        return state.model_copy(update={"status": "running"})
    return state


def state_in(events: Sequence[Event], number: int) -> TurnState:
    """Return a turn's state from the events of a session.

    Raises:
        InputError: there is no turn of that number.
    """
    begun = events[number - 1] if 1 <= number <= len(events) else None
    if begun is None or begun.kind not in ("turn", "resume"):
        raise InputError(f"There is no turn {number} in this session.", "missing")
    said = next(e for e in reversed(events[:number]) if e.kind == "turn")
    words, by = str(said.data["words"]), str(begun.data.get("by", ""))
    state = TurnState(turn=number, status="interrupted", words=words, by=by)
    moving = False
    for event in events[number:]:
        if event.kind in ("turn", "resume"):
            break
        moving = moving or event.kind == "moving"
        if event.kind == "end":
            told = {"status": event.data["status"], "message": event.data["message"]}
            return state.model_copy(update=told)
    message = "The server's process ended during this turn; robots were held. Say what to do next."
    return state.model_copy(update={"message": message, "moving": moving})
