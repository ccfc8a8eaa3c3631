"""The answers to chat clients: a turn is begun, awaited, and reported in Markdown with a picture.

A turn goes on if its client disconnects, and the same request sent again finds it.
"""

import asyncio
import hashlib
import io
import logging
import re
import time
from collections.abc import AsyncGenerator
from dataclasses import dataclass, field

from fastapi import Request

from ...agent.outcomes import Cancelled, Paused
from ...agent.report import Totals
from ...agent.session import Run
from ...agent.stopping import is_stop
from ...agent.turns import Turn
from ...tools.draw import draw_plan
from ...tools.errors import FormupError, InputError
from ..run_display import choice_words
from ..run_files import draw_choices
from .hub import Hub, asked_by, check_owner, require_scope
from .openai_chores import chore
from .openai_places import (
    OPENED,
    PICTURE,
    find_session,
    name_of,
    person_lock,
    recently_opened,
    run_at,
)
from .openai_request import ChatRequest, Message, Place, data_of, digest
from .sessions import check_room, checked_picture
from .tokens import Person

USUAL = "formup"
"""The model name of the default agent."""
BEAT, DRIVING = 5.0, 20.0
"""Seconds between heartbeats, and the longest wait, in seconds, for robots that are driving."""
NEEDED = (
    "I need a picture of the place, and what the robots should do there: attach one picture, and "
    "say for example *Surround the largest coin with 6 robots*."
)
WHAT_TO_DO = (
    "I have the picture. What should the robots do there? Say for example *Surround the largest "
    "coin with 6 robots*."
)
EMPTY = "Say what to do, such as *a bit further out*, *undo* or *go*."
BUSY = (
    "I am still working on your last message. Wait a moment and send this one again, or say "
    "**stop**."
)
ON_THE_WAY = (
    "The robots are on their way, which takes a while. Say **stop** to hold them where they "
    "are, or ask *are they there?* to see how far they are."
)
DRIVES = "The robots are still on their way. Wait for them, or say **stop** to hold them."
CUT_OFF = "That was stopped before it began; nothing was done."
BROKEN_OFF = (
    "That was interrupted before it was finished; robots that were driving are held. Say what to "
    "do next."
)
NOTHING_MOVES = (
    "No robots of this chat are moving. Real robots of this server are held, whoever drove them."
)
UNSAFE = re.compile(r"\](?=[(\[:])|<(?=[a-z/!?])", re.I)
"""Characters to escape, so that text a model read in a picture is no link, picture or HTML."""


@dataclass(frozen=True)
class Answer:
    """An answer to a client.

    Attributes:
        place: the turn that it is about; None for none.
    """

    text: str
    place: Place | None = None
    usage: Totals = field(default_factory=Totals)

    async def answers(self) -> AsyncGenerator["Answer"]:
        """Yield this answer."""
        yield self


@dataclass(frozen=True)
class Begun:
    """A turn that has begun, to be answered when it ends."""

    base: str
    session: str
    turn: Turn

    @property
    def place(self) -> Place:
        """The session and number of the turn."""
        return Place(self.session, self.turn.number)

    async def answers(self) -> AsyncGenerator[Answer | None]:
        """Yield None as a heartbeat until the turn ends, then its answer.

        Once robots have driven for `DRIVING` seconds, the answer is a note that they still do.

        Raises:
            FormupError: the turn failed.
        """
        moves = None
        while not self.turn.task.done():
            if self.turn.moving.is_set():
                moves = moves or time.monotonic()
                if time.monotonic() - moves >= DRIVING:
                    yield _text_answer(ON_THE_WAY, self.base, self.place)
                    return
            yield None
            await asyncio.wait({self.turn.task}, timeout=BEAT)
        run = await self.turn.ended()
        yield Answer(CUT_OFF) if run is None else await answer_of(self.place, run, self.base)


async def final_answer(begun: Answer | Begun) -> Answer:
    """Wait for the answer and return it."""
    answers = [answer async for answer in begun.answers() if answer is not None]
    return answers[-1]


