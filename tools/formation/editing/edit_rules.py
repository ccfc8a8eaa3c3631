"""Edits of one group of a formation: new places and new fields for each kind of edit.

Maps of the plane and shifts along a curve take every robot along; only if places are new does the
least sum of squared distances decide who goes where. Frame: image pixels, x right, y down.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...errors import ToolError
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import corner_points, nearest
from ..contract import MAX_LENGTH, OUTSIDE, exact_clearance
from ..placement.pitch import pitch_places
from .edit_forms import DECIMALS
from .edit_kinds import Offset, SideOnly
from .moving import rigid
from .part import ON_CURVE, RING, Part, assigned_slots, check_room, without_pitch
from .respacing import Track, feet_on, moved_out, pushed, track, track_at


def _offset(part: Part, edit: Offset) -> Part:
    group = part.group
    if group.stands_beside:
        return moved_from_target(
            part, _distance_change(edit, part.offset - part.radius, inward=False)
        )
    if group.solves_clearance:  # the pitch gives way
        clearance = exact_clearance(group, part.offset - part.radius)
        group = group.model_copy(update={"clearance": clearance, **without_pitch(group)})
        part = replace(part, group=group)
    if group.clearance is None or not group.targets:
        raise ToolError(
            f"The {group.relation} group keeps no distance to move out or in by: scale it instead."
        )
    outline = part.site.outlines[group.targets[0]]
    inward = group.enters
    base = outline.polygon.boundary if inward else outline.filled
    here = track(group, part.points, part.site, part.radius) if group.relation in ON_CURVE else None
    nearest_px = here.offset if here else float(distances(base, part.points).min())
    clearance = nearest_px - part.radius
    by = _distance_change(edit, clearance, inward)
    if clearance + by <= 0:
        raise ToolError(
            f"{part.site.length(-by)} nearer to the outline of {group.targets[0]} is too much: "
            f"robots' edges are {part.site.length(max(clearance, 0.0))} from it."
        )
    least, greatest = (round(max(bound + by, 0.0), DECIMALS) for bound in group.clearance)
    if group.clearance[1] >= MAX_LENGTH:
        stated, greatest = group.clearance[0], MAX_LENGTH
        if by < 0 and clearance + by >= stated:  # "at least" still holds
            least = stated
        elif by < 0 and edit.px is None:
            raise ToolError(
                f"Robots' edges were to be at least {part.site.length(stated)} from "
                f"{group.targets[0]}, and are {part.site.length(clearance)} from it: say how far "
                "they are to be now."
            )
    if group.radius is not None:
        return _resized(part, (group.radius + by) / group.radius, (least, greatest))
    moved = part.to(
        _places_at_clearance(part, here, by, (least, greatest)), clearance=(least, greatest)
    )
    if here is None or group.pitch is not None or moved.certified or not part.certified:
        return moved
    even = moved.evenly_at(moved.group, here.offset + by)
    return even if even.certified else moved


def moved_from_target(part: Part, by: float) -> Part:
    """Move robots placed independently `by` px further from their target.

    A shape moves as a whole; robots at points move one by one.

    Raises:
        ToolError: they would come into contact with the target.
    """
    solid = part.site.outlines[part.group.targets[0]].filled
    if part.offset - part.radius + by <= 0:
        raise ToolError(f"{part.site.length(-by)} nearer to {part.group.targets[0]} is too much.")
    feet = feet_on(solid, part.points)
    if part.group.relation == "at":
        return part.to(pushed(solid, part.points, feet, by))
    i = int(distances(solid, part.points).argmin())
    way = part.points[i] - feet[i]
    return rigid(part, np.eye(2), np.zeros(2), by * way / np.linalg.norm(way))


def _resized(part: Part, factor: float, clearance: tuple[float, float]) -> Part:
    """Scale a circle of robots about its centre."""
    points, radius = part.centre + (part.points - part.centre) * factor, part.group.radius or 0.0
    return part.to(points, radius=round(radius * factor, DECIMALS), clearance=clearance)


def _distance_change(edit: Offset, clearance: float, inward: bool) -> float:
    """Return how much further from the outline robots go, px; inside, out means nearer to it."""
    grows = (edit.kind == "out") != inward
    if edit.px is not None:
        return edit.px if grows else -edit.px
    factor = edit.factor or 1.0
    return clearance * (factor - 1 if grows else 1 / factor - 1)


def _places_at_clearance(
    part: Part, here: Track | None, by: float, clearance: tuple[float, float]
) -> FloatArray:
    """Return where robots stand with a new clearance, (n, 2)."""
    group, points = part.group.model_copy(update={"clearance": clearance}), part.points
    if here is not None:
        there = track_at(group, part.site, part.radius, here.offset + by)
        check_room(part, there)
        if group.pitch is not None:
            slots = pitch_places(group, there.curve, part.site)
            if len(slots) == len(points):
                return slots[assigned_slots(points, slots)]
        return moved_out(points, here, there)
    if group.relation == "corners":
        outline = part.site.outlines[group.targets[0]]
        corners = corner_points(outline, group.robots)
        return pushed(outline.filled, points, corners[nearest(corners, points, 1)[1]], by)
    slots = part.placed(len(points), clearance=clearance)
    return slots[assigned_slots(points, slots)]


def _to_side(part: Part, edit: SideOnly) -> Part:
    group = part.group
    if group.relation not in OUTSIDE:
        raise ToolError(
            f"Only robots outside a target can keep to one side of it; these are {group.relation}."
        )
    other = {"relation": "along", "side": edit.side, "edges": None, "facing": None}
    gone = dict.fromkeys((*RING, "max_gap"))
    along = group.model_copy(update={**other, **gone, **without_pitch(group)})
    there = part.evenly_at(along, part.offset)
    return there if there.certified else part.anew(along)


RULES: Mapping[str, Callable[..., Part]] = {
    "out": _offset,
    "in": _offset,
    "side": _to_side,
}
