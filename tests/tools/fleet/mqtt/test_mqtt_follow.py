"""Robots on a real broker keep about a thing that moves, and hold when it is no longer seen."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

import pytest
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import deploy
from formup.tools.fleet.escort import escort
from formup.tools.fleet.follow import Follow, Followed
from formup.tools.fleet.mqtt.fleet import MqttFleet
from formup.tools.fleet.protocol import FleetStoppedError, Sighting, points_of
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline

Labs = Callable[..., Any]
SITE = Site({"t1": make_outline([(200, 200), (300, 200), (300, 300), (200, 300)])}, 640, 480)
STARTS = [[150, 150], [250, 130], [350, 150], [350, 350], [250, 370], [150, 350]]
TEAM: dict[str, Any] = {
    "robots": [f"r{i}" for i in range(6)],
    "speed": 150,
    "pose_timeout": 2,
    "watchdog": 2,
    "simulated": {"starts": STARTS, "drive": "differential"},
}


class Eyes:
    """Sees a box that moves from when robots begin to follow it, until a time."""

    def __init__(self, speed: float, until: float = 1e9) -> None:
        self.speed, self.until, self.begun = speed, until, 0.0

    async def sightings(self) -> tuple[Sighting, ...]:
        now = time.monotonic()
        since = now - self.begun if self.begun else 0.0
        if since > self.until:
            return ()
        return (Sighting("t1", self.speed * since, 0.3 * self.speed * since, 0.0, now),)


async def followed(fleet: MqttFleet, eyes: Eyes, seconds: float) -> Followed:
    """What comes of standing about the box, then following it."""
    fleet.sightings = eyes.sightings  # the camera's part is tested with a drawn one
    group = Group(relation="around", targets=("t1",), robots=6, clearance=(20, 60))
    plan = make_plan(Contract(groups=(group,), robot_radius=fleet.radius), SITE, "s")
    robots = assign_robots(await fleet.observe(), plan.formation.points).robots
    made = await deploy(plan, SITE, fleet, robots)
    assert made.arrival.arrived

    async def starting() -> None:
        eyes.begun = time.monotonic()

    leave = Follow(seconds=seconds, speed=60)
    return await escort(plan, SITE, fleet, made.arrival.robots, leave, starting=starting)


def test_robots_keep_about_a_thing_that_moves_slowly(lab: Labs) -> None:
    fleet = lab(**TEAM).simulate().fleet()
    came = asyncio.run(followed(fleet, Eyes(10), 6))
    assert came.ended == "time", came
    assert came.moved_px > 40, came
    assert came.certified > 0.9, came


def test_a_thing_that_is_seen_no_more_holds_the_robots(lab: Labs) -> None:
    fleet = lab(**TEAM).simulate().fleet()

    async def work() -> Followed:
        came = await followed(fleet, Eyes(10, until=2), 30)
        before = points_of(await fleet.observe())
        await asyncio.sleep(0.3)
        assert abs(points_of(await fleet.observe()) - before).max() < 1
        return came

    came = asyncio.run(work())
    assert came.ended == "unseen"
    assert came.reason is not None and "t1 was not seen for" in came.reason


def test_a_stop_ends_it(lab: Labs) -> None:
    there = lab(**TEAM).simulate()
    fleet: MqttFleet = there.fleet()

    async def work() -> None:
        poses = await fleet.observe()
        places = {pose.id: (pose.x, pose.y, 0.0, 0.0) for pose in poses}
        async for _ in fleet.accompany(lambda: places):
            if not fleet.stopped:
                there.link().say(there.topic("hold"), {"by": "hand"}, surely=True)
                while not fleet.stopped:
                    await asyncio.sleep(0.01)

    with pytest.raises(FleetStoppedError):
        asyncio.run(work())


def test_without_a_camera_nothing_is_seen(lab: Labs) -> None:
    assert asyncio.run(lab(**TEAM).fleet().sightings()) == ()
