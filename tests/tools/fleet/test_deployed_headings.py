"""Robots that are to look somewhere are driven to it, seen to, or refused."""

import asyncio
import math
from collections.abc import AsyncGenerator

import pytest
from formup.tools.errors import ToolError
from formup.tools.fleet.arrival import Deployment
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import ARRIVED_DEG, deploy
from formup.tools.fleet.protocol import FleetRequest, Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet, open_fleet
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.headings import off_heading
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import make_outline

SITE = Site(
    {
        "t1": make_outline([(200, 150), (420, 150), (420, 330), (200, 330)]),
        "t2": make_outline([(500, 180), (560, 180), (560, 300), (500, 300)]),
    },
    640,
    480,
)
RADIUS = 4.0


def planned(group: dict[str, object]) -> Plan:
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=RADIUS)
    return make_plan(contract, SITE, "s")


def opened(plan: Plan) -> SimulatedFleet:
    return open_fleet(FleetRequest(SITE.room, len(plan.formation.positions), radius=RADIUS))


@pytest.mark.parametrize("heading", ["towards", "away", 135.0, "t2"])
def test_robots_are_observed_to_look_where_the_plan_says(heading: object) -> None:
    plan = planned({"relation": "around", "targets": ("t1",), "robots": 5, "heading": heading})
    fleet = opened(plan)

    async def go() -> tuple[Deployment, tuple[Pose, ...]]:
        robots = assign_robots(await fleet.observe(), plan.formation.points).robots
        return await deploy(plan, SITE, fleet, robots), await fleet.observe()

    made, poses = asyncio.run(go())
    assert made.arrival.arrived
    assert max(off or 0.0 for off in made.arrival.heading_residual_deg) <= ARRIVED_DEG
    seen = {pose.id: math.degrees(pose.heading or 0.0) for pose in poses}
    for robot, angle in zip(made.arrival.robots, plan.formation.headings_deg, strict=True):
        assert off_heading(seen[robot], angle or 0.0) <= ARRIVED_DEG


class Stubborn(SimulatedFleet):
    """Drives, but does not turn, whatever it says."""

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        async for poses in super().drive(Motion(motion.paths)):
            yield poses


def test_robots_that_do_not_look_there_have_not_arrived_and_a_fleet_that_cannot_is_refused() -> (
    None
):
    plan = planned({"relation": "around", "targets": ("t1",), "robots": 5, "heading": "away"})
    poses = asyncio.run(opened(plan).observe())
    robots = assign_robots(poses, plan.formation.points).robots
    fleet = Stubborn(poses, speed=160.0, radius=RADIUS)
    arrival = asyncio.run(deploy(plan, SITE, fleet, robots)).arrival
    assert (arrival.arrived, arrival.ended) == (False, "short")
    assert arrival.heading_residual_deg == (180.0,) * 5
    fleet.turns = False
    with pytest.raises(ToolError, match="cannot be turned"):
        asyncio.run(deploy(plan, SITE, fleet, robots))


def test_a_plan_whose_headings_were_changed_is_not_driven() -> None:
    plan = planned({"relation": "around", "targets": ("t1",), "robots": 5, "heading": "away"})
    forged = plan.formation.model_copy(update={"headings_deg": (0.0,) * 5})
    with pytest.raises(ToolError, match="looks"):
        asyncio.run(
            deploy(plan.model_copy(update={"formation": forged}), SITE, opened(plan), "12345")
        )
