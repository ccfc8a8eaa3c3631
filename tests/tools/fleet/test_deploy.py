"""From a certified plan to robots that stand where it says, and never on what it says not to."""

import asyncio
import math
from collections.abc import AsyncGenerator, Callable

import numpy as np
import pytest
import shapely
from formup.tools.errors import FleetError, ToolError
from formup.tools.fleet.arrival import Deployment
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import TRACK_FRAMES, deploy
from formup.tools.fleet.protocol import (
    Fleet,
    FleetBusyError,
    FleetRequest,
    FleetSizeError,
    FleetStoppedError,
    Motion,
    PlaceTakenError,
    Pose,
    RobotsFailedError,
    points_of,
)
from formup.tools.fleet.simulated import PERIOD, SimulatedFleet, open_fleet
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import FloatArray, distances, make_outline
from formup.tools.motion.routes import obstacles
from shapely.geometry.base import BaseGeometry

CUP = [(200, 150), (240, 150), (240, 270), (380, 270), (380, 150), (420, 150), (420, 330),
       (200, 330)]  # fmt: skip
SITE = Site(
    {
        "t1": make_outline(CUP),
        "t2": make_outline([(500, 180), (560, 180), (560, 300), (500, 300)]),
    },
    640,
    480,
)
RADIUS = 4.0
GROUPS: list[dict[str, object]] = [
    {"relation": "around", "targets": ("t1",), "robots": 9},
    {"relation": "cage", "targets": ("t1",), "robots": 12},
    {"relation": "corners", "targets": ("t1",), "robots": 8},
    {"relation": "along", "targets": ("t1",), "robots": 4, "side": "right"},
    {"relation": "between", "targets": ("t1", "t2"), "robots": 2},
    {"relation": "inside", "targets": ("t1",), "robots": 6},
]
Frames = list[tuple[Pose, ...]]


def planned(group: dict[str, object], keep_out: tuple[str, ...] = ("t2",)) -> Plan:
    named = keep_out if group["relation"] != "between" else ()
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=RADIUS, keep_out=named)
    return make_plan(contract, SITE, "s")


def solid_of(plan: Plan) -> BaseGeometry:
    return obstacles(plan.formation.contract, SITE)


def opened(plan: Plan, seed: int = 0, more: int = 0) -> SimulatedFleet:
    contract = plan.formation.contract
    request = FleetRequest(
        SITE.room,
        contract.robots + more,
        solid=obstacles(contract, SITE),
        radius=contract.robot_radius,
        seed=seed,
    )
    return open_fleet(request)


def standing(points: FloatArray) -> SimulatedFleet:
    poses = [Pose(str(i), float(x), float(y)) for i, (x, y) in enumerate(points, start=1)]
    return SimulatedFleet(poses, speed=160.0, radius=RADIUS)


async def assigned(plan: Plan, fleet: Fleet) -> tuple[str, ...]:
    return assign_robots(await fleet.observe(), plan.formation.points).robots


def driven(plan: Plan, fleet: Fleet) -> tuple[Deployment, Frames]:
    frames: Frames = []

    async def go() -> Deployment:
        return await deploy(plan, SITE, fleet, await assigned(plan, fleet), watch=frames.append)

    return asyncio.run(go()), frames


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: str(g["relation"]))
def test_everyone_arrives_and_no_body_is_ever_on_a_target(group: dict[str, object]) -> None:
    plan = planned(group)
    assert plan.verdict.certified
    deployment, frames = driven(plan, opened(plan))
    arrival = deployment.arrival
    residual = np.linalg.norm(np.array(arrival.observed) - plan.formation.points, axis=1)
    assert arrival.arrived
    assert (arrival.ended, arrival.reason, arrival.failed) == ("arrived", None, ())
    assert residual.max() <= arrival.tolerance_px
    assert residual == pytest.approx(arrival.residual_px, abs=2e-3)
    assert sorted(map(int, arrival.robots)) == list(range(1, len(residual) + 1))
    by_id = {pose.id: (pose.x, pose.y) for pose in deployment.poses}
    assert np.array([by_id[r] for r in arrival.robots]) == pytest.approx(
        np.array(arrival.observed), abs=1e-3
    )
    assert frames[-1] == deployment.poses
    for frame in frames:
        assert shapely.distance(solid_of(plan), shapely.points(points_of(frame))).min() > RADIUS


