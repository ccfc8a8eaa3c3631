"""The agent: a model, the tools and the loop put together for one instruction on one picture."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from ..prompts import Prompt, PromptError, list_prompts, load_prompt
from ..tools.doors import TOOLS
from ..tools.errors import InputError, ToolError
from ..tools.formation.contract import MAX_ROBOTS
from ..tools.formation.plan import Plan
from ..tools.perception.image import Picture
from ..tools.perception.prompts import TargetPrompt
from ..tools.scene import Scene
from ..tools.tool import Tool
from ..tools.workspace import Settings, Workspace
from .loop import DEFAULT_LIMITS, Limits, run
from .messages import History, Reply, Result, User
from .model import Model
from .models import model_named
from .outcomes import Cancelled, Outcome, Paused, Stopped
from .report import Report, Status, Totals, candidate_choice, target_choice, target_data
from .task import task_text

MAX_INSTRUCTION = 4_000
"""Characters; longer texts are no instruction, and cost whoever reads them."""
Show = Callable[[User | Reply | Result], None]
T = TypeVar("T")


@dataclass(frozen=True)
class Run:
    """A finished or paused run: its report, how it ended, and what it worked on."""

    report: Report
    outcome: Outcome
    workspace: Workspace


class Agent:
    """Carries out instructions on pictures.

    Args:
        model: a name (`offline`, `openai:NAME` and so on) or any object with a name and a `reply`
            method. Its `prompt`, if it has one, is the id of the prompt it is given by default;
            its `aclose`, if it has one, is awaited by `run` and `answer` when they are done.
        base_url: of the server, for a model given by name.
        prompt: `id@vNNN`; None for the newest version of the model's own.
        tools: what the model may call.
        system: a text in place of a prompt; the offline planner reads neither.
        limits: bounds of each run.

    Raises:
        InputError: an unknown model or prompt, or a model that cannot be asked.
    """

    def __init__(
        self,
        model: str | Model = "offline",
        *,
        base_url: str | None = None,
        prompt: str | None = None,
        tools: tuple[Tool, ...] = TOOLS,
        system: str = "",
        limits: Limits = DEFAULT_LIMITS,
    ) -> None:
        if base_url is not None and not isinstance(model, str):
            raise InputError("A base URL goes with a model's name; this model is an object.")
        self.model = model_named(model, base_url) if isinstance(model, str) else model
        own = None if system else getattr(self.model, "prompt", None)
        self.prompt = _prompt(prompt, own)
        self.system = self.prompt.text if self.prompt else system
        self.tools, self.limits = tools, limits

    def run(
        self,
        picture: Picture,
        instruction: str,
        *,
        pointed: Sequence[TargetPrompt] = (),
        settings: Settings | None = None,
        show: Show | None = None,
    ) -> Run:
        """Carry out one instruction; the synchronous door to `arun`.

        Raises:
            InputError: something given cannot be used.
        """
        return asyncio.run(
            self._closing(
                self.arun(picture, instruction, pointed=pointed, settings=settings, show=show)
            )
        )

    async def arun(
        self,
        picture: Picture,
        instruction: str,
        *,
        pointed: Sequence[TargetPrompt] = (),
        settings: Settings | None = None,
        show: Show | None = None,
    ) -> Run:
        """Carry out one instruction on one picture.

        Args:
            picture: where.
            instruction: what, in the person's words.
            pointed: the things meant, if the person points.
            settings: what the person fixed.
            show: is given every message as it comes.

        Raises:
            InputError: something given cannot be used.
        """
        fixed = settings or Settings()
        _check(instruction, fixed.robots)
        workspace = Workspace(Scene(picture), fixed, tuple(pointed))
        _check_candidates(workspace)
        first = User(text=task_text(instruction, workspace))
        if show is not None:
            show(first)
        return await self.resume(workspace, (first,), instruction, show)

    def answer(self, asked: Run, text: str, *, show: Show | None = None) -> Run:
        """Go on from a question with its answer; the synchronous door to `aanswer`.

        Raises:
            InputError: the run asked nothing, or the answer cannot be used.
        """
        return asyncio.run(self._closing(self.aanswer(asked, text, show=show)))

    async def aanswer(self, asked: Run, text: str, *, show: Show | None = None) -> Run:
        """Go on from a question with its answer.

        Args:
            asked: a run whose report's status is `question`; its workspace is worked on further.
            text: what the person says; "3" or "c3" is the third candidate.
            show: is given every new message as it comes, the answer first.

        Raises:
            InputError: the run asked nothing, or the answer cannot be used.
        """
        outcome = asked.outcome
        if not (isinstance(outcome, Paused) and outcome.call.name == "ask_user"):
            raise InputError(f"The run asked nothing: it is {asked.report.status}.")
        _check_text("answer", text, "say it in words, or the number of a candidate")
        answer = Result(call_id=outcome.call.id, name=outcome.call.name, text=text.strip())
        if show is not None:
            show(answer)
        history = (*outcome.messages, answer)
        run = await self.resume(asked.workspace, history, asked.report.instruction, show)
        spent = asked.report.usage.seconds + run.report.usage.seconds
        usage = run.report.usage.model_copy(update={"seconds": round(spent, 3)})
        return replace(run, report=run.report.model_copy(update={"usage": usage}))

    async def resume(
        self, workspace: Workspace, messages: History, instruction: str, show: Show | None = None
    ) -> Run:
        """Go on from a history, answered where it had paused."""
        began = time.perf_counter()
        outcome = await run(
            self.model,
            self.tools,
            workspace,
            messages,
            system=self.system,
            limits=self.limits,
            allowed=lambda call: workspace.settings.fleet == "simulated",
            show=show or (lambda message: None),
        )
        seconds = time.perf_counter() - began
        report = _report(outcome, workspace, instruction, self.model.name, seconds)
        if self.prompt:
            facts = {"id": self.prompt.id, "version": self.prompt.version}
            prompt = {**facts, "sha256": self.prompt.sha256}
            report = report.model_copy(update={"prompt": prompt})
        return Run(report, outcome, workspace)

    async def aclose(self) -> None:
        """Close what the model keeps open in the running event loop; it may be used again."""
        close: Callable[[], Awaitable[Any]] | None = getattr(self.model, "aclose", None)
        if close is not None:
            await close()

    async def _closing(self, run: Awaitable[T]) -> T:
        """A run with an event loop of its own: connections cannot outlive it."""
        try:
            return await run
        finally:
            await self.aclose()


def _prompt(name: str | None, own: str | None) -> Prompt | None:
    """The prompt of a name, else the newest of the model's own, if it has one."""
    if name is None and own is not None:
        name = max(n for n in list_prompts() if n.startswith(f"{own}@"))
    try:
        return load_prompt(name) if name is not None else None
    except PromptError as error:
        raise InputError(str(error)) from None


