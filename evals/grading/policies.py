"""Baseline policies that know where the thing is but understand nothing.

The best of them, by cell, is the chance level printed with every table. They use the true outline,
so they show what finding the thing alone would give.
"""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.random import Generator
from shapely.geometry import LineString

from ...tools.geometry.outline import FloatArray
from ..tasks.task import Goal
from .attempts import grade_goals

DRAWS = 4
"""Repetitions of the policies that place at random, for a chance level."""
BOX = 1.5
"""Side of the box in which robots are scattered, over the side of the target's own box."""


def pile(goal: Goal, random: Generator) -> FloatArray:
    """Place all robots at the centroid."""
    return np.tile(_centroid(goal), (goal.robots, 1))


def scatter(goal: Goal, random: Generator) -> FloatArray:
    """Place robots at random in a box half as large again as the target's."""
    x0, y0, x1, y1 = goal.target.outline.bounds
    middle, half = np.array([x0 + x1, y0 + y1]) / 2, np.array([x1 - x0, y1 - y0]) / 2 * BOX
    far = np.array(goal.size) - 1.0
    low, high = np.clip(middle - half, 0, far), np.clip(middle + half, 0, far)
    return random.uniform(low, high, (goal.robots, 2))


def boundary(goal: Goal, random: Generator) -> FloatArray:
    """Place robots at random on the target's boundary."""
    line = LineString(goal.target.outline.polygon.exterior.coords)
    stations = random.uniform(0, line.length, goal.robots)
    return shapely.get_coordinates(shapely.line_interpolate_point(line, stations))


def circle(goal: Goal, random: Generator) -> FloatArray:
    """Place robots evenly on a circle about the centroid that has the target's area."""
    turns = 2 * np.pi * np.arange(goal.robots) / goal.robots
    radius = goal.target.outline.size / np.sqrt(np.pi)
    return _centroid(goal) + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def line(goal: Goal, random: Generator) -> FloatArray:
    """Place robots evenly on a straight line through the centroid along the target's long axis."""
    unit, length, _ = goal.target.outline.long_axis
    return _centroid(goal) + np.linspace(-0.5, 0.5, goal.robots)[:, None] * length * unit


Policy = Callable[[Goal, Generator], FloatArray]
POLICIES: dict[str, Policy] = {
    policy.__name__: policy for policy in (pile, scatter, boundary, circle, line)
}


def positions(name: str, goals: Sequence[Goal], seed: int) -> FloatArray:
    """Return where a policy puts the robots of all goals, (N, 2) px."""
    random = np.random.default_rng(seed)
    return np.concatenate([POLICIES[name](goal, random) for goal in goals])


def scores(name: str, goals: Sequence[Goal], draws: int = DRAWS) -> tuple[float, float]:
    """Return mean SR and GCR of a policy on a task; 0 if nothing is to be placed, as it moves."""
    if not goals:
        return 0.0, 0.0
    count = draws if name in ("scatter", "boundary") else 1
    graded = [grade_goals(goals, positions(name, goals, i)) for i in range(count)]
    return float(np.mean([g.sr for g in graded])), float(np.mean([g.gcr for g in graded]))


def chance(tasks: Sequence[Sequence[Goal]]) -> tuple[float, float]:
    """Return the chance level over tasks, given by their goals: the best SR and GCR of a policy."""
    means = [np.mean([scores(name, goals) for goals in tasks], axis=0) for name in POLICIES]
    return float(max(m[0] for m in means)), float(max(m[1] for m in means))


def _centroid(goal: Goal) -> FloatArray:
    return shapely.get_coordinates(goal.target.outline.polygon.centroid)[0]
