"""Sends what happens in a session to any number of subscribers as it is written.

Events come in order and without gaps, from whatever number a subscriber has seen; of poses only
the latest are sent, so a slow subscriber holds up nobody, least of all robots.
"""

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ..tools.context import Context, Shown
from ..tools.errors import StorageError
from ..tools.fleet.follow import Rigid
from ..tools.fleet.pace import pace_of
from ..tools.fleet.protocol import Fleet, Pose
from ..tools.formation.plan import Plan
from .store.protocol import Event, EventKind, EventLog, StoredSession
from .turns import Turn

MOST_KEPT = 256
"""Events held in memory for subscribers that follow closely; others are read from the store."""
POLL = 1.0
"""Seconds between looks at whether another process has gone on with the session."""
STAMPED = ("turn", "resume")
"""Kinds of events that record who asked for them."""


def _shown_by_fleet(poses: tuple[Pose, ...], moved: Rigid | None = None, /) -> None:
    """Do nothing: the poses are passed to `Feed.moved` as well."""


@dataclass(frozen=True)
class Poses:
    """Where all robots of the fleet were seen last.

    Attributes:
        number: of the observation, from 1; a subscriber may skip some.
    """

    number: int
    poses: tuple[Pose, ...]


class Feed:
    """What happens in one session.

    Args:
        stored: the session in its store.
        events: the events it has so far.

    Attributes:
        last: the number of the last event.
        loop: event loop of subscribers and turns; None before there are any.
        turn: the turn that is under way in this process, or the last one.
        followers: how many subscribers there are.
        watching: how many of them watch the robots.
        keys: digest and event number of each turn that was asked for under a key, by that key.
    """

    def __init__(self, stored: StoredSession, events: Sequence[Event]) -> None:
        self.stored, self.last = stored, 0
        self.turn: Turn | None = None
        self.loop: asyncio.AbstractEventLoop | None = None
        self.followers, self.watching, self._ended = 0, 0, False
        self.keys: dict[str, tuple[str, int]] = {}
        self._kept: deque[Event] = deque(maxlen=MOST_KEPT)
        self._poses = Poses(0, ())
        self._changed = asyncio.Event()
        self._looked = time.monotonic()
        for event in events:
            self.publish(event)

    def publish(self, event: Event) -> None:
        """Send out an event that was written; may be called from any thread."""
        if self.loop is None or self.loop is running_loop():
            self._publish(event)
        else:
            self.loop.call_soon_threadsafe(self._publish, event)

    def _publish(self, event: Event) -> None:
        if event.number == self.last + 1:
            self.last = event.number
            self._kept.append(event)
            if key := event.data.get("key") if event.kind in STAMPED else None:
                self.keys[key] = (event.data["digest"], event.number)
            if self.turn is not None:
                self.turn.heard(event)
            self._wake()

    def moved(self, poses: tuple[Pose, ...]) -> None:
        """Send out where robots are."""
        self._poses = Poses(self._poses.number + 1, poses)
        self._wake()

    def end(self) -> None:
        """End all subscriptions once they have yielded what has happened so far."""
        self._ended = True
        self._wake()

    @contextmanager
    def view(self, context: Context, plan: Plan, fleet: Fleet) -> Generator[Shown]:
        """Let simulated robots drive in real time if anybody watches; see `Services.view`."""
        pace = pace_of(fleet) if self.watching else None
        if pace is None or pace.speed is not None:
            yield _shown_by_fleet
            return
        pace.speed = 1.0
        try:
            yield _shown_by_fleet
        finally:
            pace.speed = None

    async def subscribe(
        self, after: int = 0, *, watching: bool = False
    ) -> AsyncGenerator[Event | Poses]:
        """Yield events as they are written, from a number on, and the latest poses.

        Args:
            after: the number of the last event that the subscriber has seen.
            watching: whether a person watches the robots.

        Raises:
            StorageError: the session cannot be read.
        """
        self.followers += 1
        self.watching += watching
        self.loop = asyncio.get_running_loop()
        try:
            async for what in self._follow(after):
                yield what
        finally:
            self.followers -= 1
            self.watching -= watching

    async def _follow(self, after: int) -> AsyncGenerator[Event | Poses]:
        seen = 0
        while True:
            changed, poses = self._changed, self._poses
            for event in await self._since(after):
                yield event
                after = event.number
            if poses.number != seen:
                yield poses
                seen = poses.number
            if self._ended:
                return
            try:
                async with asyncio.timeout(POLL):
                    await changed.wait()
            except TimeoutError:
                await self._look()

    async def _since(self, after: int) -> tuple[Event, ...]:
        """Return the events with greater numbers."""
        if after >= self.last:
            return ()
        if self._kept and self._kept[0].number <= after + 1:
            return tuple(event for event in self._kept if event.number > after)
        return await asyncio.to_thread(self.stored.events, after)

    async def _look(self) -> None:
        """Publish what another process has written; one subscriber looks for all."""
        if time.monotonic() - self._looked >= POLL:
            self._looked = time.monotonic()
            try:
                for event in await asyncio.to_thread(self.stored.events, self.last):
                    self.publish(event)
            except StorageError as error:
                if error.kind != "missing":
                    raise
                self.end()

    def _wake(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()


def running_loop() -> asyncio.AbstractEventLoop | None:
    """Return the event loop that runs in this thread, or None."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None


class FedSession:
    """A stored session whose feed sends out what is written."""

    def __init__(self, stored: StoredSession, feed: Feed) -> None:
        self._stored, self._feed = stored, feed
        self.id, self.label, self.artefacts = stored.id, stored.label, stored.artefacts

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `StoredSession.events`."""
        return self._stored.events(after)

    def write(self, after: int) -> EventLog:
        """See `StoredSession.write`."""
        return _FedLog(self._stored.write(after), self._feed)


class _FedLog:
    def __init__(self, log: EventLog, feed: Feed) -> None:
        self._log, self._feed = log, feed
        self.events, self.close = log.events, log.close

    @property
    def last(self) -> int:
        return self._log.last

    def append(self, kind: EventKind, data: Mapping[str, Any]) -> int:
        turn = self._feed.turn
        data = {**data, **turn.stamp} if turn is not None and kind in STAMPED else data
        number = self._log.append(kind, data)
        self._feed.publish(Event(number, kind, 0.0, data))
        return number
