"""Facts about robots around an object: their distances and openings, and what closes the ring.

A person's questions are answered from these, so that the answers agree with the certificate.
"""

import math

import numpy as np
import shapely
from shapely.geometry import Polygon

from ...errors import ToolError
from ...geometry.outline import FloatArray, Outline, distances
from ..contract import MAX_ROBOTS, Group
from ..placement.ring_parts import whole_ring
from ..site import Site
from ..value import Value

LEAST_OFFSET = 0.1
"""Distance from the outline, px, at which a ring is measured if a robot stands on the outline."""


class Ring(Value):
    """The openings between robots around an object.

    Attributes:
        widest_opening_px: widest gap between the edges of two neighbours.
        between: those two, as indices from 0 within the group.
        min_width_px: width of the object at its narrowest.
        closed: whether the object is enclosed and every opening is narrower than its min_width_px.
        robots_to_close: how many robots evenly on this ring would close it; None if not known.
    """

    widest_opening_px: float
    between: tuple[int, int]
    min_width_px: float
    closed: bool
    robots_to_close: int | None


def ring_of(points: FloatArray, group: Group, site: Site, radius: float) -> Ring | None:
    """Measure the ring of robots around an object; None for fewer than 2 robots.

    Args:
        points: (n, 2), px.
        group: the robots' group, about one object.
        site: with the outline of that object.
        radius: radius of a robot, px.
    """
    if len(points) < 2:
        return None
    outline = site.outlines[group.targets[0]]
    away = distances(outline.filled, points)
    loop = outline.filled.buffer(float(away.mean())).exterior
    order = np.argsort(shapely.line_locate_point(loop, shapely.points(points)), kind="stable")
    ring = points[order]
    opening = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1) - 2 * radius
    widest = int(np.argmax(opening))
    encloses = len(ring) > 2 and shapely.make_valid(Polygon(ring)).contains(
        shapely.Point(outline.centre)
    )
    try:
        needed = robots_to_close(group, site, radius, float(away.min()))
    except ToolError:
        needed = None
    return Ring(
        widest_opening_px=round(float(opening[widest]), 2),
        between=(int(order[widest]), int(order[(widest + 1) % len(order)])),
        min_width_px=round(outline.min_width, 2),
        closed=bool(encloses and opening[widest] < outline.min_width),
        robots_to_close=needed,
    )


def robots_to_close(group: Group, site: Site, radius: float, offset: float) -> int:
    """Return how many robots, evenly all round a group's target, leave no gap it could pass.

    Every gap is then narrower than the target at its narrowest, and no wider than the contract
    allows.

    Args:
        group: the group, about one target.
        site: with the target's outline.
        radius: radius of a robot, px.
        offset: distance of robots' centres from the outline, px.

    Raises:
        ToolError: no number is known to close the ring, or the picture cuts it.
    """
    name = group.targets[0]
    outline, clearance = site.outlines[name], group.clearance or (offset - radius, offset - radius)
    whole = group.model_copy(update={"radius": None, "clearance": clearance})
    curve = whole_ring(whole, site, radius, max(offset, LEAST_OFFSET), site.frame(radius))
    if not curve.closed:
        raise ToolError(f"The picture's border cuts the ring around {name}: come nearer to it.")
    widest = min(outline.min_width, math.inf if group.max_gap is None else group.max_gap)
    needed = max(math.floor(curve.length / max(widest + 2 * radius, 1e-9)) + 1, 3)
    if needed > MAX_ROBOTS or curve.length / needed < (group.min_spacing or 0.0):
        raise ToolError(f"No number of robots is known to close the ring around {name}.")
    return needed


def clearance_of(points: FloatArray, outline: Outline, group: Group, radius: float) -> FloatArray:
    """Return the distances of robots' edges from their object, (n,), px; 0 on it.

    For robots that enter it, distances from its edge.
    """
    region = outline.polygon.boundary if group.enters else outline.filled
    return np.maximum(distances(region, points) - radius, 0.0)
