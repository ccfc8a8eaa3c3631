"""Motions of whole groups: rotation, reflection, translation and scaling.

If a group no longer meets its demands, robots keep their form at places of their own and a note
says so, but stated lengths are not given up. Frame: image pixels, y down.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPoint, Point

from ...errors import ToolError
from ...geometry.outline import FloatArray, distances
from ..checking.finding import Finding
from ..contract import MAX_LENGTH, SideName, has_default_clearance
from ..placement.caging import escape_proof
from ..placement.figure import figure_of
from ..placement.ring_parts import opening_way
from .draft import Draft
from .edit_forms import DECIMALS, Affine, form_after
from .edit_kinds import Mirror, Rotate, Scale, Shift
from .part import ON_CURVE, Part, assigned_slots, at_points, free_targets

HELD_TO = {
    "wrong_side": "on their side of {thing}",
    "off_sides": "on their side of {thing}",
    "wrong_edge": "along their edge of {thing}",
    "off_corner": "at the corners of {thing}",
    "too_near": "at their distance from {thing}",
    "too_far": "at their distance from {thing}",
    "not_inside": "as far from the edge of {thing}",
    "too_deep": "as near to the edge of {thing}",
    "outside": "inside {thing}",
    "uncovered": "spread over {thing}",
    "uneven": "spread over {thing}",
    "off_centre": "in the middle of {thing}",
    "not_enclosed": "a closed ring around {thing}",
    "opening": "a closed ring around {thing}",
    "opening_at_border": "a closed ring around {thing}",
    "narrow_opening": "with their opening to its side",
    **dict.fromkeys(("gap", "crowded", "bare_end", "bare_stretch"), "evenly along {thing}"),
    **dict.fromkeys(("off_curve", "crowded_figure", "off_grid", "same_place"), "that form exactly"),
}
"""Demands that a group can be freed of, by the kind of finding that reports them violated."""
SAME_WIDTH, HALVINGS = 1e-3, 40
STRAIGHT = 0.5
"""Robots within this distance of a line, px, stand on it."""
ALONG = 0.9
"""A row slides along its side if at least this share of the shift points along it."""
QUARTERS: tuple[SideName, ...] = ("left", "top", "right", "bottom")
"""Clockwise as seen."""
OPPOSITE: Mapping[str, Mapping[str, SideName]] = {
    "left-right": {"left": "right", "right": "left"},
    "top-bottom": {"top": "bottom", "bottom": "top"},
}
ROUND = frozenset({"around", "cage", "corners", "inside", "centre"})


def moved_groups(draft: Draft, edit: Rotate | Mirror | Shift | Scale) -> Draft:
    """Return the draft with groups moved, under their demands or as free places with a note."""
    for k in draft.chosen(edit):
        old = draft.parts[k]
        new, gone = _moved(old, edit)
        draft = draft.with_parts(new if part is old else part for part in draft.parts)
        if gone:
            thing = " and ".join(old.group.targets) or "their line"
            what = " or ".join(dict.fromkeys(HELD_TO[f.kind].format(thing=thing) for f in gone))
            note = f"The robots keep their form at places of their own, no longer {what}."
            draft = replace(draft, notes=(*draft.notes, note))
    return draft


def _moved(part: Part, edit: Rotate | Mirror | Shift | Scale) -> tuple[Part, tuple[Finding, ...]]:
    """Return a group after a motion, and the findings for demands that it is then freed of."""
    if isinstance(edit, Rotate):
        there = _rotated(part, edit.degrees)
    elif isinstance(edit, Scale):
        there = scaled(part, edit.factor or _widened(part, edit.px or 0.0))
    else:
        there = _mirrored(part, edit) if isinstance(edit, Mirror) else _shifted(part, edit)
    findings = there.findings
    if findings and isinstance(edit, Mirror):
        there = _on_curve(there, part)
    elif part.group.relation not in ROUND and any(f.kind == "on_target" for f in findings):
        there = _moved_off_target(there, part) if isinstance(edit, Rotate | Scale) else there
    findings = there.findings if findings else ()
    kept = _binding_findings(part, edit) if findings else set[str]()
    if not findings or any(f.kind in kept or f.kind not in HELD_TO for f in findings):
        slid = _slid(part, edit) if findings and isinstance(edit, Shift) else None
        return slid or there, ()
    return _freed(there), findings


def _binding_findings(part: Part, edit: Rotate | Mirror | Shift | Scale) -> set[str]:
    """Return the kinds of findings that a group is not freed of: those on stated lengths.

    Those on gaps matter only to scaling, as other motions preserve gaps.
    """
    group, kept = part.group, set[str]()
    if escape_proof(group):
        return set(HELD_TO)
    if group.clearance is not None and not _usual_range(part):
        kept |= {"too_near", "too_far", "not_inside", "too_deep"}
    if group.opening and isinstance(edit, Scale):
        kept.add("narrow_opening")
    if group.max_gap is not None and isinstance(edit, Scale):
        kept |= {"opening", "opening_at_border"}
    return kept | ({"off_curve"} if group.radius is not None else set())


def _usual_range(part: Part) -> bool:
    """Return whether a clearance range is as wide as the default one, at whatever distance."""
    if part.group.radius is not None or part.group.solves_clearance:
        return True
    usual = part.valid_group(clearance=None).clearance
    widths = [pair[1] - pair[0] for pair in (usual, part.group.clearance) if pair is not None]
    return len(widths) == 2 and abs(widths[0] - widths[1]) < SAME_WIDTH


def _freed(part: Part) -> Part:
    """Return the group at places of its own: on a line if they lie on one, else at points."""
    group, points = part.group, part.points
    if (group.relation in ("along", "between") or group.line) and len(points) > 1:
        way = points - points.mean(axis=0)
        unit = np.linalg.svd(way, full_matrices=False)[2][0]
        along = way @ unit
        if np.linalg.norm(way - along[:, None] * unit, axis=1).max() <= STRAIGHT:
            ends = points[[int(along.argmin()), int(along.argmax())]]
            kept = {n: getattr(group, n) for n in ("spacing", "pitch", "min_spacing", "heading")}
            kept |= {"relation": "shape", "robots": len(points), "targets": free_targets(group)}
            line = tuple(round(float(v), DECIMALS) for v in ends.ravel())
            row = replace(part, group=part.demanding(kept | {"line": line}))
            if row.certified:
                return row
    return at_points(part, np.ones(len(points), dtype=bool))


def _on_curve(image: Part, old: Part) -> Part:
    """Spread a mirrored group along its curve, if certified, as its target may not be symmetric."""
    group = image.group
    if group.relation not in ON_CURVE or group.spacing == "free" or group.pitch is not None:
        return image
    with suppress(ToolError):
        evenly = image.evenly_at(group, old.track(len(old.points)).offset)
        return evenly if evenly.certified else image
    return image


def _moved_off_target(part: Part, old: Part) -> Part:
    """Move a form, rotated or scaled onto its target, off it to its distance before."""
    way = part.points.mean(axis=0) - part.centre
    if not free_targets(part.group) or not way.any():
        return part
    solid, unit = part.site.outlines[part.group.targets[0]].filled, way / np.linalg.norm(way)
    low, high = 0.0, float(np.hypot(*part.site.room))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        off = distances(solid, part.points + middle * unit).min() >= old.offset
        low, high = (low, middle) if off else (middle, high)
    return rigid(part, np.eye(2), np.zeros(2), high * unit)


def _pivot(part: Part) -> FloatArray:
    """Return the centre of rotation and scaling: the target it is around or in, else its mean."""
    group, centre = part.group, part.centre
    placed = group.shape is None and group.line is None and group.relation != "between"
    if group.relation in ROUND or (
        placed and MultiPoint(part.points).convex_hull.contains(Point(centre))
    ):
        return centre
    return part.points.mean(axis=0)


def _rotated(part: Part, degrees: float) -> Part:
    here = part.track(len(part.points)) if part.group.relation in ("around", "cage") else None
    if here is not None and here.curve.closed and here.holds(part.points):
        arc = here.clockwise * here.curve.length * degrees / 360
        points = here.at(here.stations(part.points) + arc)
        return part.to(here.at_distances(points, distances(here.base, part.points)))
    quarters = degrees / 90
    if part.group.opens or (part.group.sides and abs(quarters - round(quarters)) < 1e-9):
        return part.on_ring(part.valid_group(**_ring_turned(part, degrees)))
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return rigid(part, np.array([[c, s], [-s, c]]), _pivot(part), _pivot(part))


def _ring_turned(part: Part, degrees: float) -> dict[str, object]:
    """Return where a ring's opening, or its sides, are after a turn; sides by quarter turns."""
    group = part.group
    if group.sides is None:
        x, y = opening_way(group, part.site)
        angle = math.degrees(math.atan2(y, x)) + degrees
        return {"opening_towards": round((angle + 180) % 360 - 180, DECIMALS)}
    by = round(degrees / 90) % 4
    after: dict[str, str] = dict(zip(QUARTERS, (*QUARTERS[by:], *QUARTERS[:by]), strict=True))
    return {"sides": _sides_by(after, group.sides)}


