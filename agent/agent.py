"""The agent: a model, the tools and the loop put together for a session about a picture."""

import time
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from ..prompts import PromptLibrary
from ..tools.builtin import TOOLS
from ..tools.builtin.others import with_keep_outs
from ..tools.context import Artefacts, Context, Services, Settings
from ..tools.errors import InputError
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.tool import Tool, to_its_end
from ..tools.world import Target, World, to_json_values
from .conversation import Session, in_own_loop
from .first_message import check_turn, first_message, in_new_picture, pointed_at
from .limits import DEFAULT_LIMITS, Limits
from .loop import ANYTHING, Approval
from .loop import run as run_loop
from .messages import History, closed
from .model import Model, ShowText
from .outcomes import Cancelled, Paused
from .policy import Policy
from .providers.registry import model_named
from .recording import LogRecorder, recording, reopened
from .report import Report, make_report
from .session import (
    Run,
    RunOptions,
    Show,
    TurnOptions,
    answered_by,
    end_facts,
    picture_facts,
    with_confirmed_outline,
)
from .session_start import prompt_facts, start_facts
from .store.folder import FolderLog
from .store.folder_store import FolderSession
from .store.protocol import StoredSession
from .wrappers.model_finder import asking, check_sees
from .wrappers.telemetry import traced_model, traced_run, traced_tool
from .wrappers.two_stages import offered, prompt_named, staged

if TYPE_CHECKING:
    from opentelemetry.trace import Tracer


