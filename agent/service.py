"""Every command a front end can give, for many conversations in one process.

One turn at a time per conversation; stop passes always. Front ends show and parse, nothing else.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Unpack

from ..tools.context import Settings
from ..tools.errors import InputError
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from .agent import Agent
from .conversation import Session
from .session import Run, SayOptions, Show, load_run
from .store.copies import fork
from .store.protocol import Event, Store


class Service:
    """Conversations by their ids.

    Args:
        agent: who decides in all of them.
        store: where they are written.
        auto: whether simulated robots move as soon as a plan is certified.
    """

    def __init__(self, agent: Agent, store: Store, *, auto: bool = False) -> None:
        self.agent, self.store, self.auto = agent, store, auto
        self._sessions: dict[str, Session] = {}
        self._turns: dict[str, asyncio.Task[Run]] = {}

    def open(
        self,
        picture: Picture,
        *,
        settings: Settings | None = None,
        pointed: Sequence[TargetPrompt] = (),
        keep_out: Sequence[TargetPrompt] = (),
        name: str = "",
    ) -> str:
        """Begin a conversation about a picture.

        Returns:
            Its id.
        """
        stored = self.store.create(name)
        self._sessions[stored.id] = self.agent.start(
            picture,
            pointed=pointed,
            keep_out=keep_out,
            settings=settings,
            stored=stored,
            auto=self.auto,
        )
        return stored.id

    def reopen(self, session: str, picture: Picture | None = None) -> Session:
        """Go on with a conversation that is stored.

        Args:
            picture: where it is not stored beside it any more.

        Raises:
            InputError: there is none, it is damaged, or the picture is another.
        """
        if session not in self._sessions:
            stored = self.store.open(session)
            run = load_run(stored, picture)
            made = Session(self.agent, run.context.picture, run.context.settings, auto=self.auto)
            self._sessions[session] = replace(made, run=run, stored=stored)
        return self._sessions[session]

    def session(self, session: str) -> Session:
        """A conversation that is open.

        Raises:
            InputError: it is not.
        """
        if session not in self._sessions:
            raise InputError(f"The session {session!r} is not open here.", "missing")
        return self._sessions[session]

    async def say(self, session: str, words: str, **options: Unpack[SayOptions]) -> Run:
        """What a person says next; see `Session.asay`.

        Raises:
            InputError: a turn of it is under way (`busy`), or something given cannot be used.
        """
        return await self._turn(session, self.session(session).asay(words, **options))

    async def edit(self, session: str, *edits: dict[str, Any]) -> Run:
        """Change the plan that stands, by edits as `edit_formation` takes them."""
        return await self._turn(session, self.session(session).aedit(*edits))

    async def undo(self, session: str, steps: int = 1, to: str | None = None) -> Run:
        """Go back to the plan before; `steps` below 0 forward again."""
        return await self._turn(session, self.session(session).aundo(steps, to))

    async def go(self, session: str, plan_id: str | None = None, show: Show | None = None) -> Run:
        """Drive the robots to a plan, the one that stands by default."""
        return await self._turn(session, self.session(session).ago(plan_id, show))

    async def image(self, session: str, picture: Picture) -> Run:
        """Go on with another picture; see `Session.aimage`."""
        return await self._turn(session, self.session(session).aimage(picture))

    async def approve(self, session: str, plan_id: str, show: Show | None = None) -> Run:
        """Approve exactly one plan, and drive real robots to it."""
        return await self._turn(session, self.session(session).aapprove(plan_id, show))

    async def stop(self, session: str) -> Run | None:
        """Hold the robots at once, and end the turn that runs.

        Returns:
            That turn, or one that says that they are held; None before anything was said.
        """
        held, turn = self.session(session), self._turns.get(session)
        await held.ahold()
        if turn is None:
            return await held.astop() if held.run is not None else None
        if not turn.cancelling():  # said twice, it would cut off what is written in the end
            turn.cancel()
        return await turn

    def point(self, session: str, *prompts: TargetPrompt) -> None:
        """What the person points at with their next words."""
        held = self.session(session)
        held.pointed = (*held.pointed, *prompts)

    def fork(self, session: str, turn: int | None = None) -> str:
        """A conversation of its own that begins as another did.

        Args:
            turn: after how many turns of it; all by default.

        Returns:
            Its id. The other one stays as it is.
        """
        made = fork(self.store, self.store.open(session), turn)
        self.reopen(made.id)
        return made.id

    def events(self, session: str, after: int = 0) -> tuple[Event, ...]:
        """What happened in a conversation, from a number on."""
        return self.store.open(session).events(after)

    async def close(self) -> None:
        """Let go of fleets, models and the store."""
        for held in self._sessions.values():
            if held.run is not None:
                await held.run.context.services.close_fleets()
        await self.agent.aclose()
        self.store.close()

    async def _turn(self, session: str, work: Any) -> Run:
        """One turn at a time."""
        if session in self._turns:
            work.close()
            raise InputError("A turn is under way; wait for it, or stop it.", "busy")
        task = self._turns[session] = asyncio.ensure_future(work)
        try:
            return await task
        finally:
            del self._turns[session]
