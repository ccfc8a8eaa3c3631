"""Who carries tasks out, as arms of a sweep: rules, an agent, a model alone, a policy."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...agent.agent import Agent
from ...agent.model import Model
from ...prompts import Prompt, PromptLibrary
from ...tools.errors import InputError
from ...tools.tool import Tool
from ...tools.world import Descriptor
from ..grading.policies import POLICIES
from ..tasks.task import Task
from .journal import USUAL
from .pointing import Mode, can_point
from .rate_limiter import RateLimited, rate_limiter
from .recordings import REPLAY, recordings
from .simulated_model import SIMULATED, SimulatedModel
from .trials import Trial, canonical

METHODS = ("rules", "agent", "alone", *POLICIES)
DIRECT = "former-direct"
"""The prompt of a model alone: to write coordinates."""
NO_MODEL = {"rules": "offline", **dict.fromkeys(POLICIES, "none")}
WITH_TOOLS = ("rules", "agent")
"""Methods that put shapes into words."""
SHIPPED = PromptLibrary()


@dataclass(frozen=True)
class Method:
    """An arm of a sweep: who decides, with which prompt, and how things are pointed at.

    Attributes:
        name: one of METHODS.
        model: of agent and alone, as Agent takes it, `simulated`, or replay:FOLDER.
        prompt: id@vNNN, None for the current one of the model's own.
        descriptor: how shapes are described.
        mode: how things are pointed at.
        planner: a second model of an agent, which plans without the picture.
        library: where prompts are.
        base_url: of the model's server.
        rate: requests per minute in each process at most; None for no limit.
    """

    name: str
    model: str
    prompt: str | None = None
    descriptor: Descriptor = "edges"
    mode: Mode = "words"
    planner: str | None = None
    library: PromptLibrary = SHIPPED
    base_url: str | None = None
    rate: float | None = None

    @property
    def facts(self) -> dict[str, Any]:
        """What a trial says of its arm.

        Raises:
            InputError: no such model or prompt.
        """
        recorded = recordings(self.model)
        if self.name in POLICIES or recorded:
            model = recorded.name if recorded else self.model
            return {"method": self.name, "model": model, "mode": self.mode}
        agent = self.agent(0)
        return {
            "method": self.name,
            "mode": self.mode,
            **_prompt_facts(agent.prompts),
            "tools_sha": _tools_sha(agent.offered) if agent.tools else None,
            "model": agent.model.name,
            "descriptor": self.descriptor if self.name in WITH_TOOLS else None,
        }

    def agent(self, seed: int, recording: Path | None = None) -> Agent:
        """The agent of a trial.

        Args:
            seed: of the trial.
            recording: the trace that is replayed, if one is.

        Raises:
            InputError: no such model or prompt, or one that writes no coordinates alone.
        """
        name = self.model if recording is None else f"{REPLAY}{recording}"
        model: str | Model = SimulatedModel(seed) if name == SIMULATED else name
        url = self.base_url if isinstance(model, str) and model != "offline" else None
        if self.name == "alone":
            if name in ("offline", SIMULATED):
                raise InputError(f"{name} writes no coordinates alone; --model takes another.")
            prompt = self.prompt or DIRECT
            agent = Agent(model, base_url=url, prompt=prompt, library=self.library, tools=())
        else:
            agent = Agent(
                model,
                base_url=url,
                prompt=self.prompt,
                planner=self.planner,
                library=self.library,
            )
        if self.rate is not None:
            agent.model = RateLimited(agent.model, rate_limiter(self.model, self.rate))
        return agent

    def takes(self, task: Task) -> bool:
        """Whether a task can be tried: pointed at this way, and recorded if that is replayed."""
        recorded = recordings(self.model)
        return can_point(task, self.mode) and (
            recorded is None or recorded.of(task.id, 0) is not None
        )


def check_method(arm: Method) -> Method:
    """The same method, if its parts go together.

    Raises:
        InputError: there is none of its name, or it does not go with what else is given.
    """
    name = arm.name
    if name not in METHODS:
        raise InputError(f"Unknown method {name!r}. There are: {', '.join(METHODS)}.")
    if arm.descriptor != USUAL and name not in WITH_TOOLS:
        raise InputError(f"--descriptor goes with the methods rules and agent, not with {name}.")
    if arm.mode != "words" and name in POLICIES:
        raise InputError(f"--mode goes with rules, agent and alone: {name} knows where things are.")
    if arm.planner is not None and name != "agent":
        raise InputError(f"--planner goes with the method agent, not with {name}.")
    if name in NO_MODEL and arm.prompt is not None:
        raise InputError(f"--prompt goes with the methods agent and alone, not with {name}.")
    if arm.model == "offline" and name not in NO_MODEL:
        raise InputError("The offline rules are a method of their own: --method rules.")
    return arm


def model_of(method: str, given: str | None) -> str:
    """The model of a method by name: the one given, or its own.

    Raises:
        InputError: it has its own and one is given, or it has none and none is.
    """
    if (given is None) == (method in NO_MODEL) or method not in METHODS:
        return given or NO_MODEL.get(method, "")
    if given is None:
        raise InputError(f"The method {method} takes a --model, such as openai:NAME.")
    raise InputError(f"--model goes with the methods agent and alone, not with {method}.")


def trials_of(
    suite: str, tasks: Sequence[Task], arms: Sequence[Mapping[str, Any]], count: int
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
            style=task.style,
            must_pass=task.must_pass,
            **arm,
        )
        for number in range(count)
        for task in tasks
        for arm in arms
    ]


def _prompt_facts(prompts: Sequence[Prompt]) -> dict[str, Any]:
    """Name and hash of the prompt, or of all of them where two models share the work."""
    if not prompts:
        return {}
    hashes = [prompt.sha256 for prompt in prompts]
    joint = hashlib.sha256(canonical(hashes)).hexdigest()
    return {
        "prompt": "+".join(prompt.name for prompt in prompts),
        "prompt_sha": hashes[0] if len(hashes) == 1 else joint,
    }


def _tools_sha(tools: Sequence[Tool]) -> str:
    return hashlib.sha256(
        canonical([[tool.name, tool.description, tool.schema] for tool in tools])
    ).hexdigest()
