"""Which robot takes which place of a formation.

Least sum of squared distances by default, the condition of CAPT (Turpin et al. 2014) for straight
synchronised ways that do not meet; else the shortest longest way, or everyone by name. Exact up
to `EXACT` robots; beyond, nearly so, with a proven bound of what was left to save.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ToolError
from .bottleneck import bottleneck
from .optimal_transport import (
    BASE,
    Matching,
    Reach,
    blockwise,
    exchanged,
    lower_bound,
    matched,
    squares,
)
from .outline import FARTHEST, FloatArray

Objective = Literal["squares", "makespan", "named"]
Method = Literal["exact", "bottleneck", "approximate", "named"]
IntArray = NDArray[np.intp]

EXACT = 2_000
"""Robots up to which the optimum is found: under a second and 100 MB."""
ENOUGH = 0.01
"""Share of the cost that may be left to save when an approximation is no longer improved."""
ROUNDS = 6
"""Rounds of improvement at most: about 0.3 s each for 10,000 robots."""
WARM_ROUNDS = 2
"""Rounds after which the exact method takes over; prices to start from make it several times
faster."""
CONFINED_ROUNDS, SAVED = 12, 1e-5
"""With a longest way to keep to: more rounds, as long as each saves this share of the cost."""
REACH_SLACK = 1e-9
"""Share of the longest way by which rounding may make a way seem longer."""
METHODS: Mapping[Objective, Method] = MappingProxyType(
    {"squares": "exact", "makespan": "bottleneck", "named": "named"}
)
NOBODY: Mapping[int, int] = MappingProxyType({})


@dataclass(frozen=True)
class Assignment:
    """Who goes where, how that was found, and what it costs.

    Attributes:
        robots: (n,) for each goal the robot (from 0) that takes it.
        method: exact (least sum of squares), bottleneck (shortest longest way, then least
            squares), approximate (either of them, with more robots), named.
        cost: sum of squared distances, px^2.
        makespan: greatest distance, px.
        gap: share of the cost that another assignment with the same demands could save at
            most; 0 unless approximate. The makespan asked for is the least there is, always.
    """

    robots: IntArray
    method: Method
    cost: float
    makespan: float
    gap: float = 0.0


def assign(
    starts: FloatArray,
    goals: FloatArray,
    *,
    objective: Objective = "squares",
    fixed: Mapping[int, int] = NOBODY,
) -> Assignment:
    """The robots for all goals.

    Args:
        starts: (n, 2) where robots are, image pixels.
        goals: (n, 2) places.
        objective: squares, makespan, or named: robot i takes goal i. Robots whose own place is
            fixed for another one share the places left over, by squares.
        fixed: goals (from 0) and the robots (from 0) that take them whatever the objective.

    Raises:
        ToolError: arrays of other shapes or with no places in a picture, or a `fixed` that
            names a goal or robot that is not there, or a robot twice.
    """
    starts, goals = _checked(starts, goals)
    _check_fixed(fixed, len(goals))
    robots = np.full(len(goals), -1, dtype=np.intp)
    robots[list(fixed.keys())] = list(fixed.values())
    if objective == "named":
        own = np.setdiff1d(np.flatnonzero(robots < 0), robots)
        robots[own] = own
    goal = np.flatnonzero(robots < 0)
    robot = np.setdiff1d(np.arange(len(goals)), robots)
    method = METHODS[objective]
    unpaid = 0.0
    if len(goal):
        floor = _longest(starts, goals, robots) if objective == "makespan" else None
        takes, unpaid = _solved(starts[robot], goals[goal], floor)
        robots[goal] = robot[takes]
    if len(goal) > EXACT and method != "named":
        method = "approximate"
    cost = squares(goals, starts, robots)
    gap = unpaid / cost if method == "approximate" and cost > 0 else 0.0
    return Assignment(robots, method, cost, _longest(starts, goals, robots), gap)


def _solved(starts: FloatArray, goals: FloatArray, floor: float | None) -> tuple[IntArray, float]:
    """Robots for all goals, and how far the sum of squares may be above its least, px^2.

    Args:
        starts, goals: (n, 2), n > 0.
        floor: for the shortest longest way, what that is in any case, px; None for squares alone.
    """
    # The optimum does not change when all goals move together; aligned sets solve faster.
    shift = goals.mean(axis=0) - starts.mean(axis=0)
    aligned, displacement = goals - shift, len(goals) * float(shift @ shift)
    matching, bound, reach = matched(aligned, starts), 0.0, None
    if len(goals) > EXACT:
        matching, bound = _nearly(aligned, starts, matching, None, displacement)
    if floor is not None:
        robots, px = bottleneck(goals, starts, matching.robots, floor)
        reach = Reach(max(px, floor) * (1 + REACH_SLACK), shift)
        matching = replace(matching, robots=robots)
    if len(goals) <= EXACT:
        return _exact(aligned, starts, matching, reach), 0.0
    if reach:
        matching = blockwise(aligned, starts, matching, reach)
        matching, _ = _nearly(aligned, starts, matching, reach, displacement, bound)
    return matching.robots, max(squares(aligned, starts, matching.robots) - bound, 0.0)


def _exact(
    goals: FloatArray, starts: FloatArray, matching: Matching, reach: Reach | None
) -> IntArray:
    """The least sum of squares, warm: costs less prices have the same optimum, found sooner."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(goals) > BASE:
        matching = _warmed(goals, starts, matching, reach)
    elif reach is None:
        return matching.robots  # exact as it is
    cost = cdist(goals, starts, "sqeuclidean") - matching.prices
    cost -= cost.min(axis=1, keepdims=True)
    if reach:
        cost[reach.beyond(goals[:, None], starts)] = np.inf
    return np.asarray(linear_sum_assignment(cost)[1], dtype=np.intp)