def problem(error: Exception) -> str:
    """Return what a client is told of an error; internal errors go to the log alone."""
    if isinstance(error, FormupError):
        return str(error)
    logging.getLogger("formup").error("a turn broke", exc_info=error)
    return "The server failed to do this; its log says why."


def base_of(request: Request, hub: Hub) -> str:
    """Return the address of this server, as browsers reach it."""
    return (hub.settings.public_url or str(request.base_url)).rstrip("/")


def agents(hub: Hub) -> dict[str, str]:
    """Return the agents' names by the model names that clients use, the default one first."""
    usual, *others = hub.service.agents
    return {USUAL: usual, **{name: name for name in others}}


async def begin(hub: Hub, person: Person, request: ChatRequest, base: str) -> Answer | Begun:
    """Begin the turn that a request asks for, or answer it at once if it needs none.

    Args:
        base: the address of this server.

    Raises:
        InputError: the request cannot be carried out.
    """
    if request.model not in agents(hub):
        there = ", ".join(agents(hub))
        raise InputError(
            f"There is no model {request.model[:80]!r} here; use one of {there}.", "missing"
        )
    if (answer := chore(request)) is not None:
        return Answer(answer)
    if request.place is not None and not request.since:  # no new message since our answer
        check_owner(request.place.session, person)
        return await answer_at(hub, request.place, base)
    _check(request.last)
    if (held := await _hold(hub, person, request, base)) is not None:
        return held
    require_scope(person, "plan")
    async with person_lock(hub, person):
        there = await find_session(hub, person, request)
        found = there or await _open_session(hub, person, request)
    if found is None:
        return Answer(NEEDED)
    session, key = found
    try:
        turn = await _turn(hub, person, request, session, key)
        if turn is None:
            return await _nothing_said(hub, session, request, base)
        await turn.begin()
        return Begun(base, session, turn)
    except InputError as error:
        if there is None and error.kind not in ("repeated", "busy"):
            await hub.service.delete(session)
        return await _fallback_answer(hub, session, request, base, error)


async def _fallback_answer(
    hub: Hub, session: str, request: ChatRequest, base: str, error: InputError
) -> Answer:
    """Return the answer where a turn could not begin: repeated, not allowed, or busy.

    Raises:
        InputError: the error itself, if it is none of these.
    """
    if error.kind == "repeated":
        return await answer_at(hub, Place(session, error.facts["turn"]), base)
    if error.kind in ("not_allowed", "asked"):
        return _text_answer(str(error), base, request.place)
    if error.kind != "busy":
        raise error
    now = hub.service.turn(session)
    place = Place(session, now.number) if now and now.number else request.place
    return _text_answer(DRIVES if now and now.moving.is_set() else BUSY, base, place)


async def answer_at(hub: Hub, place: Place, base: str) -> Answer:
    """Return the answer that was given at a place.

    Raises:
        InputError: there is no such turn (`missing`).
    """
    if place.turn == OPENED:
        return _text_answer(WHAT_TO_DO, base, place)
    return await answer_of(place, await run_at(hub, place), base)


async def answer_of(place: Place, run: Run, base: str) -> Answer:
    """Return the answer to a finished turn, and store its picture in the session."""
    report, choices = run.report, run.report.candidates or ()
    message = BROKEN_OFF if isinstance(run.outcome, Cancelled) else report.message
    lines = [message]
    if choices:
        lines.append("\n".join(f"- {choice_words(choice)}" for choice in choices))
    if isinstance(run.outcome, Paused) and run.outcome.plan_id is not None:
        lines.append(f"Say **yes** to move them to plan {run.outcome.plan_id}, or **no**.")
    elif report.status == "planned":
        lines.append("Say **go** to move them there, or what to change.")
    text = UNSAFE.sub(r"\\\g<0>", "\n\n".join(lines))
    png = await asyncio.to_thread(_picture, run)
    if png is None or run.stored is None:
        return _text_answer(text, base, place, report.usage)
    sha256 = await asyncio.to_thread(run.stored.artefacts.put, png)
    shows = "The choices" if choices else f"Plan {report.plan_id}"
    text += f"\n\n![{shows}]({base}{place.path}/{sha256}.png)"
    return Answer(text, place, report.usage)


