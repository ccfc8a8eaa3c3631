"""Edits across the groups of a formation: which robots belong to which group, around which target.

Frame: image pixels, x right, y down.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import shapely

from ...errors import ToolError
from ...geometry.cages.cage_places import fewest_cage
from ...geometry.interior import ground
from ...geometry.outline import FloatArray
from ..checking.allowed import allowed_area
from ..checking.surroundings import robots_to_close
from ..checking.verdict import Part as Placed
from ..contract import (
    MAX_ROBOTS,
    MIN_SPACING,
    OUTSIDE,
    default_clearance,
    exact_clearance,
    nominal,
)
from ..placement.caging import demand_of, escape_proof
from ..site import CapacityError
from .draft import Draft
from .edit_kinds import (
    Add,
    Closure,
    Count,
    KeepOff,
    Place,
    Remove,
    Skip,
    Swap,
)
from .moving import moved_groups
from .part import ON_CURVE, Part, check_known, closed_up, skipped, without_pitch
from .regrouping import added_about, arranged, left_of, merged, more_of, targeted, without
from .ring_rules import closed, ringed
from .staying import at_own_points

EXACT = 0.01
"""How far inside its limits, px, a corrected distance is kept."""


def _swapped(draft: Draft, edit: Swap) -> Draft:
    """Let two robots take each other's place, and group."""
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
    return without(draft, draft.indices(edit.robots), skipped)


def _removed(draft: Draft, edit: Remove) -> Draft:
    if edit.robots is not None:
        return without(draft, draft.indices(edit.robots), closed_up)
    return _fewer(draft, draft.chosen(edit)[0], edit.n or 0)


def _fewer(draft: Draft, k: int, n: int) -> Draft:
    """Remove n robots of a group: those with the highest numbers, held robots last."""
    part = draft.parts[k]
    if n > len(part.points):
        raise ToolError(f"{n} robots cannot be removed: there are {len(part.points)}.")
    ranks = [(i not in draft.held, draft.number(i)) for i in part.was.tolist()]
    order = sorted(range(len(ranks)), key=ranks.__getitem__)
    stays = np.ones(len(part.points), dtype=bool)
    stays[order[len(order) - n :]] = False
    return draft.with_parts(left_of(p, stays, closed_up) if p is part else p for p in draft.parts)


def _added(draft: Draft, edit: Add) -> Draft:
    if edit.to is not None:
        return added_about(draft, edit.group or 1, edit.n, edit.to)
    return draft.with_each(draft.chosen(edit), lambda part: more_of(part, edit.n))


def _counted(draft: Draft, edit: Count) -> Draft:
    k = draft.chosen(edit)[0]
    if edit.robots == "held":
        return _with_as_many_as_hold(draft, k)
    if edit.robots != "needed":
        if edit.robots == "fit":
            return _with_as_many_as_fit(draft, k, edit.px)
        part = draft.parts[k]
        others = 0 if edit.group else len(draft.was) - len(part.points)
        if edit.robots <= others:
            raise ToolError(f"{others} robots stand in other groups: say who is to leave.")
        return _with_count(draft, k, edit.robots - others)
    if draft.parts[k].group.relation != "cage":
        draft = draft.with_each((k,), lambda part: part.on_ring(ringed(part)))
    draft = _with_count(draft, k, _needed(draft.parts[k]))
    return draft.with_each((k,), lambda part: closed(part, Closure(kind="close")))


def _with_as_many_as_hold(draft: Draft, k: int) -> Draft:
    def held(part: Part) -> Part:
        rest = without_pitch(part.group)
        return replace(part, group=ringed(part, "cage", closure="escape-proof", **rest))

    draft = draft.with_each((k,), held)
    draft = _with_count(draft, k, _needed(draft.parts[k]))
    return draft.with_each((k,), lambda part: part.anew(part.group))


def _with_count(draft: Draft, k: int, count: int) -> Draft:
    more = count - len(draft.parts[k].points)
    if more > 0:
        return draft.with_each((k,), lambda part: more_of(part, more))
    return _fewer(draft, k, -more) if more else draft


def _needed(part: Part) -> int:
    """Return how many robots close a group's ring, or are certified to for an escape-proof one.

    Raises:
        ToolError: no number is known to.
    """
    if not escape_proof(part.group):
        return robots_to_close(part.group, part.site, part.radius, part.offset)
    found = fewest_cage(demand_of(part.group, part.site, part.radius), 3)
    if found is None:
        name = part.group.targets[0]
        raise ToolError(f"No number of robots is known to hold {name} for sure.")
    return len(found)


