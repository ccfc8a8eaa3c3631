"""What each kind of edit does to one group of a formation: new places and new demands.

Maps of the plane and shifts along a curve take every robot with them; only where places are new
does the least sum of squared ways decide. Frame: image pixels, x right, y down.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString

from ...errors import ToolError
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import along_curve, corner_points, nearest
from ..contract import MAX_LENGTH, OUTSIDE, SideName, exact_clearance, has_default_clearance
from ..placement.figure import figure_of
from ..placement.pitch import pitch_places
from ..placement.ring_parts import opening_way
from .edit_forms import DECIMALS, Affine, form_after
from .edit_kinds import Mirror, Offset, Rotate, Scale, Shift, SideOnly
from .part import ON_CURVE, RING, Part, check_room, taken, without_pitch
from .respacing import Track, feet_on, moved_out, pushed, respaced, track, track_at

QUARTERS: tuple[SideName, ...] = ("left", "top", "right", "bottom")
"""Clockwise as seen."""
OPPOSITE: Mapping[str, Mapping[str, SideName]] = {
    "left-right": {"left": "right", "right": "left"},
    "top-bottom": {"top": "bottom", "bottom": "top"},
}


def _offset(part: Part, edit: Offset) -> Part:
    group = part.group
    if group.relation == "at" and group.targets:
        return _pushed(part, edit)
    if group.solves_clearance:  # how far apart they stand gives way
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
    by = _by(edit, clearance, inward)
    if clearance + by <= 0:
        raise ToolError(
            f"{part.site.length(-by)} nearer to the outline of {group.targets[0]} is too much: "
            f"robots' edges are {part.site.length(max(clearance, 0.0))} from it."
        )
    least, greatest = (round(max(bound + by, 0.0), DECIMALS) for bound in group.clearance)
    if group.clearance[1] >= MAX_LENGTH:
        greatest = MAX_LENGTH
    if group.radius is not None:
        return _resized(part, (group.radius + by) / group.radius, (least, greatest))
    moved = part.to(_beyond(part, here, by, (least, greatest)), clearance=(least, greatest))
    if here is None or group.pitch is not None or moved.certified or not part.certified:
        return moved
    there = track_at(moved.group, part.site, part.radius, here.offset + by)
    slots, takes = respaced(there, moved.points, len(moved.points))
    even = replace(moved, points=slots[takes])
    return even if even.certified else moved


def _pushed(part: Part, edit: Offset) -> Part:
    """Robots at points of their own straight away from the target, or towards it."""
    solid = part.site.outlines[part.group.targets[0]].filled
    by = _by(edit, part.offset - part.radius, inward=False)
    if part.offset - part.radius + by <= 0:
        raise ToolError(f"{part.site.length(-by)} nearer to {part.group.targets[0]} is too much.")
    return part.to(pushed(solid, part.points, feet_on(solid, part.points), by))


def _resized(part: Part, factor: float, clearance: tuple[float, float]) -> Part:
    """A circle of another radius about the same centre."""
    points, radius = part.centre + (part.points - part.centre) * factor, part.group.radius or 0.0
    return part.to(points, radius=round(radius * factor, DECIMALS), clearance=clearance)


def _by(edit: Offset, clearance: float, inward: bool) -> float:
    """How much further from the outline, px; what is inside it goes out by going nearer."""
    grows = (edit.kind == "out") != inward
    if edit.px is not None:
        return edit.px if grows else -edit.px
    factor = edit.factor or 1.0
    return clearance * (factor - 1 if grows else 1 / factor - 1)


def _beyond(
    part: Part, here: Track | None, by: float, clearance: tuple[float, float]
) -> FloatArray:
    """Where robots stand with a new clearance, (n, 2)."""
    group, points = part.group.model_copy(update={"clearance": clearance}), part.points
    if here is not None:
        there = track_at(group, part.site, part.radius, here.offset + by)
        check_room(part, there)
        if group.pitch is not None:
            slots = pitch_places(group, there.curve, part.site)
            if len(slots) == len(points):
                return slots[taken(points, slots)]
        return moved_out(points, here, there)
    if group.relation == "corners":
        outline = part.site.outlines[group.targets[0]]
        corners = corner_points(outline, group.robots)
        return pushed(outline.filled, points, corners[nearest(corners, points, 1)[1]], by)
    slots = part.placed(len(points), clearance=clearance)
    return slots[taken(points, slots)]


def _rotated(part: Part, edit: Rotate) -> Part:
    here = part.track(len(part.points)) if part.group.relation in ("around", "cage") else None
    if here is not None and here.curve.closed and here.holds(part.points):
        arc = here.clockwise * here.curve.length * edit.degrees / 360
        points = here.at(here.stations(part.points) + arc)
        return part.to(here.settled(points, distances(here.base, part.points)))
    if part.group.opens or part.group.sides is not None:
        turned = part.valid_group(**_ring_turned(part, edit.degrees))
        return part.on_ring(turned)
    c, s = np.cos(np.radians(edit.degrees)), np.sin(np.radians(edit.degrees))
    return rigid(part, np.array([[c, s], [-s, c]]), part.centre, part.centre)


def _ring_turned(part: Part, degrees: float) -> dict[str, object]:
    """Where the opening or the sides of a ring are after a turn.

    Raises:
        ToolError: sides are turned by what is no quarter of a turn.
    """
    group = part.group
    if group.sides is None:
        x, y = opening_way(group, part.site)
        angle = math.degrees(math.atan2(y, x)) + degrees
        return {"opening_towards": round((angle + 180) % 360 - 180, DECIMALS)}
    quarters = degrees / 90
    if abs(quarters - round(quarters)) > 1e-9:
        raise ToolError("Robots on some sides turn by quarters: 90, 180 or 270 degrees.")
    by = round(quarters) % 4
    after: dict[str, str] = dict(zip(QUARTERS, (*QUARTERS[by:], *QUARTERS[:by]), strict=True))
    return {"sides": _sides_by(after, group.sides)}


def _sides_by(after: Mapping[str, str], sides: tuple[str, ...]) -> tuple[str, ...]:
    """Parts of the way round by other names: "left half" may become "top half"."""
    words = (name.split() for name in sides)
    return tuple(" ".join([after.get(side, side), *half]) for side, *half in words)


def _mirrored(part: Part, edit: Mirror) -> Part:
    flip = np.diag([-1.0, 1.0] if edit.axis == "left-right" else [1.0, -1.0])
    side = part.group.side
    there = rigid(part, flip, part.centre, part.centre)
    side = side and OPPOSITE[edit.axis].get(side, side)
    edges = part.group.edges and _edges_after(part, Affine(flip, part.centre, part.centre))
    sides = part.group.sides and _sides_by(OPPOSITE[edit.axis], part.group.sides)
    towards = part.group.opening_towards
    if part.group.opens:
        x, y = opening_way(part.group, part.site) @ flip
        towards = round(math.degrees(math.atan2(y, x)), DECIMALS)
    return there.to(there.points, side=side, edges=edges, sides=sides, opening_towards=towards)


def _edges_after(part: Part, there: Affine) -> tuple[int, ...]:
    """The edges of the target that lie where a map takes the middles of those chosen."""
    vertices, pairs = part.site.outlines[part.group.targets[0]].graph()
    ends = np.array([vertices[list(pair)] for pair in pairs])
    middles = there(ends[list(part.group.edges or ())].mean(axis=1))
    at = np.argmin(np.stack([distances(LineString(e), middles) for e in ends]), axis=0)
    return tuple(sorted({int(k) for k in at}))


def _shifted(part: Part, edit: Shift) -> Part:
    """As it stands; a usual distance from the target makes room for that, a named one does not."""
    group, centre = part.group, part.centre
    there = rigid(part, np.eye(2), centre, centre + np.array([edit.dx, edit.dy]))
    usual = has_default_clearance(group, part.site.outlines, part.site.room, part.radius)
    if group.clearance is None or group.relation not in OUTSIDE or not usual:
        return there
    off, (least, greatest) = _edges_off(there), group.clearance
    if off.min() <= 0:
        return there
    least, greatest = min(least, float(off.min())), max(greatest, float(off.max()))
    clearance = (math.floor(least * 1e3) / 1e3, math.ceil(greatest * 1e3) / 1e3)
    return there.to(there.points, clearance=clearance)


def scaled(part: Part, edit: Scale) -> Part:
    """Rigid but for size; clearances demanded grow as those that are kept do."""
    there = rigid(part, np.eye(2) * edit.factor, part.centre, part.centre)
    group = there.group
    if group.clearance is None or not group.targets:
        return there
    old, new = (_edges_off(p) for p in (part, there))
    if min(old.min(), new.min()) <= 0:
        return there  # on the outline: the verdict says so
    if group.radius is not None:
        return there.to(there.points, radius=round(group.radius * edit.factor, DECIMALS))
    least, greatest = group.clearance
    least = round(least * float(new.min() / old.min()), DECIMALS)
    if greatest < MAX_LENGTH:
        greatest = round(greatest * float(new.max() / old.max()), DECIMALS)
    return there.to(there.points, clearance=(least, greatest))


def _edges_off(part: Part) -> FloatArray:
    """How far each robot's edge is from the outline, (n,), px; negative on its wrong side."""
    outline = part.site.outlines[part.group.targets[0]]
    within = np.asarray(shapely.intersects_xy(outline.polygon, part.points))
    apart = distances(outline.polygon.boundary, part.points)
    return np.where(within == (part.group.relation == "inside"), apart, -apart) - part.radius


