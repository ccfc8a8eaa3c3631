"""What there is to say of robots that stand about a thing: distances, openings, what closes it.

Answers to a person's questions come from here, so that they agree with the certificate.
"""

import math

import numpy as np
import shapely
from shapely.geometry import Polygon

from ...geometry.outline import FloatArray, Outline, distances
from ..contract import Group
from ..value import Value


class Ring(Value):
    """The openings of robots around a thing.

    Attributes:
        widest_opening_px: between the edges of two neighbours.
        between: those two, counted from 0 within the group.
        min_width_px: of the thing at its narrowest.
        closed: whether the thing is enclosed and no opening is as wide as it at its narrowest.
        robots_to_close: how many on this ring would close it.
    """

    widest_opening_px: float
    between: tuple[int, int]
    min_width_px: float
    closed: bool
    robots_to_close: int


def ring_of(points: FloatArray, outline: Outline, radius: float) -> Ring | None:
    """How closed robots stand around a thing; None of fewer than 2.

    Args:
        points: (n, 2), px.
        outline: of the thing they stand around.
        radius: of a robot, px.
    """
    if len(points) < 2:
        return None
    exterior = outline.filled.exterior
    order = np.argsort(shapely.line_locate_point(exterior, shapely.points(points)), kind="stable")
    ring = points[order]
    opening = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1) - 2 * radius
    widest = int(np.argmax(opening))
    encloses = len(ring) > 2 and shapely.make_valid(Polygon(ring)).contains(
        shapely.Point(outline.centre)
    )
    offset = float(distances(outline.filled, points).mean())
    around = float(outline.filled.buffer(offset).exterior.length)
    needed = math.ceil(around / (outline.min_width + 2 * radius))
    return Ring(
        widest_opening_px=round(float(opening[widest]), 2),
        between=(int(order[widest]), int(order[(widest + 1) % len(order)])),
        min_width_px=round(outline.min_width, 2),
        closed=bool(encloses and opening[widest] < outline.min_width),
        robots_to_close=max(needed, 3),
    )


def clearance_of(points: FloatArray, outline: Outline, group: Group, radius: float) -> FloatArray:
    """Distances of robots' edges from the thing they are about, (n,) px; 0 on it.

    Of robots inside it, from its edge.
    """
    region = outline.polygon.boundary if group.enters else outline.filled
    return np.maximum(distances(region, points) - radius, 0.0)
