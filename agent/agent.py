"""The agent: a model, the tools and the loop put together for one instruction on one picture."""

import asyncio
import time
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..prompts import Prompt, PromptError, PromptLibrary
from ..tools.builtin import TOOLS
from ..tools.errors import InputError, ToolError
from ..tools.formation.contract import MAX_ROBOTS
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.scene import Scene, Target
from ..tools.tool import Tool
from ..tools.world import Settings, Workspace
from .first_message import first_message
from .limits import DEFAULT_LIMITS, Limits
from .loop import ANYTHING, Show, run
from .messages import Call, History, Reply, Result, User
from .model import Model
from .outcomes import Outcome, Paused, Stopped
from .policy import Policy
from .providers.registry import model_named
from .report import Report, make_report
from .session import Run, check_text, going_on
from .store.folder import TraceWriter, settings_facts
from .wrappers.telemetry import traced_model, traced_run, traced_tool
from .wrappers.two_stages import TwoStages, offered

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
        library: where prompts are taken from; the shipped ones by default.
        planner: a second model, which makes the formation without seeing the picture; the first
            then only says what is meant. The prompt is the planner's.
        tools: what the model may call.
        system: a text in place of a prompt; the offline planner reads neither.
        limits: bounds of each run.
        policy: which calls go ahead, wait for a person, or are refused.
        tracer: of OpenTelemetry; it is given spans of runs, replies and tools, and no texts.

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
    ) -> None:
        if base_url is not None and not isinstance(model, str):
            raise InputError("A base URL goes with a model's name; this model is an object.")
        self.model = model_named(model, base_url) if isinstance(model, str) else model
        own = None if system else getattr(self.model, "prompt", None)
        self.library = library or PromptLibrary()
        name = (own if planner is None else "planner") if prompt is None else prompt
        self.prompt = None if name is None else _prompt(self.library, name)
        self.prompts = () if self.prompt is None else (self.prompt,)
        self._names: tuple[str, str | None] = (self.model.name, None)
        if planner is not None:
            made = _staged(self.model, planner, base_url, str(name), self.library)
            self.model, self.prompts = made
            self._names = made[0].names
        self.system = self.prompt.render() if self.prompt else system
        self.base_url, self.tools, self.limits, self.policy = base_url, tools, limits, policy
        self._tracer = tracer
        if tracer is not None:
            self.model = traced_model(self.model, tracer)
            self.tools = tuple(traced_tool(tool, tracer) for tool in tools)
        self.offered = offered(self.tools, None if planner else self.prompt)

    def run(
        self,
        picture: Picture,
        instruction: str,
        *,
        pointed: Sequence[TargetPrompt] = (),
        targets: Sequence[Target] = (),
        settings: Settings | None = None,
        trace: Path | None = None,
        show: Show | None = None,
    ) -> Run:
        """Carry out one instruction; the synchronous door to `arun`.

        Raises:
            InputError: something given cannot be used.
        """
        made = self.arun(
            picture,
            instruction,
            pointed=pointed,
            targets=targets,
            settings=settings,
            trace=trace,
            show=show,
        )
        return self._sync(made)

    async def arun(
        self,
        picture: Picture,
        instruction: str,
        *,
        pointed: Sequence[TargetPrompt] = (),
        targets: Sequence[Target] = (),
        settings: Settings | None = None,
        trace: Path | None = None,
        show: Show | None = None,
    ) -> Run:
        """Carry out one instruction on one picture.

        Args:
            picture: where.
            instruction: what, in the person's words.
            pointed: the things meant, if the person points.
            targets: the things meant, where they are measured already.
            settings: what the person fixed.
            trace: a file to write the run to as it goes: it can be resumed and replayed from it.
            show: is given every message as it comes.

        Raises:
            InputError: something given cannot be used.
        """
        fixed = settings or Settings()
        _check(instruction, fixed.robots)
        workspace = Workspace(Scene(picture, tuple(targets)), fixed, tuple(pointed), instruction)
        _check_candidates(workspace)
        writer = None if trace is None else TraceWriter(trace)
        if writer is not None:
            writer.start(self._facts(instruction, fixed), workspace)
        note = _noting(workspace, writer, show)
        first = first_message(workspace, seen=getattr(self.model, "sees", False))
        note(first)
        return await self._go(workspace, (first,), instruction, note, writer=writer)

    def resume(
        self,
        paused: Run,
        *,
        answer: str | None = None,
        approve: bool | None = None,
        show: Show | None = None,
    ) -> Run:
        """Go on where a run was left; the synchronous door to `aresume`.

        Raises:
            InputError: the run is over, or waits for something else.
        """
        made = self.aresume(paused, answer=answer, approve=approve, show=show)
        return self._sync(made)

    async def aresume(
        self,
        paused: Run,
        *,
        answer: str | None = None,
        approve: bool | None = None,
        show: Show | None = None,
    ) -> Run:
        """Go on where a run was left, here or, with `load_run`, in another process.

        Args:
            paused: a run that waits for a person, was stopped, cancelled or killed; its
                workspace is worked on further, and its trace written on.
            answer: to a question; "3" or "c3" is the third candidate. With a no, the reason.
            approve: a person's yes or no to the very call that waits, such as moving robots.
            show: is given every new message as it comes, the person's first.

        Raises:
            InputError: the run is over, or waits for something else.
        """
        said, approved = going_on(paused, answer, approve)
        workspace, instruction = paused.workspace, paused.report.instruction
        writer = None if paused.trace is None else TraceWriter(paused.trace, resumed=True)
        if writer is not None:
            writer.resume(workspace)
        note = _noting(workspace, writer, show)
        history = paused.outcome.messages
        if said is not None:
            note(said)
            history = (*history, said)
        spent = paused.report.usage.seconds
        return await self._go(
            workspace, history, instruction, note, writer=writer, spent=spent, approved=approved
        )

    async def _go(
        self,
        workspace: Workspace,
        messages: History,
        instruction: str,
        note: Show,
        *,
        writer: TraceWriter | None,
        spent: float = 0.0,
        approved: Call | None = None,
    ) -> Run:
        began = time.perf_counter()
        traced = traced_run(self._tracer, self.model.name, messages)
        with writer or nullcontext(), traced as told:
            outcome = await run(
                self.model,
                self.tools,
                workspace,
                messages,
                system=self.system,
                offered=self.offered,
                limits=self.limits,
                policy=self.policy,
                approved=approved,
                show=note,
            )
            seconds = round(spent + time.perf_counter() - began, 3)
            report = make_report(outcome, workspace, instruction, self.model.name, seconds)
            report = report.model_copy(update=self._prompts())
            if writer is not None:
                writer.end(_end(outcome, report))
            told(outcome, report)
        return Run(report, outcome, workspace, writer and writer.path)

    def _facts(self, instruction: str, settings: Settings) -> dict[str, Any]:
        """What a trace begins with, enough to go on in another process."""
        return {
            "instruction": instruction,
            "model": self._names[0],
            "planner": self._names[1],
            "base_url": self.base_url,
            "library": self.library.folder and str(self.library.folder.absolute()),
            **self._prompts(),
            "settings": settings_facts(settings),
            "limits": asdict(self.limits),
            "policy": self.policy.rules,
        }

    def _prompts(self) -> dict[str, Any]:
        """The prompt and, where two models share the work, all of theirs."""
        facts = tuple(p.facts for p in self.prompts)
        mine = [f for f, p in zip(facts, self.prompts, strict=True) if p == self.prompt]
        return {"prompt": mine[0] if mine else None, "prompts": facts}

    async def aclose(self) -> None:
        """Close what the model keeps open in the running event loop; it may be used again."""
        close: Callable[[], Awaitable[Any]] | None = getattr(self.model, "aclose", None)
        if close is not None:
            await close()

    def _sync(self, run: Coroutine[Any, Any, Run]) -> Run:
        """A run with an event loop of its own: connections cannot outlive it."""

        async def closing() -> Run:
            try:
                return await run
            finally:
                await self.aclose()

        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return asyncio.run(closing())
        run.close()
        raise InputError("An event loop runs here already: await agent.arun(...) or aresume(...).")


