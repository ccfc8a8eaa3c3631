"""A right answer to every task: the contract its rule amounts to, placed on the true outline.

If it does not score 1, the task or the grader is wrong: a test checks every task.
"""

from typing import Any

import numpy as np
from scipy.cluster.vq import kmeans2

from ...tools.formation.contract import Contract, Group, Relation, with_defaults
from ...tools.formation.placement.place import Site, place
from ...tools.geometry.outline import FloatArray
from ...tools.geometry.sampling import nearest
from ..tasks.task import Goal
from .attempts import grade_goals
from .infill import cells_within

SPARE = 0.02
"""Share by which a place keeps within the limits of the rule."""
CELLS = 40
"""Least number of cells along the size of a region."""
WIDTHS = (0.25, 0.05)
"""Half the part of a band that is used; a narrow one follows recesses that a wide one bridges."""


def reference(goal: Goal) -> FloatArray:
    """Return positions that satisfy a goal, (N, 2) px.

    Raises:
        ToolError: no placement satisfies it.
    """
    where = str(goal.success["where"])
    if where == "line_between":
        a, b = np.asarray(goal.success["points"], dtype=float)
        share = (np.arange(goal.robots) + 1) / (goal.robots + 1)
        return a + share[:, None] * (b - a)
    inside, (wide, narrow) = where == "inside", WIDTHS
    placed = _spread_inside(goal) if inside else _place_by_contract(goal, where, wide)
    if (inside or "band_px" in goal.success) and not grade_goals([goal], placed).strict:
        placed = _place_by_contract(goal, where, narrow)
    return placed


def _spread_inside(goal: Goal) -> FloatArray:
    """Return the cells nearest to the means of clusters of cells: quick, and often even."""
    rule, target = goal.success, goal.target.outline.polygon
    inner = target.buffer(-rule["min_clearance_px"] * (1 + SPARE))
    step = goal.target.outline.size / max(CELLS, 4 * goal.robots**0.5)
    cells = cells_within(inner, target.bounds, step)
    if len(cells) < goal.robots:
        return np.empty((0, 2))
    means, _ = kmeans2(cells, goal.robots, minit="++", seed=np.random.default_rng(0))
    return cells[nearest(cells, means, 1)[1]]


def _place_by_contract(goal: Goal, where: str, width: float) -> FloatArray:
    outlines = {"t1": goal.target.outline}
    width_px, height_px = (float(side) for side in goal.size)
    site = Site(outlines, width_px, height_px)
    contract = with_defaults(
        Contract(groups=(_group_for(goal, where, width),)), outlines, site.room
    )
    return place(contract, site)


def _group_for(goal: Goal, where: str, width: float) -> Group:
    rule, n = goal.success, goal.robots
    kind, _, name = where.partition(":")
    if kind == "inside":
        deep = max(rule["min_clearance_px"] * (1 + SPARE), 0.01)
        floor = rule["min_spacing_px"] * (1 + SPARE)
        depth = (deep, 4 * goal.target.outline.size)
        return _group_of("inside", n, clearance=depth, min_spacing=floor)
    if kind == "corners":
        return _group_of("corners", n)
    if kind == "center":
        return _group_of("centre", n)
    low, high = rule["band_px"]
    spread = (high - low) * width
    band = ((low + high) / 2 - spread, (low + high) / 2 + spread)
    if kind == "side":
        return _group_of("along", n, clearance=band, side=name)
    if kind == "cage":
        return _group_of("cage", n, clearance=band, closure="escape-proof")
    return _group_of("cage" if rule.get("closed") else "around", n, clearance=band)


def _group_of(relation: Relation, robots: int, **more: Any) -> Group:
    return Group(relation=relation, targets=("t1",), robots=robots, **more)
