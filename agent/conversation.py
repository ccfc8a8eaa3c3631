"""A conversation: turns about one picture, and the commands that a person gives between them.

Robots move when the person says go, or at once if they asked for that. What counts as "go" is
decided only here, in the same way for every model.
"""

import asyncio
import copy
from collections.abc import Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, Unpack

from ..tools.context import Context, Services, Settings
from ..tools.errors import InputError
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from .first_message import standing
from .offline.followups import read_followup
from .offline.standing import Standing
from .open_question import asked_again, asks, calls_off, check_settled, drops, whole_instruction
from .outcomes import Paused
from .said_measures import AGAIN, place_said, scale_said, scale_told
from .session import Run, SayOptions, Show
from .stopping import is_stop, stop_all
from .store.protocol import StoredSession
from .turn_taker import TurnTaker
from .wrappers.commands import Commands
from .wrappers.telling import Telling

NOTHING_SAID = "Say what to do first, such as surround the coin with 6 robots."
HELD = "The robots are held where they are. Say what to change, or go to drive on."
DROPPED = "The question is dropped; nothing was changed."
UNCHANGED = "Nothing was changed. To take back the change before that, say undo."
MAY_NOT_MOVE = (
    "You may plan here but not move robots: nothing moves; somebody who may has to say go."
)
YES, NO = frozenset({"y", "yes", "approve", "approved"}), frozenset({"n", "no", "nope"})


