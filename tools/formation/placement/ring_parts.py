"""Rings other than a whole offset curve: circles, some sides only, or with an opening.

Placement puts robots on them and the checker measures against them. Frame: image pixels, x right,
y down; degrees are clockwise from the right.
"""

import math

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from ...errors import ToolError
from ...geometry.curves import Curve, Frame, circle, interpolate, locate, part_of, ring
from ...geometry.outline import FloatArray, Outline
from ...geometry.sampling import arc_length
from ..contract import DIRECTIONS, MAX_LENGTH, Group
from ..site import Site

WIDER, NAMED = 2.0, 1.6
"""An opening is at least WIDER times as wide as the gaps between the other robots; NAMED times if
its width was stated."""
STEPS, MOST_OPEN = 400, 0.9
"""Number of widths tried for an opening, up to MOST_OPEN as a share of the ring."""
ROUNDING = 1e-3
"""Error of the ends of an opening, px."""


def ring_of(group: Group, site: Site, radius: float, offset: float) -> Curve:
    """Return the curve that a ring group stands on, as far as it lies in the picture.

    Args:
        group: the group.
        site: the outlines and the picture.
        radius: radius of a robot, px.
        offset: distance of robots' centres from the outline, px; a circle has its own radius.

    Raises:
        ToolError: the target does not fit into the circle, or the opening into the ring.
    """
    curve = whole_ring(group, site, radius, offset, site.frame(radius))
    if group.sides is None and not group.opens:
        return curve
    if group.sides is not None:
        region = sides_of(group, site)
    else:
        far = _far(site)
        gap = _opening(group, site, radius, ring_line(group, site, radius, offset))
        region = shapely.box(-far, -far, far, far).difference(gap)
    whole = whole_ring(group, site, radius, offset)
    return part_of(curve, region, part_of(whole, region).length)


def ring_line(group: Group, site: Site, radius: float, offset: float) -> FloatArray:
    """Return the closed line (m, 2) in which an opening is left: within the picture if possible."""
    seen = whole_ring(group, site, radius, offset, site.frame(radius))
    return (seen if seen.closed else whole_ring(group, site, radius, offset)).lines[0]


def whole_ring(
    group: Group, site: Site, radius: float, offset: float, frame: Frame | None = None
) -> Curve:
    """Return the curve of a ring group all the way round, less what lies outside the frame.

    Raises:
        ToolError: the target does not fit into the circle.
    """
    if group.radius is not None:
        return circle(_circle_centre(group, site, radius), group.radius, frame)
    least, greatest = group.offsets(radius)
    farthest = max(site.room) if greatest >= MAX_LENGTH else greatest
    outline = site.outlines[group.targets[0]]
    return ring(outline, offset, max(farthest, offset), frame, keep=min(least, offset))


def _circle_centre(group: Group, site: Site, radius: float) -> FloatArray:
    name, circle_radius = group.targets[0], group.radius or 0.0
    outline = site.outlines[name]
    centre = centre_of(outline)
    corners = shapely.get_coordinates(outline.filled.exterior)
    reach = float(np.linalg.norm(corners - centre, axis=1).max()) + radius
    if reach >= circle_radius:
        has, needs = site.length(circle_radius), site.length(reach)
        raise ToolError(
            f"Robots on a circle of radius {has} about the centre of {name} do not go around it: "
            f"that takes a radius above {needs}.",
        )
    return centre


def centre_of(outline: Outline) -> FloatArray:
    """Return the centroid of an object with its holes filled, (2,)."""
    return shapely.get_coordinates(outline.filled.centroid)[0]


def sides_of(group: Group, site: Site) -> BaseGeometry:
    """Return the region for robots of a group that keeps to some sides.

    A side extends to the diagonals of the target's bounding box, a half to the box's middle.
    """
    x0, y0, x1, y1 = site.outlines[group.targets[0]].bounds
    middle, half = np.array([x0 + x1, y0 + y1]) / 2, np.array([x1 - x0, y1 - y0]) / 2
    far = _far(site)
    parts: list[Polygon] = []
    for name in group.sides or ():
        side, _, is_half = name.partition(" ")
        out = np.array(DIRECTIONS[side])
        across = np.abs(out[::-1])
        if is_half:
            corners = [across, -across, out - across, out + across]
            parts.append(Polygon([middle + far * c for c in corners]))
        else:
            ends = (out + across) * half, (out - across) * half
            parts.append(Polygon([middle, *(middle + far / half.min() * end for end in ends)]))
    return shapely.union_all(np.asarray(parts, dtype=object))


def _far(site: Site) -> float:
    return 4 * sum(site.room)


def opening_station(group: Group, site: Site, loop: FloatArray) -> float:
    """Return the arc length, px, along a ring (m, 2) of the middle of its opening."""
    centre = centre_of(site.outlines[group.targets[0]])
    unit = opening_way(group, site)
    ray = LineString([centre, centre + _far(site) * unit])
    hits = shapely.get_coordinates(shapely.intersection(ray, LineString(loop)))
    points = hits if len(hits) else loop
    return float(locate(loop, points[[int(np.argmax((points - centre) @ unit))]])[0])


def opening_way(group: Group, site: Site) -> FloatArray:
    """Return the unit vector (2,) from the target's centre towards the opening.

    Raises:
        ToolError: it is to be towards something that lies on the target's centre.
    """
    centre = centre_of(site.outlines[group.targets[0]])
    towards = group.opening_towards
    if isinstance(towards, str) and towards not in DIRECTIONS:
        other = site.outlines[towards].filled
        link = shapely.get_coordinates(shapely.shortest_line(shapely.Point(centre), other))
        way = link[1] - link[0]
        if not np.linalg.norm(way):
            raise ToolError(
                f"There is no opening towards {towards}: it lies on {group.targets[0]}."
            )
        return way / np.linalg.norm(way)
    if isinstance(towards, str):
        return np.array(DIRECTIONS[towards])
    turn = math.radians(towards or 0.0)
    return np.array([math.cos(turn), math.sin(turn)])


def _opening(group: Group, site: Site, radius: float, loop: FloatArray) -> BaseGeometry:
    """Return the sector from the target's centre outwards in which a ring is left open.

    Raises:
        ToolError: an opening of that width cannot be left in the ring.
    """
    length, station = arc_length(loop), opening_station(group, site, loop)
    wider = NAMED if group.opening else WIDER
    least = wider * length / (group.robots - 1 + wider)
    half: FloatArray = np.linspace(least / 2, MOST_OPEN * length / 2, STEPS)
    ends = [interpolate(loop, (station + sign * half) % length) for sign in (-1, 1)]
    wide = np.linalg.norm(ends[1] - ends[0], axis=1) - 2 * radius - 2 * ROUNDING
    enough = np.flatnonzero(wide >= (group.opening or 0.0))
    if not len(enough):
        most, asked = site.length(float(wide.max())), site.length(group.opening or 0.0)
        raise ToolError(
            f"No opening of {asked} can be left in the ring around {group.targets[0]}: {most} is "
            "the widest there.",
        )
    around: FloatArray = np.linspace(-half[enough[0]], half[enough[0]], STEPS)
    centre = centre_of(site.outlines[group.targets[0]])
    spokes = interpolate(loop, (station + around) % length) - centre
    far = _far(site) / max(float(np.linalg.norm(spokes, axis=1).min()), ROUNDING)
    return shapely.make_valid(Polygon([centre, *(centre + far * spokes)]))