def _prompt(library: PromptLibrary, name: str) -> Prompt:
    """The prompt of a name, which a run gives no values."""
    try:
        prompt = library.load(name)
        prompt.render()
    except PromptError as error:
        raise InputError(str(error)) from None
    return prompt


def _staged(
    looker: Model,
    planner: str | Model,
    base_url: str | None,
    plan: str,
    library: PromptLibrary,
) -> tuple[TwoStages, tuple[Prompt, ...]]:
    """Two models as one, and their prompts."""
    second = model_named(planner, base_url) if isinstance(planner, str) else planner
    blind = [m.name for m in (looker, second) if not getattr(m, "prompt", None)]
    if blind:
        raise InputError(
            f"{blind[0]} reads no prompt and cannot share the work: "
            "--model and --planner both take a language model, such as openai:NAME."
        )
    look, made, repair = (_prompt(library, name) for name in ("context", plan, "repair"))
    return TwoStages(looker, second, look=look, plan=made, repair=repair), (look, made, repair)


def _noting(workspace: Workspace, writer: TraceWriter | None, show: Show | None) -> Show:
    """Writes a message down, then shows it."""

    def note(message: User | Reply | Result) -> None:
        if writer is not None:
            writer.message(message, workspace)
        if show is not None:
            show(message)

    return note


def _end(outcome: Outcome, report: Report) -> dict[str, Any]:
    """The last line of a trace."""
    facts = {
        "outcome": type(outcome).__name__.lower(),
        "status": report.status,
        "message": report.message,
        "usage": report.usage.model_dump(),
    }
    if isinstance(outcome, Stopped):
        facts |= {"kind": outcome.kind, "reason": outcome.reason}
    if isinstance(outcome, Paused):
        facts |= {"call": outcome.call.id}
    return facts


def _check(instruction: str, robots: int | None) -> None:
    example = 'say what to do, such as "Surround the car at the corners"'
    check_text("instruction", instruction, example)
    if robots is not None and not 1 <= robots <= MAX_ROBOTS:
        raise InputError(f"{robots} robots cannot be placed; 1 to {MAX_ROBOTS:,} can.")


def _check_candidates(workspace: Workspace) -> None:
    """Candidates pointed at must be there; the picture is searched only if there are some."""
    try:
        for prompt in workspace.pointed:
            if prompt.candidate is not None:
                workspace.candidate(prompt.candidate)
    except ToolError as error:
        raise InputError(str(error)) from None
