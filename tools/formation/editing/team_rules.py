"""What edits do across the groups of a formation: who belongs to which, and round what.

Frame: image pixels, x right, y down.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...errors import ToolError
from ...geometry.interior import ground
from ...geometry.outline import FloatArray, distances
from ..contract import (
    DIRECTIONS,
    MAX_ROBOTS,
    MIN_SPACING,
    ONLY_IN,
    OUTSIDE,
    default_clearance,
    has_default_clearance,
    nominal,
)
from ..placement.group_conflicts import Stand
from ..site import CapacityError
from .draft import Draft
from .edit_kinds import (
    Add,
    Arrange,
    Closure,
    Count,
    KeepOff,
    Merge,
    Place,
    Remove,
    Skip,
    Swap,
    Target,
)
from .edit_rules import rigid
from .part import ON_CURVE, IntArray, Part, check_known, closed_up, skipped, slots_for, taken
from .ring_rules import closed, ringed, robots_to_close
from .staying import alone

Leave = Callable[[Part, FloatArray], Part]


def _swapped(draft: Draft, edit: Swap) -> Draft:
    """Each stands where the other did, for the other's group."""
    if edit.a == edit.b:
        raise ToolError(f"Robot {edit.a} cannot swap with itself: name two robots.")
    a, b = draft.indices((edit.a, edit.b))

    def one(part: Part) -> Part:
        points, here = part.points.copy(), np.flatnonzero(np.isin(part.was, (a, b)))
        if len(here) == 2:
            points[here] = points[here[::-1]]
            return part.to(points)
        was = np.where(part.was == a, b, np.where(part.was == b, a, part.was))
        return replace(part, was=was)

    return draft.with_parts(map(one, draft.parts))


def _skipped(draft: Draft, edit: Skip) -> Draft:
    return _without(draft, draft.indices(edit.robots), skipped)


def _removed(draft: Draft, edit: Remove) -> Draft:
    if edit.robots is not None:
        return _without(draft, draft.indices(edit.robots), closed_up)
    return _fewer(draft, draft.chosen(edit)[0], edit.n or 0)


def _fewer(draft: Draft, k: int, n: int) -> Draft:
    """Without the n robots of a group that have the last numbers."""
    part = draft.parts[k]
    if n > len(part.points):
        raise ToolError(f"{n} robots cannot be removed: there are {len(part.points)}.")
    ranks = [(i not in draft.held, draft.number(i)) for i in part.was.tolist()]
    order = sorted(range(len(ranks)), key=ranks.__getitem__)
    stays = np.ones(len(part.points), dtype=bool)
    stays[order[len(order) - n :]] = False
    return draft.with_parts(_left(p, stays, closed_up) if p is part else p for p in draft.parts)


def _without(draft: Draft, gone: IntArray, leave: Leave) -> Draft:
    return draft.with_parts(_left(p, ~np.isin(p.was, gone), leave) for p in draft.parts)


def _left(part: Part, stays: NDArray[np.bool_], leave: Leave) -> Part:
    """A group without some of its robots; of nobody where nobody stays."""
    if stays.all():
        return part
    fewer = part.to(part.points[stays]) if not stays.any() else leave(part, part.points[stays])
    return replace(fewer, was=part.was[stays])


def _added(draft: Draft, edit: Add) -> Draft:
    return draft.with_each(draft.chosen(edit), lambda part: _more_of(part, edit.n))


def _more_of(part: Part, n: int, coming: Part | None = None) -> Part:
    """A group with n more robots, those that come from another group or new ones.

    Who is in it takes the least ways; the others take what is left.
    """
    if part.free:
        raise ToolError("A free shape has no places of its own for more robots: give positions.")
    slots, takes = slots_for(part, len(part.points) + n)
    new = np.setdiff1d(np.arange(len(slots)), takes)
    if coming is not None:
        new = new[taken(coming.points, slots[new])]
    was = np.full(n, -1, dtype=np.intp) if coming is None else coming.was
    return replace(part.to(slots[np.concatenate([takes, new])]), was=np.append(part.was, was))


def _counted(draft: Draft, edit: Count) -> Draft:
    k = draft.chosen(edit)[0]
    if edit.robots != "needed":
        part = draft.parts[k]
        if edit.robots == "fit":
            return _with_count(draft, k, _fitting(part))
        others = 0 if edit.group else len(draft.was) - len(part.points)
        if edit.robots <= others:
            raise ToolError(f"{others} robots stand in other groups: say who is to leave.")
        return _with_count(draft, k, edit.robots - others)
    if draft.parts[k].group.relation != "cage":
        draft = draft.with_each((k,), lambda part: part.on_ring(ringed(part)))
    part = draft.parts[k]
    draft = _with_count(draft, k, robots_to_close(part.group, part.site, part.radius, part.offset))
    return draft.with_each((k,), lambda part: closed(part, Closure(kind="close")))