def _check(instruction: str, robots: int | None) -> None:
    example = 'say what to do, such as "Surround the car at the corners"'
    _check_text("instruction", instruction, example)
    if robots is not None and not 1 <= robots <= MAX_ROBOTS:
        raise InputError(f"{robots} robots cannot be placed; 1 to {MAX_ROBOTS:,} can.")


def _check_text(name: str, text: str, advice: str) -> None:
    if not text.strip():
        raise InputError(f"The {name} is empty; {advice}.")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"The {name} holds bytes that are not text in UTF-8.") from None
    if len(text) > MAX_INSTRUCTION:
        raise InputError(
            f"The {name} has {len(text):,} characters; {MAX_INSTRUCTION:,} can be read."
        )


def _check_candidates(workspace: Workspace) -> None:
    """Candidates pointed at must be there; the picture is searched only if there are some."""
    try:
        for prompt in workspace.pointed:
            if prompt.candidate is not None:
                workspace.candidate(prompt.candidate)
    except ToolError as error:
        raise InputError(str(error)) from None


def _report(
    outcome: Outcome, workspace: Workspace, instruction: str, model: str, seconds: float
) -> Report:
    picture = workspace.scene.picture
    plan = _last_plan(workspace)
    arrival = workspace.arrivals.get(plan.id) if plan else None
    status, message = _status(outcome, workspace, plan)
    return Report(
        status=status,
        message=message,
        instruction=instruction,
        image={"sha256": picture.sha256, "width": picture.width, "height": picture.height},
        targets=tuple(target_data(t) for t in workspace.scene.targets),
        candidates=_candidates(outcome, workspace),
        contract=plan.formation.contract if plan else None,
        plan_id=plan.id if plan else None,
        positions=plan.formation.positions if plan else None,
        verdict=plan.verdict if plan else None,
        arrival=arrival,
        model=model,
        usage=_totals(outcome.messages, seconds),
    )


