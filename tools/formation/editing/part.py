"""One group of a formation during an edit, and which robots take which of its new places.

Frame: image pixels, x right, y down.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import ValidationError
from shapely.geometry import Point

from ...errors import ToolError
from ...geometry.assignment import EXACT, assign
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import nearest
from ..checking.check import certify
from ..checking.finding import Finding
from ..contract import Contract, Group, broken_rules, pitch_slack, with_defaults
from ..placement.group_conflicts import Stand
from ..placement.place import Site, reference_curve, stand_of
from .edit_forms import DECIMALS
from .respacing import Track, respaced, track, track_at

IntArray = NDArray[np.intp]
ON_CURVE = frozenset({"around", "cage", "along"})
RING = ("closure", "walls", "radius", "sides", "opening", "opening_towards")
"""Fields of a group that apply to rings only."""


@dataclass(frozen=True)
class Part:
    """One group during an edit.

    Attributes:
        points: positions of its robots, (n, 2), px.
        was: each robot's index in the formation before, from 0, (n,); -1 for new robots.
        radius: radius of a robot, px.
        beside: the other groups, which new places keep clear of.
        keep_out: ids of what no robot may stand on.
        keep_out_clearance: how far from that the edges of robots stay, px.
    """

    group: Group
    points: FloatArray
    was: IntArray
    site: Site
    radius: float
    beside: tuple[Stand, ...] = ()
    keep_out: tuple[str, ...] = ()
    keep_out_clearance: float = 0.0

    def to(self, points: FloatArray, **update: object) -> "Part":
        """Return the group with its robots at other places, and other values of some fields."""
        return replace(self, points=points, group=self.group.model_copy(update=update))

    @property
    def free(self) -> bool:
        """Whether its places are given explicitly, rather than derived from its other fields."""
        group = self.group
        return group.relation == "at" or (
            group.relation == "shape" and group.line is None and group.shape is None
        )

    @property
    def centre(self) -> FloatArray:
        """The target's centroid, (2,); the robots' mean without one target or for `centre`."""
        if len(self.group.targets) != 1 or self.group.relation == "centre":
            return self.points.mean(axis=0)
        outline = self.site.outlines[self.group.targets[0]]
        return shapely.get_coordinates(outline.filled.centroid)[0]

    @property
    def offset(self) -> float:
        """Distance of the nearest robot's centre from the target, px.

        Raises:
            ToolError: a robot stands on the target.
        """
        name = self.group.targets[0]
        apart = float(distances(self.site.outlines[name].filled, self.points).min())
        if apart <= 0:
            raise ToolError(f"A robot stands on {name}: propose the formation anew.")
        return apart

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on this group alone."""
        group = self.group.model_copy(update={"robots": len(self.points)})
        alone = Contract.model_construct(groups=(group,), robot_radius=self.radius)
        return certify(self.points, alone, self.site).findings

    @property
    def certified(self) -> bool:
        """Whether this group alone is certified."""
        return not self.findings

    def track(self, count: int) -> Track:
        """Return the curve its robots stand on, or would if there were `count`."""
        group = self.group.model_copy(update={"robots": count})
        if self.group.relation in ON_CURVE:
            return track(group, self.points, self.site, self.radius)
        return Track(Point(), 0.0, reference_curve(group, self.site, self.radius))

    def valid_group(self, **update: object) -> Group:
        """Return the group with some fields updated and defaults filled in.

        Raises:
            ToolError: the group would be invalid.
        """
        return self.demanding({**self.group.model_dump(), **update})

    def demanding(self, demands: dict[str, Any]) -> Group:
        """Return a group with these fields and defaults filled in.

        Raises:
            ToolError: the group would be invalid, or names something not in the picture.
        """
        try:
            group = Group.model_validate(demands)
        except ValidationError as error:
            name, why = demands.get("relation", self.group.relation), broken_rules(error)
            raise ToolError(f"The {name} group cannot be changed so: {why}.") from None
        contract = Contract(groups=(group,), robot_radius=self.radius)
        for name in contract.target_ids:
            check_known(name, self.site)
        return with_defaults(contract, self.site.outlines, self.site.room).groups[0]

    def placed(self, count: int, **update: object) -> FloatArray:
        """Compute new places for `count` robots beside the other groups, (count, 2)."""
        group = self.valid_group(**update, robots=count)
        others = tuple(stand.group for stand in self.beside)
        alone = Contract(groups=(group,), robot_radius=self.radius)
        kept = {"keep_out": self.keep_out, "keep_out_clearance": self.keep_out_clearance}
        contract = alone.model_copy(update={"groups": (group, *others), **kept})

        def sound(group: Group, points: FloatArray) -> bool:
            return replace(self, group=group, points=points).certified

        return stand_of(group, contract, list(self.beside), self.site, sound).points

    def anew(self, group: Group) -> "Part":
        """Move its robots to the places of another group, assigned by least motion."""
        there = replace(self, group=group)
        slots = there.placed(len(self.points))
        return replace(there, points=slots[assigned_slots(self.points, slots)])

    def evenly_at(self, group: Group, offset: float) -> "Part":
        """Spread its robots evenly on the curve of another group at an offset of centres, px."""
        there = track_at(group, self.site, self.radius, offset)
        check_room(self, there)
        slots, takes = respaced(there, self.points, len(self.points))
        if not there.curve.closed:
            takes = assigned_slots(self.points, slots)
        return replace(self, group=group, points=slots[takes])

    def on_ring(self, group: Group) -> "Part":
        """Spread its robots evenly on the curve of another group at their present distance.

        The distance is kept within the group's clearance; if the result is not certified, places
        are computed anew.
        """
        if group.pitch is not None:
            return self.anew(group)
        least, greatest = group.offsets(self.radius)
        ring = self.evenly_at(group, min(max(self.offset, least), greatest))
        return ring if ring.certified else self.anew(group)


