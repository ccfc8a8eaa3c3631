"""Robots that are not to move while the others do.

Where a ring can be turned so that a robot that stays is on its place again, it is; else the robot
stands at a point of its own from then on, and the others are edited without it.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...geometry.outline import FloatArray, distances
from .draft import Draft
from .part import Part, at_points, skipped

STILL = 0.5
"""Px by which a robot that stays may miss its place on a curve, before it is put there."""


def holding(draft: Draft, robots: Collection[int]) -> Draft:
    """The draft in which robots are to stay; nobody is chosen to leave or go who does."""
    return replace(draft, held=frozenset(draft.indices(robots).tolist()))


def moved_in(draft: Draft, before: Draft) -> list[int]:
    """The numbers of the robots that stay in a draft and have no place where they were."""
    there = dict(zip(draft.was.tolist(), draft.points, strict=True))
    old = before.points
    gone = [i for i in draft.held if i not in there or (there[i] != old[i]).any()]
    return sorted(map(draft.number, gone))


def settled(draft: Draft, before: Draft) -> Draft:
    """The draft with its rings turned so that who stays is where they were, as far as that goes."""
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
            points = here.settled(turned, distances(here.base, points))
    near = np.linalg.norm(points[mine] - wanted, axis=1) <= STILL
    if not near.all():
        return part
    points[mine] = wanted
    return part.to(points)


def held(draft: Draft, robots: Collection[int]) -> Draft:
    """The draft in which robots that stay stand at points of their own, out of their groups.

    Groups all of whose robots stay are left alone.
    """
    draft = holding(draft, robots)
    names = ", ".join(map(str, sorted(robots)))
    who = f"Robot {names} stays" if len(robots) == 1 else f"Robots {names} stay"
    note = f"{who} as it is, by itself." if len(robots) == 1 else f"{who} as they are."
    return replace(alone(draft, draft.held), notes=(*draft.notes, note))


def alone(draft: Draft, robots: Collection[int]) -> Draft:
    """The draft in which robots stand at points of their own, and their places are empty.

    Args:
        robots: their places in the formation before.
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
            rest = skipped(_unringed(part), part.points[~mine])
            left.append(replace(rest, was=part.was[~mine]))
    return draft.with_parts([*left, *singles])


def _unringed(part: Part) -> Part:
    """A group of which a robot is taken out: its ring has a hole, and is no cage any more."""
    group = part.group
    hole = dict.fromkeys(("closure", "walls", "max_gap", "opening", "opening_towards"))
    relation = "around" if group.relation == "cage" else group.relation
    return part.to(part.points, relation=relation, **hole)
