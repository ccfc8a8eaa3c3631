"""Robots for plans: which robot takes which place, and the drive there."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import shapely

from ..context import Context
from ..errors import ApprovalError, FleetError, InputError, ToolError
from ..fleet.arrival import Arrival, Deployment
from ..fleet.deploy import (
    ARRIVED_DEG,
    MAX_AGE,
    check_turns,
    deploy,
    heading_residuals,
    motion_to,
)
from ..fleet.described import fleet_named
from ..fleet.escort import check_follow
from ..fleet.follow import Follow
from ..fleet.protocol import Fleet, FleetRequest, FleetSizeError, PlaceTakenError, Pose
from ..fleet.simulated import FULL_SPEED_S, SimulatedFleet
from ..fleet.simulator import tracking_error
from ..fleet.trajectories import Trajectories, tracked, wheeled
from ..formation.checking.instruction_doubts import overruled
from ..formation.contract import Contract
from ..formation.encounters import notes_of
from ..formation.plan import Plan
from ..formation.site import Other
from ..formation.units import length_text
from ..motion.routes import obstacles
from ..tool import in_thread
from ..world import PlanNode, World
from .follows import followed, stands_about, watch_target
from .motions import Going, going, met_by, remember_ways
from .others import without_robots
from .tracks import with_track

MOST_NAMED = 12
"""Most idle robots that a note names."""


async def with_robots(
    context: Context,
    node: PlanNode,
    taking: Sequence[str | None] | None = None,
    share: bool = False,
) -> World:
    """Return the world with a plan as the latest one and, if certified, robots for its places.

    Args:
        taking: the robot that keeps each place, in the order of the groups, None for one more;
            left out, the least sum of squared ways decides.
        share: whether they may take each other's places if they find no order otherwise.

    Raises:
        ToolError: a real fleet has too few robots.
        FleetError: the fleet cannot be observed.
        InputError: impossible starting positions.
    """
    world, plan = context.world, node.plan
    if not plan.verdict.certified:
        return world.with_plan(node)
    settings, contract = context.settings, plan.formation.contract
    told = overruled(
        context.words,
        contract,
        counted=settings.robots is not None,
        measured=settings.clearance is not None or settings.robot_radius is not None,
        scale=world.metres_per_pixel,
    )
    try:
        fleet = await _team(context, contract, taking or ())
    except FleetSizeError:  # more robots than can be driven can still be planned for
        return world.with_plan(_noted(world, node, told, None))
    check_turns(plan, fleet)
    poses = await fleet.observe(max_age=MAX_AGE)
    if fleet.real:
        world = without_robots(world, poses, fleet.radius)
    found: Going = await in_thread(lambda: going(world, plan, fleet, poses, taking, share))
    plan = plan.for_robots(found.robots, [pose.id for pose in poses])
    node = node.model_copy(update={"plan": plan, "motion": found.verdict})
    told += _notes(found, poses)
    node = await in_thread(lambda: _noted(world, node, told, found))
    remember_ways(context, plan, found)
    return world.having(robots=poses).with_plan(node)


def _noted(world: World, node: PlanNode, notes: list[str], found: Going | None) -> PlanNode:
    """Return the plan with notes, and with what its robots stand on and drive over."""
    plan = node.plan
    met = met_by(world, plan, found)
    more = (*plan.verdict.notes, *notes, *notes_of(met))
    plan = plan.model_copy(update={"verdict": plan.verdict.model_copy(update={"notes": more})})
    return node.model_copy(update={"plan": plan, "encounters": met})


def _notes(found: Going, poses: tuple[Pose, ...]) -> list[str]:
    """Return notes on which robots take which places."""
    notes: list[str] = []
    if found.gap is not None:
        notes.append(
            "Which robot takes which place is approximate: another assignment could save "
            f"{found.gap:.2%} of the summed squared ways at most."
        )
    if found.verdict is not None and not found.verdict.certified:
        told = " ".join(finding.sentence for finding in found.verdict.findings)
        notes.append(f"No robot can be driven there as they stand: {told}")
    idle = [pose.id for pose in poses if pose.id not in set(found.robots)]
    if idle:
        counted = "1 robot" if len(idle) == 1 else f"{len(idle)} robots"
        shown = ", ".join(idle[:MOST_NAMED]) + (", ..." if len(idle) > MOST_NAMED else "")
        notes.append(f"Without a place, staying where they are: {counted} ({shown}).")
    return notes


async def drive_to(
    context: Context, node: PlanNode, follow: Follow | None = None
) -> tuple[Arrival, World, bool]:
    """Drive the robots of a plan to their places, and return what was observed.

    Where they stand at the end is recorded even if the drive fails or is cancelled.

    Args:
        follow: permission to follow the thing that the plan is about from then on.

    Returns:
        What was observed, the world after it, and whether robots moved: those that are there
        already are not moved.

    Raises:
        ApprovalError: real robots, and the person has not approved this plan, or this follow.
        ToolError: more robots than can be driven, or one stands on a place; the thing moved away,
            or cannot be followed.
        FleetError: robots failed or were stopped on the way.
    """
    plan, world, moved = node.plan, context.world, True
    try:
        fleet = await _team(context, plan.formation.contract, plan.formation.robots)
        watch_target(context, plan, fleet)
        if follow is not None:
            await check_follow(plan, fleet, follow.most(world.picture.size))
        agreed = context.settings.approved == plan.id and (follow is None or context.agreed)
        if fleet.real and not agreed:
            raise ApprovalError(plan.id)
        before, arrival = world.arrivals.get(plan.id), None
        there = await stands_about(context, plan, fleet, follow)
        if before is not None:
            poses = await fleet.observe(max_age=MAX_AGE)
            if there or _are_there(poses, plan, before):
                arrival = before.model_copy(update={"follow": None})
                world, moved = world.with_arrival(plan.id, arrival), follow is not None
        if arrival is None:
            arrival, world = await _arrived(context, plan, fleet)
    except FleetSizeError as error:
        raise ToolError(str(error), "too_many_robots") from None
    except PlaceTakenError as error:
        raise ToolError(str(error)) from None
    if follow is not None and arrival.arrived:
        arrival, world = await followed(context.at(world), plan, fleet, arrival, follow)
    return arrival, world, moved


async def _arrived(context: Context, plan: Plan, fleet: Fleet) -> tuple[Arrival, World]:
    """Deploy a plan and return what was observed, and the world after it."""
    made = await _deployed(context, plan, fleet)
    arrival = _in_robot_order(made.arrival, plan)
    arrival = await with_track(context, arrival, made.track)
    world = context.world.having(robots=made.poses).with_arrival(plan.id, arrival)
    if arrival.ended in ("stopped", "failed"):
        context.observed(world)
        raise FleetError(arrival.reason or "")
    return arrival, world


def with_observed(tell: str | None, arrival: Arrival, world: World) -> str | None:
    """Return the model's words and, after them, what was observed; None if there are no words."""
    if not tell:
        return None
    count, worst = len(arrival.observed), max(arrival.residual_px)
    robots = "The robot was" if count == 1 else f"All {count} robots were"
    within = length_text(max(worst, 0.1), world.metres_per_pixel)
    told = f"{robots} observed within {within} of the plan."
    follow = arrival.follow and arrival.follow.told(world.metres_per_pixel)
    return " ".join(filter(None, [tell.strip(), told, arrival.reason, follow]))


