"""Robots' headings according to a contract: degrees clockwise as seen, 0 to the right."""

import math

import numpy as np
import shapely

from ..geometry.outline import FloatArray
from .checking.verdict import Part, parts_of
from .contract import Contract
from .site import Site

DECIMALS = 3
"""Headings are rounded to this many decimals of a degree."""


def headings_of(contract: Contract, points: FloatArray, site: Site) -> tuple[float | None, ...]:
    """Return the heading at each of the points (n, 2), degrees, in the order of the groups.

    None where the group has no heading; an empty tuple if no group has one.
    """
    if all(group.heading is None for group in contract.groups):
        return ()
    return tuple(angle for part in parts_of(contract, points, site) for angle in _of_part(part))


def off_heading(heading: float, wanted: float) -> float:
    """Return the difference between two headings, degrees, 0 to 180."""
    return abs((heading - wanted + 180) % 360 - 180)


def _of_part(part: Part) -> list[float | None]:
    heading = part.group.heading
    if heading is None:
        return [None] * len(part.points)
    if not isinstance(heading, str):
        return [heading % 360] * len(part.points)
    turned = 180.0 if heading == "away" else 0.0
    return [
        round(math.degrees(math.atan2(y, x)) + turned, DECIMALS) % 360
        for x, y in _look_vectors(part)
    ]


def _look_vectors(part: Part) -> FloatArray:
    """Return the vectors (n, 2) from each robot to the nearest point of the object it looks at.

    A robot on the object looks at its centre. If there is no object, robots look at their mean.
    """
    group = part.group
    name = (
        next(iter(group.targets), None) if group.heading in ("towards", "away") else group.heading
    )
    if not isinstance(name, str):
        return part.points.mean(axis=0) - part.points
    solid = part.site.outlines[name].filled
    links = shapely.shortest_line(shapely.points(part.points), solid)
    ways = np.diff(shapely.get_coordinates(links).reshape(-1, 2, 2), axis=1)[:, 0]
    on = ~ways.any(axis=1)
    ways[on] = shapely.get_coordinates(solid.centroid) - part.points[on]
    return ways