def _last_plan(workspace: Workspace) -> Plan | None:
    """The plan deployed last, else the one proposed last that is not void."""
    if workspace.arrivals:
        return workspace.plans[list(workspace.arrivals)[-1]]
    version = workspace.scene.version
    valid = [p for p in workspace.plans.values() if p.formation.scene_version == version]
    return valid[-1] if valid else None


def _status(outcome: Outcome, workspace: Workspace, plan: Plan | None) -> tuple[Status, str]:
    arrival = workspace.arrivals.get(plan.id) if plan else None
    if arrival is not None:  # robots have moved, whatever was said after that
        arrived = arrival.arrived and not isinstance(outcome, Stopped)
        return ("deployed" if arrived else "failed"), _last_words(outcome)
    if isinstance(outcome, Paused):
        asked = outcome.call.name == "ask_user"
        return ("question" if asked else "needs_approval"), _last_words(outcome)
    if isinstance(outcome, Stopped):
        ours = outcome.kind in ("limit", "repeat")
        return ("stopped" if ours else "failed"), outcome.reason
    if isinstance(outcome, Cancelled):
        return "stopped", _last_words(outcome)
    given_up = isinstance(outcome.messages[-1], Result)
    certified = plan is not None and plan.verdict.certified
    return ("planned" if certified and not given_up else "impossible"), _last_words(outcome)


def _last_words(outcome: Outcome) -> str:
    if isinstance(outcome, Paused):
        named = outcome.call.arguments
        return str(named.get("question") or f"A person must approve {named.get('plan_id')}.")
    if isinstance(outcome, Stopped):
        return outcome.reason
    if isinstance(outcome, Cancelled):
        return "The run was cancelled."
    last = outcome.messages[-1]
    return json.loads(outcome.text)["reason"] if isinstance(last, Result) else outcome.text


def _candidates(outcome: Outcome, workspace: Workspace) -> tuple[dict[str, object], ...] | None:
    """What a question offers, in its order; ids that mean nothing are left out."""
    if not (isinstance(outcome, Paused) and outcome.call.name == "ask_user"):
        return None
    named = outcome.call.arguments.get("candidates", ())
    known = {t.id: target_choice(t) for t in workspace.scene.targets}
    if any(n not in known for n in named):
        known |= {c.id: candidate_choice(c) for c in workspace.candidates()}
    return tuple(known[n] for n in named if n in known)


def _totals(messages: History, seconds: float) -> Totals:
    replies = [m for m in messages if isinstance(m, Reply)]
    return Totals(
        requests=len(replies),
        tool_calls=sum(len(m.calls) for m in replies),
        input_tokens=sum(m.usage.input_tokens for m in replies),
        output_tokens=sum(m.usage.output_tokens for m in replies),
        cost_usd=sum(m.usage.cost_usd for m in replies),
        seconds=round(seconds, 3),
    )