def _with_count(draft: Draft, k: int, count: int) -> Draft:
    more = count - len(draft.parts[k].points)
    if more > 0:
        return draft.with_each((k,), lambda part: _more_of(part, more))
    return _fewer(draft, k, -more) if more else draft


def _fitting(part: Part) -> int:
    """How many robots the place of a group holds at the spacing asked for.

    Raises:
        ToolError: none was, and any number of points would fit.
    """
    group = part.group
    apart = group.pitch or group.min_spacing or 0.0
    if group.relation in ("corners", "centre"):
        most = MAX_ROBOTS
    elif group.relation in (*ON_CURVE, "between") or group.line or group.shape:
        most = int(part.track(len(part.points)).curve.length / apart) + 2
    elif group.relation == "inside":
        outline = part.site.visible(group.targets[0])
        room = ground(outline, *group.offsets(part.radius))
        most = int(room.area / (0.8 * apart**2) + room.length / apart) + 2
    else:
        raise ToolError(f"How many fit is not known of a {group.relation} group: give a number.")
    if group.relation != "corners" and part.radius == 0 and apart <= MIN_SPACING:
        raise ToolError("Say how far apart they are to be: robots are points, so any number fits.")
    try:
        part.placed(min(most, MAX_ROBOTS))
    except CapacityError as error:
        return error.fits
    return most


