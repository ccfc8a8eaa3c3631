"""Drives a fleet to a certified formation and says what was observed, not what was commanded."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from contextlib import aclosing, suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import FleetError, ToolError
from ..formation.checking.check import certify
from ..formation.contract import MIN_SPACING, Contract, with_defaults
from ..formation.headings import off_heading
from ..formation.placement.place import Site
from ..formation.plan import Plan, Point
from ..formation.value import Value
from ..geometry.assignment import assign
from ..geometry.outline import FloatArray
from ..motion.avoiding import routes_off
from ..motion.routes import obstacles
from .protocol import (
    Fleet,
    FleetBusyError,
    FleetSizeError,
    FleetStoppedError,
    Motion,
    PlaceTakenError,
    Pose,
    RobotsFailedError,
    points_of,
)

CORRECTIONS = 5
ARRIVED_DEG = 2.0
"""A robot that is to look somewhere has arrived within so many degrees of it."""
ARRIVED_SHARE, ARRIVED_PX = 0.001, 0.5
"""A robot has arrived within this share of the picture's diagonal, at least half a pixel."""
MAX_AGE = 1.0
"""Robots are driven only on poses seen within so many seconds."""
TRACK_FRAMES = 120
"""Most moments of a deployment that are recorded for its film."""

Ended = Literal["arrived", "short", "stopped", "failed"]
Watch = Callable[[tuple[Pose, ...]], None]

_in_deployment: set[int] = set()
"""`id` of the fleets that are being deployed; a deployment holds its fleet, so none is reused."""


class Arrival(Value):
    """Requested against observed, per place of the formation.

    Attributes:
        ended: arrived; short: some are off their places after all corrections; stopped: by the
            fleet's stop; failed: robots or the fleet failed on the way.
        reason: one sentence where it was stopped or failed.
        robots: ids of the robots that take the places.
        failed: ids of those that the fleet named as having failed.
        observed: where they were seen last, px.
        residual_px: distance of observed to requested.
        heading_residual_deg: of observed to requested headings; empty where none were requested.
        corrections: how many times robots were sent again after the first drive.
        track: hash of the file that holds where they were on their way.
    """

    arrived: bool
    ended: Ended
    reason: str | None = None
    robots: tuple[str, ...]
    failed: tuple[str, ...] = ()
    observed: tuple[Point, ...]
    residual_px: tuple[float, ...]
    heading_residual_deg: tuple[float | None, ...] = ()
    tolerance_px: float
    corrections: int
    track: str | None = None


@dataclass(frozen=True)
class Track:
    """Where robots were over a deployment, for its film.

    Attributes:
        ids: of the robots, in the order of their places.
        points: (f, n, 2) px at f moments, evenly thinned; the last is the last observation.
    """

    ids: tuple[str, ...]
    points: FloatArray


@dataclass(frozen=True)
class Deployment:
    """What came of a deployment, and where all robots of the fleet, idle ones too, were last."""

    arrival: Arrival
    poses: tuple[Pose, ...]
    track: Track


@dataclass(frozen=True)
class Assigned:
    """Who takes which place.

    Attributes:
        robots: ids; robot i takes place i.
        gap: share of the summed squared ways another assignment could have saved at most; None
            where there was none better.
    """

    robots: tuple[str, ...]
    gap: float | None