def rigid(part: Part, linear: FloatArray, origin: FloatArray, to: FloatArray) -> Part:
    """Every place, and a line or form of the contract, by the same map of row vectors."""
    there = Affine(linear, origin, to)
    points, shape = there(part.points), part.group.shape
    if shape is not None:
        figure = figure_of(part.group, shape, part.site, part.radius)
        group, anew = form_after(part.group, figure, there)
        moved = replace(part, group=group, points=points)
        if anew:
            slots = moved.placed(len(points))
            moved = replace(moved, points=slots[taken(points, slots)])
        return moved
    if part.group.line is None:
        return part.to(points)
    ends = there(np.reshape(part.group.line, (2, 2)))
    return part.to(points, line=tuple(round(float(v), DECIMALS) for v in ends.ravel()))


def _to_side(part: Part, edit: SideOnly) -> Part:
    group = part.group
    if group.relation not in OUTSIDE:
        raise ToolError(
            f"Only robots outside a target can keep to one side of it; these are {group.relation}."
        )
    other = {"relation": "along", "side": edit.side, "edges": None, "facing": None}
    gone = dict.fromkeys((*RING, "max_gap"))
    along = group.model_copy(update={**other, **gone, **without_pitch(group)})
    there = track_at(along, part.site, part.radius, part.offset)
    check_room(part, there)
    slots = along_curve(there.curve, len(part.points))
    return replace(part, group=along, points=slots[taken(part.points, slots)])


RULES: Mapping[str, Callable[..., Part]] = {
    "out": _offset,
    "in": _offset,
    "rotate": _rotated,
    "mirror": _mirrored,
    "shift": _shifted,
    "scale": scaled,
    "side": _to_side,
}
