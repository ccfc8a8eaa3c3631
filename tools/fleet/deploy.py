"""Drives a fleet to a certified formation and says what was observed, not what was commanded."""

from typing import Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict

from ..errors import FleetError, ToolError
from ..formation.checking.check import certify
from ..formation.contract import with_defaults
from ..formation.placement.place import Site
from ..formation.plan import Plan, Point
from ..geometry.assignment import assign
from ..geometry.outline import FloatArray, distances
from ..motion.motion import obstacles, routes

CORRECTIONS = 5
ARRIVED_SHARE, ARRIVED_PX = 0.001, 0.5
"""A robot has arrived within this share of the picture's diagonal, at least half a pixel."""


class Fleet(Protocol):
    """Robots that can be observed and driven; poses are (n, 2) positions in image pixels."""

    async def observe(self) -> FloatArray:
        """Where the robots are seen to be now, robot order."""
        ...

    async def move(self, paths: list[FloatArray]) -> None:
        """Drive robot i along polyline i, all in step, and return when they stand still."""
        ...


class Arrival(BaseModel):
    """Requested against observed, per place of the formation.

    Attributes:
        robots: which robot of the fleet (from 1) took each place.
        residual_px: distance of observed to requested.
        corrections: how many times robots were sent again after the first move.
        assignment_gap: share of the summed squared ways another assignment could have saved at
            most; None where there was none better.
    """

    model_config = ConfigDict(frozen=True)

    arrived: bool
    robots: tuple[int, ...]
    observed: tuple[Point, ...]
    residual_px: tuple[float, ...]
    tolerance_px: float
    corrections: int
    assignment_gap: float | None = None


async def deploy(plan: Plan, site: Site, fleet: Fleet) -> Arrival:
    """Move a fleet onto a plan that is certified here and now, observe, correct, and report.

    Raises:
        ToolError: the plan does not certify.
        FleetError: the fleet has another number of robots, or one starts on a target.
    """
    contract = with_defaults(plan.formation.contract, site.outlines, site.room)
    goals = plan.formation.points
    verdict = certify(goals, contract, site)  # a plan's own word is not taken for it
    if not verdict.certified:
        why = verdict.findings[0].sentence
        raise ToolError(f"Plan {plan.id} is not certified: {why} Nothing was moved.")
    poses = await fleet.observe()
    if len(poses) != len(goals):
        raise FleetError(f"The fleet has {len(poses)} robots; the plan needs {len(goals)}.")
    solid, frame = obstacles(contract, site), site.frame(contract.robot_radius)
    if not solid.is_empty and distances(solid, poses).min() <= contract.robot_radius:
        robot = int(np.argmin(distances(solid, poses))) + 1
        raise FleetError(f"Robot {robot} stands on the target; move it off before deploying.")
    assignment = assign(poses, goals)
    takes = assignment.robots
    tolerance = max(ARRIVED_PX, ARRIVED_SHARE * float(np.hypot(*site.room)))
    corrections = -1
    residual = np.full(len(goals), np.inf)
    while residual.max() > tolerance and corrections < CORRECTIONS:
        paths: list[FloatArray] = [np.stack([p, p]) for p in poses]
        planned = routes(poses[takes], goals, solid, contract.robot_radius, frame)
        for robot, path in zip(takes, planned, strict=True):
            paths[robot] = path
        await fleet.move(paths)
        poses = await fleet.observe()
        residual = np.linalg.norm(poses[takes] - goals, axis=1)
        corrections += 1
    return Arrival(
        arrived=bool(residual.max() <= tolerance),
        robots=tuple(int(r) + 1 for r in takes),
        observed=tuple((round(float(x), 3), round(float(y), 3)) for x, y in poses[takes]),
        residual_px=tuple(round(float(r), 3) for r in residual),
        tolerance_px=round(tolerance, 3),
        corrections=corrections,
        assignment_gap=assignment.gap if assignment.method == "approximate" else None,
    )
