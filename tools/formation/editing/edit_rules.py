"""What each kind of edit does to one group of a formation: new places and new demands.

Maps of the plane and shifts along a curve take every robot with them; only where places are new
does the least sum of squared ways decide. Frame: image pixels, x right, y down.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import ValidationError
from shapely.geometry import LineString, Point

from ...errors import ToolError
from ...geometry.assignment import EXACT, assign
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import along_curve, corner_points, nearest
from ..contract import OUTSIDE, Contract, Group, SideName, broken_rules
from ..placement.figure import figure_of
from ..placement.place import Site, place, reference_curve
from .edit_forms import DECIMALS, Affine, form_after
from .edit_kinds import Add, Mirror, Offset, Rotate, Scale, Shift, SideOnly
from .respacing import Track, moved_out, pushed, respaced, track, track_at

IntArray = NDArray[np.intp]
UNLIMITED = 100_000.0
"""A greatest clearance of this is none: "at least"."""
ON_CURVE = frozenset({"around", "cage", "along"})
OPPOSITE: Mapping[str, Mapping[str, SideName]] = {
    "left-right": {"left": "right", "right": "left"},
    "top-bottom": {"top": "bottom", "bottom": "top"},
}


@dataclass(frozen=True)
class Part:
    """One group while it is edited: positions (n, 2) and old numbers from 0, -1 for new ones."""

    group: Group
    points: FloatArray
    was: IntArray
    site: Site
    radius: float

    def to(self, points: FloatArray, **update: object) -> "Part":
        """With its robots at other places, and other demands."""
        return replace(self, points=points, group=self.group.model_copy(update=update))

    @property
    def free(self) -> bool:
        """Whether its places follow from nothing but what was given."""
        group = self.group
        return group.relation == "shape" and group.line is None and group.shape is None

    @property
    def centre(self) -> FloatArray:
        """Of the target; of the robots where there is none, or more than one."""
        if len(self.group.targets) != 1:
            return self.points.mean(axis=0)
        outline = self.site.outlines[self.group.targets[0]]
        return shapely.get_coordinates(outline.filled.centroid)[0]

    def track(self, count: int) -> Track:
        """The curve its robots stand on, and would if there were `count`."""
        if self.group.relation in ON_CURVE:
            return track(self.group, self.points, self.site, self.radius)
        group = self.group.model_copy(update={"robots": count})
        return Track(Point(), 0.0, reference_curve(group, self.site, self.radius))

    def valid_group(self, **update: object) -> Group:
        """The group with other demands.

        Raises:
            ToolError: there is no such group.
        """
        group = self.group.model_copy(update=update)
        try:
            return Group.model_validate(group.model_dump())
        except ValidationError as error:
            why = broken_rules(error)
            raise ToolError(f"The {group.relation} group cannot be changed so: {why}.") from None

    def placed(self, count: int, **update: object) -> FloatArray:
        """Places for `count` robots, computed anew, (count, 2)."""
        group = self.valid_group(**update, robots=count)
        return place(Contract(groups=(group,), robot_radius=self.radius), self.site)


def skipped(part: Part, stay: FloatArray) -> Part:
    """Nobody moves; a ring of a cage stays even by definition, and its verdict says so."""
    spacing = "even" if part.group.relation == "cage" else "free"
    if part.group.relation == "between":  # its line would be that of fewer robots
        line = np.concatenate(part.track(len(part.points)).curve.lines)[[0, -1]].ravel()
        ends = tuple(round(float(v), DECIMALS) for v in line)
        return part.to(stay, spacing=spacing, relation="shape", line=ends, layout="line")
    if part.group.shape is not None and part.group.shape.kind == "grid":
        return part.to(stay, spacing=spacing, shape=None, clearance=None, pitch=None)
    return part.to(stay, spacing=spacing, pitch=None)


def closed_up(part: Part, stay: FloatArray) -> Part:
    """Those who stay share the place evenly; at corners and where spacing is free nobody moves."""
    if part.free or part.group.spacing == "free" or part.group.relation == "corners":
        return part.to(stay)
    slots, takes = _slots(replace(part, points=stay), len(stay))
    return part.to(slots[takes])


def _slots(part: Part, count: int) -> tuple[FloatArray, IntArray]:
    """Places for `count` robots, and which of them those that are there take."""
    drawn = part.group.shape is not None
    exact = part.group.pitch is not None
    if not drawn and not exact and part.group.relation not in ("corners", "inside", "centre"):
        here = part.track(count)
        _check_room(part, here)
        return respaced(here, part.points, count)
    slots = part.placed(count)
    return slots, _taken(part.points, slots)


def _taken(points: FloatArray, slots: FloatArray) -> IntArray:
    """For each robot one of as many slots or more, by least sum of squares."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(slots) <= EXACT:
        cost = cdist(points, slots, "sqeuclidean")
        return np.asarray(linear_sum_assignment(cost)[1], dtype=np.intp)
    away, _ = nearest(points, slots, 1)  # many: the places furthest from anybody stay empty
    kept = np.sort(np.argsort(away, kind="stable")[: len(points)])
    return kept[np.argsort(assign(points, slots[kept]).robots)]


def _check_room(part: Part, here: Track) -> None:
    if here.curve.length <= 0:
        raise ToolError(
            f"Nothing of the place for the {part.group.relation} group would lie in the picture."
        )


