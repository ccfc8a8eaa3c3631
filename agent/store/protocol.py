"""What conversations are stored in: append-only logs of numbered events, many to a store.

State is folded from the events, so that undo, crashes and replays follow from the log alone. Files
that events name by their hash lie beside it, as `Artefacts`.
"""

import os
import re
import secrets
import socket
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal, Protocol

from pydantic_core import to_json

from ...tools.context import Artefacts
from ...tools.errors import InputError, StorageError

EventKind = Literal[
    "session", "turn", "picture", "resume", "world", "message", "approval", "moving", "end"
]
"""session: who decides, by which prompts, within which limits, and the picture; turn: what the
person says, with the settings; picture: another one from now on; resume: the turn goes on, perhaps
in another process; world: what has changed in it; message: of the conversation; approval: a
person's yes or no to a call; moving: robots are about to move; end: how the turn ended."""


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes:
        number: from 1, without gaps.
        seconds: since the turn was begun or resumed.
        data: JSON.
    """

    number: int
    kind: EventKind
    seconds: float
    data: Mapping[str, Any]


class EventLog(Protocol):
    """The events of one session; whoever has it open for writing is the only one."""

    @property
    def last(self) -> int:
        """The number of the last event; 0 where there is none."""
        ...

    def append(self, kind: EventKind, data: Mapping[str, Any]) -> int:
        """Write one event, at once and whole, and return its number.

        Raises:
            StorageError: it cannot be written.
        """
        ...

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """The events with greater numbers than that, in order."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Files(Artefacts, Protocol):
    """The files of one session."""

    def __contains__(self, sha256: str) -> bool:
        """Whether there is a file of this hash."""
        ...


class StoredSession(Protocol):
    """One session where it is stored: read by anyone, written by one at a time."""

    @property
    def id(self) -> str:
        """What its store knows it by."""
        ...

    @property
    def label(self) -> str:
        """What errors call it, such as the path of its log."""
        ...

    @property
    def artefacts(self) -> Files:
        """Its files."""
        ...

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """The events with greater numbers than that, in order.

        Raises:
            StorageError: it is not there, or is no whole session that formup wrote.
        """
        ...

    def write(self, after: int) -> EventLog:
        """Its log, to be written on and then closed.

        Args:
            after: how many events the writer knows of.

        Raises:
            StorageError: it is not there (`missing`); another process writes it (`busy`), or it
                has gone on since (`gone_on`): the text says what happened meanwhile.
        """
        ...


@dataclass(frozen=True)
class SessionFacts:
    """What a list says of a session.

    Attributes:
        name: given by a person; may be empty.
        created: when, ISO 8601 in UTC.
        turns: how many things were said.
        words: the last of them.
        picture: SHA-256 of the picture it began with; None before it has begun.
    """

    id: str
    name: str
    created: str
    turns: int
    words: str
    picture: str | None


class Store(Protocol):
    """Many sessions; safe for several processes at once."""

    @property
    def label(self) -> str:
        """What errors call it: its address without secrets."""
        ...

    def create(
        self,
        name: str = "",
        events: Sequence[Event] = (),
        files: Sequence[bytes] = (),
        owner: str = "",
    ) -> StoredSession:
        """A new session, whole or not at all.

        Args:
            name: what a person calls it.
            events: that it begins with, such as those of another.
            files: that these name.
            owner: whose it is: small letters, digits and underscores, with which its id begins.

        Raises:
            StorageError: it cannot be written.
        """
        ...

    def open(self, session: str) -> StoredSession:
        """The session with an id.

        Raises:
            StorageError: there is none (`missing`).
        """
        ...

    def sessions(self, text: str = "") -> tuple[SessionFacts, ...]:
        """All sessions whose names or words have that text in them, the newest first."""
        ...

    def rename(self, session: str, name: str) -> None:
        """Call a session otherwise.

        Raises:
            StorageError: there is none (`missing`), or it cannot be written.
        """
        ...

    def delete(self, session: str) -> None:
        """Delete a session with its files.

        Raises:
            StorageError: there is none (`missing`), or another process writes it (`busy`).
        """
        ...

    def lock(self, name: str) -> ExitStack | None:
        """A lock among all processes that use the store, which ends with its process.

        Returns:
            What lets go of it; None while another has it.

        Raises:
            StorageError: it cannot be had.
        """
        ...

    def holder(self, name: str) -> str:
        """Which process has a lock, as HOST:PID; empty where that is not known."""
        ...

    def close(self) -> None:
        """Let go of what is open."""
        ...


MAX_NAME = 200
"""Characters of a session's name."""
_HASH = re.compile(rb'"([0-9a-f]{64})"')


PROCESS = f"{socket.gethostname()}:{os.getpid()}"[-63:]
"""This process, as others are told of it, as long as PostgreSQL keeps such a name."""


def new_id(owner: str = "") -> str:
    """The id of a new session, which says whose it is."""
    return f"{owner}-{secrets.token_hex(5)}" if owner else secrets.token_hex(5)


def owner_of(session: str) -> str:
    """Whose a session is."""
    return session.rpartition("-")[0]


def now() -> str:
    """The time as a session's facts have it."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def checked_name(name: str) -> str:
    """A session's name, in one line.

    Raises:
        InputError: too long, or no text.
    """
    line = " ".join(name.split())
    if len(line) > MAX_NAME or not line.isprintable():
        raise InputError(
            f"A session's name is one line of up to {MAX_NAME} printable characters; "
            f"{line[:40]!r} has {len(line)}."
        )
    return line


def matches(facts: SessionFacts, said: Sequence[str], text: str) -> bool:
    """Whether a text is in a session's name or in what was said in it, large or small letters."""
    wanted = text.casefold()
    return any(wanted in part.casefold() for part in (facts.name, *said))


def files_named(events: Sequence[Event], files: Files) -> tuple[bytes, ...]:
    """The files that events name by their hash.

    Raises:
        StorageError: one was changed since.
    """
    hashes = dict.fromkeys(h.decode() for e in events for h in _HASH.findall(to_json(e.data)))
    return tuple(files.get(sha256) for sha256 in hashes if sha256 in files)


def missing(label: str) -> StorageError:
    """The error where a session is not in its store."""
    return StorageError(
        f"{label} is not there; formup sessions list names those that are.", "missing"
    )


def busy(label: str, meanwhile: Sequence[Event] = (), holder: str = "") -> StorageError:
    """The error where another process writes a session; with what it has written by now."""
    happened = f" Meanwhile {_told(meanwhile)}." if meanwhile else ""
    who = f"another process ({holder})" if holder else "another process"
    return StorageError(
        f"{label} is being written by {who}; wait for it to end, or stop it.{happened}",
        "busy",
    )


def gone_on(label: str, meanwhile: Sequence[Event]) -> StorageError:
    """The error where a session has gone on elsewhere; with what happened there."""
    happened = f": {_told(meanwhile)}" if meanwhile else ""
    return StorageError(
        f"{label} has gone on since it was opened{happened}. Nothing was written; open it again "
        "to go on from there.",
        "gone_on",
    )


def _told(events: Sequence[Event]) -> str:
    """What was said and how it ended, in a clause; the last few turns of many."""
    parts: list[str] = []
    for event in events:
        if event.kind == "turn":
            words = str(event.data.get("words", ""))
            parts.append(f'"{words[:80]}" was said')
        elif event.kind == "end":
            parts.append(f"it came to {event.data.get('status')}")
    shown = parts[-6:] or [f"{len(events)} events were written"]
    return ", ".join(["...", *shown] if len(parts) > len(shown) else shown)
