"""Edits of whole groups: around another target, merged, or in another arrangement.

Frame: image pixels, x right, y down.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import ToolError
from ...geometry.outline import FloatArray, distances
from ..contract import DIRECTIONS, ONLY_IN, OUTSIDE, Group, exact_clearance, has_default_clearance
from ..placement.group_conflicts import Stand
from .draft import Draft
from .edit_kinds import Arrange, Merge, Target
from .moving import rigid
from .part import (
    ON_CURVE,
    IntArray,
    Part,
    assigned_slots,
    check_known,
    closed_up,
    skipped,
    slots_for,
)

Leave = Callable[[Part, FloatArray], Part]
KEPT = ("targets", "heading", "min_spacing", "max_gap", "pitch")
"""Fields that an arrangement with another relation takes over if it can."""
EITHER = (
    ("line", "shape"),
    ("side", "edges", "facing"),
    ("sides", "opening"),
    ("sides", "opening_towards"),
)
"""Alternatives: a group has only one field of each pair or triple."""
TOLD_OF = {
    "opening": "the opening",
    "opening_towards": "the opening",
    "sides": "the sides",
    "max_gap": "the greatest gap",
    "pitch": "the spacing",
    "radius": "the radius",
}
"""Fields that another arrangement may not have, in words."""
CLOSED_OFF = ("the opening", "the sides")
"""What a cage is meant to have none of."""


def without(draft: Draft, gone: IntArray, leave: Leave) -> Draft:
    """Return the draft without some robots; `leave` rearranges the others of their groups."""
    return draft.with_parts(left_of(p, ~np.isin(p.was, gone), leave) for p in draft.parts)


def left_of(part: Part, stays: NDArray[np.bool_], leave: Leave) -> Part:
    """Return a group with only the robots of the mask `stays` (n,); it may be empty."""
    if stays.all():
        return part
    fewer = part.to(part.points[stays]) if not stays.any() else leave(part, part.points[stays])
    return replace(fewer, was=part.was[stays])


def more_of(part: Part, n: int, coming: Part | None = None) -> Part:
    """Return a group with n more robots, either `coming` from another group or new.

    The robots already in it move as little as possible; the others take the places left.

    Raises:
        ToolError: the group's places are given explicitly.
    """
    if part.free:
        raise ToolError("A free shape has no places of its own for more robots: give positions.")
    slots, takes = slots_for(part, len(part.points) + n)
    new = np.setdiff1d(np.arange(len(slots)), takes)
    if coming is not None:
        new = new[assigned_slots(coming.points, slots[new])]
    was = np.full(n, -1, dtype=np.intp) if coming is None else coming.was
    return replace(part.to(slots[np.concatenate([takes, new])]), was=np.append(part.was, was))


def _retargeted(part: Part, to: str) -> dict[str, Any]:
    """Return a group's fields for another target, adapting those that refer to the old one.

    Raises:
        ToolError: the group has no single target, or the new one is unknown.
    """
    group, site = part.group, part.site
    check_known(to, site)
    if group.relation == "between":
        count = {"robots": len(part.points)}
        if to in group.targets:
            return {"relation": "around", "targets": (to,), "heading": group.heading} | count
        return group.model_dump() | {"targets": (group.targets[0], to)} | count
    if len(group.targets) != 1:
        raise ToolError(
            f"The {group.relation} group is not about a thing: arrange it anew, or shift it."
        )
    (old,) = group.targets
    demands = group.model_dump() | {"targets": (to,), "robots": len(part.points)}
    if has_default_clearance(group, site.outlines, site.room, part.radius):
        demands["clearance"] = None
    for name in ("facing", "opening_towards"):
        if demands[name] == to:
            demands[name] = old
    if group.edges is not None:
        demands |= {"edges": None, "side": _side_of(part)}
    return demands


def _all_to(draft: Draft, chosen: Sequence[int], to: str) -> Draft:
    """Move whole groups to another target, where those of one relation become one group."""
    joined: dict[str, list[Part]] = {}
    done: list[Part] = []
    for k, part in enumerate(draft.parts):
        there = part.group.targets == (to,)
        if k not in chosen and not there:
            done.append(part)
        else:
            name = part.group.relation if part.group.relation in OUTSIDE | {"inside"} else f"{k}"
            joined.setdefault(name, []).insert(0 if there else len(draft.parts), part)
    for parts in joined.values():
        first = parts[0]
        if len(parts) == 1:
            stays = first.group.targets == (to,)
            done.append(first if stays else _taken_to(_beside_others(first, done), to))
        elif first.group.targets == (to,):
            done.append(_gathered(parts, first.group.model_dump(), done))
        else:
            done.append(_gathered(parts, _retargeted(first, to), done))
    return draft.with_parts(done)


def _taken_to(part: Part, to: str) -> Part:
    """Move a group to another target; one placed independently of its target is translated."""
    group = part.group
    if len(group.targets) == 1 and (part.free or _placeless(group.model_dump())):
        check_known(to, part.site)
        there = replace(part, group=group.model_copy(update={"targets": (to,)}))
        moved = rigid(part, np.eye(2), part.centre, there.centre)
        return moved.to(moved.points, targets=(to,))
    return _at_same_distance(part, part.demanding(_retargeted(part, to)))


def _at_same_distance(part: Part, group: Group) -> Part:
    """Place a group at its new target, at the same distance as before if there is room."""
    usual = group.clearance
    if usual is not None and group.relation in ON_CURVE and group.pitch is None:
        exact = exact_clearance(group, part.offset - part.radius)
        with suppress(ToolError):
            there = part.anew(group.model_copy(update={"clearance": exact}))
            for near in (there.to(there.points, clearance=usual), there):
                if near.certified:
                    return near
    return part.anew(group)


def _side_of(part: Part) -> str:
    """Return the side of its target on which a group stands."""
    way = part.points.mean(axis=0) - part.centre
    return max(DIRECTIONS, key=lambda name: float(np.dot(way, DIRECTIONS[name])))


def targeted(draft: Draft, edit: Target) -> Draft:
    """Move groups, or some of their robots, to another target; they join robots already there."""
    check_known(edit.to, draft.site)
    if edit.robots is None:
        chosen = [k for k in draft.chosen(edit) if draft.parts[k].group.targets != (edit.to,)]
        if not chosen:
            raise ToolError(f"The robots are at {edit.to} already.")
        return _all_to(draft, chosen, edit.to)
    going = _robots_to_move(draft, edit)
    first = next(p for p in draft.parts if np.isin(p.was, going).any())
    where = {int(i): point for i, point in zip(draft.was, draft.points, strict=True)}
    coming = replace(first, points=np.array([where[int(i)] for i in going]), was=going)
    group = coming.demanding(_retargeted(coming, edit.to))
    others: tuple[Part, ...] = ()
    if len(going) < len(draft.was):
        left = without(draft, going, skipped if edit.stay else closed_up)
        others = left.parts
        for k, part in enumerate(others):
            if (part.group.relation, part.group.targets) == (group.relation, group.targets):
                return left.with_each((k,), lambda part: more_of(part, len(going), coming))
    return draft.with_parts((*others, _at_same_distance(_beside_others(coming, others), group)))


def added_about(draft: Draft, number: int, n: int, to: str) -> Draft:
    """Add n robots at another target, arranged like those of group `number` (from 1).

    Raises:
        ToolError: there is no such target or group.
    """
    if number > len(draft.parts):
        raise ToolError(f"There is no group {number}: they go from 1 to {len(draft.parts)}.")
    first = draft.parts[number - 1]
    new = np.full(n, -1, dtype=np.intp)
    coming = replace(first, points=np.resize(first.points, (n, 2)), was=new)
    group = coming.demanding(_retargeted(coming, to))
    for k, part in enumerate(draft.parts):
        if (part.group.relation, part.group.targets) == (group.relation, group.targets):
            return draft.with_each((k,), lambda part: more_of(part, n))
    return draft.with_parts(
        (*draft.parts, _at_same_distance(_beside_others(coming, draft.parts), group))
    )


def _beside_others(part: Part, others: Sequence[Part]) -> Part:
    return replace(part, beside=tuple(Stand(p.group, p.points) for p in others))


def _robots_to_move(draft: Draft, edit: Target) -> IntArray:
    """Return who goes to another target: the robots named, or as many of those nearest to it."""
    if isinstance(edit.robots, tuple):
        return draft.indices(edit.robots)
    mine = [draft.parts[k] for k in draft.chosen(edit)]
    mine = [part for part in mine if part.group.targets != (edit.to,)]
    was = np.concatenate([part.was for part in mine]) if mine else np.empty(0, dtype=np.intp)
    points = np.concatenate([part.points for part in mine]) if mine else np.empty((0, 2))
    free = (was >= 0) & ~np.isin(was, list(draft.held))
    count = edit.robots or 0
    if not free.any():
        raise ToolError(f"The robots are at {edit.to} already.")
    if count > free.sum():
        raise ToolError(f"{count} robots cannot go to {edit.to}: only {free.sum()} could.")
    away = distances(draft.site.outlines[edit.to].filled, points[free])
    return was[free][np.argsort(away, kind="stable")[:count]]


def merged(draft: Draft, edit: Merge) -> Draft:
    """Merge groups of one relation, and robots at their own points, into one group."""
    first = next((p for p in draft.parts if p.group.relation != "at"), draft.parts[0])
    rings = ("around", "cage") if first.group.relation in ("around", "cage") else ()
    same = {first.group.relation, "at", *rings}
    alike = [p for p in draft.parts if p.group.relation in same]
    if len(alike) < 2 and edit.to is None:
        raise ToolError("There is nothing to merge: no two groups have the same arrangement.")
    others = [p for p in draft.parts if all(p is not a for a in alike)]
    rest = [p for p in alike if p is not first]
    whole = first
    if edit.to is not None and first.group.targets != (edit.to,):
        group = first.demanding(_retargeted(first, edit.to))
        whole = first.anew(group) if not rest else replace(first, group=group)
    alone_ = any(p.group.relation == "at" for p in rest)
    if alone_ and whole.group.spacing == "free":
        whole = replace(whole, group=whole.valid_group(spacing="even"))
    if rest:
        whole = _gathered([whole, *rest], whole.group.model_dump(), others)
    return draft.with_parts((whole, *others))


def _gathered(parts: Sequence[Part], demands: dict[str, Any], others: Sequence[Part]) -> Part:
    """Join several groups into one with the given fields, placed beside others."""
    points = np.concatenate([part.points for part in parts])
    was = np.concatenate([part.was for part in parts])
    whole = replace(_beside_others(parts[0], others), points=points, was=was)
    return whole.anew(whole.demanding(demands | {"robots": len(points)}))


def arranged(draft: Draft, edit: Arrange) -> Draft:
    """Rearrange the robots of each target; all in one group if targets or places are given."""
    demands = {name: value for name, value in edit.demands.items() if name != "robots"}
    numbers = draft.chosen(edit) if edit.group else range(len(draft.parts))
    chosen = [draft.parts[k] for k in numbers]
    named = [p for p in chosen if p.group.relation != "at"] or chosen[:1]
    sets: dict[Any, list[Part]] = {}
    for part in named:
        mine = None if "targets" in demands or _placeless(demands) else part.group.targets
        sets.setdefault(mine, []).append(part)
    for part in chosen:
        if all(part is not p for p in named):
            sets.get(part.group.targets, next(iter(sets.values()))).append(part)
    done = [p for p in draft.parts if all(p is not c for c in chosen)]
    lost: dict[str, None] = {}
    for parts in sets.values():
        done.append(_gathered(parts, _rearranged(parts[0], demands), done))
        lost |= dict.fromkeys(_given_up(parts[0], done[-1].group, demands))
    told = [f"Not carried over to the new arrangement: {' and '.join(lost)}."] if lost else []
    return replace(draft.with_parts(done), notes=(*draft.notes, *told))


def _given_up(part: Part, group: Group, demands: dict[str, Any]) -> Iterator[str]:
    """Yield what was demanded of a part beside its arrangement, and is not of its new group."""
    before = part.group
    if before.relation == group.relation:
        return
    closes = group.relation == "cage"
    for name, words in TOLD_OF.items():
        demanded = getattr(before, name) is not None and name not in demands
        if demanded and getattr(group, name) is None and not (closes and words in CLOSED_OFF):
            yield words
    usual = has_default_clearance(before, part.site.outlines, part.site.room, part.radius)
    if not usual and "clearance" not in demands and group.clearance != before.clearance:
        yield "the distance"


def _placeless(demands: dict[str, Any]) -> bool:
    """Return whether these fields place an arrangement independently of any target."""
    shape: dict[str, Any] = demands.get("shape") or {}
    return demands.get("relation") in ("shape", "at") and not shape.get("where")


def _rearranged(part: Part, demands: dict[str, Any]) -> dict[str, Any]:
    """Return a group's fields after some are newly demanded; the others are kept if possible."""
    group = part.group
    relation = demands.get("relation", group.relation)
    usual = has_default_clearance(group, part.site.outlines, part.site.room, part.radius)
    if relation == group.relation:
        kept = group.model_dump()
        anew = ("fit", "pitch", "radius", "targets")
        if "fit" in demands or (usual and any(name in demands for name in anew)):
            kept["clearance"] = None
        for names in EITHER:
            if any(demands.get(name) is not None for name in names):
                kept |= dict.fromkeys(names)
    else:
        kept = {n: getattr(group, n) for n in KEPT if relation in ONLY_IN.get(n, (relation,))}
        if {relation, group.relation} <= OUTSIDE and not usual:
            kept["clearance"] = group.clearance
        if _placeless(demands):
            kept["targets"] = ()
        elif relation != "between":
            known = [name for name in part.site.outlines if name not in part.keep_out]
            kept["targets"] = group.targets[:1] or (tuple(known) if len(known) == 1 else ())
    return kept | {"relation": relation} | demands
