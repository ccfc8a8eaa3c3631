"""A formation while it is edited: its groups, who is who in them, and who is to stay."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydantic import ValidationError

from ...errors import ToolError
from ...geometry.outline import FloatArray
from ..contract import OUTSIDE, Contract, Group, broken_rules
from ..placement.group_conflicts import Stand
from ..placement.place import Site
from ..plan import Plan
from .edit_kinds import (
    Add,
    Closure,
    Count,
    Distance,
    Edit,
    Heading,
    Offset,
    Opening,
    Remove,
    Rotate,
    Scale,
    Shift,
    SideOnly,
    Sides,
    Target,
)
from .part import IntArray, Part, pairs

NEW = 100_000
"""Robots that were added are called by no number yet: later than all that are."""


@dataclass(frozen=True)
class Draft:
    """A formation on its way to the next one.

    Attributes:
        contract: of which all but the groups is meant.
        numbers: what each robot is called by, and its place in the formation before, from 0.
        held: those of these who are to stay where they are.
        notes: what is to be said of it.
    """

    contract: Contract
    parts: tuple[Part, ...]
    numbers: Mapping[int, int]
    site: Site
    held: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()

    @property
    def was(self) -> IntArray:
        """For each robot its place in the formation before, from 0; -1 for one added."""
        return np.concatenate([part.was for part in self.parts])

    @property
    def points(self) -> FloatArray:
        """Where robots are, (n, 2)."""
        return np.concatenate([part.points for part in self.parts])

    def number(self, index: int) -> int:
        """What a robot is called by."""
        return next((n for n, i in self.numbers.items() if i == index), NEW)

    def indices(self, robots: Collection[int]) -> IntArray:
        """Places in the formation before of robots that are there, from 0.

        Raises:
            ToolError: one is not.
        """
        here = {n: i for n, i in self.numbers.items() if i in set(self.was.tolist())}
        if strange := sorted(set(robots) - set(here)):
            names, all_ = " and ".join(f"no robot {r}" for r in strange), sorted(here)
            gapless = all_ == list(range(1, len(all_) + 1))
            known = ", ".join(map(str, all_))
            there = f"they go from 1 to {len(all_)}" if gapless else f"there are {known}"
            raise ToolError(f"There is {names}: {there}.")
        return np.array([here[r] for r in robots], dtype=np.intp)

    def with_parts(self, parts: Iterable[Part]) -> "Draft":
        """With other groups, those without robots left out.

        Raises:
            ToolError: nobody is left, or there is no such group.
        """
        left = [_in_step(part) for part in parts if len(part.points)]
        if not left:
            raise ToolError("Nobody would be left: at least one robot has to stay.")
        stands = [Stand(part.group, part.points) for part in left]
        keep_out = self.contract.keep_out
        beside = (tuple(stands[:k] + stands[k + 1 :]) for k in range(len(left)))
        whole = [replace(p, beside=b, keep_out=keep_out) for p, b in zip(left, beside, strict=True)]
        return replace(self, parts=tuple(whole))

    def with_each(self, chosen: Collection[int], rule: Callable[[Part], Part]) -> "Draft":
        """With some groups, from 0, changed one after another by the same rule."""
        draft = self
        for k in chosen:
            draft = draft.with_parts(rule(p) if i == k else p for i, p in enumerate(draft.parts))
        return draft

    def agreed(self) -> Contract:
        """The contract with the groups as they are now.

        Raises:
            ToolError: they contradict it.
        """
        groups = tuple(part.group for part in self.parts)
        try:
            return Contract.model_validate({**self.contract.model_dump(), "groups": groups})
        except ValidationError as error:
            raise ToolError(f"That cannot be: {broken_rules(error)}.") from None

    def chosen(self, edit: Edit) -> list[int]:
        """Which groups an edit is for, from 0.

        Raises:
            ToolError: there is no such group, or it is not said which.
        """
        number, count = getattr(edit, "group", None), len(self.parts)
        if number is not None and number > count:
            raise ToolError(f"There is no group {number}: they go from 1 to {count}.")
        if number is not None:
            return [number - 1]
        free = [k for k, part in enumerate(self.parts) if not set(part.was) <= self.held]
        if isinstance(edit, Rotate | Shift | Scale | Heading) or edit.kind == "mirror":
            return free
        some = [k for k in free if _suits(edit, self.parts[k].group)] or free[:1]
        if isinstance(edit, Add | Remove | Count | SideOnly) and len(some) > 1:
            raise ToolError(f"Say which of the groups 1 to {count} is meant.")
        return some


def _suits(edit: Edit, group: Group) -> bool:
    """Whether an edit that names no group can be meant for this one."""
    if isinstance(edit, Offset):
        return group.clearance is not None or group.stands_beside
    if isinstance(edit, Target):
        return group.relation != "at" or bool(group.targets)
    if isinstance(edit, Distance):
        return group.clearance is not None
    if isinstance(edit, Sides | Opening | Closure):
        return group.relation in OUTSIDE
    return group.relation != "at"


def _in_step(part: Part) -> Part:
    """A group that says how many robots it has, and where those at points of their own are."""
    points = pairs(part.points) if part.group.relation == "at" else None
    return replace(part, group=part.valid_group(robots=len(part.points), points=points))


def draft_of(plan: Plan, site: Site) -> Draft:
    """The formation of a plan, to be edited.

    Raises:
        ToolError: it is partial, or has not as many positions as robots.
    """
    contract, points = plan.formation.contract, plan.formation.points
    if plan.partial is not None:
        short = plan.partial.short(site.metres_per_pixel)
        raise ToolError(
            f"Plan {plan.id} is partial ({short}); propose what is wanted instead before changing "
            "it."
        )
    if len(points) != contract.robots:
        raise ToolError(
            f"Plan {plan.id} has {len(points)} positions for {contract.robots} robots; propose it "
            "anew before changing it."
        )
    ends = np.cumsum([g.robots for g in contract.groups])
    places = np.split(np.arange(len(points)), ends[:-1])
    radius = contract.robot_radius
    parts = [
        Part(group, points[mine], mine, site, radius)
        for group, mine in zip(contract.groups, places, strict=True)
    ]
    return Draft(contract, (), numbers_of(plan), site).with_parts(parts)


def numbers_of(plan: Plan) -> dict[int, int]:
    """What each robot is called by: its id where that is a number, else its rank in the fleet."""
    names = plan.formation.robot_of_place
    if all(name.isdecimal() for name in names):
        return {int(name): i for i, name in enumerate(names)}
    rank = {name: k for k, name in enumerate(plan.formation.robots, 1)}
    return {rank[name]: i for i, name in enumerate(names)}
