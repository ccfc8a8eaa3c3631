"""Keeps a formation about a thing that moves, within what a person has given leave to.

Its places move as one rigid body with the thing; what is observed is certified against the same
contract; leaving a bound holds all robots and is said. Frame: image pixels.
"""

import asyncio
import math
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from contextlib import aclosing

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from ..errors import FleetError, ToolError
from ..formation.checking.check import certify
from ..formation.checking.finding import KEEP_OUTS, Finding
from ..formation.contract import Contract
from ..formation.plan import Plan
from ..formation.site import Site
from ..geometry.outline import FloatArray, distances
from ..geometry.sampling import min_spacing
from ..motion.routes import named_obstacles
from .follow import Follow, Followed, Left, Rigid
from .protocol import (
    Fleet,
    FleetStoppedError,
    Pose,
    RobotsFailedError,
    Sighting,
    Tracker,
    body_radius,
    points_of,
)

WINDOW = 0.2
"""Seconds over which it is seen how fast places move."""
AHEAD = 0.5
"""No robot may touch anything where its place will be within so many seconds."""
CHECKED = 0.1
"""Seconds from one certificate to the next."""
GRACE = 0.5
"""Robots may be off what the contract allows for so many seconds on end."""
UNSEEN = 1.0
"""The thing may be unseen for so many seconds; so may a robot at the beginning."""
OUTSIDE = frozenset({"out_of_picture", *KEEP_OUTS})
"""Findings about what does not move with the thing, and is checked where it is."""
FATAL = frozenset({"on_target"})
"""Findings that hold robots at once."""

Watch = Callable[[tuple[Pose, ...], Rigid], None]
Ending = tuple[Left, str]


def followed_target(contract: Contract) -> str:
    """The one thing that a formation is about.

    Raises:
        ToolError: there is none, or several.
    """
    names = list(dict.fromkeys(name for group in contract.groups for name in group.targets))
    if len(names) != 1:
        about = " and ".join(names) or "no thing"
        raise ToolError(f"Robots can follow one thing; this formation is about {about}.")
    return names[0]


async def sighted(fleet: Fleet, target: str) -> Sighting | None:
    """Where a fleet sees a thing; None where it does not."""
    found = await fleet.sightings() if isinstance(fleet, Tracker) else ()
    return next((seen for seen in found if seen.id == target), None)


def rigid_of(site: Site, sighting: Sighting) -> Rigid:
    """How a thing has moved that is seen somewhere."""
    return Rigid(np.asarray(site.outlines[sighting.id].centre), sighting)


def lost(plan: Plan, site: Site, poses: Sequence[Pose], rigid: Rigid) -> Finding | None:
    """What keeps robots, in the order of places, from standing about a thing as a plan has it."""
    headings = None
    if plan.formation.headings_deg:
        looks = [math.nan if pose.heading is None else pose.heading for pose in poses]
        headings = np.degrees(np.array(looks) - rigid.sighting.turn).tolist()
    verdict = certify(rigid.back(points_of(poses)), plan.formation.contract, site, headings)
    return next((found for found in verdict.findings if found.kind not in OUTSIDE), None)


async def escort(
    plan: Plan,
    site: Site,
    fleet: Fleet,
    robots: Sequence[str],
    follow: Follow,
    *,
    watch: Watch = lambda poses, rigid: None,
    starting: Callable[[], Awaitable[None]] | None = None,
) -> Followed:
    """Keep robots that stand in a formation about its thing as that moves; at the end they hold.

    Args:
        plan: certified.
        robots: ids; robot i has place i.
        follow: what a person has given leave to.
        watch: is called with the poses of the whole fleet and how the thing has moved.
        starting: is awaited right before the first motion; raising prevents it.

    Raises:
        ToolError: see `check_follow`. Nothing was moved.
        FleetError: the fleet cannot be observed.
    """
    sighting = await check_follow(plan, fleet, follow.most(site.room))
    assert isinstance(fleet, Tracker)
    going = _Going(plan, site, fleet, robots, follow, rigid_of(site, sighting))
    ending = await going.saw(await fleet.observe(max_age=UNSEEN), sighting)
    if ending is None and starting is not None:
        await starting()
    try:
        async with aclosing(fleet.accompany(going.places)) as moving:
            while ending is None:
                poses = await anext(moving, None)
                if poses is None:
                    raise FleetError(f"The fleet {fleet.name} drove no further.")
                ending = await going.saw(poses, await sighted(fleet, sighting.id))
                watch(poses, going.rigid)
    except FleetError as error:
        ending = "stopped" if isinstance(error, FleetStoppedError) else "failed", str(error)
    return going.report(ending)


