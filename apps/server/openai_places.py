"""In which session, and after which turn of it, what a chat client sends belongs.

Such clients send a whole history and no session. Where it goes on elsewhere than at its session's
end, it goes on in a fork. All of it is found again in the store, by any process.
"""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager, suppress
from datetime import UTC, datetime, timedelta

from ...agent.feed import STAMPED, FedSession, Feed
from ...agent.session import Run, load_run
from ...agent.store.protocol import Event, StoredSession, files_named
from ...tools.errors import InputError, StorageError
from .forms import SessionFacts
from .hub import Hub, check_owner
from .openai_request import Message, Place, Said, digest
from .sessions import check_room, owned
from .tokens import Person

SAME = timedelta(minutes=10)
"""For so long a first message that is sent again is the same."""
PICTURE = ".picture"
"""What the key of a turn ends with that brings the picture of the next one."""
MARK = 12
"""Digits of a digest by which a session is found again, in its name."""


@asynccontextmanager
async def alone(hub: Hub, person: Person) -> AsyncGenerator[None]:
    """One search at a time for each person, among all processes: none begins what another has."""
    while (held := hub.service.store.lock(f"chats-{person.name}")) is None:
        await asyncio.sleep(0.02)
    with held:
        yield


async def find(
    hub: Hub, person: Person, said: Said, *, here: bool = False
) -> tuple[str, str | None] | None:
    """The session to go on in, and the key of the turn; None where nothing has begun.

    Args:
        here: not to fork, whatever has happened since.

    Raises:
        InputError: there is no such session of theirs, or no room for a fork.
    """
    place = said.place or await _remembered(hub, person, said)
    if place is None:
        return None
    events = await _events(hub, check_owner(place.session, person))
    key = None if len(said.users) == 1 else digest(said.who, *said.users)
    if place.turn == 0:
        return place.session, key
    if said.place is not None:
        for message in said.since[:-1]:  # those whose answers the client has lost
            place, events = await _answered(hub, person, place, message, events)
        key = _key(place, said.last)
    assert key is not None, "a history that is remembered has more than one message"
    return place.session if here else await _in_session(hub, person, said, place, key, events), key


def name_of(said: Said, key: str) -> str:
    """The name of a session, by which it is found again."""
    words = next((m.text for m in said.users if m.text), "")
    line = " ".join("".join(c if c.isprintable() else " " for c in words).split())
    return " ".join([line[:60], f"[{key[:MARK]}]", *([_chat_mark(said)] if said.chat else [])])


async def begun_before(hub: Hub, person: Person, key: str) -> str | None:
    """The session that a first message began when it was sent a short while ago."""
    found = await asyncio.to_thread(_marked, hub, person, f"[{key[:MARK]}]")
    since = (datetime.now(UTC) - SAME).isoformat()
    return next((facts.id for facts in found if facts.created >= since), None)


async def run_at(hub: Hub, place: Place) -> Run:
    """A turn, as its session was when it ended.

    Raises:
        InputError: there is none.
    """
    held, events = await hub.service.fresh(place.session), await _events(hub, place.session)
    begun = [e.number for e in events if e.kind in STAMPED]
    if place.turn not in begun:
        raise InputError(f"There is no turn {place.turn} in {place.session}.", "missing")
    if held.run is not None and place.turn == begun[-1]:
        return held.run
    stored = hub.service.store.open(place.session)
    return await asyncio.to_thread(load_run, _Until(stored, place.turn))


async def _remembered(hub: Hub, person: Person, said: Said) -> Place | None:
    """Where a history without any message of ours goes on; turn 0 for a session's end."""
    keys = [digest(said.who, *said.users[:n]) for n in range(len(said.users) - 1, 0, -1)]
    marks = [f"[{key[:MARK]}]" for key in keys]
    chat = _chat_mark(said) if said.chat else None
    listed = await asyncio.to_thread(_marked, hub, person, *marks, *([chat] if chat else []))
    for facts in listed:
        turns = _turns(await _events(hub, facts.id))
        if number := next((turns[key] for key in keys if key in turns), None):
            return Place(facts.id, number)
    if said.last.pictures and not keys:
        return None  # another chat begins as this one did
    return next((Place(f.id, 0) for f in listed if chat and chat in f.name), None)


async def _in_session(
    hub: Hub, person: Person, said: Said, place: Place, key: str, events: Sequence[Event]
) -> str:
    """A session in which nothing but this request has followed a turn."""
    later = [e for e in events[place.turn :] if e.kind in STAMPED]
    if not later or later[0].data.get("key") in (key, key + PICTURE):
        return place.session
    if (fork := await _fork_for(hub, person, key)) is not None:
        return fork
    await asyncio.to_thread(check_room, hub, person)
    kept, store = _until(events, place.turn), hub.service.store
    files = files_named(kept, store.open(place.session).artefacts)
    return store.create(name_of(said, key), kept, files, person.name).id


async def _answered(
    hub: Hub, person: Person, place: Place, message: Message, events: Sequence[Event]
) -> tuple[Place, Sequence[Event]]:
    """Where a message led that was said at a place, with the events there; else the same place."""
    key = _key(place, message)
    fork = None if key in _turns(events) else await _fork_for(hub, person, key)
    there = events if fork is None else await _events(hub, fork)
    turn = _turns(there).get(key)
    return (place, events) if turn is None else (Place(fork or place.session, turn), there)


async def _fork_for(hub: Hub, person: Person, key: str) -> str | None:
    """The session that was made for a message."""
    found = await asyncio.to_thread(_marked, hub, person, f"[{key[:MARK]}]")
    return found[0].id if found else None


def _until(events: Sequence[Event], turn: int) -> tuple[Event, ...]:
    """The events up to the end of a turn."""
    for event in events[turn:]:
        if event.kind == "end":
            return tuple(events[: event.number])
        if event.kind in STAMPED:
            return tuple(events[: event.number - 1])
    return tuple(events)


async def _events(hub: Hub, session: str) -> tuple[Event, ...]:
    with suppress(StorageError):
        return await asyncio.to_thread(hub.service.events, session)
    raise InputError(
        f"The session {session!r} of this chat is not there any more; begin a new chat.", "missing"
    )


def _marked(hub: Hub, person: Person, *marks: str) -> list[SessionFacts]:
    """The sessions of a person with one of these marks in their names, the newest first."""
    if not marks:
        return []
    found = owned(hub, person, marks[0] if len(marks) == 1 else "")
    return [facts for facts in found if any(mark in facts.name for mark in marks)]


def _chat_mark(said: Said) -> str:
    return f"[{digest('chat', said.who, said.chat)[:MARK]}]"


def _key(place: Place, message: Message) -> str:
    """The key of what is said after a message of ours."""
    return digest(place.session, place.turn, message)


def _turns(events: Sequence[Event]) -> dict[str | None, int]:
    """The numbers of turns, by the keys they were asked for under."""
    return {e.data.get("key"): e.number for e in events if e.kind in STAMPED}


class _Until(FedSession):
    """A stored session as far as a turn of it."""

    def __init__(self, stored: StoredSession, turn: int) -> None:
        super().__init__(stored, Feed(stored, ()))
        self._turn = turn

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `StoredSession.events`."""
        return _until(super().events(), self._turn)[after:]
