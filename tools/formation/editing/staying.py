"""Robots that are not to move while the others do.

Where a ring can be turned so that a robot that stays is on its place again, it is; else the robot
stands at a point of its own from then on, and the others are edited without it.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...geometry.outline import FloatArray, distances
from .draft import Draft
from .part import Part, skipped

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
    for index in draft.held:
        draft = alone(draft, index)
    return draft


def alone(draft: Draft, index: int) -> Draft:
    """The draft in which a robot stands at a point of its own, and its place is empty."""
    k = next(k for k, part in enumerate(draft.parts) if index in part.was)
    part = draft.parts[k]
    mine = part.was == index
    if part.group.relation == "at" and len(mine) == 1:
        return draft
    if set(part.was.tolist()) <= draft.held:
        return draft
    group = part.group
    single = part.demanding(
        {
            "relation": "at",
            "targets": () if group.enters or len(group.targets) != 1 else group.targets,
            "robots": 1,
            "points": (tuple(part.points[mine][0].tolist()),),
            "heading": group.heading,
        }
    )
    one = replace(part, group=single, points=part.points[mine], was=part.was[mine])
    rest = replace(part, was=part.was[~mine])
    if not mine.all():
        rest = replace(skipped(_unringed(rest), part.points[~mine]), was=part.was[~mine])
    others = [*draft.parts[:k], *([] if mine.all() else [rest]), *draft.parts[k + 1 :], one]
    return draft.with_parts(others)


def _unringed(part: Part) -> Part:
    """A group of which a robot is taken out: its ring has a hole, and is no cage any more."""
    group = part.group
    hole = dict.fromkeys(("closure", "walls", "max_gap", "opening", "opening_towards"))
    relation = "around" if group.relation == "cage" else group.relation
    return part.to(part.points, relation=relation, **hole)