def _warmed(
    goals: FloatArray, starts: FloatArray, matching: Matching, reach: Reach | None
) -> Matching:
    """The matching after rounds of exchanges, for the sake of its prices."""
    before = squares(goals, starts, matching.robots)
    for done in range(1, CONFINED_ROUNDS + 1):
        matching = exchanged(goals, starts, matching, reach)
        now = squares(goals, starts, matching.robots)
        if done >= WARM_ROUNDS and (reach is None or now > (1 - SAVED) * before):
            break
        before = now
    return matching


def _nearly(
    goals: FloatArray,
    starts: FloatArray,
    matching: Matching,
    reach: Reach | None,
    displacement: float,
    bound: float = 0.0,
) -> tuple[Matching, float]:
    """Rounds of improvement until little can be left to save of cost and displacement, px^2.

    Returns:
        the matching, and a lower bound of the cost of any.
    """
    bound = max(bound, lower_bound(goals, starts, matching.prices))
    for _ in range(ROUNDS):
        cost = squares(goals, starts, matching.robots)
        if cost - bound <= ENOUGH * (cost + displacement):
            break
        matching = exchanged(goals, starts, matching, reach)
        bound = max(bound, lower_bound(goals, starts, matching.prices))
    return matching, bound


def _longest(starts: FloatArray, goals: FloatArray, robots: IntArray) -> float:
    """The greatest distance of those that are taken, px; 0 where none is."""
    taken = robots >= 0
    return float(np.linalg.norm(goals[taken] - starts[robots[taken]], axis=1).max(initial=0.0))


def _checked(starts: FloatArray, goals: FloatArray) -> tuple[FloatArray, FloatArray]:
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


def _check_fixed(fixed: Mapping[int, int], n: int) -> None:
    problems = [
        f"{what} {i} is not there, they go from 0 to {n - 1}"
        for what, named in (("place", fixed.keys()), ("robot", fixed.values()))
        for i in named
        if not 0 <= i < n
    ]
    twice = [r for r, times in Counter(fixed.values()).items() if times > 1]
    problems += [f"robot {r} is given two places or more" for r in twice]
    if problems:
        raise ToolError(f"These places cannot be fixed: {'; '.join(problems)}.")
