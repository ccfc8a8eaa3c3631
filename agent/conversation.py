"""A conversation: turn after turn about one picture, and the commands a person gives beside them.

Robots move when the person says go, or at once where they asked for that. What "go" is, is read
here and nowhere else, for every model alike.
"""

import asyncio
import copy
import re
from collections.abc import Awaitable, Callable, Coroutine, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, Unpack

from ..tools.context import Context, Services, Settings
from ..tools.errors import InputError
from ..tools.fleet.protocol import Fleet
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from .first_message import standing
from .model import Model
from .offline.followups import read_followup
from .offline.standing import Standing
from .outcomes import Paused
from .session import Run, SayOptions, Show
from .store.protocol import StoredSession
from .wrappers.commands import Commands

NOTHING_SAID = "Say what to do first, such as surround the coin with 6 robots."
HELD = "The robots are held where they are. Say what to change, or go to drive on."
DROPPED = "The question is dropped; nothing was changed."
UNCHANGED = "Nothing was changed. To take back the change before that, say undo."
MAY_NOT_MOVE = (
    "You may plan here but not move robots: nothing moves; somebody who may has to say go."
)
STOP = re.compile(
    r"(?=.*\b(?:stop|halt|freeze)\b)"
    r"(?:\W*(?:stop|halt|freeze|please|now|it|the|robots?|all|them|every\w*|team|"
    r"immediately|at|once|emergency|right|just|quick|oh|no|hey|ok|moving|driving|this|that)\b)+\W*"
)
"""A sentence that holds the robots at once, whoever else would have read it."""
CALLED_OFF = re.compile(
    r"\W*(?:(?:oh|ok|okay|no|well|ah|actually|please|then|just)\b\W*)*"
    r"(?:cancel|never ?mind|forget)(?: (?:about )?(?:it|that|this|the question))?"
    r"(?:\W+(?:please|then|thanks|thank you))*\W*"
)
"""A sentence that drops a question; a change is taken back by it only right after it was made."""
STOP_DRIVING = re.compile(r"\b(?:stop+|halt|freeze|hold|wait|abort|cancel|don'?t|whoa|enough)\b")
"""Words that do so in a short sentence while they drive: to stop once too often costs little."""
SHORT = 8
"""Words of a sentence that is short."""
YES, NO = frozenset({"y", "yes", "approve", "approved"}), frozenset({"n", "no", "nope"})
DROPS = frozenset({"query", "talk", "undo", "hold", "go"})
"""Kinds of what is said that are no answer to a question, which is dropped for them."""


class TurnTaker(Protocol):
    """What works on turns: an `Agent`, whose methods these are."""

    model: Model

    @property
    def arun(self) -> Callable[..., Awaitable[Run]]:
        """See `Agent.arun`."""
        ...

    @property
    def asay(self) -> Callable[..., Awaitable[Run]]:
        """See `Agent.asay`."""
        ...

    @property
    def aresume(self) -> Callable[..., Awaitable[Run]]:
        """See `Agent.aresume`."""
        ...

    async def aclose(self) -> None:
        """See `Agent.aclose`."""
        ...


