"""The embedded fleet: robots of the stepping simulator, which arrive because they are seen to."""

import math
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import aclosing
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .described import described
from .moving import MovingTargets
from .pace import Pace
from .physics import Physics
from .protocol import (
    FleetBusyError,
    FleetClosedError,
    FleetRequest,
    FleetSizeError,
    FleetStoppedError,
    Motion,
    Places,
    Pose,
    RobotsFailedError,
    Sighting,
    check_ages,
    points_of,
)
from .simulator import PERIOD, Simulator, tracking_error
from .starts import set_down

MAX_ROBOTS = 1_000
"""Above this, motion takes too long to plan."""
SPEED_SHARE = 0.2
"""Share of the picture's diagonal a robot drives in a second where nobody says how fast it is."""
FULL_SPEED_S = 0.25
"""Seconds in which a robot comes to its speed where nobody says."""
RADIUS = 3.0
SLIP = 0.02
"""A robot makes between 1 - SLIP and all of what it is told: wheels slip, odometry drifts."""


class SimulatedFleet:
    """Robots on the picture's plane.

    Args:
        poses: where they stand.
        speed: px per second of simulated time; left out where `physics` says it.
        radius: of a robot, px.
        physics: what they can do, and what goes wrong.
        seed: of everything random.
    """

    name = "simulated"
    real = False
    turns = True

    def __init__(
        self,
        poses: Sequence[Pose],
        *,
        speed: float = 0.0,
        radius: float = RADIUS,
        physics: Physics | None = None,
        seed: int = 0,
    ) -> None:
        self.stopped, self.pace = False, Pace()
        physics = physics or Physics(
            speed=speed, acceleration=speed / FULL_SPEED_S, radius=radius, slip=SLIP
        )
        self.physics, self.radius, self.speed = physics, physics.radius, physics.speed
        self.tracking_error = tracking_error(physics)
        self._simulator = Simulator(
            [pose.id for pose in poses],
            points_of(poses),
            np.array([math.nan if p.heading is None else p.heading for p in poses]),
            physics,
            seed=seed,
            now=max((pose.seen for pose in poses), default=0.0),
        )
        self._targets = MovingTargets(physics.targets, seed)
        self._driving = self._closed = False
        self._stops = 0

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        """Poses as they were seen last."""
        self._check_open()
        poses = self._seen()
        check_ages(poses, self._simulator.now, max_age)
        return poses

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Follow the paths in their order of passage; poses at every step."""
        self._check_drive(motion.paths)
        if not motion.paths:
            return
        self._simulator.begin(motion)
        async with aclosing(self._steps(self._simulator.step)) as steps:
            async for poses in steps:
                yield poses
                if self._simulator.arrived:
                    return

    async def sightings(self) -> tuple[Sighting, ...]:
        """Where the things are that the fleet's file moves."""
        self._check_open()
        now, where = self._simulator.now, self._targets.where()
        return tuple(Sighting(name, x, y, turn, now) for name, (x, y, turn) in where.items())

    async def accompany(
        self, places: Callable[[], Places]
    ) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Keep robots at places that move; poses at every step, in which the things move too."""
        wanted = places()
        self._check_drive(wanted)
        self._simulator.accompany([*wanted])

        def step() -> None:
            now = places()
            self._simulator.step(np.array([now[robot] for robot in wanted]))
            self._targets.step(PERIOD)

        async with aclosing(self._steps(step)) as steps:
            async for poses in steps:
                yield poses

    async def _steps(self, step: Callable[[], None]) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Poses after every step, at the pace there is, until it is stopped."""
        self._driving, stops = True, self._stops
        try:
            while True:
                step()
                yield self._seen()
                await self.pace.step(PERIOD)
                self._check_open()
                if self._stops != stops:
                    raise FleetStoppedError(
                        "The simulated fleet was stopped on the way: its robots are held."
                    )
        finally:
            self._simulator.hold()
            self._driving = False

    async def stop(self) -> None:
        """Hold all robots where they are, until `release`."""
        self.stopped = True
        self._stops += 1

    async def release(self) -> None:
        """Lift the stop."""
        self.stopped = False

    async def close(self) -> None:
        """Hold all robots, for good."""
        self._closed = True

    def _seen(self) -> tuple[Pose, ...]:
        sim = self._simulator
        looks = [None if math.isnan(h) else h for h in sim.headings.tolist()]
        x, y = sim.sensed.T.tolist()
        return tuple(map(Pose, sim.ids, x, y, looks, sim.seen.tolist()))

    def _check_open(self) -> None:
        if self._closed:
            raise FleetClosedError("The simulated fleet is closed; open it again.")

    def _check_drive(self, robots: Mapping[str, object]) -> None:
        self._check_open()
        if self.stopped:
            raise FleetStoppedError("The simulated fleet is stopped; release it to drive.")
        if self._driving:
            raise FleetBusyError("The simulated fleet is driving already; wait, or stop it.")
        unknown = sorted(set(robots) - set(self._simulator.ids))
        if unknown:
            raise RobotsFailedError(
                f"Robot {', '.join(unknown)} is not in the simulated fleet of "
                f"{len(self._simulator.ids)} robots.",
                unknown,
            )


def open_fleet(request: FleetRequest) -> SimulatedFleet:
    """Robots where they were last, at the starts a person gave, or spread along the border.

    Raises:
        FleetSizeError: more robots than are simulated.
        InputError: starts where no robot can stand, no room for all, or a file that describes no
            fleet or faults of robots that there are not.
    """
    if request.robots > MAX_ROBOTS:
        raise FleetSizeError(
            f"{request.robots} robots can be placed and certified, but motion is simulated only "
            f"up to {MAX_ROBOTS} so far: the plan stands, nothing was moved."
        )
    speed, radius = SPEED_SHARE * math.hypot(*request.size), request.radius or RADIUS
    path = request.config
    if path is None:
        return SimulatedFleet(set_down(request), speed=speed, radius=radius, seed=request.seed)
    told = described(path)
    speed = told.given.get("speed", speed)
    usual = {"speed": speed, "acceleration": speed / FULL_SPEED_S, "radius": radius}
    physics = told.physics(usual)
    if "radius" in told.given:
        request = replace(request, radius=physics.radius)
    poses = set_down(request)
    _check_named(path, physics, [pose.id for pose in poses])
    fleet = SimulatedFleet(poses, physics=physics, seed=request.seed)
    fleet.pace.speed = 1.0 if told.pace == "real" else None
    return fleet


def _check_named(path: Path, physics: Physics, ids: Sequence[str]) -> None:
    """Refuse faults of robots that there are not.

    Raises:
        InputError: naming them.
    """
    faults = (*physics.stuck, *physics.lost, *physics.pushes)
    unknown = sorted({fault.robot for fault in faults} - set(ids))
    if unknown:
        raise InputError(
            f"{path} has faults of robot {', '.join(unknown)}; the fleet has {len(ids)} robots, "
            f"{ids[0]} to {ids[-1]}."
        )
