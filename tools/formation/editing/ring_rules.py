"""Edits of a group around a target: its distance, spacing, sides, opening and closure."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...errors import ToolError
from ...geometry.interior import ground
from ...geometry.outline import FloatArray
from ...geometry.sampling import nearest
from ..contract import (
    LEAST_SOLVED,
    MAX_LENGTH,
    OUTSIDE,
    Group,
    RingPart,
    exact_clearance,
    has_default_clearance,
)
from ..placement.pitch import pitch_offset
from .edit_forms import DECIMALS
from .edit_kinds import Closure, Distance, Heading, Opening, Sides, Spacing
from .edit_rules import moved_from_target
from .moving import QUARTERS, scaled
from .part import ON_CURVE, RING, Part, check_room, without_pitch
from .respacing import moved_out, track, track_at

ROUNDS, HALVINGS, INSIDE_SLACK = 2, 12, 0.15
"""For robots inside: how often they are spread anew, steps of the search for the room they need,
and tolerance on the spacing reached, as a share."""
NARROWER = 0.98
"""An opening counts as narrower only below this share of its former width."""
OTHER_HALF: Mapping[str, RingPart] = {
    "left half": "right half",
    "right half": "left half",
    "top half": "bottom half",
    "bottom half": "top half",
}


def _distant(part: Part, edit: Distance) -> Part:
    """Move all robots straight to a distance if their curve allows that; else place them anew."""
    group = part.group
    if group.stands_beside:
        return moved_from_target(part, edit.px + part.radius - part.offset)
    clearance = exact_clearance(group, edit.px)
    if group.relation == "centre":  # at a distance from an object means around it
        demands = {"relation": "around", "targets": group.targets, "heading": group.heading}
        return part.anew(part.demanding(demands | {"robots": group.robots, "clearance": clearance}))
    if group.clearance is None or not group.targets:
        raise ToolError(f"The {group.relation} group keeps no distance from anything.")
    unsolved = without_pitch(group) if group.solves_clearance else {}
    group = part.valid_group(clearance=clearance, radius=None, **unsolved)
    if group.relation not in ON_CURVE or group.pitch is not None:
        return part.anew(group)
    here = track(part.group, part.points, part.site, part.radius)
    there = track_at(group, part.site, part.radius, edit.px + part.radius)
    check_room(part, there)
    if here.holds(part.points) and part.group.radius is None:
        points = moved_out(part.points, here, there)
        if there.holds(points):
            return replace(part, group=group, points=points)
    return part.evenly_at(group, edit.px + part.radius)


def _spaced(part: Part, edit: Spacing) -> Part:
    """Change the spacing of neighbours: of a whole ring by its distance, otherwise in place."""
    group, count = part.group, len(part.points)
    if count < 2:
        raise ToolError("One robot alone has no neighbours.")
    if group.relation in ("between", "corners"):
        raise ToolError(
            f"How far apart robots are follows from where they stand: {group.relation}."
        )
    now = neighbours_px(part)
    px = edit.px or now * (edit.factor or 1.0)
    loose = {**without_pitch(group), "min_spacing": None, "max_gap": None}
    if group.relation == "inside":
        return _inside_spaced(part, px, loose)
    if group.relation not in ON_CURVE:
        larger = scaled(part, px / now)
        pitch = px if edit.px and (group.line or group.shape) else None
        return replace(larger, group=larger.valid_group(**loose, pitch=pitch))
    whole = group.relation != "along" and group.sides is None and not group.opens
    if not whole:
        return part.anew(part.valid_group(**loose | {"pitch": px, "spacing": "even"}))
    return _ring_spaced(part, px, exact=edit.px is not None, loose=loose)


def _inside_spaced(part: Part, px: float, loose: dict[str, object]) -> Part:
    """Spread robots evenly over as much of a target's middle as gives the spacing.

    Raises:
        ToolError: the spacing reached differs from the one demanded by more than INSIDE_SLACK.
    """
    outline, (margin, deep) = part.site.visible(part.group.targets[0]), part.group.offsets()
    best = part
    for _ in range(ROUNDS):
        room = ground(outline, margin + part.radius, outline.size).area
        room *= (px / neighbours_px(best)) ** 2
        low, high = 0.0, outline.min_width / 2
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            wide = ground(outline, middle + part.radius, outline.size).area > room
            low, high = (middle, high) if wide else (low, middle)
        margin = round(low, DECIMALS)
        best = part.anew(part.valid_group(**loose, clearance=(margin, max(deep, margin + 1))))
    now = neighbours_px(best)
    if abs(now - px) > INSIDE_SLACK * px:
        asked, has = part.site.length(px), part.site.length(now)
        name = part.group.targets[0]
        raise ToolError(f"Inside {name} they cannot be {asked} apart: its room allows {has}.")
    return best


def _ring_spaced(part: Part, px: float, *, exact: bool, loose: dict[str, object]) -> Part:
    """Place a whole ring at the distance at which its robots have the spacing."""
    solved = {"clearance": (LEAST_SOLVED, MAX_LENGTH), "radius": None, "spacing": "even"}
    if exact and part.group.relation == "around":
        return part.anew(part.valid_group(**loose | solved | {"pitch": px}))
    asked = {"relation": "around", **dict.fromkeys(RING), **loose, **solved, "pitch": px}
    offset = pitch_offset(part.valid_group(**asked), part.site, part.radius)
    loose = loose | {"radius": None}
    return _distant(part.to(part.points, **loose), Distance(px=offset - part.radius))


def neighbours_px(part: Part) -> float:
    """Return the mean straight distance between neighbours, px; on a curve, less the widest gap."""
    if part.group.relation not in ON_CURVE and part.group.line is None:
        return float(nearest(part.points, part.points, 2)[0][:, 1].mean())
    steps = _steps(part)
    return float(np.delete(steps, np.argmax(steps)).mean() if len(steps) > 1 else steps.mean())


def _steps(part: Part) -> FloatArray:
    """Return the straight distances between successive robots on a curve, px; closed for a ring."""
    here = part.track(len(part.points))
    ordered = part.points[np.argsort(here.stations(part.points), kind="stable")]
    if part.group.relation in ("around", "cage"):
        ordered = np.concatenate([ordered, ordered[:1]])
    return np.linalg.norm(np.diff(ordered, axis=0), axis=1)


def ringed(part: Part, relation: str = "around", **demands: object) -> Group:
    """Return the group as a ring around the same target, with other fields as given.

    Raises:
        ToolError: it is not outside a target.
    """
    group = part.group
    if group.relation not in OUTSIDE:
        raise ToolError(
            f"Only robots outside a target can make a ring round it; these are {group.relation}."
        )
    usual = has_default_clearance(group, part.site.outlines, part.site.room, part.radius)
    gone = dict.fromkeys((*RING, "side", "edges", "facing"))
    kept = {"clearance": None} if usual and group.relation == "corners" else {}
    return part.valid_group(**{**gone, **kept, "relation": relation, "spacing": "even", **demands})


def _sided(part: Part, edit: Sides) -> Part:
    sides: tuple[str, ...] | None = edit.only
    if sides is None:
        free = set(edit.without or ())
        halves = {name for name in free if name.endswith(" half")}
        left: tuple[str, ...] = part.group.sides or QUARTERS
        if halves:
            left = tuple(OTHER_HALF[name] for name in sorted(halves)) if len(halves) == 1 else ()
        sides = tuple(name for name in left if name not in free)
    if not sides:
        raise ToolError("No part of the way round would be left to stand on.")
    return part.on_ring(ringed(part, sides=sides, radius=part.group.radius))


def _opened(part: Part, edit: Opening) -> Part:
    group = part.group
    towards = group.opening_towards if edit.towards is None else edit.towards
    now = max(float(_steps(part).max()) - 2 * part.radius, 0.0)
    px = group.opening if edit.px is None else edit.px
    px = px if edit.factor is None else round(edit.factor * now, DECIMALS)
    towards = "bottom" if towards is None else towards
    ring = ringed(part, radius=group.radius, opening=px or 0.0, opening_towards=towards)
    opened = part.on_ring(ring)
    left = float(_steps(opened).max()) - 2 * part.radius
    narrows = edit.px is not None or edit.factor is not None
    if narrows and group.opens and px and px < NARROWER * now and left > NARROWER * now:
        raise ToolError(
            f"The opening is {part.site.length(now)} wide; narrower it would be as the other gaps. "
            "Close it, take more robots, or leave it."
        )
    return opened


def closed(part: Part, edit: Closure) -> Part:
    """Make a group a closed ring, an escape-proof cage, or a ring without such a demand."""
    group = part.group
    if edit.kind == "open":
        if group.relation != "cage":
            raise ToolError(f"The {group.relation} group is no closed ring that could be opened.")
        return part.to(part.points, relation="around", closure=None, walls=None, max_gap=None)
    closure = "ring" if edit.kind == "close" else "escape-proof"
    cage = ringed(part, "cage", closure=closure, walls=group.walls, **without_pitch(group))
    if group.solves_clearance:
        cage = cage.model_copy(
            update={"clearance": exact_clearance(cage, part.offset - part.radius)}
        )
    there = part.on_ring(cage) if group.relation != "cage" else replace(part, group=cage)
    return there if closure == "ring" or there.certified else part.anew(cage)


def _headed(part: Part, edit: Heading) -> Part:
    return replace(part, group=part.valid_group(heading=edit.to))


RING_RULES: Mapping[str, Callable[..., Part]] = {
    "distance": _distant,
    "spacing": _spaced,
    "sides": _sided,
    "opening": _opened,
    "close": closed,
    "open": closed,
    "escape-proof": closed,
    "heading": _headed,
}
