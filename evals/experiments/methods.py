"""Who carries a task out, and how a trial becomes a row: rules, an agent, a model alone, a policy.

A provider that fails is an infrastructure error and says nothing; output that cannot be used is the
model's failure, counted apart.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from shapely.geometry import Polygon

from ...agent.agent import Agent, Run
from ...agent.messages import Result
from ...agent.model import Model
from ...agent.outcomes import Answered, Stopped
from ...prompts import PromptLibrary
from ...tools.context import Descriptor, Settings
from ...tools.errors import InputError
from ...tools.perception.image import load_picture
from ...tools.store import write_whole
from ...tools.tool import Tool
from ..grading.graded import VERSION, Graded
from ..grading.grading import Attempt, grade_attempt
from ..grading.policies import POLICIES, positions
from ..tasks.suite_task import SuiteTask
from .journal import USUAL
from .pointed import written_positions
from .rate_limiter import Paced, pace_of
from .simulated_model import ObedientModel
from .tokens import spent
from .trials import Status, Trial, TrialRow, canonical

METHODS = ("rules", "agent", "alone", *POLICIES)
DIRECT = "former-direct"
"""What a model alone is told: to write coordinates."""
LONGEST = 400
"""Characters of feedback in a row."""
NAMED = 80
"""Characters of a task's id in the names of its files."""
NO_MODEL = {"rules": "offline", **dict.fromkeys(POLICIES, "none")}
OBEDIENT = "obedient"
DESCRIBED = ("rules", "agent")
"""Methods with tools, which put shapes into words."""
SHIPPED = PromptLibrary()


@dataclass(frozen=True)
class Method:
    """An arm of a sweep: who decides, with which prompt, and how shapes are described.

    Attributes:
        name: one of METHODS.
        model: of agent and alone, as Agent takes it, or `obedient`; the others have none.
        prompt: id@vNNN, None for the current one of the model's own.
        descriptor: edges, edges+vertices or matrix.
        library: where prompts are.
        rate: requests per minute in each process at most; None for no limit.
    """

    name: str
    model: str
    prompt: str | None = None
    descriptor: Descriptor = "edges"
    library: PromptLibrary = SHIPPED
    rate: float | None = None

    def facts(self, base_url: str | None) -> dict[str, Any]:
        """What a trial says of its arm.

        Raises:
            InputError: no such model or prompt.
        """
        if self.name in POLICIES:
            return {"method": self.name, "model": self.model}
        agent = self.agent(0, base_url)
        return {
            "method": self.name,
            "prompt": agent.prompt and agent.prompt.name,
            "prompt_sha": agent.prompt and agent.prompt.sha256,
            "tools_sha": _tools_sha(agent.offered) if agent.tools else None,
            "model": agent.model.name,
            "descriptor": self.descriptor if self.name in DESCRIBED else None,
        }

    def agent(self, seed: int, base_url: str | None) -> Agent:
        """The agent of a trial.

        Raises:
            InputError: no such model or prompt, or one that writes no coordinates alone.
        """
        agent = self._agent(seed, base_url)
        if self.rate is not None:
            agent.model = Paced(agent.model, pace_of(self.model, self.rate))
        return agent

    def _agent(self, seed: int, base_url: str | None) -> Agent:
        model: str | Model = ObedientModel(seed) if self.model == OBEDIENT else self.model
        url = base_url if isinstance(model, str) and model != "offline" else None
        if self.name != "alone":
            return Agent(model, base_url=url, prompt=self.prompt, library=self.library)
        if self.model in ("offline", OBEDIENT):
            raise InputError(f"{self.model} writes no coordinates alone; --model takes another.")
        prompt = self.prompt or DIRECT
        return Agent(model, base_url=url, prompt=prompt, library=self.library, tools=())


