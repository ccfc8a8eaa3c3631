"""What an instruction demands of a formation, in a form that code can check.

A model or a person writes a Contract before anything is placed; the checker certifies positions
against it. Lengths are image pixels, or metres until `contract_in_pixels`; clearances run from the
outline to the robot's edge, so a robot of radius r keeps its centre r further away.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from ..geometry.outline import Outline
from .shape_spec import Four, Pair, ShapeSpec, numbers
from .value import Value

MAX_ROBOTS = 10_000
MIN_SPACING = 2.0
"""Point robots whose centres are nearer than this, px, are in the same place."""
CLEARANCE_SHARE, MIN_CLEARANCE = 0.16, 6.0
"""Default clearance: this share of the target's size (square root of its area), and least value,
px."""
CORNER_SHARE, MIN_STANDOFF = 0.06, 3.0
LEAST_SOLVED = 1.0
"""Least clearance, px, of a ring whose clearance follows from its radius or its pitch."""
INSIDE_SHARE = 0.05
CENTRE_SHARE = 0.2
PITCH_SHARE, PITCH_PX = 0.01, 0.5
"""Tolerance of the distance of neighbours at an exact pitch: this share, at least PITCH_PX px."""

EXACT_SHARE, EXACT_PX = 0.05, 1.0
"""Tolerance of a clearance stated exactly: this share of it, at least EXACT_PX px."""

Relation = Literal[
    "around", "cage", "corners", "along", "inside", "between", "centre", "shape", "at"
]
Unit = Literal["px", "m"]
SideName = Literal["left", "right", "top", "bottom", "long", "short", "other long", "other short"]
RingPart = Literal[
    "left", "right", "top", "bottom", "left half", "right half", "top half", "bottom half"
]
Fit = Literal["tight", "normal", "wide"]
FIT_FACTOR = {"tight": 0.5, "normal": 1.0, "wide": 2.0}
MAX_LENGTH = 100_000.0
"""A greatest clearance of this, px, means that there is none, as in "at least"."""
LOOKING = ("towards", "away")
DIRECTIONS = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "top": (0.0, -1.0), "bottom": (0.0, 1.0)}
Length = Annotated[float, Field(ge=0, le=MAX_LENGTH, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]
OUTSIDE: frozenset[str] = frozenset({"around", "cage", "corners", "along"})


class Group(Value):
    """One arrangement; lengths only if named.

    around: even ring (surround, guard); opening: least gap in it (0: any). cage: closed
    ring ("no gap", "nobody gets in", "must stay put", "cannot be pushed off"); escape-proof, walls
    (the picture's border is one): only if so said. corners: one at each ("surround at the
    corners"); clearance [0, 0]: on them. along: one of side, edges (describe_shape's numbers),
    facing an id. inside: spread (in, on). between: two targets. centre: gathered.
    shape: shape, line (x0, y0, x1, y1) or positions. at: points. clearance: from the outline
    (inside: inwards) to robots' edges; 15 px away: [15, 15], at least 15 [15, 1000]; else fit:
    normal also "next to". min_spacing, pitch (exact): of centres; max_gap: of edges. heading:
    towards, away, id or degrees; opening_towards: left, right, top, bottom, id or degrees.
    """

    relation: Relation
    targets: tuple[str, ...] = Field(default=(), max_length=2)
    robots: int = Field(ge=1, le=MAX_ROBOTS)
    clearance: Annotated[tuple[Length, Length], numbers(2)] | None = None
    fit: Fit = "normal"
    spacing: Literal["even", "free"] = "even"
    min_spacing: Length | None = None
    max_gap: Length | None = None
    pitch: Length | None = Field(default=None, gt=0)
    radius: Length | None = Field(default=None, gt=0)
    sides: tuple[RingPart, ...] | None = Field(default=None, min_length=1)
    opening: Length | None = None
    opening_towards: str | Angle | None = None
    side: SideName | None = None
    edges: tuple[Annotated[int, Field(ge=0)], ...] | None = Field(default=None, min_length=1)
    layout: Literal["line", "divider"] = "line"
    line: Four | None = None
    points: tuple[Pair, ...] | None = None
    closure: Literal["ring", "escape-proof"] | None = None
    walls: bool | None = None
    facing: str | None = None
    shape: ShapeSpec | None = None
    heading: str | Angle | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = [*self._missing(), *self._misplaced()]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def keeps_clearance(self) -> bool:
        """Whether a clearance applies; to a shape, if it is around, inside or beside a target."""
        if self.shape is not None:
            return self.shape.where not in (None, "on")
        return self.relation not in ("between", "centre", "shape", "at")

    @property
    def enters(self) -> bool:
        """Whether its robots are meant to stand on its target."""
        within = self.shape is not None and self.shape.where in ("inside", "on")
        return within or self.relation in ("inside", "centre")

    @property
    def stands_beside(self) -> bool:
        """Whether its robots are placed independently of its one target and only keep off it."""
        free = self.relation in ("shape", "at") and not self.keeps_clearance
        return free and not self.enters and len(self.targets) == 1

    @property
    def opens(self) -> bool:
        """Whether its ring is to have an opening."""
        return self.opening is not None or self.opening_towards is not None

    @property
    def solves_clearance(self) -> bool:
        """Whether the distance from the target follows from the pitch of the robots on the ring."""
        whole = self.radius is None and self.sides is None and not self.opens
        return self.relation == "around" and self.pitch is not None and self.robots > 1 and whole

    @property
    def on_corners(self) -> bool:
        """Whether its robots' centres have to be exactly at the corners."""
        return self.relation == "corners" and self.clearance == (0, 0)

    def offsets(self, radius: float = 0.0) -> tuple[float, float]:
        """Return the least and greatest distance of robots' centres from the outline, px.

        Args:
            radius: radius of a robot, px; 0 gives the distance of their edges, the clearance.
        """
        assert self.clearance is not None  # the contract's defaults are written out
        least, greatest = self.clearance
        return least + radius, greatest + radius

    def _missing(self) -> Iterator[str]:
        wanted = {"between": 2}.get(self.relation, 1)
        if self.relation not in ("shape", "at") and len(self.targets) != wanted:
            yield f"{self.relation} takes {wanted} target(s), got {len(self.targets)}"
        if len(set(self.targets)) < len(self.targets):
            yield f"targets {self.targets} must differ"
        ways = [self.side, self.edges, self.facing]
        if self.relation == "along" and sum(way is not None for way in ways) != 1:
            yield "along takes either a side or edges, or facing: one of them"
        if self.shape is not None and self.shape.where is not None and len(self.targets) != 1:
            yield f"a shape {self.shape.where} a target takes 1 target, got {len(self.targets)}"
        if self.opens and self.robots < 2:
            yield "an opening takes 2 or more robots"
        if self.opens and self.sides is not None:
            yield "a ring takes an opening or sides, not both"
        free = self.spacing == "free" or (
            self.relation == "shape" and not (self.shape or self.line)
        )
        if self.pitch is not None and free:
            yield "what is freely spaced has no pitch"
        if self.relation == "cage" and self.robots < 3:
            yield f"a cage takes 3 or more robots, got {self.robots}"
        if (
            not self.on_corners
            and self.clearance
            and not self.clearance[0] <= self.clearance[1] > 0
        ):
            yield f"clearance {self.clearance} must be (least, greatest > 0)"

    def _misplaced(self) -> Iterator[str]:
        if self.relation == "at" and len(self.points or ()) != self.robots:
            yield f"at takes a point for each robot, got {len(self.points or ())}"
        if self.clearance is not None and not self.keeps_clearance:
            yield f"clearance does not apply to {self.relation}"
        if self.facing is not None and self.facing in self.targets:
            yield f"{self.facing} cannot face itself"
        if self.shape is not None and self.line is not None:
            yield "a shape is either a line or a form"
        if self.relation == "cage" and self.spacing != "even":
            yield "a cage is evenly spaced"
        if self.walls and self.closure != "escape-proof":
            yield "walls belong to the closure escape-proof"
        for name, only in ONLY_IN.items():
            if getattr(self, name) is not None and self.relation not in only:
                yield f"{name} belongs to {' or '.join(only)}, not to {self.relation}"


ONLY_IN = {
    "side": ("along",),
    "edges": ("along",),
    "max_gap": ("cage", "around", "along"),
    "pitch": ("around", "along", "shape"),
    "radius": ("around",),
    "sides": ("around",),
    "opening": ("around",),
    "opening_towards": ("around",),
    "closure": ("cage",),
    "walls": ("cage",),
    "line": ("shape",),
    "points": ("at",),
    "facing": ("along",),
    "shape": ("shape",),
}
"""The relations that a field of a group applies to, for fields that do not apply to all."""


class Contract(Value):
    """All groups of a formation; robots are numbered through them in order, from 1.

    Attributes:
        robot_radius: 0 is a point.
        unit: of its lengths, where the picture has a scale; places are px.
        keep_out: ids no robot may stand on or drive over; other things are kept off where possible.
        keep_out_clearance: how far from them the edges of robots stay.
        reading: why this is what is meant, where the words were held against it.
    """

    groups: tuple[Group, ...] = Field(min_length=1, max_length=50)
    robot_radius: Length = 0.0
    unit: Unit | None = None
    keep_out: tuple[str, ...] = ()
    keep_out_clearance: Length = Field(default=0.0, exclude_if=lambda px: not px)
    reading: str = Field(default="", max_length=300)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        both = sorted({t for g in self.groups if g.enters for t in g.targets} & {*self.keep_out})
        if both:
            raise ValueError(f"robots are to stand on {both[0]}, which keep_out forbids")
        return self

    @property
    def robots(self) -> int:
        """The number of robots over all groups."""
        return sum(group.robots for group in self.groups)

    @property
    def target_ids(self) -> tuple[str, ...]:
        """The ids of everything named, each once: targets and keep-outs, then what is faced."""
        named = [t for group in self.groups for t in group.targets] + list(self.keep_out)
        faced = [group.facing for group in self.groups if group.facing is not None]
        ways = [way for group in self.groups for way in (group.opening_towards, group.heading)]
        faced += [w for w in ways if isinstance(w, str) and w not in (*DIRECTIONS, *LOOKING)]
        return tuple(dict.fromkeys(named + faced))

    @property
    def solid_targets(self) -> tuple[str, ...]:
        """Targets that no robot may stand on or drive over: those that no group enters."""
        entered = {t for g in self.groups if g.enters for t in g.targets}
        return tuple(t for t in self.target_ids if t in self.keep_out or t not in entered)

    @property
    def spacing_floor(self) -> float:
        """Least distance between any two robots' centres, px, at which bodies do not overlap."""
        return max(2 * self.robot_radius, MIN_SPACING)


def broken_rules(error: ValidationError) -> str:
    """Return what is wrong with the fields of a contract or group, as its validators phrase it."""
    return "; ".join(e["msg"].removeprefix("Value error, ") for e in error.errors())


def with_defaults(
    contract: Contract, outlines: Mapping[str, Outline], room: tuple[float, float]
) -> Contract:
    """Return the contract with all lengths it leaves open filled in.

    `room` is the picture's width and height, px.
    """
    groups = tuple(
        group.model_copy(update=_defaults(group, outlines, room, contract))
        for group in contract.groups
    )
    return contract.model_copy(update={"groups": groups})


def nominal(clearance: tuple[float, float]) -> float:
    """Return the clearance to aim at within an allowed range, px: the geometric mean.

    "At least" allows any distance further out; the aim is then no more than twice the least.
    """
    least, greatest = clearance
    return math.sqrt(least * min(greatest, 4 * least)) if least > 0 else greatest / 2


def has_default_clearance(
    group: Group, outlines: Mapping[str, Outline], room: tuple[float, float], radius: float
) -> bool:
    """Return whether a group's clearance is the one it gets by default."""
    if group.clearance is None or not group.targets:
        return True
    return group.clearance == _default_range(group, outlines[group.targets[0]], room, radius)


def default_clearance(outline: Outline, room: tuple[float, float], radius: float) -> float:
    """Return 0.16 of the target's size, at least 6 px but no more than the picture has room for."""
    x0, y0, x1, y1 = outline.bounds
    widest = max(x0, y0, room[0] - 1 - x1, room[1] - 1 - y1) - 2 * radius
    return min(max(CLEARANCE_SHARE * outline.size, MIN_CLEARANCE), max(0.6 * widest, 1.0))


def exact_clearance(group: Group, px: float) -> tuple[float, float]:
    """Return the clearance range, px, for a distance stated exactly; for inside, "at least"."""
    if group.relation == "inside":
        return px, MAX_LENGTH
    slack = max(EXACT_PX, EXACT_SHARE * px)
    return max(px - slack, 0.0), px + slack


def _defaults(
    group: Group, outlines: Mapping[str, Outline], room: tuple[float, float], contract: Contract
) -> dict[str, object]:
    update: dict[str, object] = {}
    if group.min_spacing is None or group.min_spacing < contract.spacing_floor:
        update["min_spacing"] = max(contract.spacing_floor, _least_pitch(group))
    if group.relation == "cage" and group.closure is None:
        update["closure"] = "ring"
    if group.opens:
        update["opening"] = group.opening or 0.0
        update["opening_towards"] = (
            "bottom" if group.opening_towards is None else group.opening_towards
        )
    if group.clearance is None and (group.radius is not None or group.solves_clearance):
        update["clearance"] = (LEAST_SOLVED, MAX_LENGTH)
    elif group.clearance is None and group.targets:
        outline = outlines[group.targets[0]]
        update["clearance"] = _default_range(group, outline, room, contract.robot_radius)
    return update


def _least_pitch(group: Group) -> float:
    return 0.0 if group.pitch is None else group.pitch - pitch_slack(group.pitch)


def pitch_slack(pitch: float) -> float:
    """Return the tolerance, px, on the distance between neighbours at an exact pitch."""
    return max(PITCH_SHARE * pitch, PITCH_PX)


def _default_range(
    group: Group, outline: Outline, room: tuple[float, float], radius: float
) -> tuple[float, float] | None:
    if group.shape is not None and group.shape.where == "inside":
        return (INSIDE_SHARE * outline.size, outline.size)
    if group.relation in ("around", "cage", "along") or (group.shape and group.keeps_clearance):
        aim = default_clearance(outline, room, radius) * FIT_FACTOR[group.fit]
        return (aim / 2, aim * 2)
    if group.relation == "corners":
        aim = max(CORNER_SHARE * outline.size * FIT_FACTOR[group.fit], MIN_STANDOFF)
        return (aim / 3, aim * 3)
    if group.relation == "inside":
        least = min(INSIDE_SHARE * outline.size, 0.15 * outline.min_width)
        return (least, outline.size)
    return None
