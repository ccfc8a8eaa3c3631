"""Drives a fleet to a certified formation and says what was observed, not what was commanded."""

import asyncio
import math
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from contextlib import aclosing, suppress
from dataclasses import replace

import numpy as np

from ..errors import FleetError, ToolError
from ..formation.checking.check import certify
from ..formation.contract import MIN_SPACING, Contract, with_defaults
from ..formation.headings import off_heading
from ..formation.placement.place import Site
from ..formation.plan import Plan
from ..geometry.outline import FloatArray
from ..motion.checking import MotionVerdict
from ..motion.planning import Ground, Team, plan_motion
from ..motion.routes import named_obstacles
from .arrival import Arrival, Deployment, Ended, Track
from .getting_on import GettingOn, nearest_spare, said_of, said_of_replaced
from .protocol import (
    Fleet,
    FleetBusyError,
    FleetSizeError,
    FleetStoppedError,
    Motion,
    PlaceTakenError,
    Pose,
    RobotsFailedError,
    StalePosesError,
    body_radius,
    points_of,
)
from .supervisor import Supervisor

CORRECTIONS = 5
TRIES = 2
"""How often a robot that does not get on is sent before it is given up."""
ARRIVED_DEG = 2.0
"""A robot that is to look somewhere has arrived within so many degrees of it."""
ARRIVED_SHARE, ARRIVED_PX = 0.001, 0.5
"""A robot has arrived within this share of the picture's diagonal, at least half a pixel."""
MAX_AGE = 1.0
"""Robots are driven only on poses seen within so many seconds."""
TRACK_FRAMES = 120
"""Most moments of a deployment that are recorded for its film."""

Watch = Callable[[tuple[Pose, ...]], None]

_in_deployment: set[int] = set()
"""`id` of the fleets that are being deployed; a deployment holds its fleet, so none is reused."""


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
    drive = _certified(plan, site, fleet, robots, watch)
    if id(fleet) in _in_deployment:
        raise FleetBusyError(
            f"The fleet {fleet.name} is being deployed already; wait for it to end, or stop it."
        )
    _in_deployment.add(id(fleet))
    try:
        return await drive.run(starting)
    finally:
        _in_deployment.discard(id(fleet))


async def motion_to(
    plan: Plan, site: Site, fleet: Fleet, robots: Sequence[str], error: float
) -> tuple[Motion, MotionVerdict]:
    """The motion that a deployment of robots that come off so far, px, would begin with now."""
    return await _certified(plan, site, fleet, robots, lambda poses: None).planned(error)


def _certified(
    plan: Plan, site: Site, fleet: Fleet, robots: Sequence[str], watch: Watch
) -> "_Drive":
    contract = with_defaults(plan.formation.contract, site.outlines, site.room)
    formation = plan.formation
    headings = formation.place_headings  # a plan's own word is not enough
    verdict = certify(formation.points, contract, site, headings)
    if not verdict.certified:
        why = verdict.findings[0].sentence
        raise ToolError(f"Plan {plan.id} is not certified: {why} Nothing was moved.")
    check_turns(plan, fleet)
    return _Drive((formation.points, headings), contract, site, fleet, robots, watch)