async def trajectories_to(context: Context, plan: Plan) -> Trajectories:
    """Return how robots with two wheels would drive to a plan's places from where they are seen.

    Raises:
        ToolError, FleetError: as of `drive_to`.
    """
    fleet = await _team(context, plan.formation.contract, plan.formation.robots)
    if isinstance(fleet, SimulatedFleet):
        physics = wheeled(fleet.physics.speed, fleet.physics.acceleration, fleet.radius)
    else:
        physics = wheeled(fleet.speed, fleet.speed / FULL_SPEED_S, fleet.radius)
    error = max(tracking_error(physics), fleet.tracking_error)
    site, robots = context.world.site(plan.formation.contract), plan.formation.robot_of_place
    motion, verdict = await motion_to(plan, site, fleet, robots, error)
    looks = {pose.id: pose.heading for pose in await fleet.observe()}
    return await in_thread(lambda: tracked(motion, verdict, physics, looks, error))


async def _deployed(context: Context, plan: Plan, fleet: Fleet) -> Deployment:
    """Deploy a plan; where robots were seen last is recorded however that ends."""
    last: tuple[Pose, ...] = ()

    def watch(poses: tuple[Pose, ...]) -> None:
        nonlocal last
        last = poses
        context.services.watch(poses)
        show(poses)

    site = context.world.site(plan.formation.contract)
    robots = plan.formation.robot_of_place
    try:
        with context.services.view(context, plan, fleet) as show:
            return await deploy(
                plan, site, fleet, robots, watch=watch, starting=lambda: context.moving(plan.id)
            )
    finally:
        if last:
            context.observed(context.world.having(robots=last))