def method(
    name: str,
    model: str | None,
    prompt: str | None,
    descriptor: Descriptor,
    library: PromptLibrary = SHIPPED,
) -> Method:
    """A method by name.

    Raises:
        InputError: there is none, or it does not go with what else is given.
    """
    if name not in METHODS:
        raise InputError(f"Unknown method {name!r}. There are: {', '.join(METHODS)}.")
    if descriptor != USUAL and name not in DESCRIBED:
        raise InputError(f"--descriptor goes with the methods rules and agent, not with {name}.")
    if name in NO_MODEL:
        given = [o for o, v in (("--model", model), ("--prompt", prompt)) if v is not None]
        if given:
            raise InputError(f"{given[0]} goes with the methods agent and alone, not with {name}.")
        return Method(name, NO_MODEL[name], None, descriptor)
    if model is None:
        raise InputError(f"The method {name} takes a --model, such as openai:NAME.")
    if model == "offline":
        raise InputError("The offline rules are a method of their own: --method rules.")
    return Method(name, model, prompt, descriptor, library)


@dataclass(frozen=True)
class SuiteWork:
    """Runs and grades one trial; another process can be given it.

    Attributes:
        tasks: by id.
        pictures: files, by the task's id.
        arms: by what a trial says of its arm; see `arm_key`.
        keep: a folder for what was planned and observed, for looking and grading again; None where
            only scores are to be seen.
    """

    tasks: Mapping[str, SuiteTask]
    pictures: Mapping[str, Path]
    arms: Mapping[str, Method]
    base_url: str | None = None
    keep: Path | None = None

    def __call__(self, trial: Trial) -> TrialRow:
        """The row of a trial."""
        task, arm = self.tasks[trial.task], self.arms[arm_key(trial)]
        if arm.name in POLICIES:
            attempt, run = _by_policy(task, arm.name, trial.seed), None
        else:
            run = self._run(task, arm, trial)
            lost = _lost(run)
            if lost is not None:
                return TrialRow.of(trial, "infra_error", feedback=lost, **_cost(run, arm))
            attempt = _attempt(run, arm)
        graded = grade_attempt(task.goals, task.expects, attempt)
        status: Status = "pass" if graded.sr else "fail"
        if run is not None and not graded.sr and _invalid(run, arm, attempt):
            status = "model_invalid"
        if self.keep is not None:
            _write(self.keep / f"{kept_as(trial)}.json", attempt, graded)
        return TrialRow.of(
            trial,
            status,
            gcr=graded.gcr,
            strict=graded.strict,
            object_correct=graded.object_correct,
            feedback=graded.feedback[:LONGEST] if self.keep is not None else "",
            **_cost(run, arm),
        )

    def _run(self, task: SuiteTask, arm: Method, trial: Trial) -> Run:
        agent = arm.agent(trial.seed, self.base_url)
        settings = Settings(
            robots=task.robots,
            descriptor=arm.descriptor,
            seed=trial.seed,
            metres_per_pixel=task.metres_per_pixel,
        )
        trace = None
        if self.keep is not None and arm.model not in ("offline", OBEDIENT):
            trace = self.keep / f"{kept_as(trial)}.jsonl"
        picture = load_picture(self.pictures[task.id])
        return agent.run(picture, task.instruction, settings=settings, trace=trace)


def arm_key(trial: Trial) -> str:
    """What a trial says of its arm, as text."""
    return " ".join([trial.method, trial.prompt or "-", trial.model, trial.descriptor or "-"])


def kept_as(trial: Trial) -> str:
    """The name of what is kept of a trial: its positions (.json) and its trace (.jsonl)."""
    task = re.sub(r"[^\w.-]+", "_", trial.task)[:NAMED]
    return f"{task}-{trial.trial}-{trial.key[:12]}"


def trials_of(
    suite: str, tasks: Sequence[SuiteTask], arms: Sequence[Mapping[str, Any]], count: int
) -> list[Trial]:
    """All trials: every task, every arm, so many tries.

    Args:
        suite: its hash.
        tasks: of it.
        arms: `facts` of methods.
        count: tries of each.
    """
    return [
        Trial(
            suite=suite,
            task=task.id,
            trial=number,
            category=task.category,
            setup=task.setup,
            must_pass=task.must_pass,
            **arm,
        )
        for number in range(count)
        for task in tasks
        for arm in arms
    ]


