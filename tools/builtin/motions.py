"""How the robots of a plan would get to their places: planned and certified with the plan."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..context import Context
from ..errors import FleetError, ToolError
from ..fleet.assigning import assign_robots
from ..fleet.protocol import Fleet, FleetSizeError, Pose, body_radius, points_of
from ..formation.encounters import Encounter, encounters_of
from ..formation.plan import Plan
from ..geometry.assignment import EXACT
from ..geometry.outline import FloatArray
from ..motion.avoiding import long_ways_round
from ..motion.checking import MotionVerdict
from ..motion.planning import Ground, NoOrderError, Team, assigned, plan_motion
from ..motion.routes import named_obstacles, obstacles
from ..world import World

SHARING = (
    "Ask whether robots may share the places among themselves; after a yes edit again, with "
    "share true."
)
"""What a model is told to do about places that cannot each be reached by their own robots."""
MOST_WAYS = 16
"""Most plans whose ways are remembered."""
MOVED_PX = 1.0
"""A robot that is seen no further from where its way began has not moved, px."""


@dataclass(frozen=True)
class Going:
    """Who of a fleet takes which place, and how all of them get there.

    Attributes:
        robots: ids; robot i takes place i.
        gap: share of the summed squared ways another assignment could save at most; None where
            the least was found.
        paths: (k, 2) px by id; none if there is no way, which a deployment then says.
        verdict: of the motion; None where there is none.
        radius: of a body, px.
    """

    robots: tuple[str, ...]
    gap: float | None
    paths: dict[str, FloatArray]
    verdict: MotionVerdict | None
    radius: float


def paths_to(context: Context, plan: Plan) -> dict[str, FloatArray]:
    """Return how robots would get to a plan's places from where they were seen last.

    Returns:
        (k, 2) px by the robot's id; none if no fleet is in use yet, or there is no way.

    Raises:
        ToolError: robots that keep places stand in each other's way.
    """
    fleet = context.services.fleets.get(context.settings.fleet)
    if fleet is None or not plan.formation.robots:
        return {}
    taking, poses = plan.formation.robot_of_place, context.world.robots
    return going(context.world, plan, fleet, poses, taking).paths


def remember_ways(context: Context, plan: Plan, found: Going) -> None:
    """Keep how robots would get to a plan's places, for pictures of it."""
    ways = context.services.ways
    ways[plan.id] = found.paths
    for old in [*ways][:-MOST_WAYS]:
        del ways[old]


def ways_ahead(context: Context, world: World, plan: Plan) -> dict[str, FloatArray]:
    """Return how robots would get to a plan's places, as planned with it.

    Returns:
        (k, 2) px by the robot's id; none if that is not known, or a robot has moved since.
    """
    ways = context.services.ways.get(plan.id, {})
    at = {pose.id: (pose.x, pose.y) for pose in world.robots}
    there = all(
        robot in at and np.hypot(*(way[0] - at[robot])) <= MOVED_PX for robot, way in ways.items()
    )
    return ways if there else {}


def going(
    world: World,
    plan: Plan,
    fleet: Fleet,
    poses: tuple[Pose, ...],
    taking: Sequence[str | None] | None,
    share: bool = False,
) -> Going:
    """Plan how robots get to a plan's places from where they were seen.

    Args:
        taking: the robot that keeps each place, None for one more; left out, robots are
            interchangeable.
        share: whether they may take each other's places if they find no order otherwise.

    Raises:
        ToolError: too few robots, or those that keep places stand in each other's way.
    """
    points, contract = plan.formation.points, plan.formation.contract
    ground = Ground(named_obstacles(contract, world.site(contract)), world.site(contract))
    radius = body_radius(fleet, contract, points)
    robots, gap = _assigned_robots(poses, points, taking, ground, radius)
    at = {pose.id: (pose.x, pose.y) for pose in poses}
    team = Team(
        ids=robots,
        starts=np.array([at[robot] for robot in robots]),
        radius=radius,
        speed=fleet.speed,
        error=fleet.tracking_error,
        idle={robot: place for robot, place in at.items() if robot not in set(robots)},
    )
    try:
        free = taking is None or share
        motion, robots, verdict = plan_motion(team, points, ground, interchangeable=free)
    except NoOrderError as error:
        if taking is None:
            return Going(robots, gap, {}, None, radius)
        kind, text = ("edit" if share else "no_order"), f"Nothing was changed: {error}"
        raise ToolError(text if share else f"{text} {SHARING}", kind, plain=str(error)) from None
    except FleetError:  # no way to a place: a deployment says so
        return Going(robots, gap, {}, None, radius)
    return Going(robots, gap, dict(motion.paths), verdict, radius)


def met_by(world: World, plan: Plan, found: Going | None) -> tuple[Encounter, ...]:
    """Return the other things that robots of a plan stand on, or drive over or far around."""
    site = world.site(plan.formation.contract)
    if found is None:
        return encounters_of(plan, site, {}, plan.formation.contract.robot_radius)
    met = encounters_of(plan, site, found.paths, found.radius)
    solid = obstacles(plan.formation.contract, site)
    return met + long_ways_round(found.paths, solid, site, found.radius)


def _assigned_robots(
    poses: tuple[Pose, ...],
    points: FloatArray,
    taking: Sequence[str | None] | None,
    ground: Ground,
    radius: float,
) -> tuple[tuple[str, ...], float | None]:
    """Return who takes which place, and what another assignment could save."""
    try:
        if taking is None:
            return _interchangeable(poses, points, ground, radius)
        new = [i for i, robot in enumerate(taking) if robot is None]
        free = tuple(pose for pose in poses if pose.id not in taking)
        found = _interchangeable(free, points[new], ground, radius)[0] if new else ()
    except FleetSizeError as error:
        raise ToolError(str(error), "too_many_robots") from None
    more = iter(found)
    return tuple(next(more) if robot is None else robot for robot in taking), None


def _interchangeable(
    poses: tuple[Pose, ...], points: FloatArray, ground: Ground, radius: float
) -> tuple[tuple[str, ...], float | None]:
    if len(poses) > EXACT or len(poses) < len(points):
        found = assign_robots(poses, points)
        return found.robots, found.gap
    rows = assigned(points_of(poses), points, ground, radius)
    return tuple(poses[int(i)].id for i in rows), None
