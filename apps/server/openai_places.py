"""The place of a chat client's message: the session, and the turn in it, that it follows.

Such clients send a whole history and no session. A history that branches off before its session's
end continues in a fork. Any process finds all of this again in the store.
"""

import asyncio
import hashlib
import re
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager, suppress
from datetime import UTC, datetime, timedelta

from ...agent.feed import STAMPED, FedSession, Feed
from ...agent.session import Run, load_run
from ...agent.store.protocol import Event, StoredSession, files_named
from ...tools.errors import InputError, StorageError
from .forms import SessionFacts
from .hub import Hub, check_owner
from .openai_request import ChatRequest, Message, Place, data_of, digest
from .sessions import check_room, owned
from .tokens import Person

SAME = timedelta(minutes=10)
"""How long a first message that is sent again counts as the same."""
PICTURE = ".picture"
"""The suffix of the key of a turn that only sets the picture for the next one."""
MARK = 12
"""Digits of a digest in a session's name, by which the session is found again."""
CHAT_MARK = re.compile(rf"\[[0-9a-f]{{{MARK}}}\] (\[[0-9a-f]{{{MARK}}}\])$")
"""Finds, in a session's name, the mark of the chat that the session belongs to."""
OPENED = 1
"""The number of the event that opens a session; as a turn, the place before the first turn."""


@asynccontextmanager
async def person_lock(hub: Hub, person: Person) -> AsyncGenerator[None]:
    """Hold a person's lock, across all processes, so that no session is opened twice."""
    while (held := hub.service.store.lock(f"chats-{person.name}")) is None:
        await asyncio.sleep(0.02)
    with held:
        yield


async def find_session(
    hub: Hub, person: Person, request: ChatRequest, *, here: bool = False
) -> tuple[str, str | None] | None:
    """Return the session to go on in and the key of the turn; None if no session has begun.

    Args:
        here: whether never to fork, whatever has happened since.

    Raises:
        InputError: they have no such session, or no room for a fork.
    """
    place = request.place or await _remembered(hub, person, request)
    if place is None:
        return None
    events = await _events(hub, check_owner(place.session, person))
    key = None if len(request.users) == 1 else digest(request.who, *request.users)
    if _begins_anew(request, events if place.turn == 0 else _until(events, place.turn)):
        return None
    if place.turn == 0:
        return place.session, key
    if request.place is not None:
        for message in request.since[:-1]:  # messages whose answers the client lost
            place, events = await _follow_up(hub, person, request, place, message, events)
        key = _key(place, request.last)
    assert key is not None, "a history that is remembered has more than one message"
    return place.session if here else await _in_session(
        hub, person, request, place, key, events
    ), key


def name_of(request: ChatRequest, key: str) -> str:
    """Return the name of a session, with marks by which it is found again."""
    words = next((m.text for m in request.users if m.text), "")
    line = " ".join("".join(c if c.isprintable() else " " for c in words).split())
    return " ".join(filter(None, [line[:60], f"[{key[:MARK]}]", _chat_mark(request)]))


async def recently_opened(hub: Hub, person: Person, request: ChatRequest, key: str) -> str | None:
    """Return the session that the same first message of the chat opened within `SAME`, or None."""
    found = await asyncio.to_thread(_marked, hub, person, f"[{key[:MARK]}]")
    since = (datetime.now(UTC) - SAME).isoformat()
    return next((f.id for f in _of_chat(found, request) if f.created >= since), None)


async def run_at(hub: Hub, place: Place) -> Run:
    """Return the run of a session as it was when a turn ended.

    Raises:
        InputError: there is no such turn (`missing`).
    """
    held, events = await hub.service.fresh(place.session), await _events(hub, place.session)
    begun = [e.number for e in events if e.kind in STAMPED]
    if place.turn not in begun:
        raise InputError(f"There is no turn {place.turn} in {place.session}.", "missing")
    if held.run is not None and place.turn == begun[-1]:
        return held.run
    stored = hub.service.store.open(place.session)
    return await asyncio.to_thread(load_run, _Until(stored, place.turn))


async def _remembered(hub: Hub, person: Person, request: ChatRequest) -> Place | None:
    """Return the place where a history without our messages goes on; turn 0 for a session's end.

    Sessions of the request's own chat come first, then those in which most of it was said.
    """
    keys = [digest(request.who, *request.users[:n]) for n in range(len(request.users) - 1, 0, -1)]
    marks = [f"[{key[:MARK]}]" for key in keys] + ([_chat_mark(request)] if request.chat else [])
    listed = await asyncio.to_thread(_marked, hub, person, *marks)
    own = _of_chat(listed, request)
    turns = {facts.id: _turns(await _events(hub, facts.id)) for facts in own or listed}
    for key in keys:
        for session, numbers in turns.items():
            if key in numbers:
                return Place(session, numbers[key])
    if request.last.pictures and not keys:
        return None  # another chat may begin with the same message
    return Place(own[0].id, 0) if own and request.chat else None