def _offset(part: Part, edit: Offset) -> Part:
    group = part.group
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
    if group.clearance[1] >= UNLIMITED:
        greatest = UNLIMITED
    if group.radius is not None:
        return _resized(part, (group.radius + by) / group.radius, (least, greatest))
    return part.to(_beyond(part, here, by, (least, greatest)), clearance=(least, greatest))


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
        _check_room(part, there)
        return moved_out(points, here, there)
    if group.relation == "corners":
        outline = part.site.outlines[group.targets[0]]
        corners = corner_points(outline, group.robots)
        return pushed(outline.filled, points, corners[nearest(corners, points, 1)[1]], by)
    slots = part.placed(len(points), clearance=clearance)
    return slots[_taken(points, slots)]


def _rotated(part: Part, edit: Rotate) -> Part:
    here = part.track(len(part.points)) if part.group.relation in ("around", "cage") else None
    if here is not None and here.curve.closed and here.holds(part.points):
        arc = here.clockwise * here.curve.length * edit.degrees / 360
        points = here.at(here.stations(part.points) + arc)
        return part.to(here.settled(points, distances(here.base, part.points)))
    c, s = np.cos(np.radians(edit.degrees)), np.sin(np.radians(edit.degrees))
    return _rigid(part, np.array([[c, s], [-s, c]]), part.centre, part.centre)


def _mirrored(part: Part, edit: Mirror) -> Part:
    flip = np.diag([-1.0, 1.0] if edit.axis == "left-right" else [1.0, -1.0])
    side = part.group.side
    there = _rigid(part, flip, part.centre, part.centre)
    side = side and OPPOSITE[edit.axis].get(side, side)
    edges = part.group.edges and _edges_after(part, Affine(flip, part.centre, part.centre))
    return there.to(there.points, side=side, edges=edges)


def _edges_after(part: Part, there: Affine) -> tuple[int, ...]:
    """The edges of the target that lie where a map takes the middles of those chosen."""
    vertices, pairs = part.site.outlines[part.group.targets[0]].graph()
    ends = np.array([vertices[list(pair)] for pair in pairs])
    middles = there(ends[list(part.group.edges or ())].mean(axis=1))
    at = np.argmin(np.stack([distances(LineString(e), middles) for e in ends]), axis=0)
    return tuple(sorted({int(k) for k in at}))


def _shifted(part: Part, edit: Shift) -> Part:
    centre = part.centre
    return _rigid(part, np.eye(2), centre, centre + np.array([edit.dx, edit.dy]))


def _scaled(part: Part, edit: Scale) -> Part:
    """Rigid but for size; clearances demanded grow as those that are kept do."""
    there = _rigid(part, np.eye(2) * edit.factor, part.centre, part.centre)
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
    if greatest < UNLIMITED:
        greatest = round(greatest * float(new.max() / old.max()), DECIMALS)
    return there.to(there.points, clearance=(least, greatest))


def _edges_off(part: Part) -> FloatArray:
    """How far each robot's edge is from the outline, (n,), px; negative on its wrong side."""
    outline = part.site.outlines[part.group.targets[0]]
    within = np.asarray(shapely.intersects_xy(outline.polygon, part.points))
    apart = distances(outline.polygon.boundary, part.points)
    return np.where(within == (part.group.relation == "inside"), apart, -apart) - part.radius


def _rigid(part: Part, linear: FloatArray, origin: FloatArray, to: FloatArray) -> Part:
    """Every place, and a line or form of the contract, by the same map of row vectors."""
    there = Affine(linear, origin, to)
    points, shape = there(part.points), part.group.shape
    if shape is not None:
        figure = figure_of(part.group, shape, part.site, part.radius)
        group, anew = form_after(part.group, figure, there)
        moved = replace(part, group=group, points=points)
        if anew:
            slots = moved.placed(len(points))
            moved = replace(moved, points=slots[_taken(points, slots)])
        return moved
    if part.group.line is None:
        return part.to(points)
    ends = there(np.reshape(part.group.line, (2, 2)))
    return part.to(points, line=tuple(round(float(v), DECIMALS) for v in ends.ravel()))


def _added(part: Part, edit: Add) -> Part:
    if part.free:
        raise ToolError("A free shape has no places of its own for more robots: give positions.")
    old = len(part.points)
    slots, takes = _slots(part, old + edit.n)
    new = np.setdiff1d(np.arange(len(slots)), takes)
    was = np.concatenate([part.was, np.full(edit.n, -1)])
    return replace(part.to(slots[np.concatenate([takes, new])]), was=was)


def _to_side(part: Part, edit: SideOnly) -> Part:
    group = part.group
    if group.relation not in OUTSIDE:
        raise ToolError(
            f"Only robots outside a target can keep to one side of it; these are {group.relation}."
        )
    other = {"relation": "along", "side": edit.side, "edges": None, "facing": None}
    ring = ("closure", "walls", "radius", "sides", "opening", "opening_towards", "pitch")
    along = group.model_copy(update={**other, "max_gap": None, **dict.fromkeys(ring)})
    outline = part.site.outlines[group.targets[0]]
    offset = float(distances(outline.filled, part.points).min())
    if offset <= 0:
        raise ToolError(f"A robot stands on {group.targets[0]}: propose the formation anew.")
    there = track_at(along, part.site, part.radius, offset)
    _check_room(part, there)
    slots = along_curve(there.curve, len(part.points))
    return replace(part, group=along, points=slots[_taken(part.points, slots)])


RULES: Mapping[str, Callable[..., Part]] = {
    "out": _offset,
    "in": _offset,
    "rotate": _rotated,
    "mirror": _mirrored,
    "shift": _shifted,
    "scale": _scaled,
    "add": _added,
    "side": _to_side,
}