@dataclass
class Session:
    """A conversation, as far as it has come; `run` is its last turn.

    Attributes:
        agent: who decides.
        picture: that it is about.
        settings: what the person fixed; the number of robots holds for the first turn.
        pointed: what they point at with their next words.
        keep_out: what no robot may enter, of the first turn.
        stored: where it is written, if it is.
        auto: whether simulated robots move as soon as a plan is certified.
        held: whether they are not to, until the person says go.
        may_move: whether who speaks may move robots; otherwise only plan.
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
        """What the person says next: an instruction, a change, a question, an answer, go or stop.

        Raises:
            InputError: something given cannot be used.
        """
        if is_stop(words):
            return await self.astop()
        show, pointed = options.get("show"), (*self.pointed, *options.get("pointed", ()))
        keep = options.get("keep_out", ())
        run, said = self.run, words
        if run is not None and CALLED_OFF.fullmatch(words.lower()):
            if isinstance(run.outcome, Paused):
                return await self.aact(words, text=DROPPED, show=show)
            if run.world.current == run.began.current:
                return await self.aact(words, text=UNCHANGED, show=show)
        if run is not None and isinstance(run.outcome, Paused):
            shown = (*pointed, *keep)
            if not shown and read_followup(words, self._standing(run)).kind not in DROPS:
                return self._keep(await self._answered(run, words, show))
            if shown:  # the answer is a point
                words = f"{run.report.instruction} {words}".strip()
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

    async def aact(
        self,
        words: str,
        *calls: tuple[str, dict[str, Any]],
        text: str = "",
        picture: Picture | None = None,
        show: Show | None = None,
    ) -> Run:
        """A turn that asks no model: calls of tools by the person.

        Args:
            words: what it is called in the log, such as /undo.
            calls: names of tools and their arguments.
            text: what is said where there are none.
            picture: another one from now on.

        Raises:
            InputError: nothing was said yet.
        """
        agent, run = self._commanded(calls, text), self._run
        moves = any(name == "deploy" for name, _ in calls)
        settings = self._fixed(run).model_copy(update={"may_deploy": moves})
        self.picture = picture or self.picture
        return self._keep(
            await agent.asay(run, words, settings=settings, picture=picture, show=show)
        )

    async def aundo(self, steps: int = 1, to: str | None = None) -> Run:
        """Go back to the plan before, `steps` below 0 forward again; robots stay where they are."""
        arguments = {"steps": steps} if to is None else {"to": to}
        words = f"/undo {to or steps}" if steps > 0 or to else f"/redo {-steps}"
        return await self.aact(words, ("undo", arguments))

    async def aimage(self, picture: Picture) -> Run:
        """Go on with another picture: plans are void, things are measured where they were."""
        run = self._run
        again = ", ".join(t.id for t in run.world.targets)
        text = f"It is {picture.name} from now on. Plans made before are void; say what to do."
        text += f" {again} will be looked for where it was." if again else ""
        return await self.aact(f"/image {picture.name}", text=text, picture=picture)

    async def aedit(self, *edits: dict[str, Any]) -> Run:
        """Change the plan that stands, by edits as `edit_formation` takes them."""
        return await self.aact("/edit", ("edit_formation", {"edits": list(edits)}))

    async def ago(self, plan_id: str | None = None, show: Show | None = None) -> Run:
        """Drive the robots to a plan, the one that stands by default."""
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
            InputError: it is not the plan that waits, or who speaks may not move robots.
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
        """Stop the fleets at once, whatever else runs."""
        if self.run is not None:
            services = self.run.context.services
            services.stopped.add(self.run.context.settings.fleet)
            await stop_all(services.fleets.values())

    def at(self, run: Run) -> "Session":
        """The same conversation at a turn of it, to go on differently; it is written nowhere."""
        return replace(self, run=replace(run, stored=None, events=0), stored=None)

    def fork(self) -> "Session":
        """A copy that goes on by itself; what was said so far is in both."""
        return self if self.run is None else self.at(self.run)

    def say(self, words: str, **options: Unpack[SayOptions]) -> Run:
        """See `asay`; the synchronous door, which works inside a running event loop too."""
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
        """What tools would work with now; to look and to try, for only turns decide anything."""
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
        """Give the turn that waits its answer."""
        outcome = run.outcome
        assert isinstance(outcome, Paused)
        if outcome.call.name == "ask_user":
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
        """The agent with the person's own calls in its model's place."""
        agent = copy.copy(self.agent)
        agent.model = Commands(calls, text)
        return agent

    def _standing(self, run: Run | None) -> Standing | None:
        """What follow-ups are read by."""
        if run is None:
            return None
        facts = standing(replace(run.context, world=run.world, steps=run.steps))
        size, scale = run.world.picture.size, run.world.metres_per_pixel
        return None if facts is None else Standing.of(facts, size=size, metres_per_pixel=scale)

    async def _for_turn(self, words: str) -> Settings:
        """What holds in the next turn, as its words say: whether robots move."""
        read = read_followup(words, self._standing(self.run))
        go = read.go or read.kind == "go"
        self.held = (self.held or read.hold or read.kind == "hold") and not go
        if go:
            self._check_move()
            await self._release()
        moves = go or (self.auto and self.may_move and not self.held)
        return self._fixed(self.run).model_copy(update={"may_deploy": moves})

    def _check_move(self) -> None:
        """Refuse to move robots for who may only plan.

        Raises:
            InputError: saying so (`not_allowed`).
        """
        if not self.may_move:
            raise InputError(MAY_NOT_MOVE, "not_allowed")

    def _fixed(self, run: Run | None) -> Settings:
        if run is None:
            return self.settings
        once = {"robots": None, "starts": None, "approved": None}
        return run.context.settings.model_copy(update=once)

    async def _release(self) -> None:
        """Lift a stop: the person says go."""
        if self.run is not None:
            services = self.run.context.services
            services.stopped.clear()
            for fleet in services.fleets.values():
                await fleet.release()

    def _sync(self, turn: Coroutine[Any, Any, Run]) -> Run:
        return in_own_loop(self._closing(turn))

    async def _closing(self, turn: Coroutine[Any, Any, Run]) -> Run:
        """A turn after which nothing stays open: connections cannot outlive their event loop."""
        try:
            return await turn
        finally:
            if self.run is not None:
                await self.run.context.services.close_fleets()
            await self.agent.aclose()


async def stop_all(fleets: Iterable[Fleet]) -> None:
    """Stop each fleet, also where another cannot be.

    Raises:
        FleetError: the first that could not be.
    """
    ends = await asyncio.gather(*(fleet.stop() for fleet in fleets), return_exceptions=True)
    for problem in ends:
        if isinstance(problem, BaseException):
            raise problem


def is_stop(words: str, *, driving: bool = False) -> bool:
    """Whether words say to hold the robots at once.

    Args:
        driving: whether a turn is under way, which may drive them.
    """
    said = words.lower()
    if driving:
        return len(said.split()) <= SHORT and STOP_DRIVING.search(said) is not None
    return STOP.fullmatch(said) is not None


def in_own_loop(work: Coroutine[Any, Any, Any]) -> Any:
    """Run to its end from code that does not await, inside a running event loop too."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(work)
    with ThreadPoolExecutor(1) as thread:  # as in a notebook
        return thread.submit(asyncio.run, work).result()
