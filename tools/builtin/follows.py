"""What a deployment does if a thing moves: robots follow it, or are kept from where it was."""

from collections.abc import Sequence

import numpy as np

from ..context import Context
from ..errors import FleetError, ToolError
from ..fleet.arrival import Arrival, Track
from ..fleet.deploy import TRACK_FRAMES, tolerance
from ..fleet.escort import escort, lost, rigid_of, sighted
from ..fleet.follow import Follow, Rigid
from ..fleet.protocol import Fleet, Pose, Watcher, points_of
from ..formation.plan import Plan
from ..formation.units import length_text
from ..world import World
from .tracks import read_track, with_track


def watch_target(context: Context, plan: Plan, fleet: Fleet) -> None:
    """Have a fleet with a camera look out for what a plan is about, as the picture shows it."""
    if isinstance(fleet, Watcher):
        outlines = context.world.site(plan.formation.contract).outlines
        names = plan.formation.contract.target_ids
        bgr = np.ascontiguousarray(context.picture.pixels[..., ::-1])
        fleet.watch(bgr, {name: outlines[name] for name in names})


async def stands_about(context: Context, plan: Plan, fleet: Fleet, follow: Follow | None) -> bool:
    """Return whether a plan's target has moved, but its robots stand around it as planned.

    Raises:
        ToolError: it has moved, and they do not stand so, or are not to follow it.
    """
    world, contract = context.world, plan.formation.contract
    for name in contract.target_ids:
        seen = await sighted(fleet, name)
        far = 0.0 if seen is None else float(np.hypot(seen.dx, seen.dy))
        if seen is None or far <= tolerance(world.picture.size):
            continue
        before, site = world.arrivals.get(plan.id), world.site(contract)
        poses = {pose.id: pose for pose in await fleet.observe()}
        if follow and before and set(before.robots) <= set(poses):
            mine = [poses[robot] for robot in by_place(plan, before.robots)]
            if lost(plan, site, mine, rigid_of(site, seen)) is None:
                return True
        raise ToolError(
            f"{name} is seen {length_text(far, world.metres_per_pixel)} from where the picture "
            "shows it, so this plan is out of date; give a new picture."
        )
    return False


async def followed(
    context: Context, plan: Plan, fleet: Fleet, arrival: Arrival, follow: Follow
) -> tuple[Arrival, World]:
    """Follow the thing that robots stand around; where they were seen last is recorded.

    Returns:
        What was observed, and the world after it.

    Raises:
        FleetError: robots failed or were stopped on the way.
    """
    world, last = context.world, context.world.robots
    context.observed(world)
    seen: list[tuple[tuple[Pose, ...], Rigid]] = []

    def watch(poses: tuple[Pose, ...], rigid: Rigid) -> None:
        nonlocal last
        last = poses
        seen.append((poses, rigid))
        context.services.watch(poses)
        show(poses, rigid)

    site, robots = world.site(plan.formation.contract), by_place(plan, arrival.robots)
    try:
        with context.services.view(context, plan, fleet) as show:
            came = await escort(
                *(plan, site, fleet, robots, follow),
                watch=watch,
                starting=lambda: context.moving(plan.id),
            )
    finally:
        context.observed(world.having(robots=last))
    arrival = await _with_follow_track(context, arrival.model_copy(update={"follow": came}), seen)
    world = world.having(robots=last).with_arrival(plan.id, arrival)
    if came.ended in ("stopped", "failed"):
        context.observed(world)
        raise FleetError(came.reason or "")
    return arrival, world


async def _with_follow_track(
    context: Context, arrival: Arrival, seen: Sequence[tuple[tuple[Pose, ...], Rigid]]
) -> Arrival:
    """Return an arrival whose track goes on with what was seen while robots followed."""
    if arrival.track is None or not seen:
        return arrival
    track = read_track(context.services.artefacts.get(arrival.track))
    kept = [seen[int(i)] for i in np.linspace(0, len(seen) - 1, min(len(seen), TRACK_FRAMES))]
    by_id = [{pose.id: pose for pose in poses} for poses, _ in kept]
    points = np.stack([points_of([poses[robot] for robot in track.ids]) for poses in by_id])
    moved = np.array([rigid.numbers for _, rigid in kept])
    points, moved = np.concatenate([track.points, points]), np.concatenate([track.moved, moved])
    return await with_track(context, arrival, Track(track.ids, points, moved))


def by_place(plan: Plan, robots: Sequence[str]) -> list[str]:
    """Return robots, given in the order of a plan's positions, in the order of its places."""
    order = [i for group in plan.formation.members for i in group]
    return [robots[i] for i in order] if order else list(robots)