def _sides_by(after: Mapping[str, str], sides: tuple[str, ...]) -> tuple[str, ...]:
    """Rename the sides of a ring: "left half" may become "top half"."""
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
    """Return the edges of the target nearest to the images of the chosen edges' midpoints."""
    vertices, pairs = part.site.outlines[part.group.targets[0]].graph()
    ends = np.array([vertices[list(pair)] for pair in pairs])
    middles = there(ends[list(part.group.edges or ())].mean(axis=1))
    at = np.argmin(np.stack([distances(LineString(e), middles) for e in ends]), axis=0)
    return tuple(sorted({int(k) for k in at}))


def _shifted(part: Part, edit: Shift) -> Part:
    """Translate a group as it stands; a default clearance range is widened to allow it."""
    group, centre = part.group, part.centre
    there = rigid(part, np.eye(2), centre, centre + np.array([edit.dx, edit.dy]))
    usual = has_default_clearance(group, part.site.outlines, part.site.room, part.radius)
    if group.clearance is None or group.relation not in ("around", "cage") or not usual:
        return there
    off, (least, greatest) = _edge_clearances(there), group.clearance
    if off.min() <= 0:
        return there
    least, greatest = min(least, float(off.min())), max(greatest, float(off.max()))
    clearance = (math.floor(least * 1e3) / 1e3, math.ceil(greatest * 1e3) / 1e3)
    return there.to(there.points, clearance=clearance)


