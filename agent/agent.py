"""The agent: a model, the tools and the loop put together for one instruction on one picture."""

import asyncio
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..tools.doors import TOOLS
from ..tools.errors import InputError
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
from .report import Report, Status, Totals, target_data
from .task import task_text

MAX_INSTRUCTION = 4_000
"""Characters; longer texts are no instruction, and cost whoever reads them."""
Show = Callable[[User | Reply | Result], None]


@dataclass(frozen=True)
class Run:
    """A finished or paused run: its report, how it ended, and what it worked on."""

    report: Report
    outcome: Outcome
    workspace: Workspace


class Agent:
    """Carries out instructions on pictures.

    Args:
        model: a name (`offline`) or any object with a name and a `reply` method.
        tools: what the model may call.
        system: the prompt; the offline planner reads none.
        limits: bounds of each run.

    Raises:
        InputError: an unknown model name.
    """

    def __init__(
        self,
        model: str | Model = "offline",
        *,
        tools: tuple[Tool, ...] = TOOLS,
        system: str = "",
        limits: Limits = DEFAULT_LIMITS,
    ) -> None:
        self.model = model_named(model) if isinstance(model, str) else model
        self.tools, self.system, self.limits = tools, system, limits

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
            self.arun(picture, instruction, pointed=pointed, settings=settings, show=show)
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
        first = User(text=task_text(instruction, workspace))
        if show is not None:
            show(first)
        return await self.resume(workspace, (first,), instruction, show)

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
        return Run(report, outcome, workspace)


def _check(instruction: str, robots: int | None) -> None:
    if not instruction.strip():
        raise InputError(
            'The instruction is empty; say what to do, such as "Surround the car at the corners".'
        )
    try:
        instruction.encode()
    except UnicodeEncodeError:
        raise InputError("The instruction holds bytes that are not text in UTF-8.") from None
    if len(instruction) > MAX_INSTRUCTION:
        raise InputError(
            f"The instruction has {len(instruction):,} characters; {MAX_INSTRUCTION:,} can be read."
        )
    if robots is not None and not 1 <= robots <= MAX_ROBOTS:
        raise InputError(f"{robots} robots cannot be placed; 1 to {MAX_ROBOTS:,} can.")


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
    if not (isinstance(outcome, Paused) and outcome.call.name == "ask_user"):
        return None
    named = outcome.call.arguments.get("candidates", ())
    found = [
        workspace.scene.target(n) for n in named if n in {t.id for t in workspace.scene.targets}
    ]
    return tuple({"id": t.id, "label": t.label, "box": list(t.box)} for t in found)


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
