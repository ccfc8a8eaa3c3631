"""Moves the places of a certified plan off other objects in the picture, keeping it certified.

Frame: image pixels, x right, y down.
"""

import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from ...errors import InputError, ToolError
from ...geometry.curves import Curve, interpolate
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import nearest
from ..checking.finding import KEEP_OUTS
from ..contract import Group, nominal
from ..encounters import TOUCHING, room_of
from ..plan import Plan, make_plan
from ..site import Site
from .caging import escape_proof
from .place import reference_curve
from .spacing import stations_on

ON_CURVE = frozenset({"around", "cage", "along", "between"})
SLIDES, STEPS = 24, 720
"""Number of positions along a gap that the robots of a curve are slid to; number of samples along
the curve in search of stretches free of objects."""
OFFSETS = (0.0, -0.45, 0.45, -0.9, 0.9)
"""Offsets tried, as shares of the way from the nominal clearance to the least (negative) or the
greatest (positive)."""
MOST_ROBOTS, MOST_TRIED, TRIED_TOGETHER = 500, 60, 4_000
"""Most robots in a plan that is improved, most arrangements that are certified, and most robots in
all of those together."""
PLACE_SHARE = 0.6
"""The room wanted around a place, as a share of the room wanted on the way."""
RINGS, REACH, TURNS = 10, 10, 16
"""A robot is moved in TURNS directions onto RINGS circles around it, up to REACH times the room."""
NEAR = 2
"""Costs from this index on are mild: a group is rearranged for them, but no robot moved alone."""
Cost = tuple[int, ...]
"""How many places are on a hard keep-out, on a sure object, near one, and on an unsure one."""


def off_others(plan: Plan, site: Site) -> Plan:
    """Return the plan, or one for the same contract with fewer robots on other objects.

    Robots on a curve are slid along it and to other allowed clearances; robots still on a sure
    object are then moved off one by one. A plan that fails only because of keep-outs is repaired.
    """
    kinds = {finding.kind for finding in plan.verdict.findings}
    contract = plan.formation.contract
    costly = contract.robots > MOST_ROBOTS or any(map(escape_proof, contract.groups))
    if kinds - KEEP_OUTS or not (site.others or kinds or contract.keep_out) or costly:
        return plan
    search, first = _Search(plan, site), 0
    for group in contract.groups:
        search.rearrange(group, slice(first, first + group.robots))
        first += group.robots
    search.nudge()
    return search.best


