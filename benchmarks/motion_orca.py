"""The scenes of `motion_scenes` with pyrvo: robots on shortest paths avoid each other (ORCA)."""

import time
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import shapely

from ..tools.fleet.deploy import tolerance
from ..tools.geometry.outline import FloatArray
from ..tools.motion.routes import routes
from .motion_late import closest
from .motion_scenes import RADIUS, SPEED, Scene

PERIOD = 0.0125
"""Seconds of a step, in which robots drive less than half a radius."""
NEIGHBOURS, NEAR, HORIZON = 20, 20 * RADIUS, 0.3
"""Most neighbours that a robot avoids, within what distance, px, and for how many seconds: of five
settings, the one that overlaps least and is done soonest."""
LONGEST, MORE = 5.0, 10.0
"""A run ends at the latest after this multiple of the bound, plus this many seconds."""
LOOKING = 20
"""Steps between choosing anew the farthest visible point of each robot's path."""


@dataclass(frozen=True)
class Ended:
    """The result of a run.

    Attributes:
        arrived: fraction of robots that arrived.
        separation: least distance of two robots at any time, as a fraction of two radii.
        seconds: until the last one arrived, or the run was ended.
        spent: CPU seconds.
    """

    arrived: float
    separation: float
    seconds: float
    spent: float


def orca(of: Scene, least: float) -> Ended:
    """Step robots towards the farthest point of their path that they see.

    Args:
        least: lower bound of the makespan, seconds.
    """
    began = time.process_time()
    team, solid = of.team(0.0), of.ground.solid
    ways = routes(team.starts, of.goals, solid, RADIUS, of.site.frame(RADIUS))
    there, points, apart, steps = _simulator(of, team.starts), team.starts, np.inf, 0
    barrier = solid.buffer(0.999 * RADIUS)
    shapely.prepare(barrier)
    near, aims, off = tolerance(of.site.room), of.goals, np.full(len(ways), np.inf)
    measuring = 0.0
    while steps * PERIOD < LONGEST * least + MORE and (off > near).any():
        if steps % LOOKING == 0:
            aims = _aims(points, ways, barrier)
        wanted = (aims - points) / PERIOD
        speed = np.linalg.norm(wanted, axis=1, keepdims=True)
        wanted *= np.minimum(1.0, SPEED / np.maximum(speed, SPEED))
        for i, (x, y) in enumerate(wanted.tolist()):
            there.set_agent_pref_velocity(i, (x, y))
        there.do_step()
        moved = np.array([there.get_agent_position(i).to_tuple() for i in range(len(ways))])
        pause = time.process_time()
        apart = min(apart, closest(points, moved, 2 * RADIUS + 2 * SPEED * PERIOD))
        measuring += time.process_time() - pause
        points, steps = moved, steps + 1
        off = np.linalg.norm(points - of.goals, axis=1)
    spent = time.process_time() - began - measuring
    return Ended(float((off <= near).mean()), apart / (2 * RADIUS), steps * PERIOD, spent)


def _simulator(of: Scene, starts: FloatArray) -> Any:
    rvo: Any = import_module("pyrvo")
    there = rvo.RVOSimulator(PERIOD, NEAR, NEIGHBOURS, HORIZON, HORIZON, RADIUS, SPEED)
    for x, y in starts.tolist():
        there.add_agent((x, y))
    for part in shapely.get_parts(of.ground.solid):
        ring = shapely.orient_polygons(part).exterior.coords[:-1]
        there.add_obstacle([(x, y) for x, y in ring])
    there.process_obstacles()
    return there


def _aims(points: FloatArray, ways: list[FloatArray], barrier: shapely.Geometry) -> FloatArray:
    """Return the farthest point of each path that its robot sees, (n, 2) px; if none, its end."""
    robot = np.repeat(np.arange(len(ways)), [len(way) for way in ways])
    ends = np.concatenate(ways)
    lines = shapely.linestrings(np.stack([points[robot], ends], axis=1))
    seen = np.flatnonzero(~shapely.intersects(lines, barrier))
    last = np.arange(len(robot))[np.append(np.diff(robot) > 0, True)]
    found = ends[last]
    found[robot[seen]] = ends[seen]  # the last one assigned for a robot wins
    return found
