"""Every fault of the simulator ends in an outcome that names the robot and the reason."""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from formup.tools.errors import FleetError
from formup.tools.fleet.arrival import Arrival
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import deploy
from formup.tools.fleet.getting_on import STALLED_S, GettingOn
from formup.tools.fleet.physics import Physics
from formup.tools.fleet.protocol import Motion, Pose, points_of
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.fleet.simulator import PERIOD
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline
from formup.tools.motion.motion import Passages

SITE = Site({"t1": make_outline([(200, 200), (300, 200), (300, 300), (200, 300)])}, 640, 480)
RADIUS, ROBOTS = 4.0, 6
CONTRACT = Contract(
    groups=(Group(relation="around", targets=("t1",), robots=ROBOTS),), robot_radius=RADIUS
)
PLAN = make_plan(CONTRACT, SITE, "s")
SPARE = 1


def physics(**faults: Any) -> Physics:
    usual = {"speed": 160.0, "acceleration": 640.0, "radius": RADIUS, "slip": 0.02}
    return Physics.model_validate(usual | faults)


def poses(spare: int) -> list[Pose]:
    """Robots along the bottom; the spare ones, of the highest numbers, above."""
    below = [Pose(str(i), 60.0 * i, 440.0) for i in range(1, ROBOTS + 1)]
    return [*below, *(Pose(str(ROBOTS + i), 60.0 * i, 40.0) for i in range(1, spare + 1))]


def deployed(fleet: SimulatedFleet) -> Arrival:
    robots = assign_robots(asyncio.run(fleet.observe())[:ROBOTS], PLAN.formation.points).robots
    return asyncio.run(deploy(PLAN, SITE, fleet, robots)).arrival


@dataclass(frozen=True)
class Case:
    """A fault, how it ends, and what is told of it."""

    faults: dict[str, Any]
    ended: str
    words: Sequence[str] = ()
    failed: tuple[str, ...] = ()
    spare: int = 0
    replaced: dict[str, str] = field(default_factory=dict[str, str])