def _by_policy(task: SuiteTask, name: str, seed: int) -> Attempt:
    """Where nothing is to be placed, a policy moves robots all the same."""
    placed = positions(name, task.goals, seed).tolist() if task.goals else [(0.0, 0.0)]
    return Attempt("deployed", placed, placed)


def _attempt(run: Run, arm: Method) -> Attempt:
    report = run.report
    if arm.name == "alone":
        written = written_positions(report.message)
        declined = _declined(report.message) if written is None else None
        if declined:
            return Attempt(declined, said=report.message, declined=True)
        return Attempt("deployed" if written else "failed", written, written, said=report.message)
    given_up = isinstance(run.outcome, Answered) and isinstance(run.outcome.messages[-1], Result)
    return Attempt(
        status=report.status,
        planned=report.positions,
        observed=report.arrival and report.arrival.observed,
        found=_about(run),
        said=report.message,
        declined=report.status == "question" or (report.status == "impossible" and given_up),
    )


def _declined(text: str) -> Literal["question", "impossible"] | None:
    """What a model alone has done that writes that no robot shall be placed; else None."""
    whole = text[text.find("{") : text.rfind("}") + 1]
    try:
        said: dict[str, Any] = json.loads(whole)
        if said["positions"] != []:
            return None
        return "question" if said.get("question") else "impossible"
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _about(run: Run) -> tuple[Polygon, ...]:
    """Outlines of what the last contract is about, else none."""
    contract, scene = run.report.contract, run.world
    named = contract.target_ids if contract else ()
    return tuple(t.outline.polygon for t in scene.targets if t.id in named)


def _lost(run: Run) -> str | None:
    """Why a run says nothing about the model, if so: somebody else has failed."""
    outcome = run.outcome
    if isinstance(outcome, Stopped) and outcome.kind in ("model", "tool", "fleet"):
        return f"{outcome.kind}: {outcome.reason}"[:LONGEST]
    return None


def _invalid(run: Run, arm: Method, attempt: Attempt) -> bool:
    """Whether there is nothing to judge: no call that could be made, no positions to be read."""
    if attempt.observed is not None or attempt.declined:
        return False
    if arm.name == "alone":
        return True
    results = [m for m in run.outcome.messages if isinstance(m, Result)]
    return not results or results[-1].error in ("unknown_tool", "arguments")


def _cost(run: Run | None, arm: Method) -> dict[str, Any]:
    """Tokens as the provider counts them, else by rule of thumb; rules take none."""
    if run is None or arm.model == "offline":
        return {}
    usage, agent = run.report.usage, arm.agent(0, None) if arm.model == OBEDIENT else None
    if agent is not None:
        guess = spent(run.outcome.messages, agent.system, agent.offered)
        return {"input_tokens": guess.input, "output_tokens": guess.output}
    return {
        "input_tokens": usage.input_tokens,
        "output_tokens": usage.output_tokens,
        "cost_usd": usage.cost_usd,
    }


def _tools_sha(tools: Sequence[Tool]) -> str:
    return hashlib.sha256(
        canonical([[tool.name, tool.description, tool.schema] for tool in tools])
    ).hexdigest()


def _write(path: Path, attempt: Attempt, graded: Graded) -> None:
    content = {
        "graders": VERSION,
        "status": attempt.status,
        "said": attempt.said,
        "declined": attempt.declined,
        "planned": attempt.planned,
        "observed": attempt.observed,
        "found": [list(polygon.exterior.coords) for polygon in attempt.found],
        "graded": {
            "sr": graded.sr,
            "gcr": graded.gcr,
            "strict": graded.strict,
            "object_correct": graded.object_correct,
            "feedback": graded.feedback,
            "measures": dict(graded.measures),
            "right": graded.right,
        },
    }
    write_whole(path, canonical(content))