async def _turn(
    hub: Hub, person: Person, request: ChatRequest, session: str, key: str | None
) -> Turn | None:
    """Start the turn that a request asks for; return None if it says nothing new.

    Raises:
        InputError: the turn cannot begin, or repeats an earlier one.
    """
    held, turn, words = await hub.service.fresh(session), None, request.last.text
    if held.run is None and not words:  # the words came in a message before the picture
        words = next((m.text for m in reversed(request.users) if m.text), "")
    for address in request.last.pictures:
        data = data_of(address)
        if hashlib.sha256(data).hexdigest() != held.picture.sha256:
            picture = await asyncio.to_thread(checked_picture, data, "picture", hub)
            turn = hub.service.image(session, picture, asked_by(person, key and key + PICTURE))
    if words:
        try:
            if turn is not None:
                await turn
        except InputError as error:
            if error.kind != "repeated":
                raise
        turn = hub.service.say(session, words, asked_by(person, key))
    return turn


async def _nothing_said(hub: Hub, session: str, request: ChatRequest, base: str) -> Answer:
    """Return the answer to a message without words or another picture: what can be said."""
    if (await hub.service.fresh(session)).run is None:
        return _text_answer(WHAT_TO_DO, base, Place(session, OPENED))
    return _text_answer(EMPTY, base, request.place)


async def _open_session(hub: Hub, person: Person, request: ChatRequest) -> tuple[str, str] | None:
    """Open a session, unless the same message has just opened one.

    Returns:
        The session's id and the key of the turn; None if the messages have no picture.
    """
    pictured = [m for m in request.users if m.pictures]
    if not pictured:
        return None
    key = digest(request.who, *request.users)
    if (before := await recently_opened(hub, person, request, key)) is not None:
        return before, key
    await asyncio.to_thread(check_room, hub, person)
    _check(pictured[-1])
    data = data_of(pictured[-1].pictures[0])
    made = hub.service.open(
        await asyncio.to_thread(checked_picture, data, "picture", hub),
        settings=hub.settings.of_session(),
        name=name_of(request, key),
        agent=agents(hub)[request.model],
        owner=person.name,
    )
    return made, key


async def _hold(hub: Hub, person: Person, request: ChatRequest, base: str) -> Answer | None:
    """Hold the robots if a stop is asked for, whoever asks and whatever has happened since.

    Returns:
        The answer; None if no stop is asked for.
    """
    if not is_stop(request.last.text, driving=True):
        return None
    found = await find_session(hub, person, request, here=True)
    if not is_stop(request.last.text) and not (found and hub.service.turn(found[0])):
        return None
    await hub.service.hold()
    run = await hub.service.stop(found[0], asked_by(person)) if found else None
    if found is None or run is None:
        return _text_answer(NOTHING_MOVES, base, request.place)
    return await answer_of(Place(found[0], hub.service.last_turn(found[0])), run, base)


def _check(message: Message) -> None:
    """Refuse parts of a message that would otherwise be silently ignored."""
    if message.others:
        raise InputError(
            f"A message may contain text and a picture; leave out {message.others[0][:40]!r}."
        )
    if len(message.pictures) > 1:
        raise InputError(
            f"{len(message.pictures)} pictures came with one message; send one picture at a time."
        )


def _picture(run: Run) -> bytes | None:
    """Return the picture of a turn as PNG: its choices or its plan; None if it shows neither."""
    report, file = run.report, io.BytesIO()
    node = run.world.plans.get(report.plan_id or "")
    if report.candidates:
        drawn = draw_choices(run)
    elif node is not None and report.status in ("planned", "deployed", "needs_approval"):
        drawn = draw_plan(run.context.picture, run.world, node.plan, report.instruction)
    else:
        return None
    drawn.save(file, "PNG")
    return file.getvalue()


def _text_answer(text: str, base: str, place: Place | None, usage: Totals | None = None) -> Answer:
    """Return an answer without a picture, its place in a link definition, which Markdown hides."""
    mark = f"\n\n[formup]: {base}{place.path}" if place else ""
    return Answer(text + mark, place, usage or Totals())