def test_the_track_shows_the_way_from_the_start_to_the_last_observation() -> None:
    plan = planned(GROUPS[0])
    fleet = opened(plan)
    starts = asyncio.run(fleet.observe())
    slow = SimulatedFleet(starts, speed=2.0)
    for moved in (fleet, slow):
        deployment, frames = driven(plan, moved)
        track, by_id = deployment.track, {pose.id: (pose.x, pose.y) for pose in starts}
        assert track.ids == deployment.arrival.robots
        assert track.points[0].tolist() == [list(by_id[robot]) for robot in track.ids]
        assert track.points[-1] == pytest.approx(np.array(deployment.arrival.observed), abs=1e-3)
        assert 20 < len(track.points) <= min(TRACK_FRAMES + 1, len(frames) + 1)
        steps = np.linalg.norm(np.diff(track.points[:-1], axis=0), axis=2).max(axis=1)
        assert steps.max() < 0.1 * math.hypot(*SITE.room)


def test_what_happens_is_fixed_by_the_seed_and_only_by_it() -> None:
    plan = planned(GROUPS[0])
    (first, frames), (second, again), (third, other) = (
        driven(plan, opened(plan, s)) for s in (5, 5, 6)
    )
    assert first.arrival == second.arrival
    assert frames == again
    assert other != frames
    assert third.arrival.arrived


def test_a_plan_that_is_not_certified_moves_nobody() -> None:
    plan = planned(GROUPS[0])
    points = plan.formation.points
    points[0] = (300, 300)
    bad = make_plan(plan.formation.contract, SITE, "s", points)
    assert_nobody_moves(bad, standing(points + 5), ToolError, "not certified")


def assert_nobody_moves(
    plan: Plan, fleet: SimulatedFleet, error: type[Exception], words: str, robots: str = ""
) -> None:
    before = asyncio.run(fleet.observe())
    names = tuple(robots.split()) or tuple(pose.id for pose in before)
    with pytest.raises(error, match=words):
        asyncio.run(deploy(plan, SITE, fleet, names))
    assert asyncio.run(fleet.observe()) == before


def test_robots_that_the_fleet_does_not_have_are_named_and_nobody_moves() -> None:
    plan = planned(GROUPS[0])
    assert_nobody_moves(
        plan, opened(plan), RobotsFailedError, "Robot 12, 13 of", "1 2 3 4 5 6 7 12 13"
    )


@pytest.mark.parametrize("robots", ["1 2 3 4 5 6 7 8", "1 2 3 4 5 6 7 8 8", "1 2 3 4 5 6 7 8 9 10"])
def test_another_number_of_robots_is_refused(robots: str) -> None:
    plan = planned(GROUPS[0])
    assert_nobody_moves(plan, opened(plan, more=1), FleetSizeError, "plan has 9", robots)


@pytest.mark.parametrize("place", [(300, 300), (203, 160), (201, 329), (198, 200), (530, 240)])
def test_a_robot_that_stands_on_a_target_leaves_it_first(place: tuple[float, float]) -> None:
    plan = planned(GROUPS[0])
    starts = points_of(asyncio.run(opened(plan).observe()))
    starts[4] = place
    deployment, frames = driven(plan, standing(starts))
    assert deployment.arrival.arrived
    for robot in range(9):
        path = np.array([points_of(frame)[robot] for frame in frames])
        free = distances(solid_of(plan), path) > RADIUS
        assert free.all() or robot == 4
        assert free[np.argmax(free) :].all(), "once off the target, it stays off"


