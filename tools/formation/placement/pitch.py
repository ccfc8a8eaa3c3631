"""Places robots with neighbours at an exact straight distance between centres, the pitch.

All round a target, the ring's distance from it follows; on any other curve robots stand in its
middle.
"""

import math

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.ops import substring

from ...errors import ToolError
from ...geometry.curves import Curve, interpolate
from ...geometry.outline import FloatArray
from ...geometry.rings import equal_chords
from ...geometry.sampling import arc_length
from ..contract import Group, pitch_slack
from ..site import Site
from .ring_parts import whole_ring

ROUNDS, CLOSE = 16, 0.01
"""Most rings, or stretches of a line, that are tried; tolerance on the pitch, px."""
UNCUT = 0.999
"""A ring does not count as cut by the picture's border if this share of its length is left."""


def pitch_offset(group: Group, site: Site, radius: float) -> float:
    """Return how far from its target, px, a group's robots stand their pitch apart all round.

    Raises:
        ToolError: there is no such distance in the allowed range; it says what would be possible.
    """
    n, pitch = group.robots, group.pitch or 0.0
    low, high = group.offsets(radius)
    offset = low

    def chord() -> float:
        points = equal_chords(whole_ring(group, site, radius, offset), n)
        return _mean_step(np.concatenate([points, points[:1]]))

    apart = chord()
    for _ in range(ROUNDS):
        following = min(max(offset + n * (pitch - apart) / (2 * math.pi), low), high)
        if abs(apart - pitch) <= CLOSE or following == offset:
            break
        offset = following
        apart = chord()
    if abs(apart - pitch) <= pitch_slack(pitch):
        return offset
    length = whole_ring(group, site, radius, offset).length
    enough = (math.ceil if apart > pitch else math.floor)(length / pitch)
    there, asked = site.length(offset - radius), site.length(pitch)
    raise ToolError(
        f"{n} robots {asked} apart do not go round {group.targets[0]}: {there} from it they stand "
        f"{site.length(apart)} apart; about {enough} robots would stand {asked} apart there.",
        robots_needed=enough,
    )


def pitch_places(group: Group, curve: Curve, site: Site) -> FloatArray:
    """Return places the pitch apart on a group's curve, (k, 2), for as many robots as have room.

    Raises:
        ToolError: the picture cuts the ring that they would go round on.
    """
    if not group.solves_clearance:
        longest = max(curve.lines, key=arc_length, default=np.empty((0, 2)))
        return chain(longest, group.robots, group.pitch or 0.0)
    if curve.closed and curve.length > UNCUT * curve.whole_length:
        return equal_chords(curve, group.robots)
    apart, name = site.length(group.pitch or 0.0), group.targets[0]
    raise ToolError(
        f"{group.robots} robots {apart} apart around {name} would reach out of the picture: take "
        "fewer robots or have them stand nearer to each other."
    )


def chain(line: FloatArray, n: int, pitch: float) -> FloatArray:
    """Return up to n points, as many as fit, the pitch apart in the middle of a polyline (m, 2)."""
    if not len(line):
        return line
    whole, length = LineString(line), arc_length(line)
    for k in range(min(n, int(length / pitch + 1e-9) + 1), 1, -1):
        reach = (k - 1) * pitch
        for _ in range(ROUNDS):
            ends = ((length - reach) / 2, (length + reach) / 2)
            part = shapely.get_coordinates(substring(whole, *ends))
            points = equal_chords(Curve((part,), False, reach), k)
            apart = _mean_step(points)
            if abs(apart - pitch) <= CLOSE:
                return points
            reach += (k - 1) * (pitch - apart)
            if reach > length:
                break
    return interpolate(line, np.array([length / 2]))


def _mean_step(points: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())