def assign_robots(poses: Sequence[Pose], places: FloatArray) -> Assigned:
    """The robots for all places, (n, 2) px, with the least sum of squared ways; others stay idle.

    Raises:
        FleetSizeError: the fleet has fewer robots than there are places.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if len(poses) < len(places):
        raise FleetSizeError(f"The fleet has {len(poses)} robots; the plan needs {len(places)}.")
    points = points_of(poses)
    chosen = np.arange(len(poses))
    if len(poses) > len(places):
        cost = cdist(places, points, "sqeuclidean")
        chosen = np.sort(linear_sum_assignment(cost)[1])
    found = assign(points[chosen], places)
    robots = tuple(poses[int(i)].id for i in chosen[found.robots])
    return Assigned(robots, found.gap if found.method == "approximate" else None)


def tolerance(size: tuple[float, float]) -> float:
    """How far from its place a robot has arrived at it, px, in a picture of that size."""
    return max(ARRIVED_PX, ARRIVED_SHARE * math.hypot(*size))


async def deploy(
    plan: Plan,
    site: Site,
    fleet: Fleet,
    robots: Sequence[str],
    *,
    watch: Watch = lambda poses: None,
    starting: Callable[[], Awaitable[None]] | None = None,
) -> Deployment:
    """Move robots onto a plan that is certified here and now, observe, correct, and report.

    It has no time limit: it ends when the robots have arrived, or cannot, or when the fleet is
    stopped, or when its task is cancelled, which stops the robots where they are. Robots of the
    fleet that are not named stay where they are and are driven around.

    Args:
        robots: ids; robot i takes place i.
        watch: is called with the poses of the whole fleet whenever they have been observed; last,
            also after a failure or before CancelledError goes on, with where they ended.
        starting: is awaited right before the first motion; raising prevents it.

    Raises:
        ToolError: the plan does not certify. Here and below nothing was moved.
        FleetSizeError: another number of robots is named than there are places.
        FleetStoppedError: the fleet's stop is in force.
        FleetBusyError: another deployment is using the fleet.
        RobotsFailedError: robots are not there.
        PlaceTakenError: an idle robot stands on a place.
        FleetError: the fleet cannot be observed, or there is no way to a place.
    """
    contract = with_defaults(plan.formation.contract, site.outlines, site.room)
    formation = plan.formation
    headings = formation.place_headings  # a plan's own word is not enough
    verdict = certify(formation.points, contract, site, headings)
    if not verdict.certified:
        why = verdict.findings[0].sentence
        raise ToolError(f"Plan {plan.id} is not certified: {why} Nothing was moved.")
    check_turns(plan, fleet)
    if id(fleet) in _in_deployment:
        raise FleetBusyError(
            f"The fleet {fleet.name} is being deployed already; wait for it to end, or stop it."
        )
    _in_deployment.add(id(fleet))
    try:
        goals = formation.points, headings
        drive = _Drive(goals, contract, site, fleet, robots, watch)
        return await drive.run(starting)
    finally:
        _in_deployment.discard(id(fleet))


def check_turns(plan: Plan, fleet: Fleet) -> None:
    """Refuse headings to a fleet that cannot turn.

    Raises:
        ToolError: saying so.
    """
    if plan.formation.headings_deg and not fleet.turns:
        raise ToolError(
            f"Robots of the fleet {fleet.name} cannot be turned to a heading: leave `heading` out, "
            "or use a fleet that can."
        )


def heading_residuals(
    poses: Sequence[Pose], headings: Sequence[float | None]
) -> tuple[float | None, ...]:
    """How far robots look past where they are to, degrees; 180 for what is not known."""
    wanted = zip(poses, headings, strict=False)
    return tuple(
        None
        if angle is None
        else 180.0
        if pose.heading is None
        else round(off_heading(math.degrees(pose.heading), angle), 3)
        for pose, angle in wanted
    )


class _Drive:
    """One deployment as it goes: what was seen, and what is still to be driven."""

    def __init__(
        self,
        goals: tuple[FloatArray, tuple[float | None, ...]],
        contract: Contract,
        site: Site,
        fleet: Fleet,
        robots: Sequence[str],
        watch: Watch,
    ) -> None:
        self._goals, self._headings = goals
        self._contract, self._site = contract, site
        self._fleet, self._robots, self._watch = fleet, tuple(robots), watch
        self._radius = max(contract.robot_radius, fleet.radius)
        self._tolerance = tolerance(site.room)
        self._poses: dict[str, Pose] = {}
        self._frames: list[FloatArray] = []
        self._stride, self._seen = 1, 0

    async def run(self, starting: Callable[[], Awaitable[None]] | None) -> Deployment:
        if len(set(self._robots)) != len(self._goals):
            raise FleetSizeError(
                f"{len(set(self._robots))} robots are named; the plan has {len(self._goals)} "
                "places, and each takes one robot."
            )
        if self._fleet.stopped:
            raise FleetStoppedError(
                f"The fleet {self._fleet.name} is stopped; release it before anything moves."
            )
        await self._observe()
        self._check_idle()
        corrections, motion = 0, self._motion()
        if starting is not None:
            await starting()
        try:
            await self._drive(motion)
            while not self._arrived() and not self._fleet.stopped and corrections < CORRECTIONS:
                corrections += 1
                await self._drive(self._motion())
        except (asyncio.CancelledError, FleetError) as error:
            with suppress(FleetError):
                self._saw(await self._fleet.observe())
            if isinstance(error, FleetError):
                return self._report(corrections, error)
            raise
        return self._report(corrections)

    async def _drive(self, motion: Motion) -> None:
        async with aclosing(self._fleet.drive(motion)) as moving:
            async for poses in moving:
                self._saw(poses)
        await self._observe()

    async def _observe(self) -> None:
        poses = await self._fleet.observe(max_age=MAX_AGE)
        there = {pose.id for pose in poses}
        missing = [robot for robot in self._robots if robot not in there]
        if missing:
            raise RobotsFailedError(
                f"Robot {', '.join(missing)} of the plan is not in the fleet {self._fleet.name} "
                "now; propose the formation again with the robots there are.",
                missing,
            )
        self._saw(poses)

    def _saw(self, poses: tuple[Pose, ...]) -> None:
        """Keep poses, and thin the frames to every second one whenever there are too many."""
        self._poses |= {pose.id: pose for pose in poses}
        if self._seen % self._stride == 0:
            self._frames.append(self._points())
        if len(self._frames) > TRACK_FRAMES:
            self._frames, self._stride = self._frames[::2], 2 * self._stride
        self._seen += 1
        self._watch(tuple(self._poses.values()))

    def _points(self) -> FloatArray:
        return points_of([self._poses[robot] for robot in self._robots])

    def _idle(self) -> list[Pose]:
        taking_part = set(self._robots)
        return [pose for pose in self._poses.values() if pose.id not in taking_part]

    def _check_idle(self) -> None:
        """Refuse a plan with a place that a robot stands on which is not to be driven."""
        for pose in self._idle():
            away = np.hypot(*(self._goals - (pose.x, pose.y)).T)
            if away.min() < max(2 * self._radius, MIN_SPACING):
                place = int(away.argmin()) + 1
                raise PlaceTakenError(
                    f"Robot {pose.id}, which has no place in the plan, stands {away.min():.1f} px "
                    f"from place {place}: give it a place too, or send it away first.",
                    (pose.id,),
                )

    def _motion(self) -> Motion:
        site, radius = self._site, self._radius
        solid = obstacles(self._contract, site)
        idle = points_of(self._idle())
        paths = routes_off(self._points(), self._goals, solid, site, radius, idle=idle)
        looks = zip(self._robots, self._headings, strict=False)
        headings = {robot: math.radians(angle) for robot, angle in looks if angle is not None}
        return Motion(dict(zip(self._robots, paths, strict=True)), headings)

    def _residual(self) -> FloatArray:
        return np.linalg.norm(self._points() - self._goals, axis=1)

    def _arrived(self) -> bool:
        turned = all((off or 0.0) <= ARRIVED_DEG for off in self._heading_residual())
        return turned and bool(self._residual().max() <= self._tolerance)

    def _heading_residual(self) -> tuple[float | None, ...]:
        return heading_residuals([self._poses[robot] for robot in self._robots], self._headings)

    def _report(self, corrections: int, error: FleetError | None = None) -> Deployment:
        reason = str(error) if error else None
        if self._fleet.stopped or isinstance(error, FleetStoppedError):
            ended: Ended = "stopped"
            reason = reason or f"The fleet {self._fleet.name} was stopped."
        elif error:
            ended = "failed"
        else:
            ended = "arrived" if self._arrived() else "short"
        points = self._points()
        arrival = Arrival(
            arrived=ended == "arrived",
            ended=ended,
            reason=reason,
            robots=self._robots,
            failed=error.ids if isinstance(error, RobotsFailedError) else (),
            observed=tuple((round(float(x), 3), round(float(y), 3)) for x, y in points),
            residual_px=tuple(round(float(r), 3) for r in self._residual()),
            heading_residual_deg=self._heading_residual(),
            tolerance_px=round(self._tolerance, 3),
            corrections=corrections,
        )
        track = Track(self._robots, np.stack([*self._frames, points]))
        return Deployment(arrival, tuple(self._poses.values()), track)