def _begins_anew(request: ChatRequest, events: Sequence[Event]) -> bool:
    """Return whether a request brings another picture to a session where nothing was said yet."""
    if any(e.kind in STAMPED for e in events):
        return False
    sent = [hashlib.sha256(data_of(address)).hexdigest() for address in request.last.pictures]
    return bool(sent) and events[0].data["picture"]["facts"]["sha256"] not in sent


async def _in_session(
    hub: Hub, person: Person, request: ChatRequest, place: Place, key: str, events: Sequence[Event]
) -> str:
    """Return a session in which nothing but this request follows the turn, forking if need be.

    It is of the request's own chat.
    """
    later = [e for e in events[place.turn :] if e.kind in STAMPED]
    followed = bool(later) and later[0].data.get("key") not in (key, key + PICTURE)
    if not followed and not await _is_of_another(hub, person, request, place.session):
        return place.session
    if (fork := await _fork_for(hub, person, request, key)) is not None:
        return fork
    await asyncio.to_thread(check_room, hub, person)
    kept, store = _until(events, place.turn), hub.service.store
    files = files_named(kept, store.open(place.session).artefacts)
    return store.create(name_of(request, key), kept, files, person.name).id


async def _follow_up(
    hub: Hub,
    person: Person,
    request: ChatRequest,
    place: Place,
    message: Message,
    events: Sequence[Event],
) -> tuple[Place, Sequence[Event]]:
    """Return the place of the turn that a message began, and its events; if none, those given."""
    key = _key(place, message)
    fork = None if key in _turns(events) else await _fork_for(hub, person, request, key)
    there = events if fork is None else await _events(hub, fork)
    turn = _turns(there).get(key)
    return (place, events) if turn is None else (Place(fork or place.session, turn), there)


async def _fork_for(hub: Hub, person: Person, request: ChatRequest, key: str) -> str | None:
    """Return the session of the chat that was made for a message, or None."""
    found = await asyncio.to_thread(_marked, hub, person, f"[{key[:MARK]}]")
    return next((facts.id for facts in _of_chat(found, request)), None)


async def _is_of_another(hub: Hub, person: Person, request: ChatRequest, session: str) -> bool:
    """Return whether a session belongs to another chat than the one that the request names."""
    if not request.chat:
        return False
    listed = await asyncio.to_thread(owned, hub, person)
    chats = {facts.id: _chat_of(facts) for facts in listed}
    return chats.get(session, "") not in ("", _chat_mark(request))


def _until(events: Sequence[Event], turn: int) -> tuple[Event, ...]:
    """Return the events up to the end of a turn."""
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
        f"The session {session!r} of this chat no longer exists; begin a new chat.", "missing"
    )


def _marked(hub: Hub, person: Person, *marks: str) -> list[SessionFacts]:
    """Return a person's sessions whose names have one of the marks, the newest first."""
    if not marks:
        return []
    found = owned(hub, person, marks[0] if len(marks) == 1 else "")
    return [facts for facts in found if any(mark in facts.name for mark in marks)]


def _of_chat(found: Sequence[SessionFacts], request: ChatRequest) -> list[SessionFacts]:
    """Return the sessions that belong to the request's chat, or to none if it names none."""
    return [facts for facts in found if _chat_of(facts) == _chat_mark(request)]


def _chat_of(facts: SessionFacts) -> str:
    """Return the mark of the chat that a session belongs to; empty for none."""
    found = CHAT_MARK.search(facts.name)
    return found[1] if found else ""


def _chat_mark(request: ChatRequest) -> str:
    """Return the mark of the chat that a request names; empty for none."""
    chat = digest("chat", request.who, request.chat)
    return f"[{chat[:MARK]}]" if request.chat else ""


def _key(place: Place, message: Message) -> str:
    """Return the key of a message that follows one of ours."""
    return digest(place.session, place.turn, message)


def _turns(events: Sequence[Event]) -> dict[str | None, int]:
    """Return the numbers of turns by the keys of the requests for them."""
    return {e.data.get("key"): e.number for e in events if e.kind in STAMPED}


class _Until(FedSession):
    """A view of a stored session that ends with a turn."""

    def __init__(self, stored: StoredSession, turn: int) -> None:
        super().__init__(stored, Feed(stored, ()))
        self._turn = turn

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `StoredSession.events`."""
        return _until(super().events(), self._turn)[after:]
