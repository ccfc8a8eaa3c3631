"""What one conversation works on: the scene, the plans made in it, and the person's settings.

The one mutable object of the tools; they read it and put new values in, so that a plan id or a
target id means the same in the next call.
"""

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Literal

from .errors import InputError, ToolError
from .fleet.deploy import Arrival, Fleet
from .fleet.simulated import MAX_ROBOTS, SimulatedFleet, checked_starts, spread_starts
from .formation.contract import Contract
from .formation.placement.place import Site
from .formation.plan import Plan
from .geometry.outline import FloatArray, Outline
from .motion.motion import obstacles
from .perception.detectors.candidates import find_candidates
from .perception.measure import measure_outline, missed_vertices
from .perception.referring.attributes import Candidate
from .perception.segmenters.registry import segmenter_named
from .perception.target_prompt import MAX_POINTS, TargetPrompt
from .scene import Scene, Target

Descriptor = Literal["edges", "edges+vertices", "matrix"]
FLEETS = ("simulated",)


@dataclass(frozen=True)
class Settings:
    """What the person fixed; code holds the model to it.

    Attributes:
        robots: how many, or None where the person left it open.
        robot_radius: px, 0 is a point; None leaves it to the contract.
        clearance: exact distance wanted from the target, px, or None for the default.
        segmenter: name of the segmenter.
        threshold: t, the least confidence a mask is used at; None for the segmenter's own.
        descriptor: how describe_shape puts shapes into text.
        fleet: name of the fleet.
        starts: (n, 2) starting positions of simulated robots, px, or None to spread them.
        seed: of everything random in the simulator.
        may_deploy: whether robots may be moved at all in this run.
        approved: id of the one plan a person has approved although it is partial.
        numbered: whether what stands out is numbered in the picture a model gets.
        metres_per_pixel: of a picture taken straight from above; None where it is not known.
    """

    robots: int | None = None
    robot_radius: float | None = None
    clearance: float | None = None
    segmenter: str = "grabcut"
    threshold: float | None = None
    descriptor: Descriptor = "edges"
    fleet: str = "simulated"
    starts: FloatArray | None = None
    seed: int = 0
    may_deploy: bool = True
    approved: str | None = None
    numbered: bool = False
    metres_per_pixel: float | None = None

    def check(self) -> None:
        """Refuse names that do not exist.

        Raises:
            InputError: unknown segmenter or fleet; the text lists those there are.
        """
        segmenter_named(self.segmenter)
        if self.fleet not in FLEETS:
            raise InputError(f"Unknown fleet {self.fleet!r}. There are: {', '.join(FLEETS)}.")


