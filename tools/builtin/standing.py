"""The current plan in numbers: places, distances, and whether a ring closes."""

import math
from typing import Any

from ..context import Context
from ..errors import ToolError
from ..fleet.deploy import tolerance
from ..formation.checking.surroundings import clearance_of, ring_of
from ..formation.plan import Plan
from ..formation.units import with_metres
from ..geometry.outline import FloatArray
from ..geometry.sampling import nearest
from ..world import World

PLAN = "plan"
"""What `measure` is given in place of an id to measure the current plan."""
MOST_ROBOTS = 60
"""Most robots that a reply lists one by one."""


def _place_of_robot(world: World, name: str) -> tuple[float, float] | None:
    """Return where a robot stands, or is to stand if never driven; None for an unknown name."""
    robot = name.removeprefix("r")
    driven = {pose.id: (pose.x, pose.y) for pose in world.robots if pose.seen > 0}
    if robot in driven:
        return driven[robot]
    node = world.plans.get(world.current or "")
    if node is None or robot not in node.plan.formation.robots:
        return None
    formation = node.plan.formation
    return formation.positions[formation.robots.index(robot)]


def standing_data(context: Context) -> dict[str, Any]:
    """Return what `measure` says of the current plan."""
    world = context.world
    plan = world.plan().plan
    robots = [
        row
        for k in range(len(plan.formation.contract.groups))
        for row in _robot_rows(world, plan, k)
    ]
    data: dict[str, Any] = {"plan_id": plan.id, "robots": len(robots)}
    data |= {"deployed": plan.id in world.arrivals, **arrival_facts(world, plan)}
    data |= {
        "groups": [_group_facts(world, plan, k) for k in range(len(plan.formation.contract.groups))]
    }
    rows = sorted(robots, key=lambda row: (len(row["robot"]), row["robot"]))
    data["each"] = rows[:MOST_ROBOTS]
    return with_metres(data, world.metres_per_pixel)


def robot_data(context: Context, name: str) -> dict[str, Any]:
    """Return what `measure` says of one robot, such as r3, and its place if it has one."""
    world, robot = context.world, name.removeprefix("r")
    plan = world.plan().plan
    groups = range(len(plan.formation.contract.groups))
    rows = (row for k in groups for row in _robot_rows(world, plan, k))
    found = next((row for row in rows if row["robot"] == robot), None)
    if found is None:
        at = robot_named(world, name)
        found = {"robot": robot, "place": None, "at": [round(v, 1) for v in at]}
    return with_metres({"plan_id": plan.id, **found}, world.metres_per_pixel)


def _members(plan: Plan, k: int) -> tuple[list[str], FloatArray]:
    """Return ids and places, (n, 2) px, of the robots of group `k`, counted from 0."""
    groups = plan.formation.contract.groups
    first = sum(group.robots for group in groups[:k])
    mine = slice(first, first + groups[k].robots)
    return list(plan.formation.robot_of_place[mine]), plan.formation.points[mine]


def _robot_rows(world: World, plan: Plan, k: int) -> list[dict[str, Any]]:
    """Return for each robot of a group its place, and how far that is from thing and neighbour."""
    contract, (names, points) = plan.formation.contract, _members(plan, k)
    group, everybody = contract.groups[k], plan.formation.points
    apart, other = nearest(everybody, points, min(2, len(everybody)))
    off = None
    if group.targets:
        outline = world.outline(group.targets[0])
        off = clearance_of(points, outline, group, contract.robot_radius)
    seen = {pose.id: pose for pose in world.robots if pose.seen > 0}
    rows: list[dict[str, Any]] = []
    for i, name in enumerate(names):
        row: dict[str, Any] = {"robot": name, "place": points[i].round(1).tolist()}
        if off is not None:
            row |= {"target": group.targets[0], "target_px": round(float(off[i]), 1)}
        if len(everybody) > 1:
            neighbour = plan.formation.robot_of_place[int(other[i, 1])]
            row |= {"neighbour": neighbour, "neighbour_px": round(float(apart[i, 1]), 1)}
        if name in seen:
            row["at"] = [round(seen[name].x, 1), round(seen[name].y, 1)]
        rows.append(row)
    return rows


def _group_facts(world: World, plan: Plan, k: int) -> dict[str, Any]:
    """Return a group's arrangement and, around one thing, how closed it is."""
    contract, (names, points) = plan.formation.contract, _members(plan, k)
    group = contract.groups[k]
    data: dict[str, Any] = {"relation": group.relation, "targets": group.targets}
    if len(group.targets) != 1 or group.enters:
        return data
    ring = ring_of(points, group, world.site(contract), contract.robot_radius)
    if ring is None:
        return data
    facts = ring.model_dump() | {"between": [names[i] for i in ring.between]}
    opened = group.opens or group.sides is not None
    return data | facts | {"opened": opened, "closed": ring.closed and not opened}


def arrival_facts(world: World, plan: Plan) -> dict[str, Any]:
    """Return whether robots were last seen at the places of a plan, and how many were."""
    seen = {pose.id: (pose.x, pose.y) for pose in world.robots if pose.seen > 0}
    arrival = world.arrivals.get(plan.id)
    robots = arrival.robots if arrival is not None else plan.formation.robots
    places = zip(robots, plan.formation.positions, strict=False)
    off = {name: math.dist(seen[name], place) for name, place in places if name in seen}
    if not off:
        return {"arrived": False}
    there = sum(way <= tolerance(world.picture.size) for way in off.values())
    furthest = max(off, key=lambda name: off[name])
    return {
        "arrived": there == len(plan.formation.positions) and (arrival is None or arrival.arrived),
        "there": there,
        "furthest": furthest,
        "furthest_px": round(off[furthest], 1),
    }


def robot_named(world: World, name: str) -> tuple[float, float]:
    """Return where a robot is, named by r and its id, such as r3.

    Raises:
        ToolError: there is none of that name.
    """
    found = _place_of_robot(world, name)
    if found is None:
        node = world.plans.get(world.current or "")
        ids = [pose.id for pose in world.robots] if node is None else node.plan.formation.robots
        known = ", ".join(f"r{robot}" for robot in ids) or "none yet"
        raise ToolError(f"There is no robot {name!r}. Robots: {known}.")
    return found
