"""How conversations are stored: as append-only logs of numbered events, many to a store.

State is folded from the events, so undo, recovery and replay follow from the log alone. Files that
events name by their hash lie beside it, as `Artefacts`.
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
person says, with the settings; picture: another picture from now on; resume: the turn goes on,
perhaps in another process; world: what has changed in the world; message: one of the conversation;
approval: a person's yes or no to a call; moving: robots are about to move; end: how the turn
ended."""


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
    """The events of one session, open for writing in one place at a time."""

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
        """Return the events with numbers greater than `after`, in order."""
        ...

    def close(self) -> None:
        """Close the log."""
        ...


class Files(Artefacts, Protocol):
    """The files of one session."""

    def __contains__(self, sha256: str) -> bool:
        """Return whether there is a file of this hash."""
        ...


class StoredSession(Protocol):
    """One session in a store: read by anyone, written by one process at a time."""

    @property
    def id(self) -> str:
        """Its id in the store."""
        ...

    @property
    def label(self) -> str:
        """Its name in error messages, such as the path of its log."""
        ...

    @property
    def artefacts(self) -> Files:
        """Its files."""
        ...

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """Return the events with numbers greater than `after`, in order.

        Raises:
            StorageError: the session is missing, or not a whole one as written by formup.
        """
        ...

    def write(self, after: int) -> EventLog:
        """Open the log for appending; the caller closes it.

        Args:
            after: how many events the writer knows of.

        Raises:
            StorageError: the session is missing (`missing`), another process writes it (`busy`), or
                it has gone on since (`gone_on`); the text says what happened meanwhile.
        """
        ...


@dataclass(frozen=True)
class SessionFacts:
    """A session as it is listed.

    Attributes:
        name: given by a person; may be empty.
        created: when it was created, ISO 8601 in UTC.
        turns: how many turns it has.
        words: what the person said in the last turn.
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
        """Its name in error messages: its address without secrets."""
        ...

    def create(
        self,
        name: str = "",
        events: Sequence[Event] = (),
        files: Sequence[bytes] = (),
        owner: str = "",
    ) -> StoredSession:
        """Create a session, whole or not at all.

        Args:
            name: what a person calls it.
            events: the events it begins with, such as those of another session.
            files: the files that these name.
            owner: who owns it: lower-case letters, digits and underscores, which begin its id.

        Raises:
            StorageError: it cannot be written.
        """
        ...

    def open(self, session: str) -> StoredSession:
        """Return the session with an id.

        Raises:
            StorageError: there is none (`missing`).
        """
        ...

    def sessions(self, text: str = "") -> tuple[SessionFacts, ...]:
        """Return all sessions whose names or words contain a text, the newest first."""
        ...

    def rename(self, session: str, name: str) -> None:
        """Give a session another name; marks at the end of the old one stay, see `renamed`.

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
        """Take a lock among all processes that use the store; it ends with the process.

        Returns:
            A stack that releases the lock when closed; None while another process has it.

        Raises:
            StorageError: the lock cannot be taken.
        """
        ...

    def holder(self, name: str) -> str:
        """Return which process has a lock, as HOST:PID; empty where that is not known."""
        ...

    def close(self) -> None:
        """Close what is open."""
        ...


MAX_NAME = 200
"""Most characters of a session's name."""
_MARKS = re.compile(r"(?:(?:^| )\[[0-9a-f]{12}\])+$")
"""Marks at the end of a name, by which a chat client's next message finds its session again."""
_HASH = re.compile(rb'"([0-9a-f]{64})"')


PROCESS = f"{socket.gethostname()}:{os.getpid()}"[-63:]
"""This process as others see it, no longer than PostgreSQL allows for such a name."""


def new_id(owner: str = "") -> str:
    """Return the id of a new session, which begins with its owner if it has one."""
    return f"{owner}-{secrets.token_hex(5)}" if owner else secrets.token_hex(5)


def owner_of(session: str) -> str:
    """Return the owner of a session, from its id."""
    return session.rpartition("-")[0]


def now() -> str:
    """Return the time as a session's facts have it: ISO 8601 in UTC, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def checked_name(name: str) -> str:
    """Return a session's name as one line.

    Raises:
        InputError: the name is too long, or not printable.
    """
    line = " ".join(name.split())
    if len(line) > MAX_NAME or not line.isprintable():
        raise InputError(
            f"A session's name is one line of up to {MAX_NAME} printable characters; "
            f"{line[:40]!r} has {len(line)}."
        )
    return line


def renamed(old: str, name: str) -> str:
    """Return a session's new name, which ends with the marks of the old one.

    Raises:
        InputError: as of `checked_name`.
    """
    marks = _MARKS.search(old)
    given = _MARKS.sub("", checked_name(name)) if marks else checked_name(name)
    return f"{given} {marks[0].strip()}".strip() if marks else given


def matches(facts: SessionFacts, said: Sequence[str], text: str) -> bool:
    """Return whether a session's name or the words said in it contain a text, in any case."""
    wanted = text.casefold()
    return any(wanted in part.casefold() for part in (facts.name, *said))


def files_named(events: Sequence[Event], files: Files) -> tuple[bytes, ...]:
    """Return the files that events name by their hash.

    Raises:
        StorageError: a file was changed since.
    """
    hashes = dict.fromkeys(h.decode() for e in events for h in _HASH.findall(to_json(e.data)))
    return tuple(files.get(sha256) for sha256 in hashes if sha256 in files)


def missing(label: str) -> StorageError:
    """Return the error for a session that is not in its store."""
    return StorageError(
        f"{label} is not there; the list of sessions has those that are.", "missing"
    )


def busy(label: str, meanwhile: Sequence[Event] = (), holder: str = "") -> StorageError:
    """Return the error for a session that another process writes, with what it wrote meanwhile."""
    happened = f" Meanwhile {_turns_text(meanwhile)}." if meanwhile else ""
    who = f"another process ({holder})" if holder else "another process"
    return StorageError(
        f"{label} is being written by {who}; wait for it to end, or stop it.{happened}",
        "busy",
    )


def gone_on(label: str, meanwhile: Sequence[Event]) -> StorageError:
    """Return the error for a session that has gone on elsewhere, with what happened there."""
    happened = f": {_turns_text(meanwhile)}" if meanwhile else ""
    return StorageError(
        f"{label} has gone on since it was opened{happened}. Nothing was written; open it again "
        "to go on from there.",
        "gone_on",
    )


def _turns_text(events: Sequence[Event]) -> str:
    """Return what was said and how it ended as a clause, of many turns only the last few."""
    parts: list[str] = []
    for event in events:
        if event.kind == "turn":
            words = str(event.data.get("words", ""))
            parts.append(f'"{words[:80]}" was said')
        elif event.kind == "end":
            parts.append(f"it came to {event.data.get('status')}")
    shown = parts[-6:] or [f"{len(events)} events were written"]
    return ", ".join(["...", *shown] if len(parts) > len(shown) else shown)
