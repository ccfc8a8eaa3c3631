"""Keeps robots in place while the others move.

If a ring can be turned so that a held robot is at its place again, it is turned. Otherwise the
robot stands at a point of its own from then on, and the others are edited without it.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...geometry.outline import FloatArray, distances
from .draft import Draft
from .part import Part, at_points, skipped

STILL = 0.5
"""A held robot that misses its place on a curve by at most this, px, is put back there."""


def with_held(draft: Draft, robots: Collection[int]) -> Draft:
    """Return the draft with robots held, by number; none of them is chosen to leave or move."""
    return replace(draft, held=frozenset(draft.indices(robots).tolist()))


def displaced_robots(draft: Draft, before: Draft) -> list[int]:
    """Return the numbers of a draft's held robots that are not where they were before."""
    there = dict(zip(draft.was.tolist(), draft.points, strict=True))
    old = before.points
    gone = [i for i in draft.held if i not in there or (there[i] != old[i]).any()]
    return sorted(map(draft.number, gone))


def with_rings_turned_back(draft: Draft, before: Draft) -> Draft:
    """Return the draft with rings turned so that held robots are where they were, if possible."""
    if not draft.held:
        return draft
    return draft.with_parts(_turned_back(part, draft.held, before.points) for part in draft.parts)


def _turned_back(part: Part, held: frozenset[int], old: FloatArray) -> Part:
    mine = np.flatnonzero(np.isin(part.was, list(held)))
    points, wanted = part.points.copy(), old[part.was[mine]]
    if len(mine) == 1 and part.group.relation in ("around", "cage"):
        here = part.track(len(points))
        if here.curve.closed and here.holds(points) and here.holds(wanted):
            by = here.stations(wanted) - here.stations(points[mine])
            turned = here.at(here.stations(points) + by)
            points = here.at_distances(turned, distances(here.base, points))
    near = np.linalg.norm(points[mine] - wanted, axis=1) <= STILL
    if not near.all():
        return part
    points[mine] = wanted
    return part.to(points)


def with_held_at_points(draft: Draft, robots: Collection[int]) -> Draft:
    """Return the draft with held robots at points of their own, out of their groups.

    Groups whose robots are all held are left alone.
    """
    draft = with_held(draft, robots)
    names = ", ".join(map(str, sorted(robots)))
    who = f"Robot {names} stays" if len(robots) == 1 else f"Robots {names} stay"
    note = f"{who} as it is, by itself." if len(robots) == 1 else f"{who} as they are."
    return replace(at_own_points(draft, draft.held), notes=(*draft.notes, note))


def at_own_points(draft: Draft, robots: Collection[int]) -> Draft:
    """Return the draft with robots at points of their own and their old places empty.

    Args:
        draft: the draft.
        robots: the robots' indices in the formation before.
    """
    left: list[Part] = []
    singles: list[Part] = []
    for part in draft.parts:
        mine = np.isin(part.was, list(robots))
        if not mine.any() or (mine.all() and (part.group.relation == "at" or draft.held)):
            left.append(part)
            continue
        singles.append(at_points(part, mine))
        if not mine.all():
            rest = skipped(_without_closure(part), part.points[~mine])
            left.append(replace(rest, was=part.was[~mine]))
    return draft.with_parts([*left, *singles])


def _without_closure(part: Part) -> Part:
    """Return a group from which robots are taken out: with its ring broken, it is not a cage."""
    group = part.group
    hole = dict.fromkeys(("closure", "walls", "max_gap", "opening", "opening_towards"))
    relation = "around" if group.relation == "cage" else group.relation
    return part.to(part.points, relation=relation, **hole)
