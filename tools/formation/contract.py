"""What an instruction demands of a formation, in a form code can check.

A model (or a person) writes a Contract before anything is placed; the checker certifies
positions against it. Lengths are pixels of the picture; clearances are measured from the
outline to the robot's edge, so a robot of radius r keeps its centre r further away.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from ..geometry.outline import Outline

MAX_ROBOTS = 10_000
MIN_SPACING = 2.0
"""Centres of point robots nearer than this, px, are the same place."""
CLEARANCE_SHARE, MIN_CLEARANCE = 0.16, 6.0
"""Default clearance: this share of the target's size (square root of its area), at least 6 px."""
CORNER_SHARE, MIN_STANDOFF = 0.045, 3.0
INSIDE_SHARE = 0.05
CENTRE_SHARE = 0.2

Relation = Literal["around", "cage", "corners", "along", "inside", "between", "centre", "shape"]
SideName = Literal["left", "right", "top", "bottom", "long", "short"]
Fit = Literal["tight", "normal", "wide"]
FIT_FACTOR = {"tight": 0.5, "normal": 1.0, "wide": 2.0}
Length = Annotated[float, Field(ge=0, le=100_000, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]


def _numbers(count: int) -> WithJsonSchema:
    """Schema of a fixed-length list; providers do not all know prefixItems."""
    return WithJsonSchema(
        {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}
    )


OUTSIDE: frozenset[str] = frozenset({"around", "cage", "corners", "along"})


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Group(_Frozen):
    """One arrangement."""

    relation: Relation = Field(
        description="around: even ring; cage: closed ring, nothing gets out; corners: one at each "
        "corner; along: beside one side or chosen edges; inside: spread evenly over it; between: "
        "two targets; centre: gathered at its centre; shape: a line, or free positions."
    )
    targets: tuple[str, ...] = Field(
        default=(), max_length=2, description="Ids such as t1; two for between, else one."
    )
    robots: int = Field(ge=1, le=MAX_ROBOTS, description="How many of the robots.")
    clearance: Annotated[tuple[Length, Length], _numbers(2)] | None = Field(
        default=None,
        description="Least and greatest distance from the outline to a robot's edge, px; only "
        "where the person named a length.",
    )
    fit: Fit = Field(default="normal", description="How close, where no length was named.")
    spacing: Literal["even", "free"] = Field(
        default="even", description="free: neighbours need not be evenly spaced."
    )
    min_spacing: Length | None = Field(
        default=None, description="Least distance of two robots' centres, px; if named."
    )
    max_gap: Length | None = Field(
        default=None, description="cage: widest opening between neighbours' edges, px; if named."
    )
    side: SideName | None = Field(
        default=None,
        description="along: which side, as seen in the picture, or its long or short side.",
    )
    edges: tuple[Annotated[int, Field(ge=0)], ...] | None = Field(
        default=None,
        min_length=1,
        description="along: edges by number, see describe_shape, instead of a side.",
    )
    layout: Literal["line", "divider"] = Field(
        default="line",
        description="between: a line that joins them, or a divider that parts them.",
    )
    line: Annotated[tuple[Coordinate, Coordinate, Coordinate, Coordinate], _numbers(4)] | None = (
        Field(default=None, description="shape: x0, y0, x1, y1 of a straight line; left out: free.")
    )
    closure: Literal["ring", "escape-proof"] | None = Field(
        default=None,
        description="cage: ring, the default; escape-proof: certified that it cannot get out "
        "however it moves and turns, evenly spaced or not; only if asked for.",
    )
    walls: bool | None = Field(
        default=None, description="cage, escape-proof: the picture's border is a wall; if said."
    )

    @model_serializer(mode="wrap")
    def _walls_if_said(self, dump: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Without walls where nothing is said of them: plans of before there were any keep ids."""
        data: dict[str, object] = dump(self)
        return data if self.walls is not None else {k: v for k, v in data.items() if k != "walls"}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = [*self._missing(), *self._misplaced()]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    def _missing(self) -> Iterator[str]:
        wanted = {"between": 2, "shape": 0}.get(self.relation, 1)
        if self.relation != "shape" and len(self.targets) != wanted:
            yield f"{self.relation} takes {wanted} target(s), got {len(self.targets)}"
        if len(set(self.targets)) < len(self.targets):
            yield f"targets {self.targets} must differ"
        if self.relation == "along" and (self.side is None) == (self.edges is None):
            yield "along takes either a side or edges"
        if self.relation == "cage" and self.robots < 3:
            yield f"a cage takes 3 or more robots, got {self.robots}"
        if self.clearance is not None and not self.clearance[0] <= self.clearance[1] > 0:
            yield f"clearance {self.clearance} must be (least, greatest > 0)"

    def _misplaced(self) -> Iterator[str]:
        if self.clearance is not None and self.relation in ("between", "centre", "shape"):
            yield f"clearance does not apply to {self.relation}"
        if self.relation == "cage" and self.spacing != "even":
            yield "a cage is evenly spaced"
        if self.walls and self.closure != "escape-proof":
            yield "walls belong to the closure escape-proof"
        for name, only in _ONLY_IN.items():
            if getattr(self, name) is not None and self.relation != only:
                yield f"{name} belongs to {only}, not to {self.relation}"


_ONLY_IN = {
    "side": "along",
    "edges": "along",
    "max_gap": "cage",
    "closure": "cage",
    "walls": "cage",
    "line": "shape",
}


class Contract(_Frozen):
    """All groups of a formation; robots are numbered through them in order, from 1."""

    groups: tuple[Group, ...] = Field(min_length=1, max_length=50)
    robot_radius: Length = Field(default=0.0, description="Radius of a robot, px; 0 is a point.")
    keep_out: tuple[str, ...] = Field(default=(), description="Further targets no robot may touch.")
    reading: str = Field(
        default="",
        max_length=300,
        description="Only where propose_formation doubts the contract: why it is what is meant.",
    )

    @property
    def robots(self) -> int:
        """Robots over all groups."""
        return sum(group.robots for group in self.groups)

    @property
    def target_ids(self) -> tuple[str, ...]:
        """Every target named, once, in order."""
        named = [t for group in self.groups for t in group.targets] + list(self.keep_out)
        return tuple(dict.fromkeys(named))

    @property
    def solid_targets(self) -> tuple[str, ...]:
        """Targets no robot may stand on or drive over: those that no group is to enter."""
        entered = {t for g in self.groups if g.relation in ("inside", "centre") for t in g.targets}
        return tuple(t for t in self.target_ids if t in self.keep_out or t not in entered)

    @property
    def spacing_floor(self) -> float:
        """Least distance of any two robots' centres, px: bodies must not overlap."""
        return max(2 * self.robot_radius, MIN_SPACING)


def with_defaults(
    contract: Contract, outlines: Mapping[str, Outline], room: tuple[float, float]
) -> Contract:
    """The contract with every length it leaves open written out, so that all can be read.

    Args:
        contract: as stated.
        outlines: of every target it names.
        room: width and height of the picture, px.
    """
    groups = tuple(
        group.model_copy(update=_defaults(group, outlines, room, contract))
        for group in contract.groups
    )
    return contract.model_copy(update={"groups": groups})


def nominal(clearance: tuple[float, float]) -> float:
    """The clearance aimed at within an allowed range, px: the geometric mean.

    "At least" allows everything further out as well; no more than twice the least is aimed at.
    """
    least, greatest = clearance
    return math.sqrt(least * min(greatest, 4 * least)) if least > 0 else greatest / 2


def default_clearance(outline: Outline, room: tuple[float, float], radius: float) -> float:
    """0.16 of the target's size, at least 6 px, no more than the picture has room for."""
    x0, y0, x1, y1 = outline.bounds
    widest = max(x0, y0, room[0] - 1 - x1, room[1] - 1 - y1) - 2 * radius
    return min(max(CLEARANCE_SHARE * outline.size, MIN_CLEARANCE), max(0.6 * widest, 1.0))


def _defaults(
    group: Group, outlines: Mapping[str, Outline], room: tuple[float, float], contract: Contract
) -> dict[str, object]:
    update: dict[str, object] = {}
    if group.min_spacing is None or group.min_spacing < contract.spacing_floor:
        update["min_spacing"] = contract.spacing_floor
    if group.relation == "cage" and group.closure is None:
        update["closure"] = "ring"
    if group.clearance is None and group.targets:
        outline = outlines[group.targets[0]]
        update["clearance"] = _default_range(group, outline, room, contract.robot_radius)
    return update


def _default_range(
    group: Group, outline: Outline, room: tuple[float, float], radius: float
) -> tuple[float, float] | None:
    if group.relation in ("around", "cage", "along"):
        aim = default_clearance(outline, room, radius) * FIT_FACTOR[group.fit]
        return (aim / 2, aim * 2)
    if group.relation == "corners":
        aim = max(CORNER_SHARE * outline.size, MIN_STANDOFF) * FIT_FACTOR[group.fit]
        return (aim / 3, aim * 3)
    if group.relation == "inside":
        least = min(INSIDE_SHARE * outline.size, 0.15 * outline.min_width)
        return (least, outline.size)
    return None
