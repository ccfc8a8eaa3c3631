"""Matching of robots to slots: as many as can be, and to slots along a loop with a free start.

Least total distance is not the same: it gives up a match that could be had to shorten two pairs
that count for nothing.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ...tools.geometry.outline import FloatArray


def match_slots(points: FloatArray, slots: FloatArray, tolerance: float) -> NDArray[np.intp]:
    """Match as many pairs within the tolerance as possible, with the least total distance.

    Args:
        points: (m, 2), px.
        slots: (n, 2), px.
        tolerance: px.

    Returns:
        The slot of each point, -1 for none, (m,).
    """
    distance = np.linalg.norm(points[:, None] - slots[None], axis=2)
    beyond = (min(distance.shape) + 1) * max(tolerance, 1.0)
    cost = distance.copy()
    cost[distance > tolerance] = beyond
    rows, columns = linear_sum_assignment(cost)
    found = np.full(len(points), -1, dtype=np.intp)
    good = distance[rows, columns] <= tolerance
    found[rows[good]] = columns[good]
    return found


def phase_free(stations: FloatArray, length: float, slots: int, tolerance: float) -> int:
    """Return the most of n even slots along a loop that hold a robot, over all starts of the slots.

    The number changes only where a robot comes within the tolerance of a slot or leaves it, so
    only those starts have to be tried; with a tolerance under half a gap, no robot fits two slots.

    Args:
        stations: arc length of each robot along the loop, (m,), px.
        length: of the loop, px.
        slots: n.
        tolerance: arc length, px, under half of length / n.
    """
    if not len(stations):
        return 0
    gap = length / slots
    starts = (stations % gap) + tolerance
    off = stations[None] - starts[:, None]
    number = np.round(off / gap)
    near = np.abs(off - number * gap) <= tolerance * (1 + 1e-9)
    number = number % slots
    return max(len(set(n[k].tolist())) for n, k in zip(number, near, strict=True))


def even_along(stations: FloatArray, tolerance: float) -> int:
    """Return the most of m even slots along a line, from first to last robot, that hold a robot.

    Args:
        stations: arc length of each robot, (m,), px.
        tolerance: share of a gap, under 0.5.
    """
    if len(stations) < 3:
        return len(stations)
    ordered = np.sort(stations)
    gap = (ordered[-1] - ordered[0]) / (len(ordered) - 1)
    if gap <= 0:
        return 1
    return phase_free(ordered, gap * len(ordered), len(ordered), tolerance * gap)