class _Search:
    """The best plan so far, and how many arrangements may still be certified."""

    def __init__(self, plan: Plan, site: Site) -> None:
        self.best, self._site, self._contract = plan, site, plan.formation.contract
        self._radius, self._room = self._contract.robot_radius, PLACE_SHARE * room_of(site)
        self._left = min(MOST_TRIED, TRIED_TOGETHER // self._contract.robots)
        hard = [site.solid(name, self._contract) for name in self._contract.keep_out]
        sure, faint = ([t.region for t in site.others if t.sure is yes] for yes in (True, False))
        # Robots may be points in the contract, but a fleet's robots have bodies.
        sure += [region.buffer(TOUCHING) for region in hard]
        self._regions = [shapely.union_all(regions) for regions in (hard, sure, faint)]

    def _violations(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return in which ways each of the places (n, 2) is bad: a mask (n, 4), as in `Cost`."""
        hard, sure, faint = (
            np.full(len(points), np.inf) if region.is_empty else distances(region, points)
            for region in self._regions
        )
        on, near = self._radius + TOUCHING, self._radius + self._room
        return np.stack([hard <= self._radius, sure < on, sure < near, faint < on], axis=1)

    def _cost(self, points: FloatArray) -> Cost:
        return tuple(self._violations(points).sum(axis=0).tolist())

    def rearrange(self, group: Group, mine: slice) -> None:
        """Adopt the cheapest certified arrangement found for a group's robots, if it is better."""
        points = self.best.formation.points
        before = self._cost(points[mine])
        ways = list(self._arrangements(group, points[mine])) if any(before) else []
        costs = sorted((self._cost(way), k) for k, way in enumerate(ways))
        for _, k in [c for c in costs if c[0] < before][: self._left // 2]:
            points[mine] = ways[k]
            if self._adopt_if_better(points):
                return

    def nudge(self) -> None:
        """Move robots that still stand on a hard keep-out or a sure object off it, one by one."""
        bad = self._violations(self.best.formation.points)[:, :NEAR].any(axis=1)
        for i in map(int, np.flatnonzero(bad)):
            points = self.best.formation.points
            for place in self._places_near(points, i)[: max(self._left, 0)]:
                points[i] = place
                if self._adopt_if_better(points):
                    break

    def _adopt_if_better(self, points: FloatArray) -> bool:
        """Adopt the places as the best plan if they make a better one; return whether they do."""
        before, self._left = self.best, self._left - 1
        if self._cost(points) >= self._cost(before.formation.points):
            return False
        plan = make_plan(self._contract, self._site, before.formation.scene_version, points)
        was, now = (p.verdict.measures.get("escape_proof") for p in (before, plan))
        if not plan.verdict.certified or (before.verdict.certified and was != now):
            return False
        self.best = plan.model_copy(update={"partial": before.partial})
        return True

    def _arrangements(self, group: Group, points: FloatArray) -> Iterator[FloatArray]:
        """Yield other places for all robots on a curve, those most like their own first.

        Robots are slid along it, also at other clearances, or spread over its free stretches.
        """
        if group.relation not in ON_CURVE and group.line is None:
            return
        old = self._curve(group, None)
        varies = group.clearance is not None and group.radius is None and not group.solves_clearance
        for share in OFFSETS if varies else (None,):
            new = self._curve(group, share)
            if len(old.lines) != 1 or len(new.lines) != 1:
                continue
            line, steps = new.lines[0], np.linspace(0, new.length, STEPS)
            own = stations_on(points, old)[0] * new.length / old.length
            shifts = (np.arange(SLIDES) / SLIDES - 0.5) * new.length / len(own)
            for shift in shifts[np.argsort(np.abs(shifts), kind="stable")]:
                at = own + shift
                if new.closed or (at.min() >= 0 and at.max() <= new.length):
                    yield interpolate(line, at % new.length if new.closed else at)
            bad = self._violations(interpolate(line, steps))[:, : NEAR + 1].any(axis=1)
            begins = np.flatnonzero(np.roll(bad, 1) & ~bad).tolist() if new.closed else [0]
            for begin in begins:
                free = np.cumsum(~np.roll(bad, -begin))
                shares = np.linspace(1.0, max(float(free[-1]), 1.0), len(own))
                yield interpolate(line, steps[(free.searchsorted(shares) + begin) % STEPS])

    def _curve(self, group: Group, share: float | None) -> Curve:
        """Return the group's curve at a share, as in `OFFSETS`, of its clearance range.

        For a share of None it is the usual curve; it is empty if there is no such curve.
        """
        offset = None
        if group.clearance is not None and share is not None:
            aim, (least, greatest) = nominal(group.clearance), group.clearance
            end = least if share < 0 else min(greatest, 4 * aim)
            offset = max(aim + abs(share) * (end - aim), 0.1) + self._radius
        try:
            return reference_curve(group, self._site, self._radius, offset)
        except (ToolError, InputError):
            return Curve((), False, 0.0)

    def _places_near(self, points: FloatArray, i: int) -> FloatArray:
        """Return places off all objects and clear of other robots, nearest to robot i first."""
        reach = np.linspace(0, REACH * self._room, RINGS + 1)[1:]
        turns = np.arange(TURNS) * (2 * math.pi / TURNS)
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        places = points[i] + (reach[:, None, None] * ways).reshape(-1, 2)
        free = ~self._violations(places).any(axis=1)
        free &= shapely.intersects_xy(self._site.frame(self._radius).box, places)
        others = np.delete(points, i, axis=0)
        if len(others):
            free &= nearest(others, places, 1)[0] >= self._contract.spacing_floor
        return places[free]
