"""Which other things are in a picture, and which of them robots stand on or drive over.

Frame: image pixels, x right, y down.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from ..geometry.outline import FloatArray, Outline, distances
from .contract import Contract
from .plan import Plan
from .site import Other, Site, closed
from .value import Value

TOUCHING = 2.0
"""A robot whose edge is nearer to a thing than this, px, may stand on it: outlines are so exact."""
ROOM_SHARE = 0.02
"""The distance from things that is aimed at on the way, as a share of the picture's diagonal."""
AT_BORDER = 1.0
"""A robot whose edge is so near to the picture's border, px, is cut off by it."""
SAME, SMALL = 0.2, 0.5
"""Regions that share more than SAME of the smaller one are the same thing or one a part of the
other; on a target that robots enter may stand what covers no more than SMALL of it."""
MOST_NOTES, MOST_NAMED = 8, 12


class Encounter(Value):
    """Robots, by their ids, and a thing that they are not kept off, or the picture's border."""

    how: Literal["on", "over", "border"]
    robots: tuple[str, ...]
    thing: str = ""
    label: str = ""
    sure: bool = True

    @property
    def sentence(self) -> str:
        """For people and models."""
        s = "s" if len(self.robots) == 1 else ""
        more = ", ..." if len(self.robots) > MOST_NAMED else ""
        who = f"Robot{'' if s else 's'} {', '.join(self.robots[:MOST_NAMED])}{more}"
        if self.how == "border":
            return f"{who} stand{s} at the picture's very border: what lies beyond is not seen."
        does = f"stand{s} on or right beside" if self.how == "on" else f"drive{s} over"
        why = ": no place off it" if self.how == "on" else ": no way around it"
        doubt = f"{why} was found" if self.sure else ", too faint to tell whether it is a thing"
        return f"{who} {does} {self.thing} ({self.label}){doubt}."


def notes_of(encounters: Sequence[Encounter]) -> list[str]:
    """Sentences that name robots and things, as many as anybody reads."""
    more = len(encounters) - MOST_NOTES
    rest = [f"The picture marks {more} more such things."] if more > 0 else []
    return [e.sentence for e in encounters[:MOST_NOTES]] + rest


def others_than(
    contract: Contract, outlines: Mapping[str, Outline], things: Iterable[Other]
) -> tuple[Other, ...]:
    """The things that are no targets, parts of targets, or what targets lie on.

    Their holes are filled, but those in which a target lies.

    Args:
        things: of two that are the same the first is meant.
    """
    entered = {name for group in contract.groups if group.enters for name in group.targets}
    kept: list[Other] = []
    for found in things:
        thing = replace(found, region=closed(found.region, outlines.values()))
        targets = [
            outline.filled
            for name, outline in outlines.items()
            if not (name in entered and thing.sure and thing.region.area < SMALL * outline.area)
        ]
        if not any(_shared(thing.region, r) > SAME for r in (*targets, *(k.region for k in kept))):
            kept.append(thing)
    return tuple(kept)


def _shared(one: Polygon, other: Polygon) -> float:
    """The share of the smaller of two regions that lies in both."""
    return float(one.intersection(other).area) / min(one.area, other.area)


def room_of(site: Site) -> float:
    """The distance from other things that is aimed at on the way, px."""
    return max(ROOM_SHARE * math.hypot(*site.room), 2 * TOUCHING)


def encounters_of(
    plan: Plan, site: Site, paths: Mapping[str, FloatArray], radius: float
) -> tuple[Encounter, ...]:
    """What robots stand on or drive over that their contract does not name, and who is cut off.

    Args:
        paths: by robot, (k, 2) each, px.
        radius: of a robot on its way, px.
    """
    formation, points = plan.formation, plan.formation.points
    body, names = formation.contract.robot_radius, formation.robot_of_place
    rank = {name: i for i, name in enumerate(formation.robots or names)}
    lines = {name: LineString(np.repeat(path, 2, axis=0)) for name, path in paths.items()}

    def placed(near: NDArray[np.bool_]) -> tuple[str, ...]:
        return tuple(sorted((names[i] for i in np.flatnonzero(near)), key=rank.__getitem__))

    found: list[Encounter] = []
    for thing in site.others:
        least = max(radius, 1e-9)
        on = placed(distances(thing.region, points) < max(body + TOUCHING, least))
        over = [n for n, x in lines.items() if shapely.distance(thing.region, x) < least]
        moving = tuple(sorted({*over} - {*on}, key=rank.__getitem__))
        met = Encounter(how="on", robots=on, thing=thing.id, label=thing.label, sure=thing.sure)
        found += [met, met.model_copy(update={"how": "over", "robots": moving})]
    found.sort(key=lambda e: (not e.sure, e.how))
    frame = site.frame(body).box
    cut = () if frame.is_empty else placed(distances(frame.exterior, points) < AT_BORDER)
    return tuple(e for e in (*found, Encounter(how="border", robots=cut)) if e.robots)
