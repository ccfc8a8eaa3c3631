"""Slides robots that an edit puts onto other objects in the picture off them, along their curve.

This preserves the distance that an edit gave. Frame: image pixels, x right, y down.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from ...geometry.outline import FloatArray, distances
from ..checking.finding import KEEP_OUTS
from ..encounters import TOUCHING, others_than
from ..placement.avoidance import MOST_ROBOTS, MOST_TRIED, TRIED_TOGETHER, off_others
from ..placement.caging import escape_proof
from ..placement.place import Site
from ..plan import Plan, make_plan
from .draft import Draft
from .part import ON_CURVE, IntArray, Part, assigned_slots
from .respacing import Track

EXACT = frozenset({"rotate", "mirror", "shift", "scale", "swap", "skip", "place", "heading"})
"""Edits that say where all robots are to be; no robot is then moved off another object."""
ANEW = frozenset({"target", "arrange", "merge"})
"""Edits that place robots anew, at any allowed distance."""
GIVEN = frozenset({"out", "in", "distance", "spacing"})
"""Edits that say how far robots are to be from their target or from each other."""
SLIDES, REACH = 24, 0.9
"""Number of places on either side that a robot is slid to, up to REACH as a share of the mean
distance to its neighbours."""


def off_things(plan: Plan, draft: Draft, before: FloatArray, kinds: Collection[str]) -> Plan:
    """Return the plan, or one in which fewer of the moved robots stand on other sure objects.

    Held robots are not moved.

    Args:
        plan: the plan after the edits.
        draft: the draft it was made from.
        before: places of the formation before, (n, 2), px.
        kinds: kinds of the edits that made it.
    """
    contract, was = plan.formation.contract, draft.was
    outlines = {name: draft.site.outlines[name] for name in contract.target_ids}
    others = others_than(contract, outlines, draft.site.others)
    site, failed = replace(draft.site, others=others), {f.kind for f in plan.verdict.findings}
    sound = contract.robots <= MOST_ROBOTS and not failed - KEEP_OUTS
    if EXACT.issuperset(kinds) or not sound or any(map(escape_proof, contract.groups)):
        return plan
    moved = (was < 0) | (np.linalg.norm(plan.formation.points - before[was], axis=1) > 0)
    given = not GIVEN.isdisjoint(kinds)
    if ANEW.isdisjoint(kinds) or given:
        plan = _Slides(plan, draft, site, moved).found()
        on_curves = any(_line_of(part) is not None for part in draft.parts)
        if given or (on_curves and plan.verdict.certified):
            return plan
    return _rearranged(plan, draft, site)


def _rearranged(plan: Plan, draft: Draft, site: Site) -> Plan:
    """Return the plan, or one at other places its contract allows, assigned by least motion."""
    off = off_others(plan, site)
    if off is plan:
        return plan
    contract, points, slots = plan.formation.contract, plan.formation.points, off.formation.points
    order = np.concatenate(
        [mine[assigned_slots(points[mine], slots[mine])] for mine in _members(draft)]
    )
    stays = np.isin(draft.was, list(draft.held))
    if (slots[order][stays] != points[stays]).any():
        return plan
    again = make_plan(contract, site, plan.formation.scene_version, slots[order])
    return again if again.verdict.certified else plan


def _members(draft: Draft) -> list[IntArray]:
    """Return for each group the indices of its robots."""
    ends = np.cumsum([len(part.points) for part in draft.parts])
    return np.split(np.arange(len(draft.was)), ends[:-1])


class _Slides:
    """The best plan so far, and how many others may still be certified."""

    def __init__(self, plan: Plan, draft: Draft, site: Site, moved: NDArray[np.bool_]) -> None:
        self._best, self._draft, self._site = plan, draft, site
        self._free = moved & ~np.isin(draft.was, list(draft.held))
        self._left = min(MOST_TRIED, TRIED_TOGETHER // plan.formation.contract.robots)
        contract = plan.formation.contract
        regions = [thing.region for thing in site.others if thing.sure]
        # Robots may be points in the contract, but a fleet's robots have bodies.
        regions += [site.solid(name, contract).buffer(TOUCHING) for name in contract.keep_out]
        self._solid: BaseGeometry = shapely.union_all(regions)
        self._floor, self._near = contract.spacing_floor, contract.robot_radius + TOUCHING

    def _on(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return a mask (n,) of the places (n, 2) on an object."""
        if self._solid.is_empty:
            return np.zeros(len(points), dtype=bool)
        return distances(self._solid, points) < self._near

    def found(self) -> Plan:
        """Slide robots on objects one by one, then, if needed, all of a curve together.

        Returns:
            The best plan found.
        """
        for part, mine in zip(self._draft.parts, _members(self._draft), strict=True):
            line = _line_of(part)
            points = self._best.formation.points
            bad = mine[self._on(points[mine]) & self._free[mine]]
            if line is None or not len(bad):
                continue
            for i in map(int, bad):
                self._take(self._slide_one(line, mine, i))
            if self._on(self._best.formation.points[bad]).any() and self._free[mine].all():
                self._take(self._slide_all(line, mine, points[mine]))
        return self._best

    def _take(self, ways: Iterator[FloatArray]) -> None:
        """Adopt the first arrangement with fewer robots on objects that passes the check.

        Findings on keep-outs are allowed.
        """
        count = int(self._on(self._best.formation.points).sum())
        formation = self._best.formation
        better = (way for way in ways if int(self._on(way).sum()) < count)
        for way in islice(better, max(self._left, 0)):
            self._left -= 1
            plan = make_plan(formation.contract, self._site, formation.scene_version, way)
            if not {f.kind for f in plan.verdict.findings} - KEEP_OUTS:
                self._best = plan
                return

    def _slide_one(self, line: Track, mine: IntArray, i: int) -> Iterator[FloatArray]:
        """Yield arrangements with one robot at other places of its curve, nearest first."""
        points = self._best.formation.points
        reach = REACH * line.curve.length / len(mine)
        for shift in _shifts(reach):
            way = points.copy()
            way[[i]] = _slid(line, points[[i]], shift)
            others = np.delete(points, i, axis=0)
            apart = np.linalg.norm(others - way[i], axis=1)
            if not len(apart) or apart.min() >= self._floor:
                yield way

    def _slide_all(self, line: Track, mine: IntArray, points: FloatArray) -> Iterator[FloatArray]:
        """Yield all robots of a curve slid equally, by fewest on objects, then least motion."""
        ways = [_slid(line, points, s) for s in _shifts(REACH * line.curve.length / len(mine))]
        for own in sorted(ways, key=lambda way: int(self._on(way).sum())):
            whole = self._best.formation.points.copy()
            whole[mine] = own
            yield whole


def _shifts(reach: float) -> Iterator[float]:
    for k in range(1, SLIDES + 1):
        yield reach * k / SLIDES
        yield -reach * k / SLIDES


def _line_of(part: Part) -> Track | None:
    """Return the curve that a group's robots can be slid along; None unless it is in one piece."""
    if part.group.relation not in (*ON_CURVE, "between") and part.group.line is None:
        return None
    line = part.track(len(part.points))
    return line if len(line.curve.lines) == 1 and line.curve.length > 0 else None


def _slid(line: Track, points: FloatArray, by: float) -> FloatArray:
    """Slide robots (n, 2) along a curve by a length, px, keeping their distance from the target."""
    ends = (-np.inf, np.inf) if line.curve.closed else (0.0, line.curve.length)
    there = line.at(np.clip(line.stations(points) + by, *ends))
    return there if line.base.is_empty else line.at_distances(there, distances(line.base, points))