async def _team(context: Context, contract: Contract, taking: Sequence[str | None] = ()) -> Fleet:
    """Return the fleet; a simulated one has robots for the contract and all that keep places."""
    settings, world, fleets = context.settings, context.world, context.services.fleets
    held = fleets.get(settings.fleet)
    ids = {pose.id for pose in world.robots}
    driven = any(pose.seen > 0 for pose in world.robots)
    wanted = max(contract.robots, len(ids | {robot for robot in taking if robot}))
    if held is not None and held.real:
        return await context.services.claim(settings.fleet, lambda: held)
    if held is not None and driven and len(ids) >= wanted:
        return held
    stay = driven or not ids.isdisjoint(taking) or len(ids) == contract.robots
    site, starts = world.site(contract), settings.starts
    request = FleetRequest(
        size=world.picture.size,
        robots=wanted if stay else contract.robots,
        known=world.robots if stay else (),
        driven=driven,
        starts=None if starts is None else np.asarray(starts, dtype=float),
        solid=obstacles(contract, site),
        radius=contract.robot_radius,
        seed=settings.seed,
    )
    others = site.others if starts is None else ()
    fleet = await context.services.claim(
        settings.fleet, lambda: _opened(settings.fleet, request, others)
    )
    await context.services.close_fleets()
    if settings.fleet in context.services.stopped:
        context.services.stopped.remove(settings.fleet)
        await fleet.stop()
    fleets[settings.fleet] = fleet
    return fleet


def _opened(name: str, request: FleetRequest, others: Sequence[Other]) -> Fleet:
    """Open a fleet; robots that are set down stand off other things too where there is room."""
    load = fleet_named(name)
    if others:
        solid = shapely.union_all([request.solid, *(thing.region for thing in others)])
        with suppress(InputError):
            return load(replace(request, solid=solid))
    return load(request)


def _are_there(poses: tuple[Pose, ...], plan: Plan, arrival: Arrival) -> bool:
    """Return whether all robots of a plan stand where they had arrived."""
    seen = {pose.id: (pose.x, pose.y) for pose in poses}
    wanted = zip(arrival.robots, plan.formation.positions, strict=True)
    by_id = {pose.id: pose for pose in poses}
    mine = [by_id[robot] for robot in arrival.robots if robot in by_id]
    turned = heading_residuals(mine, plan.formation.headings_deg)
    if any((off or 0.0) > ARRIVED_DEG for off in turned):
        return False
    return arrival.arrived and all(
        robot in seen and np.hypot(*np.subtract(seen[robot], place)) <= arrival.tolerance_px
        for robot, place in wanted
    )


def _in_robot_order(arrival: Arrival, plan: Plan) -> Arrival:
    """Return an arrival ordered by places as one ordered by robots, as the plan's positions are."""
    place_of = {robot: place for place, robot in enumerate(arrival.robots)}
    for failed, other in reversed(arrival.replaced.items()):
        place_of[failed] = place_of[other]
    order = [place_of[robot] for robot in plan.formation.robots or arrival.robots]
    return arrival.model_copy(
        update={
            "robots": tuple(arrival.robots[i] for i in order),
            "observed": tuple(arrival.observed[i] for i in order),
            "residual_px": tuple(arrival.residual_px[i] for i in order),
            "heading_residual_deg": tuple(
                arrival.heading_residual_deg[i] for i in order if arrival.heading_residual_deg
            ),
        }
    )