@dataclass
class Workspace:
    """The state tools share.

    Attributes:
        pointed: what the person pointed at, in order t1, t2, ...
        instruction: the person's words, if there are any.
        samples: positions kept by the sampling tools under s1, s2, ...
        unseen: by plan id, targets whose outlines are to be looked at before robots move.
        doubted: what was found last with too little confidence, for a person to look at.
        found: what was found in the picture, once somebody has asked.
        arrivals: by plan id, what was observed after a deployment, and the way there.
    """

    scene: Scene
    settings: Settings = field(default_factory=Settings)
    pointed: tuple[TargetPrompt, ...] = ()
    instruction: str = ""
    plans: dict[str, Plan] = field(default_factory=dict[str, Plan])
    samples: dict[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    doubted: Target | None = None
    unseen: dict[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    found: tuple[Candidate, ...] | None = None
    arrivals: dict[str, Arrival] = field(default_factory=dict[str, Arrival])
    frames: dict[str, list[FloatArray]] = field(default_factory=dict[str, list[FloatArray]])

    def __post_init__(self) -> None:
        self.settings.check()
        if self.settings.metres_per_pixel is not None:
            self.scene = replace(self.scene, metres_per_pixel=self.settings.metres_per_pixel)
        problems = [p for q in self.pointed for p in q.problems(*self.scene.picture.size)]
        if problems:
            raise InputError(" ".join(problems))

    def copy(self) -> "Workspace":
        """One to work on that leaves this one as it is."""
        made = copy(self)
        for name in ("plans", "samples", "arrivals", "frames", "unseen"):
            setattr(made, name, dict(getattr(self, name)))
        return made

    def adopt(self, other: "Workspace") -> None:
        """Become what a copy has become."""
        vars(self).update(vars(other))

    def segment(self, prompt: TargetPrompt) -> Target:
        """Find the outline of the thing pointed at and keep it as a target.

        Points alone, for a target found from an outline that was drawn, correct that.

        Raises:
            ToolError: the prompt does not fit the picture, or the mask is not to be believed.
        """
        picture = self.scene.picture
        prompt = self._with_outline(prompt)
        problems = prompt.problems(picture.width, picture.height)
        if problems:
            raise ToolError(" ".join(problems))
        try:
            outline, confidence, parts = self._measured(prompt)
        except InputError as error:
            text = f"Insufficient segmentation accuracy. {error} {ADVICE[prompt.how]}"
            raise ToolError(text) from None
        target = Target(
            id=prompt.id,
            label=prompt.label or "the thing pointed at",
            box=outline.bounds,
            confidence=round(confidence, 3),
            outline=outline,
            prompt=prompt.how,
            parts=tuple((name, round(value, 3)) for name, value in parts.items()),
            missed=missed_vertices(outline, prompt),
            source=None if prompt.outline is None else prompt,
        )
        threshold = self.threshold(prompt.how)
        if confidence < threshold:
            self.doubted = target
            raise ToolError(_insufficient(confidence, threshold, prompt.how))
        self.scene = self.scene.with_target(target)
        return target

    def _with_outline(self, prompt: TargetPrompt) -> TargetPrompt:
        """The prompt, with the outline that its points correct if it has no way of its own."""
        known = next((t.source for t in self.scene.targets if t.id == prompt.id), None)
        if prompt.how == "point" and known is not None:
            mended = known.corrected_by(prompt)
            most = max(len(mended.points or ()), len(mended.negative))
            if most > MAX_POINTS:
                raise ToolError(
                    f"{prompt.id} would have {most} points that correct its outline, "
                    f"{MAX_POINTS} at most: draw a closer outline."
                )
            return mended
        if prompt.how == "point" and prompt.points is None:
            raise ToolError(
                f"Negative points alone correct an outline that was drawn; {prompt.id} has none. "
                "Give an outline, a box or points with them."
            )
        return prompt

    def threshold(self, how: str) -> float:
        """The least confidence a mask pointed at in that way is used at."""
        chosen = self.settings.threshold
        usual = segmenter_named(self.settings.segmenter).thresholds
        return usual[how] if chosen is None else chosen

    def candidates(self) -> tuple[Candidate, ...]:
        """The things in the picture, found when first asked for."""
        if self.found is None:
            self.found = find_candidates(self.scene.picture.pixels)
        return self.found

    def candidate(self, name: str) -> Candidate:
        """The candidate with an id.

        Raises:
            ToolError: there is none; the text says which there are.
        """
        found = self.candidates()
        for candidate in found:
            if candidate.id == name:
                return candidate
        known = f"c1 to c{len(found)}" if found else "none: nothing stands out in this picture"
        raise ToolError(f"There is no candidate {name!r}. Candidates: {known}.")

    def _measured(self, prompt: TargetPrompt) -> tuple[Outline, float, Mapping[str, float]]:
        """Outline, confidence and its parts."""
        segmenter = segmenter_named(self.settings.segmenter)
        candidate = None if prompt.candidate is None else self.candidate(prompt.candidate)
        found = measure_outline(self.scene.picture, prompt, segmenter, candidate)
        return found.outline, found.confidence, found.parts

    def keep_sample(self, points: FloatArray) -> str:
        """Store sampled positions, (n, 2), and name them."""
        name = f"s{len(self.samples) + 1}"
        self.samples[name] = points
        return name

    def current_plan(self, plan_id: str | None) -> Plan:
        """The plan with an id, if the scene is still the one it was certified in.

        Args:
            plan_id: None for the plan proposed last.

        Raises:
            ToolError: no such plan, or the scene has changed since.
        """
        if plan_id is None and self.plans:
            plan_id = list(self.plans)[-1]
        if plan_id is None or plan_id not in self.plans:
            known = ", ".join(self.plans) or "none yet: propose a formation first"
            named = "" if plan_id is None else f" {plan_id!r}"
            raise ToolError(f"There is no plan{named}. Plans: {known}.")
        plan = self.plans[plan_id]
        if plan.formation.scene_version != self.scene.version:
            raise ToolError(
                f"Plan {plan_id} is void: what it is about was measured again since, or the scale "
                "is another. Deploy one proposed since, or propose this again as it was."
            )
        return plan

    def fleet_for(self, contract: Contract, site: Site) -> Fleet:
        """The robots that would move.

        Raises:
            ToolError: more robots than are simulated.
            InputError: starting positions that cannot be.
        """
        if contract.robots > MAX_ROBOTS:
            raise ToolError(
                f"{contract.robots} robots can be placed and certified, but motion is simulated "
                f"only up to {MAX_ROBOTS} so far: the plan stands, nothing was moved."
            )
        solid, radius = obstacles(contract, site), contract.robot_radius
        if self.settings.starts is None:
            starts = spread_starts(contract.robots, site, solid, radius)
        else:
            starts = checked_starts(self.settings.starts, contract.robots, site, solid, radius)
        return SimulatedFleet(starts, seed=self.settings.seed)


ADVICE = {
    "point": "Draw a box close around the thing, or better a rough outline.",
    "candidate": "Draw a rough outline of 4 to 12 vertices around the thing.",
    "box": "Draw a rough outline of 4 to 12 vertices around the thing.",
    "outline": "Draw the outline closer, or name points that do not belong; if what was found "
    "looks right, the person may allow a lower threshold.",
}


def _insufficient(confidence: float, threshold: float, how: str) -> str:
    shown = math.floor(100 * confidence) / 100  # never rounded up to the threshold
    return (
        f"Insufficient segmentation accuracy. The mask's confidence is {shown:.2f}, below the "
        f"threshold {threshold:.2f}. {ADVICE[how]}"
    )