def _with_as_many_as_fit(draft: Draft, k: int, px: float | None) -> Draft:
    loose = draft.with_each((k,), lambda part: _with_least_spacing(part, px))
    for count in range(_capacity_estimate(loose.parts[k]), 0, -1):
        fits = _with_count(loose, k, count)
        if "too_close" not in {f.kind for f in fits.parts[k].findings}:
            return fits
    return _with_count(loose, k, 1)


def _with_least_spacing(part: Part, px: float | None) -> Part:
    """Return the group with its pitch replaced by a least spacing, `px` or its own.

    Without `px`, a group is changed only if its clearance follows from its pitch.
    """
    group = part.group
    if px is None and not group.solves_clearance:
        return part
    demands: dict[str, object] = {"pitch": None, "max_gap": None}
    demands["min_spacing"] = px or group.min_spacing
    if group.solves_clearance:
        demands["clearance"] = exact_clearance(group, part.offset - part.radius)
    return replace(part, group=part.valid_group(**demands))


def _capacity_estimate(part: Part) -> int:
    """Return an upper estimate of how many robots fit into a group's place at its spacing.

    Raises:
        ToolError: no spacing was stated, so any number of point robots would fit, or the number
            is not known for this relation.
    """
    group = part.group
    apart = group.pitch or group.min_spacing or 0.0
    if group.relation != "corners" and part.radius == 0 and apart <= MIN_SPACING:
        raise ToolError("Say how far apart they are to be: robots are points, so any number fits.")
    if group.relation in ON_CURVE and group.pitch is None:  # fewer on bends
        return min(int(part.track(len(part.points)).curve.length / apart) + 1, MAX_ROBOTS)
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
    try:
        part.placed(min(most, MAX_ROBOTS))
    except CapacityError as error:
        return error.fits
    return most


def _placed(draft: Draft, edit: Place) -> Draft:
    """Move one robot elsewhere; unless it stays in its group, a note says its place is empty."""
    (index,) = draft.indices((edit.robot,))
    before = len(draft.parts)
    if edit.stays is None:
        draft = at_own_points(draft, (int(index),))
    k = next(k for k, part in enumerate(draft.parts) if index in part.was)
    part = draft.parts[k]
    i = int(np.flatnonzero(part.was == index)[0])
    points = part.points.copy()
    if edit.target is not None:
        check_known(edit.target, draft.site)
        points[i] = _nearest_beside(part, points[i], edit.target)
    else:
        points[i] = edit.to if edit.to is not None else points[i] + np.asarray(edit.by)
    if edit.stays == "near":
        points[i] = _allowed_near(part, points[i])
    targets = (edit.target,) if edit.target is not None else part.group.targets
    moved = part.to(points, targets=targets)
    draft = draft.with_parts(moved if p is part else p for p in draft.parts)
    if len(draft.parts) > before:
        note = f"Robot {edit.robot} stands by itself; nobody else moves, so its old place is empty."
        draft = replace(draft, notes=(*draft.notes, note))
    return draft


def _allowed_near(part: Part, point: FloatArray) -> FloatArray:
    """Return the nearest point that the group's clearance allows; the point itself if no area."""
    area = allowed_area(Placed(part.group, part.points, 0, part.radius, part.site))
    if area is None or area.is_empty:
        return point
    near = shapely.get_coordinates(shapely.shortest_line(area, shapely.Point(point)))[0]
    if part.group.relation not in OUTSIDE:
        return near
    # The area's round corners are polygonal, so the distance is corrected.
    solid = part.site.outlines[part.group.targets[0]].filled
    foot = shapely.get_coordinates(shapely.shortest_line(solid, shapely.Point(near)))[0]
    off, (least, most) = float(np.linalg.norm(near - foot)), part.group.offsets(part.radius)
    slack = min(EXACT, (most - least) / 2)
    return foot + (near - foot) * np.clip(off, least + slack, most - slack) / off if off else near


def _nearest_beside(part: Part, point: FloatArray, name: str) -> FloatArray:
    """Return the place beside an object that is nearest to a robot, (2,)."""
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
    kept = {} if edit.px is None else {"keep_out_clearance": edit.px}
    contract = draft.contract.model_copy(update={"keep_out": keep_out, **kept})
    return replace(draft, contract=contract).with_parts(draft.parts)


TEAM_RULES: Mapping[str, Callable[..., Draft]] = {
    "swap": _swapped,
    "skip": _skipped,
    "remove": _removed,
    "add": _added,
    "count": _counted,
    "target": targeted,
    "merge": merged,
    "arrange": arranged,
    "place": _placed,
    "keep-out": _kept_off,
    **dict.fromkeys(("rotate", "mirror", "shift", "scale"), moved_groups),
}