def _widened(part: Part, px: float) -> float:
    """Return the factor that scales the robots to a width, px.

    Raises:
        ToolError: they have no width, such as one robot or a vertical row.
    """
    width = float(np.ptp(part.points[:, 0]))
    if width < STRAIGHT:
        raise ToolError("The robots stand above one another: scale them by a factor instead.")
    return px / width


def _slid(part: Part, edit: Shift) -> Part | None:
    """Slide a row along its side, or return None if the shift points elsewhere or that fails."""
    if part.group.relation != "along":
        return None
    here = part.track(len(part.points))
    if len(here.curve.lines) != 1 or not here.holds(part.points):
        return None
    stations, way = here.stations(part.points), np.array([edit.dx, edit.dy])
    ends = here.at(np.array([stations.min(), stations.max()]))
    unit = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
    by = float(way @ unit)
    there = stations + by
    off = abs(by) < ALONG * np.linalg.norm(way)
    if off or there.min() < 0 or there.max() > here.curve.length:
        return None
    slid = part.to(here.at(there))
    return slid if slid.certified else None


def scaled(part: Part, factor: float) -> Part:
    """Scale a group about its centre; its clearance range grows like its actual clearances."""
    there = rigid(part, np.eye(2) * factor, _pivot(part), _pivot(part))
    group = there.group
    if group.clearance is None or not group.targets:
        return there
    old, new = (_edge_clearances(p) for p in (part, there))
    if min(old.min(), new.min()) <= 0:
        return there  # on the outline: the verdict says so
    if group.radius is not None:
        return there.to(there.points, radius=round(group.radius * factor, DECIMALS))
    least, greatest = group.clearance
    least = round(least * float(new.min() / old.min()), DECIMALS)
    if greatest < MAX_LENGTH:
        greatest = round(greatest * float(new.max() / old.max()), DECIMALS)
    return there.to(there.points, clearance=(least, greatest))


def _edge_clearances(part: Part) -> FloatArray:
    """Return how far robots' edges are from the outline, (n,), px; negative on the wrong side."""
    outline = part.site.outlines[part.group.targets[0]]
    within = np.asarray(shapely.intersects_xy(outline.polygon, part.points))
    apart = distances(outline.polygon.boundary, part.points)
    return np.where(within == (part.group.relation == "inside"), apart, -apart) - part.radius


def rigid(part: Part, linear: FloatArray, origin: FloatArray, to: FloatArray) -> Part:
    """Map every place, and a line or shape of the contract, by the same map of row vectors."""
    there = Affine(linear, origin, to)
    points, shape = there(part.points), part.group.shape
    if shape is not None:
        figure = figure_of(part.group, shape, part.site, part.radius)
        group, anew = form_after(part.group, figure, there)
        moved = replace(part, group=group, points=points)
        if anew:
            slots = moved.placed(len(points))
            moved = replace(moved, points=slots[assigned_slots(points, slots)])
        return moved
    if part.group.line is None:
        return part.to(points)
    ends = there(np.reshape(part.group.line, (2, 2)))
    return part.to(points, line=tuple(round(float(v), DECIMALS) for v in ends.ravel()))