def test_robots_inside_a_target_come_out_to_surround_it() -> None:
    inside, around = planned(GROUPS[5]), planned({**GROUPS[0], "robots": 6})
    fleet = opened(inside)
    assert driven(inside, fleet)[0].arrival.arrived
    deployment, frames = driven(around, fleet)
    assert deployment.arrival.arrived
    first, last = (distances(solid_of(around), points_of(frames[i])) for i in (0, -1))
    assert first.max() <= RADIUS < last.min()


def test_idle_robots_stay_and_are_driven_around() -> None:
    plan = planned(GROUPS[3])
    wall = np.array([(x, y) for x in (440.0, 470) for y in range(140, 350, 14)])
    starts = np.concatenate([[(620.0, 60), (620, 150), (620, 350), (620, 440)], wall])
    away = np.linalg.norm(starts[4:, None] - plan.formation.points, axis=2).min(axis=1)
    starts = np.concatenate([starts[:4], starts[4:][away > 3 * RADIUS]])
    frames: Frames = []
    deployed = deploy(plan, SITE, standing(starts), ("1", "2", "3", "4"), watch=frames.append)
    deployment = asyncio.run(deployed)
    assert deployment.arrival.arrived
    for frame in frames:
        assert np.array_equal(points_of(frame)[4:], starts[4:])
        apart = np.linalg.norm(points_of(frame)[:4, None] - starts[4:], axis=2)
        assert apart.min() >= 2 * RADIUS


def test_a_place_on_which_an_idle_robot_stands_is_not_driven_to() -> None:
    plan = planned(GROUPS[3])
    goals = plan.formation.points
    starts = np.concatenate([goals + np.array((30, 0)), goals[:1] + np.array((3, 0))])
    words = "Robot 5.* 3.0 px from place 1"
    assert_nobody_moves(plan, standing(starts), PlaceTakenError, words, "1 2 3 4")


def interrupted(at_step: int, do: Callable[[SimulatedFleet], object]) -> tuple[Deployment, Frames]:
    plan, frames = planned(GROUPS[0]), Frames()
    fleet = opened(plan)

    def watch(poses: tuple[Pose, ...]) -> None:
        frames.append(poses)
        if len(frames) == at_step:
            do(fleet)

    async def go() -> Deployment:
        return await deploy(plan, SITE, fleet, await assigned(plan, fleet), watch=watch)

    return asyncio.run(go()), frames


def test_a_stop_ends_a_deployment_where_the_robots_are_and_lasts_until_released() -> None:
    plan, tasks = planned(GROUPS[0]), list[asyncio.Task[None]]()
    deployment, frames = interrupted(
        10, lambda fleet: tasks.append(asyncio.ensure_future(fleet.stop()))
    )
    arrival = deployment.arrival
    assert (arrival.arrived, arrival.ended, arrival.corrections) == (False, "stopped", 0)
    assert arrival.reason == "The simulated fleet was stopped on the way: its robots are held."
    assert len(frames) <= 10 + 1 + 1  # one more period, and the last observation
    assert frames[-1] == deployment.poses
    assert max(arrival.residual_px) > 10 * arrival.tolerance_px

    async def again() -> Deployment:
        fleet = opened(plan)
        await fleet.stop()
        robots = await assigned(plan, fleet)
        with pytest.raises(FleetStoppedError, match="release"):
            await deploy(plan, SITE, fleet, robots)
        await fleet.release()
        return await deploy(plan, SITE, fleet, robots)

    assert asyncio.run(again()).arrival.arrived


def test_robots_that_were_stopped_do_not_go_on_when_the_stop_is_released_at_once() -> None:
    async def brake(fleet: SimulatedFleet) -> None:
        await fleet.stop()
        await fleet.release()

    deployment, frames = interrupted(10, lambda fleet: asyncio.ensure_future(brake(fleet)))
    assert (deployment.arrival.arrived, deployment.arrival.ended) == (False, "stopped")
    assert len(frames) <= 10 + 1 + 1


