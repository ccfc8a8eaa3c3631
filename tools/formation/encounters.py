"""Finds the other objects in a picture, and which of them robots stand on or drive over.

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
"""A robot whose edge is nearer to an object than this, px, may stand on it, as outlines are only
this accurate."""
ROOM_SHARE = 0.02
"""Distance that robots aim to keep from objects on their way, as a share of the picture's
diagonal."""
AT_BORDER = 1.0
"""A robot whose edge is nearer to the picture's border than this, px, counts as cut off by it."""
SAME, SMALL = 0.2, 0.5
"""Regions that share more than SAME of the smaller one are the same object, or one is part of the
other. On a target that robots enter, a sure object below SMALL of its area stays separate."""
MOST_NOTES, MOST_NAMED = 8, 12
ROUNDING = 1e-6


class Encounter(Value):
    """Robots, by id, and an object or the picture's border that they could not be kept off.

    `how` is on, over or round (the object), border, or beyond: out of the picture and back. `times`
    is how often as far as over the object a robot drives that goes a long way round it.
    """

    how: Literal["on", "over", "round", "border", "beyond"]
    robots: tuple[str, ...]
    thing: str = ""
    label: str = ""
    sure: bool = True
    times: float = 1.0

    @property
    def sentence(self) -> str:
        """The encounter as a sentence for people and models."""
        s = "s" if len(self.robots) == 1 else ""
        more = ", ..." if len(self.robots) > MOST_NAMED else ""
        who = f"Robot{'' if s else 's'} {', '.join(self.robots[:MOST_NAMED])}{more}"
        if self.how == "beyond":
            return f"{who} leave{s} the picture on the way, unseen: no way within it was found."
        if self.how == "round":
            far = f"drive{s} up to {self.times:.1f} times as far"
            return f"{who} {far} to get round {self.thing} ({self.label}) as over it."
        if self.how == "border":
            return f"{who} stand{s} at the picture's very border: what lies beyond is not seen."
        does = f"stand{s} on or right beside" if self.how == "on" else f"drive{s} over"
        why = ": no place off it" if self.how == "on" else ": no way around it"
        doubt = f"{why} was found" if self.sure else ", too faint to tell whether it is a thing"
        return f"{who} {does} {self.thing} ({self.label}){doubt}."


def notes_of(encounters: Sequence[Encounter]) -> list[str]:
    """Return sentences on the first MOST_NOTES encounters, and one that counts the rest."""
    more = len(encounters) - MOST_NOTES
    rest = [f"The picture marks {more} more such things."] if more > 0 else []
    return [e.sentence for e in encounters[:MOST_NOTES]] + rest


def others_than(
    contract: Contract, outlines: Mapping[str, Outline], things: Iterable[Other]
) -> tuple[Other, ...]:
    """Return the objects that are neither targets, nor parts of them, nor what targets lie on.

    Their holes are filled, except those in which a target lies.

    Args:
        contract: tells which targets robots enter.
        outlines: outlines of the targets, by id.
        things: the objects found; of two that are the same, the first is used.
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
    """Return the share of the smaller of two regions that lies in both."""
    return float(one.intersection(other).area) / min(one.area, other.area)


def room_of(site: Site) -> float:
    """Return the distance that robots aim to keep from other objects on their way, px."""
    return max(ROOM_SHARE * math.hypot(*site.room), 2 * TOUCHING)


def encounters_of(
    plan: Plan, site: Site, paths: Mapping[str, FloatArray], radius: float
) -> tuple[Encounter, ...]:
    """Return what robots stand on or drive over outside their contract, and who is not seen.

    Args:
        plan: the formation.
        site: with the other objects.
        paths: the path of each robot by id, (k, 2), px.
        radius: radius of a robot on its way, px.
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
    room, ways = site.frame(radius).box, paths.items()
    out = () if room.is_empty else tuple(n for n, way in ways if _goes_beyond(room, way))
    beyond = Encounter(how="beyond", robots=tuple(sorted(out, key=rank.__getitem__)))
    frame = site.frame(body).box
    cut = () if frame.is_empty else placed(distances(frame.exterior, points) < AT_BORDER)
    border = Encounter(how="border", robots=cut)
    return tuple(e for e in (beyond, *found, border) if e.robots)


def _goes_beyond(room: Polygon, path: FloatArray) -> bool:
    """Return whether a path, (k, 2), comes further out of a rectangle than where it begins or ends.

    Between two of its vertices no path comes further out than at one of them.
    """
    out = distances(room, path)
    return bool(out.max() > max(out[0], out[-1]) + ROUNDING)
