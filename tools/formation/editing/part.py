"""One group of a formation while it is edited, and where its robots go when places are new.

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
"""What a group says of a ring alone."""


@dataclass(frozen=True)
class Part:
    """One group while it is edited: positions (n, 2) and old numbers from 0, -1 for new ones.

    Attributes:
        beside: the other groups, which new places keep clear of.
        keep_out: what no robot may stand on.
    """

    group: Group
    points: FloatArray
    was: IntArray
    site: Site
    radius: float
    beside: tuple[Stand, ...] = ()
    keep_out: tuple[str, ...] = ()

    def to(self, points: FloatArray, **update: object) -> "Part":
        """With its robots at other places, and other demands."""
        return replace(self, points=points, group=self.group.model_copy(update=update))

    @property
    def free(self) -> bool:
        """Whether its places follow from nothing but what was given."""
        group = self.group
        return group.relation == "at" or (
            group.relation == "shape" and group.line is None and group.shape is None
        )

    @property
    def centre(self) -> FloatArray:
        """Of the target; of the robots where there is not one, or they are gathered in it."""
        if len(self.group.targets) != 1 or self.group.relation == "centre":
            return self.points.mean(axis=0)
        outline = self.site.outlines[self.group.targets[0]]
        return shapely.get_coordinates(outline.filled.centroid)[0]

    @property
    def offset(self) -> float:
        """How far the nearest robot's centre is from the target, px.

        Raises:
            ToolError: it stands on it.
        """
        name = self.group.targets[0]
        apart = float(distances(self.site.outlines[name].filled, self.points).min())
        if apart <= 0:
            raise ToolError(f"A robot stands on {name}: propose the formation anew.")
        return apart

    @property
    def findings(self) -> tuple[Finding, ...]:
        """In what it alone is not what its group demands."""
        group = self.group.model_copy(update={"robots": len(self.points)})
        alone = Contract.model_construct(groups=(group,), robot_radius=self.radius)
        return certify(self.points, alone, self.site).findings

    @property
    def certified(self) -> bool:
        """Whether it alone is what its group demands."""
        return not self.findings

    def track(self, count: int) -> Track:
        """The curve its robots stand on, and would if there were `count`."""
        group = self.group.model_copy(update={"robots": count})
        if self.group.relation in ON_CURVE:
            return track(group, self.points, self.site, self.radius)
        return Track(Point(), 0.0, reference_curve(group, self.site, self.radius))

    def valid_group(self, **update: object) -> Group:
        """The group with other demands, those that are left open written out.

        Raises:
            ToolError: there is no such group.
        """
        return self.demanding({**self.group.model_dump(), **update})

    def demanding(self, demands: dict[str, Any]) -> Group:
        """A group of its own demands, those that are left open written out.

        Raises:
            ToolError: there is no such group, or no such thing in the picture.
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
        """Places for `count` robots, computed anew beside the other groups, (count, 2)."""
        group = self.valid_group(**update, robots=count)
        others = tuple(stand.group for stand in self.beside)
        alone = Contract(groups=(group,), robot_radius=self.radius)
        contract = alone.model_copy(update={"groups": (group, *others), "keep_out": self.keep_out})

        def sound(group: Group, points: FloatArray) -> bool:
            return replace(self, group=group, points=points).certified

        return stand_of(group, contract, list(self.beside), self.site, sound).points

    def anew(self, group: Group) -> "Part":
        """Its robots at the places that other demands have, who goes where by the least motion."""
        there = replace(self, group=group)
        slots = there.placed(len(self.points))
        return replace(there, points=slots[taken(self.points, slots)])

    def evenly_at(self, group: Group, offset: float) -> "Part":
        """Its robots evenly on the curve of other demands at an offset of their centres, px."""
        there = track_at(group, self.site, self.radius, offset)
        check_room(self, there)
        slots, takes = respaced(there, self.points, len(self.points))
        if not there.curve.closed:
            takes = taken(self.points, slots)
        return replace(self, group=group, points=slots[takes])

    def on_ring(self, group: Group) -> "Part":
        """Its robots evenly on the curve of other demands, as far from the target as they are."""
        if group.pitch is not None:
            return self.anew(group)
        least, greatest = group.offsets(self.radius)
        ring = self.evenly_at(group, min(max(self.offset, least), greatest))
        return ring if ring.certified else self.anew(group)


