"""Turns that somebody asked for and that are under way; under one key each is done only once."""

import asyncio
import hashlib
import time
from collections.abc import Coroutine, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic_core import PydanticSerializationError, to_json

from ..tools.errors import InputError
from ..tools.perception.image import Picture
from ..tools.tool import to_its_end
from .session import Run
from .store.protocol import Event, StoredSession

PATIENCE = 0.3
"""Seconds between looks at whether a turn was stopped from another process."""


@dataclass(frozen=True)
class Asked:
    """Who asks for a turn.

    Attributes:
        by: their name; empty where there is only one who could.
        key: their key for this turn: asked for again under the same key, it is not done again.
        may_move: whether robots may be moved for them.
    """

    by: str = ""
    key: str | None = None
    may_move: bool = True


@dataclass(eq=False)
class Turn:
    """A turn under way; awaiting it gives its run.

    Attributes:
        name: of the command.
        acting: whether it holds the conversation that it changes.
        digest: hash of what was asked for, to tell whether a key was used for the same before.
        number: of the event that began it; 0 before that is written.
        since: when it was asked for, by the monotonic clock.
        moving: set once robots are about to move.
    """

    asked: Asked
    digest: str
    name: str = "say"
    acting: bool = False
    task: "asyncio.Task[Run]" = field(init=False)
    number: int = 0
    since: float = field(default_factory=time.monotonic)
    began: asyncio.Event = field(default_factory=asyncio.Event)
    moving: asyncio.Event = field(default_factory=asyncio.Event)
    _cancelled: bool = False

    def __await__(self) -> Generator[Any, None, Run]:
        """Wait for the turn's end and return its run."""
        return self.task.__await__()

    async def begin(self) -> None:
        """Wait until the event that begins the turn is written, or the turn has ended.

        Raises:
            InputError: the turn could not begin.
        """
        await self._first(self.began.wait(), None)
        if self.task.done():
            self._result()

    async def wait(self, seconds: float, *, moving: bool = True) -> Run | None:
        """Return the run if the turn ends within so many seconds, else None.

        Args:
            moving: whether to stop waiting as soon as the turn drives robots.

        Raises:
            InputError: the turn could not begin.
        """
        waits = self.moving.wait() if moving else asyncio.sleep(seconds)
        await self._first(waits, seconds)
        return self._result() if self.task.done() else None

    def _result(self) -> Run:
        if self.task.cancelled():
            raise InputError("That was stopped before it began; nothing was done.", "busy")
        return self.task.result()

    async def _first(self, waits: Coroutine[Any, Any, object], seconds: float | None) -> None:
        """Wait for the turn's end or something else, whichever comes first."""
        other = asyncio.ensure_future(waits)
        try:
            first = asyncio.FIRST_COMPLETED
            await asyncio.wait({self.task, other}, timeout=seconds, return_when=first)
        finally:
            other.cancel()

    async def ended(self) -> Run | None:
        """Return the run of the stopped turn, or None if it had not begun."""
        try:
            return await self.task
        except asyncio.CancelledError:
            return None

    def cancel(self) -> None:
        """Cancel the turn, once only, so that it can write how it ended."""
        if not self._cancelled:
            self._cancelled = True
            self.task.cancel()

    def heard(self, event: Event) -> None:
        """Take note of an event that was written."""
        if event.kind in ("turn", "resume"):
            self.number = event.number
            self.began.set()
        elif event.kind == "moving":
            self.moving.set()

    @property
    def stamp(self) -> dict[str, Any]:
        """What the event that begins the turn records of who asked for it."""
        said = {"by": self.asked.by, "key": self.asked.key}
        return {k: v for k, v in said.items() if v} | (
            {"digest": self.digest} if self.asked.key else {}
        )


def check_key(turn: Turn, before: Mapping[str, tuple[str, int]], *, again: bool = False) -> None:
    """Refuse a turn that was asked for before under the same key.

    Args:
        before: the digest and the number of each turn that was asked for, by its key.
        again: whether the same request is fine, because it joins the turn that is under way.

    Raises:
        InputError: the key was used with other arguments (`key`), or with the same ones
            (`repeated`; `turn` is the number of that turn).
    """
    key = turn.asked.key
    if key is None or key not in before:
        return
    digest, number = before[key]
    if digest != turn.digest:
        raise InputError(
            f"The key {key!r} was used for something else in this session; use a new one for "
            "each thing you ask for.",
            "key",
        )
    if not again:
        raise InputError(f"That was done before, as turn {number}.", "repeated", turn=number)


def digest_of(name: str, arguments: Sequence[Any], options: Mapping[str, Any]) -> str:
    """Return a hash of what is asked for, without `show`, which is only for display."""
    named = [(k, _as_json(v)) for k, v in sorted(options.items()) if k != "show"]
    try:
        said = to_json([name, *map(_as_json, arguments), named])
    except PydanticSerializationError:
        raise InputError(
            "What was sent holds characters that are no text; leave them out."
        ) from None
    return hashlib.sha256(said).hexdigest()[:32]


def _as_json(value: Any) -> Any:
    """Return an argument for JSON: a picture as its hash, others as they are."""
    return value.sha256 if isinstance(value, Picture) else value


def note_stop(stored: StoredSession) -> None:
    """Leave a file with a session, so that the process which writes the session stops its turn.

    Raises:
        StorageError: the file cannot be written.
    """
    begun = [event.number for event in stored.events() if event.kind in ("turn", "resume")]
    if begun:
        stored.artefacts.put(_note(stored.id, begun[-1]))


def _note(session: str, turn: int) -> bytes:
    return to_json(["stop", session, turn])


async def is_noted(stored: StoredSession, turn: int) -> bool:
    """Return whether another process wants a turn stopped."""
    name = hashlib.sha256(_note(stored.id, turn)).hexdigest()
    return turn > 0 and await to_its_end(lambda: name in stored.artefacts)