@dataclass
class Session:
    """A conversation so far; `run` is its last turn.

    Attributes:
        agent: takes the turns.
        picture: the picture that the conversation is about.
        settings: what the person fixed; the number of robots holds for the first turn only.
        pointed: what the person points at with their next words.
        keep_out: what no robot may enter, given with the first turn.
        stored: where the conversation is stored; None if it is not.
        auto: whether simulated robots move as soon as a plan is certified.
        held: whether robots are to wait, despite `auto`, until the person says go.
        may_move: whether the speaker may move robots, or may only plan.
        begun: how many events the store had before the first turn.
        services: what tools use beside the world, in the first turn.
        run: the last turn; None before the first.
    """

    agent: TurnTaker
    picture: Picture
    settings: Settings = field(default_factory=Settings)
    pointed: tuple[TargetPrompt, ...] = ()
    keep_out: tuple[TargetPrompt, ...] = ()
    stored: StoredSession | None = None
    auto: bool = False
    held: bool = False
    may_move: bool = True
    begun: int = 0
    services: Services | None = None
    run: Run | None = None

    async def asay(self, words: str, **options: Unpack[SayOptions]) -> Run:
        """Take the person's next words: an instruction, change, question or answer, go or stop.

        Raises:
            InputError: something given cannot be used.
        """
        if is_stop(words):
            return await self.astop()
        if self.run is not None and (scale := scale_said(words, self.run.world.picture.size)):
            return self._keep(await self._scaled(self.run, words, scale, options.get("show")))
        if asks(self.run and self.run.outcome) and (place := place_said(words)):
            options["pointed"] = (*options.get("pointed", ()), place)
            return await self._said("", options)
        return await self._said(words, options)

    async def _said(self, words: str, options: SayOptions) -> Run:
        """Take words that do not hold the robots."""
        show, pointed = options.get("show"), (*self.pointed, *options.get("pointed", ()))
        keep = options.get("keep_out", ())
        run, said = self.run, words
        if run is not None and isinstance(run.outcome, Paused):
            shown, kind = (*pointed, *keep), read_followup(words, self._standing(run)).kind
            if calls_off(words, undoing=kind != "undo"):
                return await self.aact(words, text=DROPPED, show=show)
            check_settled(run.outcome, kind)
            fresh = whole_instruction(words, run.world.metres_per_pixel, kind)
            if not (shown or fresh or drops(run.outcome, kind)):
                return self._keep(await self._answered(run, words, show))
            if shown:  # the answer is something pointed at
                words = f"{run.context.words} {words}".strip()
            elif fresh:
                words = said = fresh
        elif run is not None and calls_off(words) and run.world.current == run.began.current:
            return await self.aact(words, text=UNCHANGED, show=show)
        settings = await self._for_turn(words)
        if run is not None and words != said:  # the same instruction: its numbers still hold
            once = {name: getattr(run.context.settings, name) for name in ("robots", "starts")}
            settings = settings.model_copy(update=once)
        self.pointed = ()
        if run is None:
            made = self.agent.arun(
                self.picture,
                words,
                pointed=pointed,
                keep_out=(*self.keep_out, *keep),
                settings=settings,
                trace=self.stored,
                begun=self.begun,
                services=self.services,
                show=show,
            )
        else:
            made = self.agent.asay(
                run, words, pointed=pointed, keep_out=keep, settings=settings, show=show
            )
        return self._keep(await made)

    async def _scaled(self, run: Run, words: str, scale: float, show: Show | None) -> Run:
        """Note the picture's scale; a first instruction that left something open is read anew."""
        size = run.world.picture.size
        told = scale_told(scale, size)
        fixed: dict[str, Any] = {"metres_per_pixel": scale}
        if asks(run.outcome) and run.world.current is None:
            agent, said = copy.copy(self.agent), run.context.words
            agent.model = Telling(agent.model, told)
            for name in ("robots", "starts"):  # the same instruction: its numbers still hold
                fixed[name] = getattr(run.context.settings, name)
            settings = await self._for_turn(said)
        else:
            agent, said = self._commanded(text=told + AGAIN), words
            settings = self._fixed(run).model_copy(update={"may_deploy": False})
        settings = settings.model_copy(update=fixed)
        return await agent.asay(run, said, settings=settings, show=show)

    async def aact(
        self,
        words: str,
        *calls: tuple[str, dict[str, Any]],
        text: str = "",
        picture: Picture | None = None,
        show: Show | None = None,
    ) -> Run:
        """Take a turn without a model: the person's own tool calls.

        Args:
            words: the turn's name in the log, such as /undo.
            calls: names of tools and their arguments.
            text: the reply where there are no calls.
            picture: replaces the picture from now on.

        Raises:
            InputError: there was no turn yet.
        """
        agent, run = self._commanded(calls, text), self._run
        moves = any(name == "deploy" for name, _ in calls)
        settings = self._fixed(run).model_copy(update={"may_deploy": moves})
        self.picture = picture or self.picture
        return self._keep(
            await agent.asay(run, words, settings=settings, picture=picture, show=show)
        )

    async def aundo(self, steps: int = 1, to: str | None = None) -> Run:
        """Undo `steps` changes, or redo if below 0, or go back `to` a plan; robots do not move."""
        arguments = {"steps": steps} if to is None else {"to": to}
        words = f"/undo {to or steps}" if steps > 0 or to else f"/redo {-steps}"
        return await self.aact(words, ("undo", arguments))

    async def aimage(self, picture: Picture) -> Run:
        """Go on with another picture: plans are void, things are looked for where they were."""
        run = self._run
        again = ", ".join(t.id for t in run.world.targets)
        text = f"It is {picture.name} from now on. Plans made before are void; say what to do."
        text += f" {again} will be looked for where it was." if again else ""
        return await self.aact(f"/image {picture.name}", text=text, picture=picture)

    async def aedit(self, *edits: dict[str, Any]) -> Run:
        """Change the current plan by edits as `edit_formation` takes them."""
        return await self.aact("/edit", ("edit_formation", {"edits": list(edits)}))

    async def ago(self, plan_id: str | None = None, show: Show | None = None) -> Run:
        """Drive the robots to a plan, by default the current one."""
        run = self._run
        self._check_move()
        plan_id = plan_id or run.world.current
        if plan_id is None:
            return await self.aact("/go", text="There is no plan to go to yet; nothing moves.")
        await self._release()
        return await self.aact("/go", ("deploy", {"plan_id": plan_id}), show=show)

    async def aapprove(self, plan_id: str, show: Show | None = None) -> Run:
        """Approve one plan, and drive real robots to it.

        Raises:
            InputError: this plan does not wait for approval, or the speaker may not move robots.
        """
        run = self._run
        self._check_move()
        waits = run.outcome.plan_id if isinstance(run.outcome, Paused) else None
        if waits != plan_id:
            what = f"plan {waits} waits" if waits else "no plan waits for approval"
            raise InputError(f"{plan_id} cannot be approved: {what}.")
        return self._keep(await self._commanded().aresume(run, approve=True, show=show))

    async def astop(self) -> Run:
        """Hold all robots where they are; they drive on after the next go."""
        await self.ahold()
        return await self.aact("stop", text=HELD)

    async def ahold(self) -> None:
        """Stop the fleets at once, whatever else is running."""
        if self.run is not None:
            services = self.run.context.services
            services.stopped.add(self.run.context.settings.fleet)
            await stop_all(services.fleets.values())

    def at(self, run: Run) -> "Session":
        """Return the conversation as of a given turn, to go on differently; it is not stored."""
        return replace(self, run=replace(run, stored=None, events=0), stored=None)

    def fork(self) -> "Session":
        """Return a copy that goes on independently; the conversation so far is in both."""
        return self if self.run is None else self.at(self.run)

    def say(self, words: str, **options: Unpack[SayOptions]) -> Run:
        """See `asay`; the synchronous version, which works inside a running event loop too."""
        return self._sync(self.asay(words, **options))

    def undo(self, steps: int = 1, to: str | None = None) -> Run:
        """See `aundo`."""
        return self._sync(self.aundo(steps, to))

    def edit(self, *edits: dict[str, Any]) -> Run:
        """See `aedit`."""
        return self._sync(self.aedit(*edits))

    def go(self, plan_id: str | None = None) -> Run:
        """See `ago`."""
        return self._sync(self.ago(plan_id))

    def image(self, picture: Picture) -> Run:
        """See `aimage`."""
        return self._sync(self.aimage(picture))

    @property
    def context(self) -> Context:
        """The context that tools would get now, to inspect or try; only turns change anything."""
        if self.run is None:
            return Context.of(self.picture, self.settings, services=self.services)
        return replace(self.run.context, world=self.run.world, steps=self.run.steps)

    @property
    def _run(self) -> Run:
        if self.run is None:
            raise InputError(NOTHING_SAID)
        return self.run

    def _keep(self, run: Run) -> Run:
        self.run = run
        return run

    async def _answered(self, run: Run, words: str, show: Show | None) -> Run:
        """Resume the waiting turn with its answer."""
        outcome = run.outcome
        assert isinstance(outcome, Paused)
        if outcome.call.name == "ask_user":
            if again := asked_again(outcome.call, words, self._standing(run)):
                asking = self._commanded([("ask_user", again)])
                return await asking.aresume(run, answer=words, show=show)
            fixed = run.context.settings
            fixed = fixed.model_copy(update={"may_deploy": fixed.may_deploy and self.may_move})
            left = replace(run, context=replace(run.context, settings=fixed))
            return await self.agent.aresume(left, answer=words, show=show)
        if words.strip(" .!").lower() in NO:
            return await self._commanded().aresume(run, approve=False, answer=words, show=show)
        read = read_followup(words, self._standing(run))
        yes = read.go or read.kind == "go" or words.strip(" .!").lower() in YES
        if yes and outcome.plan_id is not None:
            return await self.aapprove(outcome.plan_id, show)
        settings = await self._for_turn(words)
        return await self.agent.asay(run, words, settings=settings, show=show)

    def _commanded(
        self, calls: Sequence[tuple[str, dict[str, Any]]] = (), text: str = ""
    ) -> TurnTaker:
        """Return the agent with the person's own calls in place of its model."""
        agent = copy.copy(self.agent)
        agent.model = Commands(calls, text)
        return agent

    def _standing(self, run: Run | None) -> Standing | None:
        """Return the current plan, by which follow-ups are read; None if there is none."""
        if run is None:
            return None
        facts = standing(replace(run.context, world=run.world, steps=run.steps))
        size, scale = run.world.picture.size, run.world.metres_per_pixel
        return None if facts is None else Standing.of(facts, size=size, metres_per_pixel=scale)

    async def _for_turn(self, words: str) -> Settings:
        """Return the settings of the next turn: its words decide whether robots may move."""
        read = read_followup(words, self._standing(self.run))
        go = read.go or read.kind == "go"
        self.held = (self.held or read.hold or read.kind == "hold") and not go
        if go:
            self._check_move()
            await self._release()
        moves = go or (self.auto and self.may_move and not self.held)
        return self._fixed(self.run).model_copy(update={"may_deploy": moves})

    def _check_move(self) -> None:
        """Check that the speaker may move robots.

        Raises:
            InputError: the speaker may only plan (`not_allowed`).
        """
        if not self.may_move:
            raise InputError(MAY_NOT_MOVE, "not_allowed")

    def _fixed(self, run: Run | None) -> Settings:
        if run is None:
            return self.settings
        once = {"robots": None, "starts": None, "approved": None}
        return run.context.settings.model_copy(update=once)

    async def _release(self) -> None:
        """Lift a stop, as the person says go."""
        if self.run is not None:
            services = self.run.context.services
            services.stopped.clear()
            for fleet in services.fleets.values():
                await fleet.release()

    def _sync(self, turn: Coroutine[Any, Any, Run]) -> Run:
        return in_own_loop(self._closing(turn))

    async def _closing(self, turn: Coroutine[Any, Any, Run]) -> Run:
        """Take a turn and close all connections, which cannot outlive their event loop."""
        try:
            return await turn
        finally:
            if self.run is not None:
                await self.run.context.services.close_fleets()
            await self.agent.aclose()


def in_own_loop(work: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine to its end from synchronous code, even inside a running event loop."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(work)
    with ThreadPoolExecutor(1) as thread:  # as in a notebook
        return thread.submit(asyncio.run, work).result()