async def check_follow(plan: Plan, fleet: Fleet, most: float) -> Sighting:
    """Where the thing that a plan is about is seen.

    Args:
        most: the speed that leave is given to, px per second.

    Raises:
        ToolError: the formation is about no thing or several, the fleet does not see it, or its
            robots are slower than what leave is given to.
    """
    target = followed_target(plan.formation.contract)
    sighting = await sighted(fleet, target)
    if sighting is None:
        raise ToolError(
            f"The fleet {fleet.name} does not see where {target} is, so it cannot follow it; "
            "a simulated fleet sees the `targets` that its file says move."
        )
    if most > fleet.speed:
        raise ToolError(
            f"Robots of the fleet {fleet.name} drive {fleet.speed:.0f} px/s at most: they cannot "
            f"follow at up to {most:g} px/s; say a greatest speed below theirs."
        )
    return sighting


class _Going:
    """One follow as it goes: what was seen, and where the robots are to be."""

    def __init__(
        self,
        plan: Plan,
        site: Site,
        fleet: Fleet,
        robots: Sequence[str],
        follow: Follow,
        rigid: Rigid,
    ) -> None:
        self._plan, self._site, self._follow, self.rigid = plan, site, follow, rigid
        self._robots, self._goals = tuple(robots), plan.formation.points
        self._radius = body_radius(fleet, plan.formation.contract, self._goals)
        self._touching = min(2 * self._radius, min_spacing(self._goals)) - 2 * fleet.tracking_error
        self._past: deque[tuple[float, FloatArray]] = deque()
        self._obstacles: dict[str, BaseGeometry] | None = None
        self._began = self._now = self._certified_s = 0.0
        self._check_at, self._lost_at = -math.inf, math.inf
        self._finding: Finding | None = None
        self._behind = self._lag = self._speed = 0.0
        self._least = math.inf

    def places(self) -> dict[str, tuple[float, float, float, float]]:
        """Where robots are to be, and how fast they move there; see `Tracker.accompany`."""
        rows = np.concatenate([self._past[-1][1], self._velocity], axis=1).tolist()
        return {robot: (x, y, u, v) for robot, (x, y, u, v) in zip(self._robots, rows, strict=True)}

    @property
    def _velocity(self) -> FloatArray:
        """Of the places, (n, 2) px per second."""
        (before, old), (now, new) = self._past[0], self._past[-1]
        return (new - old) / (now - before) if now > before else np.zeros_like(new)

    async def saw(self, poses: tuple[Pose, ...], sighting: Sighting | None) -> Ending | None:
        """Take in what is seen; the bound that was left, if one was."""
        by_id = {pose.id: pose for pose in poses}
        gone = [robot for robot in self._robots if robot not in by_id]
        if gone:
            raise RobotsFailedError(f"Robot {', '.join(gone)} is not there any more.", gone)
        mine = [by_id[robot] for robot in self._robots]
        now = max(pose.seen for pose in poses)
        points, first = points_of(mine), self._obstacles is None
        self._moved(sighting or self.rigid.sighting)
        if first:
            self._began = self._now = now
            self._obstacles = self._obstacles_off(points, poses)
        self._behind = float(np.linalg.norm(points - self._past[-1][1], axis=1).max())
        self._lag = max(self._lag, self._behind)
        self._least = min(self._least, min_spacing(points))
        if now >= self._check_at:
            self._check_at = now + CHECKED - 1e-9
            plan, site, rigid = self._plan, self._site, self.rigid
            self._finding = await asyncio.to_thread(lambda: lost(plan, site, mine, rigid))
        self._certified_s += 0.0 if self._finding else now - self._now
        self._lost_at = min(self._lost_at, now) if self._finding else math.inf
        self._now = now
        return self._unsafe(points) or self._off() or self._over()

    def _moved(self, sighting: Sighting) -> None:
        """Where the thing is, and with it the places."""
        self.rigid = Rigid(self.rigid.centre, sighting)
        if not self._past or sighting.seen > self._past[-1][0]:
            self._past.append((sighting.seen, self.rigid.carried(self._goals)))
        while len(self._past) > 2 and self._past[1][0] <= sighting.seen - WINDOW + 1e-9:
            self._past.popleft()
        self._speed = max(self._speed, float(np.linalg.norm(self._velocity, axis=1).max()))

    def _obstacles_off(self, points: FloatArray, poses: Sequence[Pose]) -> dict[str, BaseGeometry]:
        """What robots may not touch on the way: none of what they touch where they stand."""
        contract, target = self._plan.formation.contract, self.rigid.sighting.id
        found = named_obstacles(contract, self._site)
        found |= {f"{other.id} ({other.label})": other.region for other in self._site.others}
        found |= {
            f"robot {p.id}": Point(p.x, p.y).buffer(self._radius)
            for p in poses
            if p.id not in self._robots
        }
        found.pop(target, None)
        near = {name: distances(region, points).min() for name, region in found.items()}
        return {name: found[name] for name, far in near.items() if far > self._radius}

    def _unsafe(self, points: FloatArray) -> Ending | None:
        """What robots touch, or would touch."""
        if self._least < self._touching:
            demanded = f"{self._touching:.1f} px are needed"
            return "separation", f"Two robots came within {self._least:.1f} px; {demanded}."
        ahead = self._past[-1][1] + AHEAD * self._velocity
        inside = self._follow.room(self._site.room).buffer(
            -self._plan.formation.contract.robot_radius
        )
        out = np.flatnonzero(~shapely.covers(inside, shapely.points(ahead)))
        if len(out):
            where = "({:.0f}, {:.0f})".format(*ahead[out[0]])
            return "area", f"Robot {self._robots[out[0]]} would leave the area for {where}."
        for name, region in (self._obstacles or {}).items():
            near = distances(region, ahead)
            if near.min() < self._radius:
                return "obstacle", f"Robot {self._robots[near.argmin()]} would touch {name}."
        return None

    def _off(self) -> Ending | None:
        """What the contract, or the sight of the thing, is lost by."""
        found, target = self._finding, self.rigid.sighting.id
        if found and (found.kind in FATAL or self._now - self._lost_at > GRACE):
            return "contract", (
                f"Robots are {self._behind:.1f} px behind their places about {target}, which moves "
                f"them at {self._pace:.0f} px/s: {found.sentence}"
            )
        unseen = self._now - self.rigid.sighting.seen
        if unseen > UNSEEN:
            return "unseen", f"{target} was not seen for {unseen:.1f} s."
        return None

    @property
    def _pace(self) -> float:
        """How fast the fastest place moves now, px per second."""
        return float(np.linalg.norm(self._velocity, axis=1).max())

    def _over(self) -> Ending | None:
        """What leave is over by: speed or time."""
        pace, most = self._pace, self._follow.most(self._site.room)
        if pace > most * (1 + 1e-6):
            moves = f"{self.rigid.sighting.id} takes robots along at {pace:.1f} px/s"
            return "speed", f"{moves}; no more than {most:g} px/s were allowed."
        if self._now - self._began >= self._follow.seconds - 1e-6:
            return "time", ""
        return None

    def report(self, ending: Ending) -> Followed:
        """What came of it."""
        ended, reason = ending
        seconds = self._now - self._began
        return Followed(
            target=self.rigid.sighting.id,
            seconds=round(seconds, 3),
            moved_px=round(float(np.linalg.norm(self.rigid.way)), 3),
            speed_px_s=round(self._speed, 3),
            lag_px=round(self._lag, 3),
            separation_px=None if math.isinf(self._least) else round(self._least, 3),
            certified=round(self._certified_s / seconds, 4) if seconds else 0.0,
            ended=ended,
            reason=f"{reason} All robots hold." if reason else None,
        )