def test_robots_stand_when_whoever_watches_them_fails() -> None:
    plan, fleet = planned(GROUPS[0]), opened(planned(GROUPS[0]))
    seen: list[float] = []

    def watch(poses: tuple[Pose, ...]) -> None:
        seen.append(poses[0].seen)
        if len(seen) == 10:
            raise OSError("the disk is full")

    async def go() -> None:
        robots = await assigned(plan, fleet)
        with pytest.raises(OSError, match="disk"):
            await deploy(plan, SITE, fleet, robots, watch=watch)
        assert (await fleet.observe())[0].seen == seen[-1]
        assert (await deploy(plan, SITE, fleet, robots)).arrival.arrived, "nothing is held"

    asyncio.run(go())


def test_a_cancelled_deployment_leaves_the_robots_where_they_are_and_says_where() -> None:
    plan, frames = planned(GROUPS[0]), Frames()

    async def go() -> tuple[Pose, ...]:
        fleet = opened(plan)
        robots = await assigned(plan, fleet)
        task = asyncio.ensure_future(deploy(plan, SITE, fleet, robots, watch=frames.append))
        while len(frames) < 10:
            await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        left = await fleet.observe()
        for _ in range(50):
            await asyncio.sleep(0)
        assert await fleet.observe() == left
        assert (await deploy(plan, SITE, fleet, robots)).arrival.arrived, "nothing is latched"
        return left

    assert asyncio.run(go()) == frames[-1]


class Faulty(SimulatedFleet):
    """Robot 3 fails on the way; or all poses grow old."""

    fails_at, gone, late = 12, False, 0.0

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        poses = await super().observe()
        if self.late and max_age is not None and max_age < self.late:
            raise RobotsFailedError("Robot 1 was not seen.", ("1",))
        return tuple(pose for pose in poses if not (self.gone and pose.id == "3"))

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        step = 0
        async for poses in super().drive(motion):
            yield poses
            step += 1
            if step == self.fails_at:
                raise RobotsFailedError("Robot 3 has an empty battery.", ("3",))


def faulty(plan: Plan, **fault: object) -> Faulty:
    poses = asyncio.run(opened(plan).observe())
    fleet = Faulty(poses, speed=160.0, radius=RADIUS)
    for name, value in fault.items():
        setattr(fleet, name, value)
    return fleet


def test_a_robot_that_fails_ends_the_deployment_and_is_named() -> None:
    plan = planned(GROUPS[0])
    deployment, frames = driven(plan, faulty(plan))
    arrival = deployment.arrival
    assert (arrival.arrived, arrival.ended, arrival.failed) == (False, "failed", ("3",))
    assert arrival.reason == "Robot 3 has an empty battery."
    assert frames[-1] == deployment.poses
    assert len(frames) == 1 + 12 + 1


def test_a_robot_that_is_gone_in_the_end_has_not_arrived() -> None:
    plan = planned(GROUPS[0])
    fleet = faulty(plan, fails_at=-1)

    async def go() -> Deployment:
        robots = await assigned(plan, fleet)

        def watch(poses: tuple[Pose, ...]) -> None:
            fleet.gone = poses[0].seen > 5 * PERIOD

        return await deploy(plan, SITE, fleet, robots, watch=watch)

    arrival = asyncio.run(go()).arrival
    assert (arrival.arrived, arrival.ended, arrival.failed) == (False, "failed", ("3",))
    assert len(arrival.observed) == 9


def test_nobody_is_driven_on_old_poses() -> None:
    plan = planned(GROUPS[0])
    fleet = faulty(plan, late=60.0)
    assert_nobody_moves(plan, fleet, FleetError, "not seen")


def test_one_deployment_at_a_time_uses_a_fleet() -> None:
    plan, frames = planned(GROUPS[0]), Frames()

    async def go() -> Deployment:
        fleet = opened(plan)
        robots = await assigned(plan, fleet)
        task = asyncio.ensure_future(deploy(plan, SITE, fleet, robots, watch=frames.append))
        while len(frames) < 10:
            await asyncio.sleep(0)
        with pytest.raises(FleetBusyError, match="being deployed already"):
            await deploy(plan, SITE, fleet, robots)
        return await task

    assert asyncio.run(go()).arrival.arrived
