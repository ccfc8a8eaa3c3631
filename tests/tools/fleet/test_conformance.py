"""One set of checks proves any fleet, ours and others', and finds what is wrong with one."""

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import AsyncGenerator
from pathlib import Path

import pytest
from formup.tools.errors import InputError
from formup.tools.fleet.conformance import check_fleet
from formup.tools.fleet.protocol import FleetRequest, FleetStoppedError, Motion, Pose
from formup.tools.fleet.registry import FLEETS
from formup.tools.fleet.simulated import SimulatedFleet

PACKAGE = Path(__file__).parents[3] / "examples/formup_example_fleet"
REQUEST = FleetRequest((640.0, 480.0), 3)
Poses = tuple[Pose, ...]

USE = """
import asyncio
from formup.tools.fleet.conformance import check_fleet
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import deploy
from formup.tools.fleet.protocol import FleetRequest
from formup.tools.fleet.registry import FLEETS
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline
from formup_example_fleet import Carts

KINDS = ("simulated", "mqtt", "recorded", "ros", "vda5050", "example")
assert FLEETS.names() == KINDS, FLEETS.names()
opened = FLEETS.load("example")(FleetRequest((640.0, 480.0), 2))
assert isinstance(opened, Carts) and opened.real
asyncio.run(check_fleet(lambda: FLEETS.load("example")(FleetRequest((640.0, 480.0), 2))))

async def deployed():
    site = Site({"t1": make_outline([(200, 200), (300, 200), (300, 300), (200, 300)])}, 640, 480)
    group = Group(relation="around", targets=("t1",), robots=2)
    plan = make_plan(Contract(groups=(group,), robot_radius=opened.radius), site, "s")
    robots = assign_robots(await opened.observe(), plan.formation.points).robots
    return (await deploy(plan, site, opened, robots)).arrival

arrival = asyncio.run(deployed())
assert arrival.arrived and set(arrival.robots) == {"left", "right"}, arrival
"""


def test_the_simulated_fleet_passes() -> None:
    opened = FLEETS.load("simulated")
    asyncio.run(check_fleet(lambda: opened(REQUEST)))


def test_a_fleet_of_a_package_that_is_installed_is_found_by_its_name_and_passes(
    tmp_path: Path,
) -> None:
    source = shutil.copytree(PACKAGE, tmp_path / "source")
    target = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    pip += ["--no-index", "--disable-pip-version-check", "--target", str(target), str(source)]
    subprocess.run(pip, check=True, timeout=300)
    paths = [str(target), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", USE],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_fleet_nobody_has_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"'navy'. There are: simulated"):
        FLEETS.load("navy")


class Reorders(SimulatedFleet):
    async def observe(self, *, max_age: float | None = None) -> Poses:
        poses = await super().observe(max_age=max_age)
        return poses[::-1] if poses[0].seen > 0.1 else poses


class IgnoresAge(SimulatedFleet):
    async def observe(self, *, max_age: float | None = None) -> Poses:
        return await super().observe()


class Silent(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        async for _ in super().drive(motion):
            pass
        yield await self.observe()


class DrivesOn(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        moving = super().drive(motion)
        try:
            async for poses in moving:
                yield poses
        finally:
            async for _ in moving:
                pass


class NeverLatches(SimulatedFleet):
    async def stop(self) -> None:
        await super().stop()
        self.stopped = False


class EndsQuietly(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        moved = False
        try:
            async for poses in super().drive(motion):
                yield poses
                moved = True
        except FleetStoppedError:
            if not moved:
                raise


class GoesOnWhenReleased(SimulatedFleet):
    async def release(self) -> None:
        await super().release()
        self._stops = 0


class NeverStops(SimulatedFleet):
    async def stop(self) -> None:
        self.stopped = True


class LatchesOnClosing(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        try:
            async for poses in super().drive(motion):
                yield poses
        except (GeneratorExit, asyncio.CancelledError):
            self.stopped = True
            raise


class DrivesTwice(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        self._driving = False
        async for poses in super().drive(motion):
            yield poses


class ForgivesUnknownRobots(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        known = {pose.id for pose in await self.observe()}
        ours = {robot: path for robot, path in motion.paths.items() if robot in known}
        async for poses in super().drive(Motion(ours)):
            yield poses


class SendsEverybody(SimulatedFleet):
    async def drive(self, motion: Motion) -> AsyncGenerator[Poses, None]:
        poses, (path, *_) = await self.observe(), motion.paths.values()
        everybody = {p.id: path - path[0] + (p.x, p.y) for p in poses}
        async for poses in super().drive(Motion(everybody | dict(motion.paths))):
            yield poses


class OpenAfterClosing(SimulatedFleet):
    async def close(self) -> None:
        pass


class HasNoBody(SimulatedFleet):
    @property
    def radius(self) -> float:
        return 0.0

    @radius.setter
    def radius(self, radius: float) -> None:
        pass


BROKEN = [
    (HasNoBody, "radius 0.0, which must be above 0"),
    (Reorders, "ids or their order"),
    (IgnoresAge, "that are too old must be refused"),
    (Silent, "not seen on its way"),
    (DrivesOn, "as if it had not been stopped"),
    (NeverLatches, "does not say that it is stopped"),
    (NeverStops, "going on after a stop must be refused"),
    (EndsQuietly, "going on after a stop must be refused"),
    (GoesOnWhenReleased, "going on after a stop must be refused"),
    (LatchesOnClosing, "early has latched the stop"),
    (DrivesTwice, "a second drive must be refused"),
    (ForgivesUnknownRobots, "a robot that does not exist must be refused"),
    (SendsEverybody, "moved that was not sent"),
    (OpenAfterClosing, "observing a closed fleet must be refused"),
]


@pytest.mark.parametrize(("broken", "words"), BROKEN, ids=lambda b: getattr(b, "__name__", ""))
def test_a_fleet_that_breaks_a_rule_is_found_out(broken: type[SimulatedFleet], words: str) -> None:
    poses = [Pose("1", 50.0, 50.0), Pose("2", 50.0, 100.0), Pose("3", 50.0, 150.0)]
    with pytest.raises(AssertionError, match=words):
        asyncio.run(check_fleet(lambda: broken(poses, speed=100.0)))
