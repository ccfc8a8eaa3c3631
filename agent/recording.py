"""Records a turn: each thing as it happens, in a thread, before anything follows from it.

A slow store holds up only the turn that writes to it: no other turn, no robots and no stop.
"""

import asyncio
import hashlib
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from functools import partial
from typing import Any

from ..tools.context import Artefacts
from ..tools.errors import InputError, StorageError
from ..tools.tool import to_its_end
from ..tools.world import World
from ..tools.world_changes import changes_since
from .loop import Recorder
from .messages import Message, Reply
from .session import Run, Show
from .store.protocol import EventLog


def message_facts(message: Message) -> dict[str, Any]:
    """Return a message as JSON, with the hashes and sizes of its images in their place."""
    images = () if isinstance(message, Reply) else message.images
    facts = message.model_dump(mode="json", exclude={"images"}, exclude_defaults=True)
    hashes = [{"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)} for data in images]
    return {"role": message.role, **facts} | {"images": hashes}


class LogRecorder(Recorder):
    """Writes what happens to a log, and shows it.

    Once robots have moved, a log that can no longer be written does not undo that: the turn goes
    on, and `problem` says what was wrong.

    Args:
        log: None to record nothing.
        world: the world as the log has it already; None where it has none yet.
    """

    def __init__(
        self, log: EventLog | None, artefacts: Artefacts, world: World | None, show: Show | None
    ) -> None:
        self._log, self._artefacts, self._world, self._show = log, artefacts, world, show
        self._moved = False
        self.problem: str | None = None

    @property
    def events(self) -> int | None:
        """How many events the log has; None if it could no longer be written."""
        return None if self.problem else 0 if self._log is None else self._log.last

    async def event(self, kind: Any, data: Mapping[str, Any]) -> None:
        """Write an event that does not change the world."""
        await self._try(lambda log: log.append(kind, data))

    async def message(self, message: Message, world: World) -> None:
        """Write what has changed in the world, then a message, and show the message."""
        await self.world(world)
        await self._try(lambda log: log.append("message", self._facts(message)))
        if self._show is not None:
            self._show(message)

    async def moving(self, plan_id: str, world: World) -> None:
        """Write that robots are about to move; a first move that cannot be written is prevented."""
        await self.world(world)
        await self.event("moving", {"plan_id": plan_id})
        self._moved = True
        await asyncio.sleep(0)  # a stop that came meanwhile takes effect first

    async def world(self, world: World) -> None:
        """Write what has changed in the world, if anything."""
        await self._try(lambda log: self._changes(log, world))

    async def end(self, world: World, facts: Mapping[str, Any]) -> None:
        """Write what has changed in the world, and how the turn ended."""
        await self._try(
            lambda log: (self._changes(log, world), log.append("end", facts)), last=True
        )

    def _changes(self, log: EventLog, world: World) -> None:
        changes = {} if world is self._world else changes_since(world, self._world)
        if changes:
            log.append("world", {"changes": changes})
        self._world = world

    def _facts(self, message: Message) -> dict[str, Any]:
        for image in () if isinstance(message, Reply) else message.images:
            self._artefacts.put(image)
        return message_facts(message)

    async def _try(self, write: Callable[[EventLog], object], *, last: bool = False) -> None:
        if (log := self._log) is None or self.problem is not None:
            return
        try:
            await to_its_end(lambda: write(log), last=last)
        except InputError as error:
            if not self._moved:
                raise
            self.problem = str(error)


@asynccontextmanager
async def recording(
    begin: Callable[[], EventLog] | None,
    artefacts: Artefacts,
    world: World | None,
    show: Show | None,
) -> AsyncGenerator[LogRecorder]:
    """Yield a recorder for a turn; `begin` opens its log, or is None if nothing is recorded.

    Raises:
        StorageError: the log cannot be opened.
    """
    log = None if begin is None else await to_its_end(begin)
    try:
        yield LogRecorder(log, artefacts, world, show)
    finally:
        if log is not None:
            await to_its_end(log.close, last=True)


def reopened(run: Run, show: Show | None) -> AbstractAsyncContextManager[LogRecorder]:
    """Return a recorder for a session that goes on.

    Raises:
        StorageError: another process writes its log, the log has gone on since it was read, or it
            could not be written to its end.
    """
    begin = None
    if run.stored is not None:
        if run.events is None:
            lost = "could not be written to its end; open it again with load_run."
            raise StorageError(f"{run.stored.label} {lost}")
        begin = partial(run.stored.write, run.events)
    return recording(begin, run.context.services.artefacts, run.world, show)
