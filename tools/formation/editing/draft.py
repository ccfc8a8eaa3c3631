"""A formation during edits: its groups, the identity of their robots, and who has to stay."""

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
"""Number of an added robot, which has none yet: it sorts after all others."""


@dataclass(frozen=True)
class Draft:
    """A formation during edits.

    Attributes:
        contract: the contract; its groups are replaced by those of `parts`.
        parts: the groups as they are now.
        numbers: from each robot's number to its index in the formation before, from 0.
        site: the outlines and the picture.
        held: the indices of the robots that have to stay where they are.
        notes: notes for the person about the result.
    """

    contract: Contract
    parts: tuple[Part, ...]
    numbers: Mapping[int, int]
    site: Site
    held: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()

    @property
    def was(self) -> IntArray:
        """For each robot its index in the formation before, from 0, (n,); -1 for an added one."""
        return np.concatenate([part.was for part in self.parts])

    @property
    def points(self) -> FloatArray:
        """The robots' positions, (n, 2), px."""
        return np.concatenate([part.points for part in self.parts])

    def number(self, index: int) -> int:
        """Return the number of the robot with an index in the formation before; NEW if added."""
        return next((n for n, i in self.numbers.items() if i == index), NEW)

    def indices(self, robots: Collection[int]) -> IntArray:
        """Return the indices in the formation before, from 0, of robots by number.

        Raises:
            ToolError: there is no robot of some number.
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
        """Return the draft with other groups, leaving out those without robots.

        Raises:
            ToolError: no robot is left, or a group would be invalid.
        """
        left = [_in_step(part) for part in parts if len(part.points)]
        if not left:
            raise ToolError("Nobody would be left: at least one robot has to stay.")
        stands = [Stand(part.group, part.points) for part in left]
        contract = self.contract
        kept = {
            "keep_out": contract.keep_out,
            "keep_out_clearance": contract.keep_out_clearance,
        }
        beside = (tuple(stands[:k] + stands[k + 1 :]) for k in range(len(left)))
        whole = [replace(p, beside=b, **kept) for p, b in zip(left, beside, strict=True)]
        return replace(self, parts=tuple(whole))

    def with_each(self, chosen: Collection[int], rule: Callable[[Part], Part]) -> "Draft":
        """Return the draft with the chosen groups, from 0, changed one by one by the same rule."""
        draft = self
        for k in chosen:
            draft = draft.with_parts(rule(p) if i == k else p for i, p in enumerate(draft.parts))
        return draft

    def agreed(self) -> Contract:
        """Return the contract with the groups as they are now.

        Raises:
            ToolError: the groups contradict the contract.
        """
        groups = tuple(part.group for part in self.parts)
        try:
            return Contract.model_validate({**self.contract.model_dump(), "groups": groups})
        except ValidationError as error:
            raise ToolError(f"That cannot be: {broken_rules(error)}.") from None

    def chosen(self, edit: Edit) -> list[int]:
        """Return the indices, from 0, of the groups that an edit is for.

        Raises:
            ToolError: there is no such group, or the edit has to name one.
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
    """Return whether an edit that names no group can be meant for this one."""
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
    """Return the group with its robot count, and an `at` group's points, brought up to date."""
    points = pairs(part.points) if part.group.relation == "at" else None
    return replace(part, group=part.valid_group(robots=len(part.points), points=points))


def draft_of(plan: Plan, site: Site) -> Draft:
    """Return the formation of a plan as a draft to edit.

    Raises:
        ToolError: the plan is partial, or does not have one position for each robot.
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
    """Map robots' numbers to their places: ids if all are numbers, else ranks in the fleet."""
    names = plan.formation.robot_of_place
    if all(name.isdecimal() for name in names):
        return {int(name): i for i, name in enumerate(names)}
    rank = {name: k for k, name in enumerate(plan.formation.robots, 1)}
    return {rank[name]: i for i, name in enumerate(names)}
