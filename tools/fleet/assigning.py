"""Which robots of a fleet take which places of a plan."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.assignment import assign
from ..geometry.outline import FloatArray
from .protocol import FleetSizeError, Pose, points_of


@dataclass(frozen=True)
class Assigned:
    """Who takes which place.

    Attributes:
        robots: ids; robot i takes place i.
        gap: share of the summed squared ways another assignment could have saved at most; None
            where there was none better.
    """

    robots: tuple[str, ...]
    gap: float | None


def assign_robots(poses: Sequence[Pose], places: FloatArray) -> Assigned:
    """The robots for all places, (n, 2) px, with the least sum of squared ways; others stay idle.

    Raises:
        FleetSizeError: the fleet has fewer robots than there are places.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(poses) < len(places):
        raise FleetSizeError(f"The fleet has {len(poses)} robots; the plan needs {len(places)}.")
    points = points_of(poses)
    chosen = np.arange(len(poses))
    if len(poses) > len(places):
        cost = cdist(places, points, "sqeuclidean")
        chosen = np.sort(linear_sum_assignment(cost)[1])
    found = assign(points[chosen], places)
    robots = tuple(poses[int(i)].id for i in chosen[found.robots])
    return Assigned(robots, found.gap if found.method == "approximate" else None)
