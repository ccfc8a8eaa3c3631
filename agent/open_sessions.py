"""The conversations that a process has in memory: as they are stored, and not too many."""

import asyncio
from collections.abc import Mapping, Sequence

from ..tools.context import Services
from ..tools.errors import InputError
from ..tools.perception.image import Picture
from .agent import Agent
from .conversation import Session
from .feed import FedSession, Feed
from .fleet_owner import FleetOwner
from .reading import read_conversation
from .store.protocol import Event, Store
from .turns import Turn

MOST_OPEN, MOST_BYTES = 128, 2**30
"""Most conversations in memory, and most bytes of their pictures; others are read when needed."""


class OpenSessions:
    """Conversations by their ids, with their feeds.

    Args:
        turns: the turns under way, by the ids of their conversations.
        auto: whether simulated robots move as soon as a plan is certified.
    """

    def __init__(
        self,
        store: Store,
        agents: Mapping[str, Agent],
        owner: FleetOwner,
        turns: Mapping[str, Turn],
        *,
        auto: bool,
    ) -> None:
        self._store, self._agents, self._owner, self._auto = store, agents, owner, auto
        self._turns = turns
        self.sessions: dict[str, Session] = {}
        self.feeds: dict[str, Feed] = {}
        self._stopped: dict[str, set[str]] = {}

    async def current(self, session: str) -> Session:
        """Return a conversation as stored, read again if another process has gone on with it.

        Raises:
            InputError: the conversation is missing (`missing`; it is then dropped) or damaged.
        """
        try:
            return await self._current(session)
        except InputError as error:
            if error.kind == "missing":
                self.drop(session)
            raise

    async def _current(self, session: str) -> Session:
        held = self.sessions.pop(session, None)
        if held is not None:
            self.sessions[session] = held  # now the last one used
            last = held.begun if held.run is None else held.run.events
            stored = self.feeds[session].stored
            if last is not None and not await asyncio.to_thread(stored.events, last):
                return held
        loaded = await asyncio.to_thread(self.load, session, None)
        turn, now = self._turns.get(session), self.sessions.get(session)
        if now is None or (now is held and not (turn and turn.acting)):
            self.keep(session, *loaded)
        return self.sessions[session]

    def load(self, session: str, picture: Picture | None) -> tuple[Sequence[Event], Session]:
        """Read a conversation and its events from the store; may be called in any thread.

        Raises:
            InputError: the conversation is missing or damaged, or the picture is another.
        """
        stored = self._store.open(session)
        events, old = stored.events(), self.sessions.get(session)
        feed = self.feeds.setdefault(session, Feed(stored, ()))
        services = Services(claim=self._owner.claim, watch=feed.moved, view=feed.view)
        services.stopped |= self._stopped.get(session, set())
        if old is not None and old.services is not None:
            services.stopped |= old.services.stopped
            services.view = old.services.view
            services.fleets |= {n: f for n, f in old.services.fleets.items() if f.real}
        fed = FedSession(stored, feed)
        return events, read_conversation(fed, events, self._agents, picture, services)

    def keep(self, session: str, events: Sequence[Event], made: Session) -> None:
        """Put a conversation in memory, and drop the least recently used ones if there are many."""
        self._stopped.pop(session, None)
        made.auto, feed = self._auto, self.feeds[session]
        for event in events[feed.last :]:
            feed.publish(event)
        self.sessions[session] = made
        for name in list(self.sessions)[:-1]:
            held = sum(s.picture.pixels.nbytes for s in self.sessions.values())
            if len(self.sessions) <= MOST_OPEN and held <= MOST_BYTES:
                break
            self._forget(name)

    def _forget(self, session: str) -> None:
        """Drop a conversation, which can be read again, unless it has a turn or real robots."""
        services = self.sessions[session].services or Services()
        if session in self._turns or any(fleet.real for fleet in services.fleets.values()):
            return
        if services.is_stopped:
            names = {name for name, fleet in services.fleets.items() if fleet.stopped}
            self._stopped[session] = services.stopped | names
        del self.sessions[session]
        if not self.feeds[session].followers:
            del self.feeds[session]

    def drop(self, session: str) -> None:
        """Drop a conversation that is deleted, and end its subscriptions."""
        self.sessions.pop(session, None)
        self._stopped.pop(session, None)
        if (feed := self.feeds.pop(session, None)) is not None:
            feed.end()