class Agent:
    """Carries out instructions on pictures.

    Args:
        model: a name (`offline`, `openai:NAME` and so on) or any object with a name and a `reply`
            method. Its `prompt`, if it has one, is the id, or the `id@vNNN`, of the prompt it is
            given by default; its `aclose`, if it has one, is awaited by `run` and `resume` when
            they are done.
        base_url: of the server, for models given by name.
        prompt: `id@vNNN`, `id@draft-NAME`, or an id for its current version; None for the current
            version of the model's own.
        library: where prompts are taken from; those shipped with formup by default.
        planner: a second model, which makes the formation without seeing the picture; the first
            then only says what is meant. The prompt is the planner's.
        tools: what the model may call.
        system: a text in place of a prompt; the offline planner reads neither.
        limits: bounds of each run.
        policy: which calls go ahead, wait for a person, or are refused.
        tracer: an OpenTelemetry tracer, given spans of runs, replies and tools, but no texts.
        show_text: for models given by name; see `model_named`.

    Raises:
        InputError: an unknown model or prompt, or a model that cannot be asked.
    """

    def __init__(
        self,
        model: str | Model = "offline",
        *,
        base_url: str | None = None,
        prompt: str | None = None,
        library: PromptLibrary | None = None,
        planner: str | Model | None = None,
        tools: tuple[Tool, ...] = TOOLS,
        system: str = "",
        limits: Limits = DEFAULT_LIMITS,
        policy: Policy = ANYTHING,
        tracer: "Tracer | None" = None,
        show_text: ShowText | None = None,
    ) -> None:
        if base_url is not None and not isinstance(model, str):
            raise InputError("A base URL goes with a model's name; this model is an object.")
        self.model = model_named(model, base_url, show_text) if isinstance(model, str) else model
        own = None if system else getattr(self.model, "prompt", None)
        self.library = library or PromptLibrary()
        name = (own if planner is None else "planner") if prompt is None else prompt
        self.prompt = None if name is None else prompt_named(self.library, name)
        self.prompts = () if self.prompt is None else (self.prompt,)
        self.names: tuple[str, str | None] = (self.model.name, None)
        if planner is not None:
            if isinstance(planner, str):
                planner = model_named(planner, base_url, show_text)
            self.model, self.prompts = staged(self.model, planner, str(name), self.library)
            self.names = self.model.names
        self.system = self.prompt.render() if self.prompt else system
        self.base_url, self.tools, self.limits, self.policy = base_url, tools, limits, policy
        self._tracer = tracer
        if tracer is not None:
            self.model = traced_model(self.model, tracer)
            self.tools = tuple(traced_tool(tool, tracer) for tool in tools)
        self.offered = offered(self.tools, None if planner else self.prompt)

    def run(self, picture: Picture, instruction: str, **options: Unpack[RunOptions]) -> Run:
        """Carry out one instruction; the synchronous version of `arun`.

        Raises:
            InputError: an argument cannot be used.
        """
        return self._sync(self.arun(picture, instruction, **options))

    async def arun(
        self,
        picture: Picture,
        instruction: str,
        *,
        pointed: Sequence[TargetPrompt] = (),
        targets: Sequence[Target] = (),
        keep_out: Sequence[TargetPrompt] = (),
        settings: Settings | None = None,
        trace: Path | StoredSession | None = None,
        begun: int = 0,
        services: Services | None = None,
        show: Show | None = None,
    ) -> Run:
        """Carry out one instruction on one picture: a session of one turn, which can go on.

        Args:
            picture: the picture.
            instruction: what to do, in the person's words.
            pointed: the things meant, if the person points.
            targets: the things meant, if they are measured already.
            keep_out: what no robot may stand on or drive over.
            settings: what the person fixed.
            trace: a file, or a new session of a store, to write to as it goes: the run can be
                resumed and replayed from there, also in another process.
            begun: how many events a session of a store has already, of which the first has the
                `facts`.
            services: what tools use beside the world; made for the picture if left out.
            show: called with every message as it comes.

        Raises:
            InputError: an argument cannot be used.
        """
        pointed = pointed_at(pointed, world := World.of(picture, targets=tuple(targets)))
        context = Context.of(picture, settings, world, services)
        check_turn(context, instruction, pointed)
        self.check(context.settings)
        context = context.at(with_keep_outs(context, keep_out))
        context = replace(context, steps=(context.world.step,))
        begin, stored = None, FolderSession(trace) if isinstance(trace, Path) else trace
        if stored is not None:
            context.services.artefacts = stored.artefacts
            anew = isinstance(trace, Path)
            begin = partial(FolderLog, trace, begin=True) if anew else partial(stored.write, begun)
        async with recording(begin, context.services.artefacts, None, show) as recorder:
            if begin is not None and not begun:
                files = context.services.artefacts
                facts = await to_its_end(lambda: self.facts(picture, files))
                await recorder.event("session", facts)
            return await self._turn(context, (), instruction, pointed, recorder, stored)

    def start(
        self,
        picture: Picture,
        *,
        pointed: Sequence[TargetPrompt] = (),
        keep_out: Sequence[TargetPrompt] = (),
        settings: Settings | None = None,
        stored: StoredSession | None = None,
        auto: bool = False,
    ) -> Session:
        """Begin a conversation about a picture: `session.say("...")`, turn after turn.

        Args:
            picture: the picture.
            pointed: the things meant, t1 first, if the person points.
            keep_out: what no robot may enter.
            settings: what the person fixed.
            stored: a new session of a store to write to.
            auto: whether simulated robots move as soon as a plan is certified, instead of at "go".
        """
        fixed, pointed, kept = settings or Settings(), tuple(pointed), tuple(keep_out)
        return Session(self, picture, fixed, pointed, kept, stored, auto)

    def say(self, run: Run, words: str, **options: Unpack[TurnOptions]) -> Run:
        """Run the next turn of a session; the synchronous version of `asay`.

        Raises:
            InputError: an argument cannot be used.
        """
        return self._sync(self.asay(run, words, **options))

    async def asay(
        self,
        run: Run,
        words: str,
        *,
        pointed: Sequence[TargetPrompt] = (),
        keep_out: Sequence[TargetPrompt] = (),
        settings: Settings | None = None,
        picture: Picture | None = None,
        show: Show | None = None,
    ) -> Run:
        """Run the next turn of a session: what the person says after a turn has ended.

        Args:
            run: the session as it is; a question that it waits for is dropped.
            words: what the person says.
            pointed: the things meant, if the person points.
            keep_out: what no robot may enter from now on, in addition to what there was.
            settings: what the person fixes from now on; if left out, as before except for the
                number of robots, their starts and approvals, which hold for one turn.
            picture: another picture from now on, which voids all plans.

        Raises:
            InputError: an argument cannot be used.
        """
        once: dict[str, Any] = {"robots": None, "starts": None}
        fixed = settings or run.context.settings.model_copy(update=once)
        fixed = fixed.model_copy(update={"approved": None})
        world = run.world.having(doubted=None)
        context = replace(run.context, world=world, settings=fixed, steps=run.steps).check()
        if picture is not None:
            context = in_new_picture(context, picture)
        pointed = pointed_at(pointed, context.world)
        check_turn(context, words, pointed)
        self.check(context.settings)
        context = context.at(with_keep_outs(context, keep_out))
        messages = closed(run.outcome.messages, "No result: the person interrupted it, or went on.")
        async with reopened(run, show) as recorder:
            for message in messages[len(run.outcome.messages) :]:
                await recorder.message(message, run.world)
            if picture is not None:
                facts = partial(picture_facts, picture, context.services.artefacts)
                await recorder.event("picture", await to_its_end(facts))
            turn = context, messages, words, pointed, recorder, run.stored
            return await self._turn(*turn, fresh=picture is not None)

    def resume(
        self,
        run: Run,
        *,
        answer: str | None = None,
        approve: bool | None = None,
        show: Show | None = None,
    ) -> Run:
        """Go on with a turn where it was left; the synchronous version of `aresume`.

        Raises:
            InputError: the turn is over, or waits for something else.
        """
        return self._sync(self.aresume(run, answer=answer, approve=approve, show=show))

    async def aresume(
        self,
        run: Run,
        *,
        answer: str | None = None,
        approve: bool | None = None,
        show: Show | None = None,
    ) -> Run:
        """Go on with a turn where it was left, here or, with `load_run`, in another process.

        Args:
            run: a run that waits for a person, or was stopped, cancelled or killed; its log is
                continued.
            answer: to a question; "3" or "c3" is the third candidate. With a no, the reason.
            approve: a person's yes or no to the very call that waits, such as moving robots.
            show: called with every new message as it comes, the person's first.

        Raises:
            InputError: the turn is over, or waits for something else.
        """
        result, approved = answered_by(run, answer, approve)
        context, messages = replace(run.context, world=run.world), run.outcome.messages
        async with reopened(run, show) as recorder:
            await recorder.event("resume", {})
            if approve is not None and isinstance(run.outcome, Paused):
                plan_id = run.outcome.plan_id if approved else None
                said = {"call": run.outcome.call.id, "plan_id": plan_id}
                await recorder.event("approval", said)
                fixed = context.settings.model_copy(update={"approved": plan_id})
                context = replace(context, settings=fixed)
            if result is not None:
                context = context.at(with_confirmed_outline(context.world, messages, result))
                await recorder.message(result, context.world)
                messages = (*messages, result)
            left, spent = replace(run, context=context), run.report.usage.seconds
            return await self._go(left, messages, recorder, spent, approved)

    async def _turn(
        self,
        context: Context,
        messages: History,
        words: str,
        pointed: Sequence[TargetPrompt],
        recorder: LogRecorder,
        stored: StoredSession | None,
        *,
        fresh: bool = False,
    ) -> Run:
        """Begin a turn and let the loop work on it."""
        said = {"words": words, "settings": to_json_values(context.settings)}
        await recorder.event("turn", said)
        world = context.world.having(pointed=tuple(pointed))
        context = replace(context, world=world, words=words)
        sees = getattr(self.model, "sees", False)
        first = first_message(context, messages, seen=sees, fresh=fresh)
        await recorder.message(first, world)
        blank = Report(status="stopped", message="", instruction=words, model=self.model.name)
        left = Cancelled((*messages, first), world)
        run = Run(blank, left, context, context.world, stored)
        return await self._go(run, left.messages, recorder)

    async def _go(
        self,
        left: Run,
        messages: History,
        recorder: LogRecorder,
        spent: float = 0.0,
        approved: Approval | None = None,
    ) -> Run:
        began, context = time.perf_counter(), left.context
        asked = (self.model, self.library, self.limits.reply_seconds)
        traced = traced_run(self._tracer, self.model.name, messages)
        with traced as describe, asking(context, *asked) as asks:
            outcome = await run_loop(
                self.model,
                self.tools,
                replace(context, asks=asks),
                messages,
                system=self.system,
                offered=self.offered,
                limits=self.limits,
                policy=self.policy,
                approved=approved,
                recorder=recorder,
            )
            seconds = round(spent + time.perf_counter() - began, 3)
            context = replace(context, world=outcome.world)
            report = make_report(outcome, context, left.began, self.model.name, seconds)
            report = report.model_copy(update=prompt_facts(self))
            await recorder.end(outcome.world, end_facts(outcome, report))
            if recorder.problem is not None:
                text = f"{report.message} The log ends before this: {recorder.problem}"
                report = report.model_copy(update={"message": text})
            describe(outcome, report)
        return Run(report, outcome, context, left.began, left.stored, recorder.events)

    def check(self, settings: Settings) -> None:
        """Refuse settings that the model cannot meet.

        Raises:
            InputError: their detector asks the model, which does not see.
        """
        check_sees(settings, self.model)

    def facts(self, picture: Picture, artefacts: Artefacts) -> dict[str, Any]:
        """Return the first event's data of a log, enough to go on in another process."""
        return start_facts(self, picture_facts(picture, artefacts))

    async def aclose(self) -> None:
        """Close what the model keeps open in the running event loop; it may be used again."""
        close: Callable[[], Awaitable[Any]] | None = getattr(self.model, "aclose", None)
        if close is not None:
            await close()

    def _sync(self, run: Coroutine[Any, Any, Run]) -> Run:
        """Run in an event loop of its own and close the connections, which cannot outlive it."""

        async def closing() -> Run:
            try:
                made = await run
                await made.context.services.close_fleets()
                return made
            finally:
                await self.aclose()

        return in_own_loop(closing())