def check_known(name: str, site: Site) -> None:
    """Check that a target is in the picture.

    Raises:
        ToolError: it is not; the message lists the targets.
    """
    if name not in site.outlines:
        known = ", ".join(site.outlines) or "none"
        raise ToolError(f"There is no target {name!r}. Targets: {known}.", "unknown_target")


def check_room(part: Part, here: Track) -> None:
    """Raise a ToolError if nothing of a curve lies in the picture."""
    if here.curve.length <= 0:
        raise ToolError(
            f"Nothing of the place for the {part.group.relation} group would lie in the picture."
        )


def without_pitch(group: Group) -> dict[str, object]:
    """Return field updates that drop a group's pitch, and `min_spacing` if it follows from that."""
    if group.pitch is None:
        return {}
    follows = group.min_spacing == group.pitch - pitch_slack(group.pitch)
    return {"pitch": None, "min_spacing": None if follows else group.min_spacing}


def skipped(part: Part, stay: FloatArray) -> Part:
    """Let the remaining robots stay where they are.

    A cage's ring stays even by definition, so its verdict may report the empty places.
    """
    spacing = "even" if part.group.relation == "cage" else "free"
    if part.group.relation == "between":  # fewer robots would change its line
        line = np.concatenate(part.track(len(part.points)).curve.lines)[[0, -1]].ravel()
        ends = tuple(round(float(v), DECIMALS) for v in line)
        return part.to(stay, spacing=spacing, relation="shape", line=ends, layout="line")
    if part.group.shape is not None and part.group.shape.kind == "grid":
        return part.to(stay, spacing=spacing, shape=None, clearance=None, pitch=None)
    left = part.to(stay, spacing=spacing, pitch=None)
    if part.group.relation == "corners" and not left.certified:  # fewer would take other corners
        return part.to(stay, relation="at", clearance=None)
    return left


def free_targets(group: Group) -> tuple[str, ...]:
    """Return the target that a group's robots keep off when at their own points, or ()."""
    return () if group.enters or len(group.targets) != 1 else group.targets


def at_points(part: Part, mine: NDArray[np.bool_]) -> Part:
    """Return the chosen robots of a group, by mask (n,), as a group at their own points."""
    group, points = part.group, part.points[mine]
    demands = {"relation": "at", "targets": free_targets(group), "robots": len(points)}
    single = part.demanding(demands | {"points": pairs(points), "heading": group.heading})
    return replace(part, group=single, points=points, was=part.was[mine])


def pairs(points: FloatArray) -> tuple[tuple[float, float], ...]:
    """Convert points (n, 2) to the rounded pairs of a contract."""
    return tuple((float(x), float(y)) for x, y in points.round(DECIMALS))


def closed_up(part: Part, stay: FloatArray) -> Part:
    """Let the remaining robots spread evenly; no robot moves if spacing is free."""
    left = part.to(stay)
    at_corners = part.group.relation == "corners" and left.certified
    if part.free or part.group.spacing == "free" or at_corners:
        return left
    slots, takes = slots_for(replace(part, points=stay), len(stay))
    return part.to(slots[takes])


def slots_for(part: Part, count: int) -> tuple[FloatArray, IntArray]:
    """Return places for `count` robots, and the index of the place each present robot takes."""
    drawn = part.group.shape is not None
    exact = part.group.pitch is not None or part.group.closure == "escape-proof"
    if not drawn and not exact and part.group.relation not in ("corners", "inside", "centre"):
        here = part.track(count)
        check_room(part, here)
        return respaced(here, part.points, count)
    slots = part.placed(count)
    return slots, assigned_slots(part.points, slots)


def assigned_slots(points: FloatArray, slots: FloatArray) -> IntArray:
    """Assign each robot one of as many slots or more by least sum of squares; indices, (n,)."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(slots) <= EXACT:
        cost = cdist(points, slots, "sqeuclidean")
        return np.asarray(linear_sum_assignment(cost)[1], dtype=np.intp)
    # With too many slots for the exact method, those furthest from all robots stay empty.
    away, _ = nearest(points, slots, 1)
    kept = np.sort(np.argsort(away, kind="stable")[: len(points)])
    return kept[np.argsort(assign(points, slots[kept]).robots)]
