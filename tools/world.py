"""World: all that is known and decided in a conversation, as one frozen value.

Tools read it from their Context and return the next one; only the loop puts that in place. Files
and logs hold it as its JSON. Frame everywhere: image pixels as the person sees them, x right, y
down, pixel centres at whole numbers.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import shapely
from pydantic import Field, TypeAdapter, field_validator

from .errors import ToolError
from .fleet.arrival import Arrival
from .fleet.protocol import Pose
from .formation.contract import Contract
from .formation.encounters import Encounter, others_than
from .formation.placement.place import Site
from .formation.plan import Plan, scene_version
from .formation.site import Other
from .formation.units import check_scale
from .formation.value import Value
from .geometry.outline import Outline
from .motion.checking import MotionVerdict
from .outline_field import OutlineField
from .perception.image import Picture
from .perception.measure import Deviation
from .perception.target_prompt import Box, Point, TargetPrompt


class PictureFacts(Value):
    """Which picture it is; its pixels are fetched through the Context."""

    sha256: str
    width: int
    height: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.width, self.height


class Target(Value):
    """An object of interest.

    Attributes:
        id: t1, t2, ... in order of finding.
        label: what it is called; "the thing pointed at" where nobody named it.
        box: x0, y0, x1, y1.
        confidence: alpha, 0 to 1: self-consistency of the segmentation, not accuracy.
        outline: as measured, with its holes.
        prompt: what it was found from: point, box, outline, candidate or mask; or what it was
            derived as: group, gap, bay or part.
        parts: the values that alpha was computed from.
        source: what it was found from, if that was an outline somebody drew, or a mask.
        missed: where the rough outline it was found from reaches beyond `outline`, (x, y, by px).
        added: where `outline` reaches beyond that, likewise.
        seen: whether a model was shown the outline to look at.
        note: what a person should know of how it was found; often empty.
    """

    id: str
    label: str
    box: Box
    confidence: float
    outline: OutlineField
    prompt: str
    parts: dict[str, float] = Field(default_factory=dict)
    missed: tuple[Deviation, ...] = ()
    added: tuple[Deviation, ...] = ()
    source: TargetPrompt | None = None
    seen: bool = False
    note: str = ""


class KeepOut(Value):
    """A region that robots stay off and drive around.

    Attributes:
        id: k1, k2, ... if it is hard, else that of a candidate.
        reason: why, in a few words; for a candidate what it looks like.
        hard: whether a plan that enters it cannot be certified; else it is avoided where possible.
        confidence: 0 to 1, how certain it is that it is a thing.
    """

    id: str
    outline: OutlineField
    reason: str
    hard: bool = True
    confidence: float = 1.0


class ShownCandidate(Value):
    """A candidate that a question offered, so that its id means the same in the answer."""

    id: str
    label: str
    box: Box


class PlanNode(Value):
    """A plan in the tree of plans.

    Attributes:
        parent: id of the plan it was made from by an edit.
        edit: the edits that made it, as JSON.
        words: the person's words that it was made for.
        unseen: targets whose outlines are to be looked at before robots move.
        encounters: other things that robots stand on, or drive over or far around, if known.
        motion: the certificate of the way there from where the robots stood when it was made;
            None where nothing was planned.
    """

    plan: Plan
    parent: str | None = None
    edit: str | None = None
    words: str = ""
    unseen: tuple[str, ...] = ()
    encounters: tuple[Encounter, ...] = ()
    motion: MotionVerdict | None = None


class Step(Value):
    """What undo restores: all that was decided at the end of a turn."""

    targets: tuple[Target, ...] = ()
    keep_out: tuple[KeepOut, ...] = ()
    samples: dict[str, tuple[Point, ...]] = Field(default_factory=dict)
    current: str | None = None


class World(Value):
    """What is known and decided, and nothing else.

    Attributes:
        picture: content hash and size.
        metres_per_pixel: of a picture taken straight from above; None where it is not known.
        pointed: what the person pointed at, in order t1, t2, ...
        targets: measured things.
        keep_out: regions robots stay off.
        plans: by id, in the order they were last proposed.
        current: the id of the current plan, which is certified in full; edits apply to it.
        arrivals: by plan id, what was observed after its last deployment, the latest last.
        robots: last observed pose of each robot; a snapshot, since only the fleet knows.
        shown: candidates that a question offered.
        phrases: nouns that were looked for in the picture, in order; candidates' ids follow it.
        samples: positions that sampling tools named, s1, s2, ...
        doubted: what was found last with too little confidence, for a person to look at.
        undone: how many of the steps that led here were taken back since the last plan was made.

    Raises:
        InputError: an impossible scale.
    """

    picture: PictureFacts
    metres_per_pixel: float | None = None
    pointed: tuple[TargetPrompt, ...] = ()
    targets: tuple[Target, ...] = ()
    keep_out: tuple[KeepOut, ...] = ()
    plans: dict[str, PlanNode] = Field(default_factory=dict)
    current: str | None = None
    arrivals: dict[str, Arrival] = Field(default_factory=dict)
    robots: tuple[Pose, ...] = ()
    shown: tuple[ShownCandidate, ...] = ()
    phrases: tuple[str, ...] = ()
    samples: dict[str, tuple[Point, ...]] = Field(default_factory=dict)
    doubted: Target | None = None
    undone: int = 0

    @field_validator("metres_per_pixel")
    @classmethod
    def _possible_scale(cls, scale: float | None) -> float | None:
        check_scale(scale)
        return scale

    @classmethod
    def of(cls, picture: Picture, **parts: Any) -> "World":
        """Return the world of a picture in which nothing has been found yet, or what `parts` give.

        Its scale is the one that the picture's file gives, if any.
        """
        facts = PictureFacts(sha256=picture.sha256, width=picture.width, height=picture.height)
        parts.setdefault("metres_per_pixel", picture.metres_per_pixel)
        return cls(picture=facts, **parts)

    def having(self, **parts: Any) -> "World":
        """Return the world with other parts, which are not validated again."""
        return self.model_copy(update=parts)

    def version_of(self, contract: Contract) -> str:
        """Return a hash of what a contract's certificate depends on.

        That is the picture, its scale, the outlines the contract names, and all that no robot may
        enter. A target that was measured anew changes it for the contracts that name it.
        """
        named = frozenset(contract.target_ids)
        outlines = {t.id: _canonical(t.outline) for t in self.targets if t.id in named}
        outlines |= {f"-{k.id}": _canonical(k.outline) for k in self.keep_out if k.hard}
        return scene_version(self.picture.sha256, outlines, self.metres_per_pixel)

    def is_void(self, plan: Plan) -> bool:
        """Return whether what a plan was certified in has changed since."""
        return plan.formation.scene_version != self.version_of(plan.formation.contract)

    def target(self, name: str) -> Target:
        """Return the target with an id.

        Raises:
            ToolError: there is none; the text lists those there are.
        """
        for target in self.targets:
            if target.id == name:
                return target
        known = ", ".join(t.id for t in self.targets) or "none yet: segment something first"
        raise ToolError(f"There is no target {name!r}. Targets: {known}.", "unknown_target")

    def with_target(self, target: Target) -> "World":
        """Return the world with one more target, or with the one of the same id replaced."""
        others = tuple(t for t in self.targets if t.id != target.id)
        return self.having(targets=(*others, target))

    def with_doubted(self) -> "World":
        """Return the world to show to a person: with the doubted outline, if there is one."""
        return self if self.doubted is None else self.with_target(self.doubted)

    def with_sample(self, points: Sequence[Point]) -> tuple["World", str]:
        """Return the world with sampled positions under the next name, and that name."""
        name = f"s{len(self.samples) + 1}"
        return self.having(samples={**self.samples, name: tuple(points)}), name

    def with_plan(self, node: PlanNode) -> "World":
        """Return the world with a plan as the latest and, if certified in full, the current one."""
        name = node.plan.id
        others = {n: p for n, p in self.plans.items() if n != name}
        plans = {**others, name: node}
        if not node.plan.verdict.certified or node.plan.partial is not None:
            return self.having(plans=plans)
        return self.having(plans=plans, current=name, undone=0)

    @property
    def latest(self) -> PlanNode:
        """The plan proposed last.

        Raises:
            ToolError: there is none.
        """
        return self.plan(next(reversed(self.plans), None))

    @property
    def step(self) -> Step:
        """What undo would restore."""
        return Step.model_construct(**{name: getattr(self, name) for name in Step.model_fields})

    def back_at(self, step: Step, undone: int) -> "World":
        """Return the world with the decisions of a step; plans and robots stay as they are."""
        parts = {name: getattr(step, name) for name in Step.model_fields}
        return self.having(**parts, undone=undone)

    def with_arrival(self, plan_id: str, arrival: Arrival) -> "World":
        """Return the world after a deployment."""
        others = {n: a for n, a in self.arrivals.items() if n != plan_id}
        return self.having(arrivals={**others, plan_id: arrival})

    def plan(self, plan_id: str | None = None) -> PlanNode:
        """Return the plan with an id, if what it was certified in has not changed.

        Args:
            plan_id: None for the current plan.

        Raises:
            ToolError: no such plan, or the world has changed since.
        """
        plan_id = plan_id or self.current
        if plan_id is None or plan_id not in self.plans:
            known = ", ".join(self.plans) or "none yet: propose a formation first"
            named = "" if plan_id is None else f" {plan_id!r}"
            raise ToolError(f"There is no plan{named}. Plans: {known}.", "unknown_plan")
        node = self.plans[plan_id]
        if node.plan.id != plan_id:
            altered = f"Plan {plan_id} was altered after formup wrote it; propose it again."
            raise ToolError(altered, "void_plan")
        if self.is_void(node.plan):
            raise ToolError(
                f"Plan {plan_id} is void: the picture or its scale is another, or what it is about "
                "was measured again since. Deploy one proposed since, or propose this again.",
                "void_plan",
            )
        return node

    def site(self, contract: Contract) -> Site:
        """Return the outlines a contract refers to, the picture's size, and what else is in it.

        Raises:
            ToolError: the contract names a target that is not there.
        """
        outlines = {name: self.outline(name) for name in contract.target_ids}
        whole = self.whole_site
        others = others_than(contract, outlines, whole.others)
        return replace(whole, outlines=outlines, others=others)

    @property
    def whole_site(self) -> Site:
        """Every outline and everything in the picture, whatever a contract may come to name."""
        hard = {k.id: k.outline for k in self.keep_out if k.hard}
        outlines = {t.id: t.outline for t in self.targets} | hard
        things = [Other(t.id, t.label, t.outline.polygon) for t in self.targets]
        things += [
            Other(k.id, k.reason, k.outline.polygon, k.confidence)
            for k in self.keep_out
            if not k.hard
        ]
        return Site(outlines, *self.picture.size, self.metres_per_pixel, tuple(things))

    def outline(self, name: str) -> Outline:
        """Return the outline of a target, or of a region that no robot may enter.

        Raises:
            ToolError: there is none.
        """
        hard = {k.id: k.outline for k in self.keep_out if k.hard}
        return hard[name] if name in hard else self.target(name).outline

    def met(self, plan_id: str) -> dict[str, Outline]:
        """Return the outlines of things that a plan's robots stand on or drive over, by id."""
        node = self.plans.get(plan_id)
        names = {e.thing for e in node.encounters} if node is not None else set[str]()
        things = (*self.targets, *self.keep_out)
        return {thing.id: thing.outline for thing in things if thing.id in names}


_ANYTHING: TypeAdapter[Any] = TypeAdapter(Any)


def to_json_values(value: Any) -> Any:
    """Return values as JSON, without what has its default value."""
    return _ANYTHING.dump_python(value, mode="json", exclude_defaults=True)


def _canonical(outline: Outline) -> str:
    """Return the region as text that depends neither on where rings start nor on their order."""
    return shapely.to_wkt(shapely.normalize(outline.polygon), rounding_precision=6)