def check_known(name: str, site: Site) -> None:
    """Refuse what is not in the picture.

    Raises:
        ToolError: listing what there is.
    """
    if name not in site.outlines:
        known = ", ".join(site.outlines) or "none"
        raise ToolError(f"There is no target {name!r}. Targets: {known}.", "unknown_target")


def check_room(part: Part, here: Track) -> None:
    """Refuse a curve of which the picture leaves nothing."""
    if here.curve.length <= 0:
        raise ToolError(
            f"Nothing of the place for the {part.group.relation} group would lie in the picture."
        )


def without_pitch(group: Group) -> dict[str, object]:
    """What no longer holds of a group when neighbours need not stand an exact distance apart."""
    if group.pitch is None:
        return {}
    follows = group.min_spacing == group.pitch - pitch_slack(group.pitch)
    return {"pitch": None, "min_spacing": None if follows else group.min_spacing}


def skipped(part: Part, stay: FloatArray) -> Part:
    """Nobody moves; a ring of a cage stays even by definition, and its verdict says so."""
    spacing = "even" if part.group.relation == "cage" else "free"
    if part.group.relation == "between":  # its line would be that of fewer robots
        line = np.concatenate(part.track(len(part.points)).curve.lines)[[0, -1]].ravel()
        ends = tuple(round(float(v), DECIMALS) for v in line)
        return part.to(stay, spacing=spacing, relation="shape", line=ends, layout="line")
    if part.group.shape is not None and part.group.shape.kind == "grid":
        return part.to(stay, spacing=spacing, shape=None, clearance=None, pitch=None)
    left = part.to(stay, spacing=spacing, pitch=None)
    if part.group.relation == "corners" and not left.certified:  # fewer would be at other corners
        return part.to(stay, relation="at", clearance=None)
    return left


def free_targets(group: Group) -> tuple[str, ...]:
    """The thing that robots of a group stay off when they are at places of their own."""
    return () if group.enters or len(group.targets) != 1 else group.targets


def at_points(part: Part, mine: NDArray[np.bool_]) -> Part:
    """Those of a group's robots that are chosen, (n,), at points of their own."""
    group, points = part.group, part.points[mine]
    demands = {"relation": "at", "targets": free_targets(group), "robots": len(points)}
    single = part.demanding(demands | {"points": pairs(points), "heading": group.heading})
    return replace(part, group=single, points=points, was=part.was[mine])


def pairs(points: FloatArray) -> tuple[tuple[float, float], ...]:
    """Points (n, 2) as a contract has them."""
    return tuple((float(x), float(y)) for x, y in points.round(DECIMALS))


def closed_up(part: Part, stay: FloatArray) -> Part:
    """Those who stay share the place evenly; where spacing is free nobody moves."""
    left = part.to(stay)
    at_corners = part.group.relation == "corners" and left.certified
    if part.free or part.group.spacing == "free" or at_corners:
        return left
    slots, takes = slots_for(replace(part, points=stay), len(stay))
    return part.to(slots[takes])


def slots_for(part: Part, count: int) -> tuple[FloatArray, IntArray]:
    """Places for `count` robots, and which of them those that are there take."""
    drawn = part.group.shape is not None
    exact = part.group.pitch is not None or part.group.closure == "escape-proof"
    if not drawn and not exact and part.group.relation not in ("corners", "inside", "centre"):
        here = part.track(count)
        check_room(part, here)
        return respaced(here, part.points, count)
    slots = part.placed(count)
    return slots, taken(part.points, slots)


def taken(points: FloatArray, slots: FloatArray) -> IntArray:
    """For each robot one of as many slots or more, by least sum of squares."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(slots) <= EXACT:
        cost = cdist(points, slots, "sqeuclidean")
        return np.asarray(linear_sum_assignment(cost)[1], dtype=np.intp)
    away, _ = nearest(points, slots, 1)  # many: the places furthest from anybody stay empty
    kept = np.sort(np.argsort(away, kind="stable")[: len(points)])
    return kept[np.argsort(assign(points, slots[kept]).robots)]