STUCK = [{"robot": 3, "after": 0.5}]
CASES = {
    "none": Case({}, "arrived"),
    "wheels": Case({"drive": "differential"}, "arrived"),
    "actuation noise": Case({"noise": {"actuation": 0.05}}, "arrived"),
    "actuation noise, wheels": Case(
        {"noise": {"actuation": 0.05}, "drive": "differential"}, "arrived"
    ),
    "sensing noise": Case({"noise": {"sensing": 0.1}}, "arrived"),
    "sensing that is worse than the tolerance": Case(
        {"noise": {"sensing": 4.0}}, "short", ("off its place", "of 6 are at", "what stands is")
    ),
    "slip": Case({"slip": 0.3}, "arrived"),
    "delay": Case({"delay": 0.2}, "arrived"),
    "delay, wheels": Case({"delay": 0.2, "drive": "differential"}, "arrived"),
    "drop-outs": Case({"drop_outs": 0.3}, "arrived"),
    "stuck for a while": Case({"stuck": [{"robot": "3", "after": 0.5, "lasting": 5}]}, "arrived"),
    "stuck for good": Case(
        {"stuck": STUCK},
        "failed",
        ("Robot 3 does not get on, ", "px from its place", "5 of 6 are at", "not certified: "),
        ("3",),
    ),
    "stuck for good, another to spare": Case(
        {"stuck": STUCK},
        "arrived",
        ("Robot 7 took the place of robot 3, which does not get on.",),
        ("3",),
        SPARE,
        {"3": "7"},
    ),
    "all stuck": Case(
        {"stuck": [{"robot": n} for n in range(1, 7)]}, "failed", ("0 of 6",), tuple("123456")
    ),
    "not seen for a while": Case({"lost": [{"robot": 3, "after": 0.5, "lasting": 1}]}, "arrived"),
    "lost for good": Case(
        {"lost": STUCK}, "failed", ("Robot 3 not seen for", "check the connection"), ("3",)
    ),
    "lost for good, another to spare": Case(
        {"lost": STUCK}, "arrived", ("Robot 7 took the place",), ("3",), SPARE, {"3": "7"}
    ),
    "pushed on the way": Case({"pushes": [{"robot": 3, "at": 0.6, "by": [-25, 10]}]}, "arrived"),
    "pushed, wheels": Case(
        {"pushes": [{"robot": 3, "at": 0.6, "by": [-25, 10]}], "drive": "differential"}, "arrived"
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_fault_ends_in_an_outcome_that_is_named(name: str) -> None:
    case = CASES[name]
    fleet = SimulatedFleet(poses(case.spare), physics=physics(**case.faults), seed=3)
    arrival = deployed(fleet)
    assert arrival.ended == case.ended
    assert (tuple(sorted(arrival.failed)), arrival.replaced) == (case.failed, case.replaced)
    assert arrival.arrived == (case.ended == "arrived")
    for words in case.words:
        assert words in (arrival.reason or "")
    assert (arrival.reason is None) == (case.ended == "arrived" and not case.replaced)
    assert (arrival.certified is None) == arrival.arrived
    if not case.faults.get("lost"):
        seen = {pose.id: (pose.x, pose.y) for pose in asyncio.run(fleet.observe())}
        now = np.array([seen[robot] for robot in arrival.robots])
        assert now == pytest.approx(np.array(arrival.observed), abs=1e-3)
        residual = np.linalg.norm(now - PLAN.formation.points, axis=1)
        assert residual == pytest.approx(arrival.residual_px, abs=1e-3)


def test_a_robot_that_is_stuck_on_a_place_is_not_replaced() -> None:
    start = poses(SPARE)
    x, y = PLAN.formation.points[0]
    start[0] = Pose("1", float(x) + 3.0, float(y))
    fleet = SimulatedFleet(start, physics=physics(stuck=[{"robot": "1"}]))
    arrival = deployed(fleet)
    assert (arrival.ended, arrival.failed, arrival.replaced) == ("failed", ("1",), {})


def test_a_robot_that_waits_for_a_stuck_one_is_named_with_it_and_the_drive_ends() -> None:
    start = [Pose(str(i), 100.0, 40.0 * i) for i in (1, 2, 3)]
    fleet = SimulatedFleet(start, physics=physics(stuck=[{"robot": "1"}]))
    motion = Motion(
        {p.id: np.array([(p.x, p.y), (p.x + 200.0, p.y)]) for p in start},
        passages=Passages(
            waiting=np.array([1, 2]),
            at=np.array([50.0, 80.0]),
            first=np.array([0, 1]),
            past=np.array([100.0, 150.0]),
        ),
    )
    on = GettingOn(motion)

    async def go() -> list[tuple[Pose, ...]]:
        frames: list[tuple[Pose, ...]] = []
        async with aclosing(fleet.drive(motion)) as moving:
            async for frame in moving:
                frames.append(frame)
                if not on.saw({pose.id: pose for pose in frame}):
                    return frames
        raise AssertionError("a robot that is stuck has arrived")

    frames = asyncio.run(go())
    assert on.stuck() == ["1"]
    assert on.waiting() == {"2": "1", "3": "2"}
    moved = points_of(frames[-1])[:, 0] - 100.0
    assert moved == pytest.approx((0.0, 50.0, 80.0), abs=0.1)
    assert len(frames) * PERIOD < STALLED_S + 2.0


class StopsShort(SimulatedFleet):
    """Its robots go on for a second and a half at a time, and fail in the drive of a number."""

    drives, fails = 0, 0

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        self.drives += 1
        if self.drives == self.fails:
            raise FleetError("The radio has no power.")
        frames = 0
        async with aclosing(super().drive(motion)) as moving:
            async for poses in moving:
                yield poses
                frames += 1
                if frames * PERIOD >= 1.5:
                    return


def test_robots_that_stop_short_are_sent_again() -> None:
    arrival = deployed(StopsShort(poses(0), speed=160.0, radius=RADIUS))
    assert arrival.arrived
    assert arrival.corrections >= 1


def test_a_fleet_that_fails_ends_the_deployment_with_its_reason() -> None:
    fleet = StopsShort(poses(0), speed=160.0, radius=RADIUS)
    fleet.fails = 2
    arrival = deployed(fleet)
    assert (arrival.ended, arrival.reason) == ("failed", "The radio has no power.")
    assert arrival.certified is False


def test_robots_that_are_pushed_onto_each_other_stand_and_go_on_from_there() -> None:
    push = {"robot": 3, "at": 0.1, "by": (55.0, 0.0)}
    fleet = SimulatedFleet(poses(0), physics=physics(pushes=[push], slip=0.0), seed=1)
    pushed = deployed(fleet)
    undisturbed = deployed(SimulatedFleet(poses(0), physics=physics(slip=0.0), seed=1))
    assert (pushed.ended, undisturbed.ended) == ("arrived", "arrived")
    assert pushed.corrections > undisturbed.corrections
    assert pushed.separation_px is not None
    assert undisturbed.separation_px is not None
    assert pushed.separation_px < 2 * RADIUS <= undisturbed.separation_px
