"""Every command a front end can give, for many conversations in one process.

A conversation has one turn at a time, in whichever process; a stop is always let through. Front
ends show and parse, nothing else.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import closing, suppress
from typing import Any, Unpack

from ..tools.context import Settings
from ..tools.errors import FleetError, FormupError, InputError, StorageError
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from .agent import Agent
from .approvals import Waiting, check_nonce, is_waiting, waiting
from .conversation import NOTHING_SAID, Session
from .feed import Poses
from .fleet_owner import FleetOwner
from .open_sessions import OpenSessions
from .session import Run, SayOptions, Show
from .session_start import Opening
from .stopping import is_stop
from .store.copies import fork
from .store.protocol import Event, Store
from .turns import PATIENCE, Asked, Turn, check_key, digest_of, is_noted, note_stop

HOLDING = 2.0
"""Seconds that a fleet may take to confirm that its robots are held."""
ANYONE = Asked()


class Service:
    """Conversations by their ids.

    Args:
        agents: the agent of all conversations; or several by name, the first being the default.
        store: where conversations are stored.
        auto: whether simulated robots move as soon as a plan is certified.

    Attributes:
        ended: called with every turn at its end, to count it.
    """

    def __init__(
        self, agents: Agent | Mapping[str, Agent], store: Store, *, auto: bool = False
    ) -> None:
        self.agents = {"": agents} if isinstance(agents, Agent) else dict(agents)
        self.store = store
        self.ended: Callable[[Turn], None] = lambda turn: None
        self._owner = FleetOwner(store)
        self._turns: dict[str, Turn] = {}
        self._open = OpenSessions(store, self.agents, self._owner, self._turns, auto=auto)
        self._sessions, self._feeds = self._open.sessions, self._open.feeds
        self._waiting: dict[str, tuple[int | None, Waiting | None]] = {}
        self._watcher: asyncio.Task[None] | None = None

    def open(
        self,
        picture: Picture,
        *,
        settings: Settings | None = None,
        pointed: Sequence[TargetPrompt] = (),
        keep_out: Sequence[TargetPrompt] = (),
        name: str = "",
        agent: str | None = None,
        owner: str = "",
    ) -> str:
        """Begin a conversation about a picture.

        Args:
            name: what a person calls the conversation.
            agent: name of the agent; the first one by default.
            owner: who owns the conversation; its id then begins with that.

        Returns:
            The conversation's id.

        Raises:
            InputError: there is no such agent, or the conversation cannot be stored.
        """
        opening = Opening(
            agent=next(iter(self.agents)) if agent is None else agent,
            settings=settings or Settings(),
            pointed=tuple(pointed),
            keep_out=tuple(keep_out),
        )
        decides = self.agent_named(opening.agent)
        decides.check(opening.settings)
        stored = self.store.create(name, owner=owner)
        facts = decides.facts(picture, stored.artefacts)
        with closing(stored.write(0)) as log:
            log.append("session", {**facts, "opening": opening.model_dump(mode="json")})
        self.reopen(stored.id, picture)
        return stored.id

    def reopen(self, session: str, picture: Picture | None = None) -> Session:
        """Open a stored conversation, to go on with it.

        Args:
            picture: its picture, if that is no longer stored with it.

        Raises:
            InputError: the conversation is missing or damaged, or the picture is another.
        """
        if session not in self._sessions:
            self._open.keep(session, *self._open.load(session, picture))
        return self._sessions[session]

    def session(self, session: str) -> Session:
        """Return a conversation that is open.

        Raises:
            InputError: it is not open here.
        """
        if session not in self._sessions:
            raise InputError(f"The session {session!r} is not open here.", "missing")
        return self._sessions[session]

    def agent_named(self, name: str) -> Agent:
        """Return the agent of a name.

        Raises:
            InputError: there is none.
        """
        if name not in self.agents:
            there = ", ".join(filter(None, self.agents)) or "one without a name"
            raise InputError(f"There is no agent {name!r} here; there is {there}.", "missing")
        return self.agents[name]

    async def fresh(self, session: str) -> Session:
        """Return a conversation as stored, read again if another process has gone on with it.

        Raises:
            InputError: the conversation is missing or damaged.
        """
        held = self._sessions.get(session)
        return held if held and session in self._turns else await self._open.current(session)

    def say(
        self, session: str, words: str, asked: Asked = ANYONE, **options: Unpack[SayOptions]
    ) -> Turn:
        """Begin a turn with what the person says next; see `Session.asay`.

        Raises:
            InputError: a turn is under way (`busy`). When the turn is awaited: an argument cannot
                be used, or its key was used before (`key`, `repeated`).
        """
        if is_stop(words, driving=session in self._turns):
            turn = Turn(asked, "", "stop")
            turn.task = asyncio.ensure_future(self._stopped(session, asked))
            return turn
        return self._begin(session, asked, "say", words, **options)

    async def _stopped(self, session: str, asked: Asked) -> Run:
        run = await self.stop(session, asked)
        if run is None:
            raise InputError(NOTHING_SAID)
        return run

    def edit(self, session: str, *edits: dict[str, Any], asked: Asked = ANYONE) -> Turn:
        """Change the current plan by edits as `edit_formation` takes them."""
        return self._begin(session, asked, "edit", *edits)

    def undo(
        self, session: str, steps: int = 1, to: str | None = None, asked: Asked = ANYONE
    ) -> Turn:
        """Go back to an earlier plan; negative `steps` go forward again."""
        return self._begin(session, asked, "undo", steps, to)

    def go(
        self,
        session: str,
        plan_id: str | None = None,
        show: Show | None = None,
        asked: Asked = ANYONE,
    ) -> Turn:
        """Drive the robots to a plan, by default the current one."""
        return self._begin(session, asked, "go", plan_id, show=show)

    def image(self, session: str, picture: Picture, asked: Asked = ANYONE) -> Turn:
        """Go on with another picture; see `Session.aimage`."""
        return self._begin(session, asked, "image", picture)

    def approve(
        self,
        session: str,
        plan_id: str,
        nonce: str,
        show: Show | None = None,
        asked: Asked = ANYONE,
    ) -> Turn:
        """Approve exactly one plan, and drive real robots to it.

        Args:
            nonce: of the call that waits, as given by `waits`.
        """

        def check(held: Session) -> None:
            check_nonce(held.run, plan_id, nonce)

        return self._begin(session, asked, "approve", plan_id, show=show, check=check)

    async def waits(self, session: str) -> Waiting | None:
        """Return the call that waits for a person's yes, the same one until answered, or None."""
        run = (await self.fresh(session)).run
        events = None if run is None else run.events
        if self._waiting.get(session, (None, None))[0] != events:
            self._waiting[session] = (events, waiting(run))
        return self._waiting[session][1] if run is not None else None

    def waiting(self) -> set[str]:
        """Return the conversations in memory in which a call waits for a person's yes."""
        return {name for name, held in self._sessions.items() if is_waiting(held.run)}

    async def stop(self, session: str, asked: Asked = ANYONE) -> Run | None:
        """Hold the robots at once, and end the turn under way, in whichever process it is.

        Returns:
            The run of that turn, or of one that says they are held; None if nothing was said yet.
        """
        while True:
            if (turn := self._turns.get(session)) is not None:
                if (cut := await self._end_turn(session, turn)) is not None:
                    return cut
                continue  # the turn had not begun
            held = await self.fresh(session)
            problem = await self._hold_in_time(held)
            if session in self._turns:
                continue
            if problem is not None:
                raise problem
            if held.run is None:
                return None
            try:
                return await self._begin(session, asked, "stop").ended()
            except InputError as error:
                if error.kind not in ("busy", "gone_on"):
                    raise
            if session not in self._turns:
                await asyncio.to_thread(note_stop, self._feeds[session].stored)
                await asyncio.sleep(PATIENCE / 3)

    async def _end_turn(self, session: str, turn: Turn) -> Run | None:
        """Hold the robots of a turn that runs here and end it, even if a fleet is out of reach."""
        if turn.name == "stop":
            return await turn.ended()
        problem = await self._hold_in_time(self._sessions.get(session))
        turn.cancel()
        run = await turn.ended()
        if problem is not None:
            raise problem
        return run

    async def _hold_in_time(self, held: Session | None) -> FleetError | None:
        """Hold all robots within HOLDING seconds; return what went wrong, or None."""
        try:
            async with asyncio.timeout(HOLDING):
                await self.hold()
                if held is not None:
                    await held.ahold()
        except FleetError as error:
            return error
        except TimeoutError:
            return FleetError(f"The robots did not say within {HOLDING:g} s that they are held.")
        return None

    async def hold(self) -> None:
        """Hold the real robots of this process, whoever drives them."""
        await self._owner.hold()

    def point(self, session: str, *prompts: TargetPrompt) -> None:
        """Note what the person points at with their next words."""
        held = self.session(session)
        held.pointed = (*held.pointed, *prompts)

    def turn(self, session: str) -> Turn | None:
        """Return the turn that is under way in this process, or None."""
        return self._turns.get(session)

    def last_turn(self, session: str) -> int:
        """Return the number of the event that began the last turn in this process, or 0."""
        feed = self._feeds.get(session)
        return feed.turn.number if feed and feed.turn else 0

    def was_asked(self, session: str, key: str) -> bool:
        """Return whether a turn of a conversation in memory was asked for under a key."""
        return key in self._feeds[session].keys

    def is_written(self, session: str) -> bool:
        """Return whether a turn of a conversation is under way, here or in another process."""
        if session in self._turns:
            return True
        stored = self.store.open(session)
        try:
            stored.write(len(stored.events())).close()
        except StorageError as error:
            return error.kind in ("busy", "gone_on")
        return False

    def fork(self, session: str, turn: int | None = None) -> str:
        """Copy a conversation, which stays as it is, into a new one and return the new id.

        Args:
            turn: how many turns to copy; all by default.
        """
        made = fork(self.store, self.store.open(session), turn)
        self.reopen(made.id)
        return made.id

    def events(self, session: str, after: int = 0) -> tuple[Event, ...]:
        """Return the events of a conversation with numbers greater than `after`."""
        return self.store.open(session).events(after)

    async def follow(
        self, session: str, after: int = 0, *, watching: bool = False
    ) -> AsyncGenerator[Event | Poses]:
        """Yield what happens in a conversation, as it happens; see `Feed.subscribe`."""
        await self.fresh(session)
        async for told in self._feeds[session].subscribe(after, watching=watching):
            yield told

    async def delete(self, session: str) -> None:
        """Stop a conversation and delete it."""
        if session in self._turns:
            await self.stop(session)
        await asyncio.to_thread(self.store.delete, session)
        self._open.drop(session)
        self._waiting.pop(session, None)

    async def leave(self) -> None:
        """Stop all turns, which holds their robots, and end all subscriptions."""
        await asyncio.gather(*map(self.stop, self._turns), return_exceptions=True)
        for feed in self._feeds.values():
            feed.end()

    async def close(self) -> None:
        """Stop everything as `leave` does, then close models, fleets and the store."""
        await self.leave()
        if self._watcher is not None:
            self._watcher.cancel()
            await asyncio.wait({self._watcher})  # until it has finished reading the store
        for held in self._sessions.values():
            if held.run is not None:
                await held.run.context.services.close_fleets()
        await self._owner.close()
        for agent in self.agents.values():
            await agent.aclose()
        self.store.close()

    def _begin(
        self,
        session: str,
        asked: Asked,
        name: str,
        *arguments: Any,
        check: Callable[[Session], None] | None = None,
        **options: Any,
    ) -> Turn:
        """Begin a turn, or return the one under way that was begun under the same key."""
        turn, now = Turn(asked, digest_of(name, arguments, options), name), self._turns.get(session)
        if now is not None:
            if asked.key is not None and now.asked.key == asked.key:
                check_key(turn, {asked.key: (now.digest, now.number)}, again=True)
                return now
            raise InputError("A turn is under way; wait for it, or stop it.", "busy")

        async def work() -> Run:
            held = await self._open.current(session)
            turn.acting, feed = True, self._feeds[session]
            check_key(turn, feed.keys)
            if check is not None:
                check(held)
            feed.turn, feed.loop = turn, asyncio.get_running_loop()
            held.may_move = asked.may_move
            return await getattr(held, f"a{name}")(*arguments, **options)

        def over(task: asyncio.Task[Run]) -> None:
            self._turns.pop(session, None)
            self.ended(turn)
            if not task.cancelled():
                task.exception()  # retrieved here, in case nobody awaits the turn

        self._turns[session] = turn
        turn.task = asyncio.ensure_future(work())
        turn.task.add_done_callback(over)
        if self._watcher is None or self._watcher.done():
            self._watcher = asyncio.ensure_future(self._watch())
        return turn

    async def _watch(self) -> None:
        """Stop the turns that other processes want stopped, while there are any."""
        while self._turns:
            await asyncio.sleep(PATIENCE)
            for session, turn in list(self._turns.items()):
                feed = self._feeds.get(session)
                with suppress(FormupError):  # a store that fails now is asked again
                    if feed is not None and await is_noted(feed.stored, turn.number):
                        await self.stop(session)
