"""Changes of a standing formation, as a conversation asks for them: "a bit further out".

An edit is a pure function from a plan to the next one with a new contract, certified like every
plan. Robots keep their identities: each goes to the image of its own place, and where the
places themselves are new, the least sum of squared ways decides who takes which.
"""

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import ToolError
from ...geometry.outline import FloatArray
from ..placement.place import Site
from ..plan import Plan, make_plan
from ..value import Value
from .edit_kinds import Add, Edit, Offset, Remove, SideOnly, Skip, Swap
from .edit_rules import RULES, Part, closed_up, skipped

IntArray = NDArray[np.intp]


class Diff(Value):
    """What an edit changes, robots numbered from 1.

    Attributes:
        was: for each robot of the new plan its number in the old one; None for one added.
        moved_px: how far each has to go; None for one added.
        added: new numbers of robots that were not there.
        removed: old numbers of robots that are not there any more.
    """

    was: tuple[int | None, ...]
    moved_px: tuple[float | None, ...]
    added: tuple[int, ...]
    removed: tuple[int, ...]


class Edited(Value):
    """The plan after an edit, certified or with findings, and what the edit changed."""

    plan: Plan
    parent: str
    diff: Diff


def edited(plan: Plan, edit: Edit, site: Site) -> Edited:
    """The plan, certified or not, after an edit in the site it was made in.

    Raises:
        ToolError: the edit makes no sense for this plan; the text says why.
    """
    formation = plan.formation
    parts = _parts(plan, site)
    if isinstance(edit, Swap):
        parts = _swapped(parts, edit)
    elif isinstance(edit, Skip):
        parts = _without_robots(parts, edit.robots, skipped)
    elif isinstance(edit, Remove):
        parts = _without_robots(parts, edit.robots or _last(parts, edit), closed_up)
    else:
        chosen = set(_chosen(edit, parts))
        parts = [RULES[edit.kind](p, edit) if k in chosen else p for k, p in enumerate(parts)]
    groups = tuple(part.valid_group(robots=len(part.points)) for part in parts)
    contract = formation.contract.model_copy(update={"groups": groups})
    points = np.concatenate([part.points for part in parts])
    after = make_plan(contract, site, formation.scene_version, points)
    was = np.concatenate([part.was for part in parts])
    return Edited(plan=after, parent=plan.id, diff=_diff(plan, after, was))


def _parts(plan: Plan, site: Site) -> list[Part]:
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
    numbers = np.split(np.arange(len(points)), ends[:-1])
    radius = contract.robot_radius
    return [
        Part(group, points[mine], mine, site, radius)
        for group, mine in zip(contract.groups, numbers, strict=True)
    ]


def _diff(before: Plan, after: Plan, was: IntArray) -> Diff:
    old, new = before.formation.points, after.formation.points
    moved = np.linalg.norm(new - old[was], axis=1)
    kept = was >= 0
    gone = np.setdiff1d(np.arange(len(old)), was)
    return Diff(
        was=tuple(int(i) + 1 if k else None for i, k in zip(was, kept, strict=True)),
        moved_px=tuple(round(float(d), 3) if k else None for d, k in zip(moved, kept, strict=True)),
        added=tuple(int(i) + 1 for i in np.flatnonzero(~kept)),
        removed=tuple(int(i) + 1 for i in gone),
    )


def _chosen(edit: Edit, parts: list[Part]) -> list[int]:
    """Which groups an edit is for, from 0."""
    number = getattr(edit, "group", None)
    if number is not None and number > len(parts):
        raise ToolError(f"There is no group {number}: they go from 1 to {len(parts)}.")
    if number is not None:
        return [number - 1]
    if isinstance(edit, Add | Remove | SideOnly) and len(parts) > 1:
        raise ToolError(f"Say which of the groups 1 to {len(parts)} is meant.")
    if isinstance(edit, Offset):  # those without a clearance stay, unless there is no other
        some = [k for k, part in enumerate(parts) if part.group.clearance is not None]
        return some or [0]
    return list(range(len(parts)))


def _robot_indices(robots: Collection[int], parts: list[Part]) -> IntArray:
    """Numbers from 0 of robots that are there."""
    count = sum(len(part.points) for part in parts)
    strange = sorted({r for r in robots if r > count})
    if strange:
        names = " and ".join(f"no robot {r}" for r in strange)
        raise ToolError(f"There is {names}: they go from 1 to {count}.")
    return np.unique(np.asarray(list(robots), dtype=np.intp)) - 1


def _swapped(parts: list[Part], edit: Swap) -> list[Part]:
    if edit.a == edit.b:
        raise ToolError(f"Robot {edit.a} cannot swap with itself: name two robots.")
    a, b = _robot_indices((edit.a, edit.b), parts)
    points = np.concatenate([part.points for part in parts])
    points[[a, b]] = points[[b, a]]
    return [replace(part, points=points[part.was]) for part in parts]


def _last(parts: list[Part], edit: Remove) -> list[int]:
    """Numbers from 1 of the last robots of a group."""
    part = parts[_chosen(edit, parts)[0]]
    count, n = len(part.points), edit.n or 0
    if n > count:
        raise ToolError(f"{n} robots cannot be removed: there are {count}.")
    return [int(i) + 1 for i in part.was[count - n :]]


def _without_robots(
    parts: list[Part], robots: Collection[int], leave: Callable[[Part, FloatArray], Part]
) -> list[Part]:
    """The groups that are left without some robots, numbered from 1."""
    gone = _robot_indices(robots, parts)
    left: list[Part] = []
    for part in parts:
        stays = ~np.isin(part.was, gone)
        if stays.all():
            left.append(part)
        elif stays.any():
            left.append(replace(leave(part, part.points[stays]), was=part.was[stays]))
    if not left:
        raise ToolError("Nobody would be left: at least one robot has to stay.")
    return left