def _retargeted(part: Part, to: str) -> dict[str, Any]:
    """The demands of a group round another thing: those that say something of its own go along."""
    group, site = part.group, part.site
    check_known(to, site)
    if len(group.targets) != 1:
        raise ToolError(
            f"The {group.relation} group is not about one thing: arrange it anew, or shift it."
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
    """Whole groups round another thing; those of one relation are one group there."""
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
    """A group round another thing; what has its place without one is moved as things lie."""
    group = part.group
    if len(group.targets) == 1 and (part.free or _placeless(group.model_dump())):
        check_known(to, part.site)
        there = replace(part, group=group.model_copy(update={"targets": (to,)}))
        moved = rigid(part, np.eye(2), part.centre, there.centre)
        return moved.to(moved.points, targets=(to,))
    return part.anew(part.demanding(_retargeted(part, to)))


def _side_of(part: Part) -> str:
    """The side of its target on which a group stands."""
    way = part.points.mean(axis=0) - part.centre
    return max(DIRECTIONS, key=lambda name: float(np.dot(way, DIRECTIONS[name])))


def _targeted(draft: Draft, edit: Target) -> Draft:
    check_known(edit.to, draft.site)
    if edit.robots is None:
        chosen = [k for k in draft.chosen(edit) if draft.parts[k].group.targets != (edit.to,)]
        if not chosen:
            raise ToolError(f"The robots are at {edit.to} already.")
        return _all_to(draft, chosen, edit.to)
    going = _going(draft, edit)
    first = next(p for p in draft.parts if np.isin(p.was, going).any())
    where = {int(i): point for i, point in zip(draft.was, draft.points, strict=True)}
    coming = replace(first, points=np.array([where[int(i)] for i in going]), was=going)
    group = coming.demanding(_retargeted(coming, edit.to))
    others: tuple[Part, ...] = ()
    if len(going) < len(draft.was):
        left = _without(draft, going, skipped if edit.stay else closed_up)
        others = left.parts
        for k, part in enumerate(others):
            if (part.group.relation, part.group.targets) == (group.relation, group.targets):
                return left.with_each((k,), lambda part: _more_of(part, len(going), coming))
    return draft.with_parts((*others, _beside_others(coming, others).anew(group)))


def _beside_others(part: Part, others: Sequence[Part]) -> Part:
    return replace(part, beside=tuple(Stand(p.group, p.points) for p in others))


def _going(draft: Draft, edit: Target) -> IntArray:
    """Who goes to another target: those named, or so many of the nearest to it."""
    if isinstance(edit.robots, tuple):
        return draft.indices(edit.robots)
    mine = [draft.parts[k] for k in draft.chosen(edit)]
    mine = [part for part in mine if part.group.targets != (edit.to,)]
    was = np.concatenate([part.was for part in mine]) if mine else np.empty(0, dtype=np.intp)
    points = np.concatenate([part.points for part in mine]) if mine else np.empty((0, 2))
    free = (was >= 0) & ~np.isin(was, list(draft.held))
    count = edit.robots or 0
    if count > free.sum():
        raise ToolError(f"{count} robots cannot go to {edit.to}: {free.sum()} can.")
    away = distances(draft.site.outlines[edit.to].filled, points[free])
    return was[free][np.argsort(away, kind="stable")[:count]]


def _merged(draft: Draft, edit: Merge) -> Draft:
    """Groups of one relation as one, with those who stand at points of their own."""
    first = next((p for p in draft.parts if p.group.relation != "at"), draft.parts[0])
    alike = [p for p in draft.parts if p.group.relation in (first.group.relation, "at")]
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
    """Several groups as one of some demands, beside others."""
    points = np.concatenate([part.points for part in parts])
    was = np.concatenate([part.was for part in parts])
    whole = replace(_beside_others(parts[0], others), points=points, was=was)
    return whole.anew(whole.demanding(demands | {"robots": len(points)}))


def _arranged(draft: Draft, edit: Arrange) -> Draft:
    """Robots of each target in another arrangement; all in one if it names targets of its own."""
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
    for parts in sets.values():
        done.append(_gathered(parts, _rearranged(parts[0], demands), done))
    return draft.with_parts(done)


def _placeless(demands: dict[str, Any]) -> bool:
    """Whether the demands give an arrangement its place without a target."""
    shape: dict[str, Any] = demands.get("shape") or {}
    return demands.get("relation") in ("shape", "at") and not shape.get("where")


KEPT = ("targets", "heading", "min_spacing", "max_gap", "pitch")
EITHER = (
    ("line", "shape"),
    ("side", "edges", "facing"),
    ("sides", "opening"),
    ("sides", "opening_towards"),
)
"""Of these fields a group has one."""


def _rearranged(part: Part, demands: dict[str, Any]) -> dict[str, Any]:
    """The demands of a group after those that are named anew; what else it says stays if it can."""
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
    return kept | {"relation": relation} | demands


def _placed(draft: Draft, edit: Place) -> Draft:
    """One robot elsewhere; its group has a hole where it stood, and says so."""
    (index,) = draft.indices((edit.robot,))
    before = len(draft.parts)
    draft = alone(draft, (int(index),))
    k = next(k for k, part in enumerate(draft.parts) if index in part.was)
    part = draft.parts[k]
    i = int(np.flatnonzero(part.was == index)[0])
    points = part.points.copy()
    if edit.target is not None:
        check_known(edit.target, draft.site)
        points[i] = _beside(part, points[i], edit.target)
    else:
        points[i] = edit.to if edit.to is not None else points[i] + np.asarray(edit.by)
    targets = (edit.target,) if edit.target is not None else part.group.targets
    moved = part.to(points, targets=targets)
    draft = draft.with_parts(moved if p is part else p for p in draft.parts)
    if len(draft.parts) > before:
        note = f"Robot {edit.robot} stands by itself; nobody else moves, so its old place is empty."
        draft = replace(draft, notes=(*draft.notes, note))
    return draft


def _beside(part: Part, point: FloatArray, name: str) -> FloatArray:
    """The place beside a thing that is nearest to a robot."""
    outline, group = part.site.outlines[name], part.group
    clearance = default_clearance(outline, part.site.room, part.radius)
    if group.clearance is not None:
        clearance = nominal(group.clearance)
    ring = outline.filled.buffer(clearance + part.radius).exterior
    frame = part.site.frame(part.radius).box
    seen = ring.intersection(frame)
    link = shapely.shortest_line(ring if seen.is_empty else seen, shapely.Point(point))
    return shapely.get_coordinates(link)[0]


def _kept_off(draft: Draft, edit: KeepOff) -> Draft:
    for name in edit.ids:
        check_known(name, draft.site)
    keep_out = tuple(dict.fromkeys((*draft.contract.keep_out, *edit.ids)))
    contract = draft.contract.model_copy(update={"keep_out": keep_out})
    return replace(draft, contract=contract).with_parts(draft.parts)


TEAM_RULES: Mapping[str, Callable[..., Draft]] = {
    "swap": _swapped,
    "skip": _skipped,
    "remove": _removed,
    "add": _added,
    "count": _counted,
    "target": _targeted,
    "merge": _merged,
    "arrange": _arranged,
    "place": _placed,
    "keep-out": _kept_off,
}