def check_turns(plan: Plan, fleet: Fleet) -> None:
    """Refuse headings to a fleet that cannot turn.

    Raises:
        ToolError: saying so.
    """
    if plan.formation.headings_deg and not fleet.turns:
        raise ToolError(
            f"Robots of the fleet {fleet.name} cannot be turned to a heading: leave `heading` out, "
            "or use a fleet that can (its file says `turns: true`)."
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
        self._radius = body_radius(fleet, contract, self._goals)
        self._tolerance = tolerance(site.room)
        self._poses: dict[str, Pose] = {}
        self._frames: list[FloatArray] = []
        self._stride, self._seen = 1, 0
        self._places: tuple[FloatArray, tuple[float | None, ...], tuple[str, ...]]
        self._places = *goals, self._robots  # of those given up, too
        self._tried: Counter[str] = Counter()
        self._failed: dict[str, str | None] = {}  # and who took their place
        self._waiting: dict[str, str] = {}
        self._demanded, self._least = 0.0, math.inf

    async def planned(self, error: float = 0.0) -> tuple[Motion, MotionVerdict]:
        """A certified motion from where robots are seen now, for robots that come off so far."""
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
        return await self._motion(error)

    async def run(self, starting: Callable[[], Awaitable[None]] | None) -> Deployment:
        corrections, (motion, _) = 0, await self.planned()
        if starting is not None:
            await starting()
        try:
            await self._drive(motion)
            while not self._arrived() and not self._fleet.stopped and corrections < CORRECTIONS:
                corrections += 1
                await self._drive((await self._motion())[0])
        except (asyncio.CancelledError, FleetError) as error:
            with suppress(FleetError):
                self._saw(await self._fleet.observe())
            if isinstance(error, FleetError):
                return self._report(corrections, error)
            raise
        return self._report(corrections)

    async def _drive(self, motion: Motion) -> None:
        """Drive until the robots are there, or none has got on for a while; then see to those."""
        failing: Sequence[str] = ()
        on, self._waiting = GettingOn(motion), {}
        watched = Supervisor(self._demanded, self._fleet.tracking_error)
        try:
            async with aclosing(self._fleet.drive(motion)) as moving:
                async for poses in moving:
                    self._saw(poses)
                    if not watched.saw(self._points()):
                        break  # all stand, and go on from where they are
                    if not on.saw(self._poses):
                        failing, self._waiting = on.stuck(), on.waiting()
                        break
            await self._observe()
            self._least = min(self._least, watched.least)
        except RobotsFailedError as error:
            gone = set(error.ids) - set(self._failed)
            if not gone or not all(self._replace(robot) for robot in gone):
                raise
        off = dict(zip(self._robots, self._residual(), strict=True))
        for robot in (robot for robot in failing if robot not in self._failed):
            self._tried[robot] += 1
            if off[robot] <= self._tolerance or self._replace(robot):
                continue
            if self._tried[robot] == TRIES:
                self._give_up(robot)

    def _replace(self, robot: str) -> bool:
        """Give the place of a robot to the nearest idle one, unless the robot stands on one."""
        if robot not in self._robots or self._blocks(self._poses[robot]):
            return False
        place = self._robots.index(robot)
        other = nearest_spare(self._goals[place], self._idle(), self._failed)
        if other is None:
            return False
        self._failed[robot] = other
        self._robots = tuple(other if r == robot else r for r in self._robots)
        goals, headings, robots = self._places
        self._places = goals, headings, tuple(other if r == robot else r for r in robots)
        return True

    def _give_up(self, robot: str) -> None:
        """Leave a robot where it is: the others go around it."""
        self._failed[robot] = None
        keep = [i for i, other in enumerate(self._robots) if other != robot]
        self._goals = self._goals[keep]
        self._robots = tuple(self._robots[i] for i in keep)
        self._headings = tuple(self._headings[i] for i in keep if self._headings)

    async def _observe(self) -> None:
        try:
            poses = await self._fleet.observe(max_age=MAX_AGE)
        except StalePosesError as error:
            if not set(error.ids) <= set(self._failed):
                raise
            poses = await self._fleet.observe()
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
            self._frames.append(self._points(self._places[2]))
        if len(self._frames) > TRACK_FRAMES:
            self._frames, self._stride = self._frames[::2], 2 * self._stride
        self._seen += 1
        self._watch(tuple(self._poses.values()))

    def _points(self, robots: Sequence[str] | None = None) -> FloatArray:
        named = self._robots if robots is None else robots
        return points_of([self._poses[robot] for robot in named])

    def _idle(self) -> list[Pose]:
        taking_part = set(self._robots)
        return [pose for pose in self._poses.values() if pose.id not in taking_part]

    def _check_idle(self) -> None:
        """Refuse a plan with a place that a robot stands on which is not to be driven."""
        for pose in self._idle():
            if self._blocks(pose):
                away = np.hypot(*(self._goals - (pose.x, pose.y)).T)
                place = int(away.argmin()) + 1
                raise PlaceTakenError(
                    f"Robot {pose.id}, which has no place in the plan, stands {away.min():.1f} px "
                    f"from place {place}: give it a place too, or send it away first.",
                    (pose.id,),
                )

    def _blocks(self, pose: Pose) -> bool:
        """Whether nobody else could stand on some place, for a robot that stays."""
        away = np.hypot(*(self._goals - (pose.x, pose.y)).T)
        return bool(away.min() < max(2 * self._radius, MIN_SPACING))

    async def _motion(self, error: float = 0.0) -> tuple[Motion, MotionVerdict]:
        """A motion that is certified from where the robots were seen.

        Raises:
            FleetError: there is none: no way, robots in each other's way, or it does not certify.
        """
        ground = Ground(named_obstacles(self._contract, self._site), self._site)
        fleet, goals = self._fleet, self._goals
        team = Team(
            ids=self._robots,
            starts=self._points(),
            radius=self._radius,
            speed=fleet.speed,
            error=max(fleet.tracking_error, error),
            idle={pose.id: (pose.x, pose.y) for pose in self._idle()},
        )
        motion, _, verdict = await asyncio.to_thread(
            lambda: plan_motion(team, goals, ground, interchangeable=False)
        )
        self._demanded = verdict.demanded_px
        if not verdict.certified:
            raise FleetError(f"{verdict.findings[0].sentence} No robot is driven like that.")
        looks = zip(self._robots, self._headings, strict=False)
        headings = {robot: math.radians(angle) for robot, angle in looks if angle is not None}
        return replace(motion, headings=headings), verdict

    def _residual(self) -> FloatArray:
        return np.linalg.norm(self._points() - self._goals, axis=1)

    def _arrived(self) -> bool:
        turned = all((off or 0.0) <= ARRIVED_DEG for off in self._heading_residual())
        return turned and bool(self._residual().max(initial=0.0) <= self._tolerance)

    def _heading_residual(self) -> tuple[float | None, ...]:
        return heading_residuals([self._poses[robot] for robot in self._robots], self._headings)

    def _report(self, corrections: int, error: FleetError | None = None) -> Deployment:
        self._goals, self._headings, self._robots = self._places
        arrived = self._arrived()
        given_up = [robot for robot, other in self._failed.items() if other is None]
        if self._fleet.stopped or isinstance(error, FleetStoppedError):
            ended: Ended = "stopped"
        elif error or given_up:
            ended = "failed"
        else:
            ended = "arrived" if arrived else "short"
        points, residual = self._points(), self._residual()
        named = error.ids if isinstance(error, RobotsFailedError) else ()
        reason, certified = self._told(ended, error)
        arrival = Arrival(
            arrived=ended == "arrived",
            ended=ended,
            reason=reason,
            robots=self._robots,
            failed=tuple(dict.fromkeys((*self._failed, *named))),
            replaced={robot: other for robot, other in self._failed.items() if other is not None},
            waiting=self._waiting,
            certified=certified,
            observed=tuple((round(float(x), 3), round(float(y), 3)) for x, y in points),
            residual_px=tuple(round(float(r), 3) for r in residual),
            heading_residual_deg=self._heading_residual(),
            tolerance_px=round(self._tolerance, 3),
            corrections=corrections,
            separation_px=None if math.isinf(self._least) else round(self._least, 3),
        )
        track = Track(self._robots, np.stack([*self._frames, points]))
        return Deployment(arrival, tuple(self._poses.values()), track)

    def _told(self, ended: Ended, error: FleetError | None) -> tuple[str | None, bool | None]:
        """Why not all arrived, and whether what stands is certified."""
        if ended == "arrived":
            return " ".join(said_of_replaced(self._failed)) or None, None
        poses = [self._poses[robot] for robot in self._robots]
        looks = [None if p.heading is None else math.degrees(p.heading) for p in poses]
        headings = tuple(looks) if any(h is not None for h in self._headings) else ()
        verdict = certify(points_of(poses), self._contract, self._site, headings)
        if ended == "stopped":
            reason = str(error) if error else f"The fleet {self._fleet.name} was stopped."
        elif error:
            reason = str(error)
        else:
            off = dict(zip(self._robots, self._residual().tolist(), strict=True))
            off = {robot: far for robot, far in off.items() if far > self._tolerance}
            reason = said_of(self._failed, self._waiting, off, len(poses), verdict)
        return reason, verdict.certified
