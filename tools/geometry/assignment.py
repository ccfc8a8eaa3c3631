"""Assigns robots to the places of a formation.

Minimises the sum of squared distances, the condition of CAPT (Turpin et al. 2014) for straight
synchronised paths that do not meet. Exact for up to `EXACT` robots; beyond that nearly optimal,
with a proven bound on what a better assignment could save.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ToolError
from .optimal_transport import (
    BASE,
    Matching,
    improved_by_cycles,
    lower_bound,
    multilevel_matching,
    sum_of_squares,
)
from .outline import FARTHEST, FloatArray

IntArray = NDArray[np.intp]

EXACT = 2_000
"""Most robots for which the optimum is found: under a second and 100 MB."""
ENOUGH = 0.01
"""An approximation is improved until at most this share of the cost could still be saved."""
ROUNDS = 6
"""Most rounds of improvement: about 0.3 s each for 10,000 robots."""
WARM_ROUNDS = 2
"""Rounds of improvement before the exact method; the prices they find make it several times
faster."""


@dataclass(frozen=True)
class Assignment:
    """An assignment of robots to goals, with its method and cost.

    Attributes:
        robots: (n,) the index of the robot that takes each goal.
        method: exact, or approximate with more than EXACT robots.
        cost: sum of squared distances, px^2.
        gap: upper bound on the share of the cost that another assignment could save; 0 when exact.
    """

    robots: IntArray
    method: Literal["exact", "approximate"]
    cost: float
    gap: float = 0.0


def assign(starts: FloatArray, goals: FloatArray) -> Assignment:
    """Assign one robot to each goal.

    Args:
        starts: (n, 2) positions of the robots, image pixels.
        goals: (n, 2) places, image pixels.

    Raises:
        ToolError: the shapes differ or are not (n, 2), or a coordinate is farther than FARTHEST.
    """
    starts, goals = _checked_places(starts, goals)
    if not len(goals):
        return Assignment(np.zeros(0, dtype=np.intp), "exact", 0.0)
    # The optimum does not change when all goals move together; aligned sets solve faster.
    shift = goals.mean(axis=0) - starts.mean(axis=0)
    aligned, displacement = goals - shift, len(goals) * float(shift @ shift)
    matching = multilevel_matching(aligned, starts)
    if len(goals) <= EXACT:
        robots = _exact(aligned, starts, matching)
        return Assignment(robots, "exact", sum_of_squares(goals, starts, robots))
    matching, bound = _improved(aligned, starts, matching, displacement)
    unpaid = max(sum_of_squares(aligned, starts, matching.robots) - bound, 0.0)
    cost = sum_of_squares(goals, starts, matching.robots)
    return Assignment(matching.robots, "approximate", cost, unpaid / cost if cost > 0 else 0.0)


def _exact(goals: FloatArray, starts: FloatArray, matching: Matching) -> IntArray:
    """Minimise the sum of squares from a warm start.

    Costs reduced by the prices have the same optimum, which is found sooner.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(goals) <= BASE:
        return matching.robots  # exact as it is
    for _ in range(WARM_ROUNDS):
        matching = improved_by_cycles(goals, starts, matching)
    cost = cdist(goals, starts, "sqeuclidean") - matching.prices
    cost -= cost.min(axis=1, keepdims=True)
    return np.asarray(linear_sum_assignment(cost)[1], dtype=np.intp)


def _improved(
    goals: FloatArray, starts: FloatArray, matching: Matching, displacement: float
) -> tuple[Matching, float]:
    """Improve the matching until little of cost plus displacement, px^2, could still be saved.

    Returns:
        The matching, and a lower bound on the cost of any matching, px^2.
    """
    bound = max(0.0, lower_bound(goals, starts, matching.prices))
    for _ in range(ROUNDS):
        cost = sum_of_squares(goals, starts, matching.robots)
        if cost - bound <= ENOUGH * (cost + displacement):
            break
        matching = improved_by_cycles(goals, starts, matching)
        bound = max(bound, lower_bound(goals, starts, matching.prices))
    return matching, bound


def _checked_places(starts: FloatArray, goals: FloatArray) -> tuple[FloatArray, FloatArray]:
    both = [np.asarray(points, dtype=float) for points in (starts, goals)]
    shapes = [points.shape for points in both]
    if shapes[0] != shapes[1] or len(shapes[0]) != 2 or shapes[0][1] != 2:
        raise ToolError(
            f"Robots and places must be as many (x, y) pairs, (n, 2) each; got shapes {shapes[0]} "
            f"and {shapes[1]}."
        )
    if not all((np.abs(points) <= FARTHEST).all() for points in both):
        raise ToolError(f"Coordinates of robots and places must lie within {FARTHEST:g} px.")
    return both[0], both[1]
