"""Methods that carry tasks out, as arms of a sweep: rules, an agent, a model alone, a policy."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...agent.agent import Agent
from ...agent.model import Model
from ...agent.wrappers.two_stages import prompt_named
from ...prompts import Prompt, PromptLibrary
from ...tools.context import Descriptor
from ...tools.errors import InputError
from ...tools.perception.segmenters.registry import segmenter_named
from ...tools.tool import Tool
from ..grading.policies import POLICIES
from ..rl.policy import RL, TRAIN, trained
from ..rl.teams import CATEGORIES
from ..tasks.task import Task
from .ablation import Part, tools_without
from .coordinate_frame import PIXELS, Frame
from .pointing import Mode, can_point
from .rate_limiter import RateLimited, rate_limiter
from .recordings import REPLAY, RecordedReplies, recordings
from .segment_only import SEGMENT_ONLY, SegmentOnly
from .simulated_model import SIMULATED, SimulatedModel
from .trials import USUAL, USUAL_SEGMENTER, Arm, Trial, canonical
from .zerocap import CALLED, OBJECT, PLACES, ZEROCAP, ZeroCap

METHODS = ("rules", "agent", "alone", ZEROCAP, SEGMENT_ONLY, RL, *POLICIES)
DIRECT = "former-direct"
"""The prompt of a model alone, which is told to write coordinates."""
NO_MODEL = {"rules": "offline", **dict.fromkeys(POLICIES, "none")}
WITH_TOOLS = ("rules", "agent")
"""Methods for which the tools place robots."""
WRITERS = ("alone", ZEROCAP)
"""Methods whose model writes coordinates itself."""
DESCRIBED = (*WITH_TOOLS, ZEROCAP)
"""Methods that put shapes into words."""
EXAMPLES = {
    SEGMENT_ONLY: "langsam, a segmenter that takes text",
    RL: f"DIR, a folder that {TRAIN} --out DIR has written",
}
"""Examples of models for methods that take no language model."""
SHIPPED = PromptLibrary()


@dataclass(frozen=True)
class Method:
    """An arm of a sweep: who decides, with which prompt, and how things are pointed at.

    Attributes:
        name: one of METHODS.
        model: for methods with a language model as Agent takes it, `simulated`, or replay:FOLDER;
            for segment-only a segmenter that takes text; for rl a folder of trained policies; the
            others have their own.
        prompt: id@vNNN, None for the current version of the method's own prompt.
        descriptor: how shapes are described.
        mode: how things are pointed at.
        planner: a second model of an agent, which plans without the picture.
        segmenter: what cuts things out; for segment-only it is the model itself.
        frame: the one in which a model that writes coordinates alone gives them.
        without: the part of the tools that is left out, for methods with tools.
        library: where prompts are.
        base_url: of the model's server.
        rate: requests per minute in each process at most; None for no limit.
    """

    name: str
    model: str = ""
    prompt: str | None = None
    descriptor: Descriptor = "edges"
    mode: Mode = "words"
    planner: str | None = None
    segmenter: str = USUAL_SEGMENTER
    frame: Frame = PIXELS
    without: Part | None = None
    library: PromptLibrary = SHIPPED
    base_url: str | None = None
    rate: float | None = None

    @property
    def arm(self) -> Arm:
        """What the results of its trials depend on.

        Raises:
            InputError: no such model or prompt.
        """
        if self.name == RL:
            return Arm(method=RL, model=f"ppo#{trained(Path(self.model)).sha256[:12]}")
        recorded = recordings(self.model)
        cut = None if self.segmenter == USUAL_SEGMENTER else self.segmenter
        if self.name in POLICIES or recorded:
            model = recorded.name if recorded else self.model
            return Arm(
                method=self.name,
                model=model,
                mode=self.mode,
                segmenter=cut,
                without=self.without,
            )
        agent = self.agent(0)
        return Arm(
            method=self.name,
            prompt="+".join(prompt.name for prompt in agent.prompts) or None,
            sha256=_prompts_sha(agent.prompts),
            tools=_tools_sha(agent.offered) if agent.tools else None,
            model=agent.model.name,
            descriptor=self.descriptor if self.name in DESCRIBED else None,
            mode=self.mode,
            segmenter=cut,
            frame=self.frame.name,
            without=self.without,
        )

    def agent(self, seed: int, recording: Path | None = None) -> Agent:
        """Return the agent of a trial.

        Args:
            seed: of the trial.
            recording: the trace to replay, if any.

        Raises:
            InputError: no such model or prompt, or one that writes no coordinates alone.
        """
        if self.name == SEGMENT_ONLY:
            return Agent(SegmentOnly(self.model))
        name = self.model if recording is None else f"{REPLAY}{recording}"
        model: str | Model = SimulatedModel(seed) if name == SIMULATED else name
        if recording is not None and self.without:  # tools no longer answer as they were recorded
            model = RecordedReplies(recording)
        url = self.base_url if isinstance(model, str) and model != "offline" else None
        if self.name in WRITERS and name in ("offline", SIMULATED):
            raise InputError(f"{name} writes no coordinates alone; --model takes another.")
        if self.name == "alone":
            prompt = self.prompt or DIRECT
            agent = Agent(model, base_url=url, prompt=prompt, library=self.library, tools=())
        elif self.name == ZEROCAP:
            agent = self._zerocap(model, url)
        else:
            agent = Agent(
                model,
                base_url=url,
                prompt=self.prompt,
                planner=self.planner,
                library=self.library,
                tools=tools_without(self.without),
            )
        if self.rate is not None:
            agent.model = RateLimited(agent.model, rate_limiter(self.model, self.rate))
        return agent

    def _zerocap(self, model: str | Model, url: str | None) -> Agent:
        """Return the agent of the paper's pipeline; a recording has the tools' calls already."""
        if recordings(self.model):
            return Agent(model, tools=CALLED)
        looker = Agent(model, base_url=url).model
        planner = Agent(self.planner, base_url=url).model if self.planner else looker
        stages = [prompt_named(self.library, name) for name in (OBJECT, PLACES)]
        by_text = "text" in segmenter_named(self.segmenter).takes
        agent = Agent(ZeroCap(looker, planner, *stages, by_text=by_text), tools=CALLED)
        agent.prompts = tuple(stages)
        return agent

    def takes(self, task: Task) -> bool:
        """Return whether a task can be tried: pointed at this way, and recorded if replayed.

        Dialogues need a method with tools.
        """
        if task.dialogue is not None and self.name not in WITH_TOOLS:
            return False
        if self.name == RL:
            return bool(task.goals) and task.category in CATEGORIES
        recorded = recordings(self.model)
        return can_point(task, self.mode) and (
            recorded is None or recorded.of(task.id, 0) is not None
        )


def check_method(arm: Method) -> Method:
    """Return the method, with its own model if none is given, after checking its options.

    Raises:
        InputError: there is no method of its name, or an option does not go with it.
    """
    name = arm.name
    if name not in METHODS:
        raise InputError(f"Unknown method {name!r}. There are: {', '.join(METHODS)}.")
    for option, given, takers in (
        ("--model", arm.model, ("agent", *WRITERS, *EXAMPLES)),
        ("--prompt", arm.prompt, ("agent", "alone")),
        ("--planner", arm.planner, ("agent", ZEROCAP)),
        ("--descriptor", arm.descriptor != USUAL, DESCRIBED),
        ("--mode", arm.mode != "words", ("rules", "agent", "alone")),
    ):
        if given and name not in takers:
            methods = f"method{'s' if len(takers) > 1 else ''} {' and '.join(takers)}"
            raise InputError(f"{option} goes with the {methods}, not with {name}.")
    if arm.model == "offline":
        raise InputError("The offline rules are a method of their own: --method rules.")
    if not arm.model and name not in NO_MODEL:
        example = EXAMPLES.get(name, "openai:NAME")
        raise InputError(f"The method {name} takes a --model, such as {example}.")
    if name == SEGMENT_ONLY and not (
        arm.model == USUAL_SEGMENTER or "text" in segmenter_named(arm.model).takes
    ):
        raise InputError(
            f"The segmenter {arm.model!r} takes no text; clipseg and langsam do, and grabcut takes "
            "what stands out most."
        )
    return replace(arm, model=arm.model or NO_MODEL[name])


def trials_of(suite: str, tasks: Sequence[Task], arms: Sequence[Arm], count: int) -> list[Trial]:
    """Return all trials: every task, every arm, so many tries.

    Args:
        suite: its hash.
        tasks: of it.
        arms: of methods.
        count: tries of each.
    """
    return [
        Trial(
            suite=suite,
            task=task.id,
            trial=number,
            arm=arm,
            category=task.category,
            setup=task.setup,
            style=task.style,
            must_pass=task.must_pass,
        )
        for number in range(count)
        for task in tasks
        for arm in arms
    ]


def _prompts_sha(prompts: Sequence[Prompt]) -> str | None:
    """Return the hash of the prompt, or of all prompts if two models share the work."""
    hashes = [prompt.sha256 for prompt in prompts]
    if len(hashes) < 2:
        return hashes[0] if hashes else None
    return hashlib.sha256(canonical(hashes)).hexdigest()


def _tools_sha(tools: Sequence[Tool]) -> str:
    return hashlib.sha256(
        canonical([[tool.name, tool.description, tool.schema] for tool in tools])
    ).hexdigest()
