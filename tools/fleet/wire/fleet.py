"""Fleets of robots elsewhere: a little of the way is released at a time, on fresh poses alone.

Robots are sent goals just ahead of them, again and again; where these end, robots hold by
themselves. So whatever fails, here or on the way, ends with robots that stand.
"""

import asyncio
import itertools
import math
import time
import uuid
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import aclosing
from types import MappingProxyType
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ...geometry.outline import FloatArray, Outline
from ...motion.following import EXACT, Following
from ...motion.motion import Motion
from ..protocol import (
    FleetBusyError,
    FleetClosedError,
    FleetStoppedError,
    FleetUnreachableError,
    Places,
    Pose,
    RobotsFailedError,
    Sighting,
    StalePosesError,
    points_of,
)
from ..seen_things import Look, SeenThings
from .poses import Poses, told_of
from .settings import WireSettings
from .tagged import Judge, TagWatch, all_believed

WAIT = 3.0
"""Seconds for which robots are waited for that have not been seen since the broker was found."""
AHEAD = 0.5
"""Robots are sent as far ahead as they drive in so many seconds at most."""
LEAD = 0.15
"""Robots at places that move are sent to where these will be in so many seconds."""
SETTLED = 0.25
"""A robot has come to its end within so many px,"""
TURNED = 0.02
"""and looks within so many radians of where it is to,"""
CALM, CALM_ASKEW = 0.5, 2.0
"""or when it has stood, within its tracking error of it, for so many seconds; for the second where
it has yet to turn, which it may only be about to."""
HOLDING = 1.0
"""Seconds in which robots that were told to hold have to stand."""
LATE, LISTENING = 0.25, 0.3
"""A program that sends goals so many seconds late has hung; it first listens for so many: somebody
may have stopped the robots meanwhile."""
OTHERS = 2.0
"""Seconds after which another program that sent goals is taken to have ended."""
STOOD_STILL = 1.0
"""A connection that is lost when this program went on after so many seconds was lost by that."""
Reason = Literal["stop", "end", "gone"]
Point = tuple[float, float]


class Connection(Protocol):
    """What a fleet has to know of what connects it.

    Attributes:
        joined: how often it has been connected.
        connected: whether it is now.
        trouble: why not, in words.
    """

    joined: int
    connected: bool
    trouble: str

    def start(self) -> object:
        """Connect, and call back from now on."""
        ...

    def close(self) -> None:
        """Say goodbye; what was said before still goes out."""
        ...


class WireFleet(ABC):
    """Robots elsewhere, as a file describes them; what they are told is up to who derives from it.

    Attributes:
        poses: what is believed of where they are; to be fed with what they say, where no camera
            sees them.
        link: what connects them; to be set before the fleet is used.
        ahead: see `AHEAD`.
        look: the newest frame of the camera above the robots; None where there is none.
    """

    real, ahead = True, AHEAD
    name: str
    link: Connection
    look: Look | None = None

    def __init__(self, settings: WireSettings) -> None:
        self.settings, self.turns = settings, settings.turns
        self.radius, self.speed = settings.pixels(settings.radius), settings.pixels(settings.speed)
        self.tracking_error = settings.pixels(settings.tracking_error)
        self.stopped, self._stops = False, 0
        self._driving = self._closed = False
        self._others, self._late = -OTHERS, 0.0
        self.poses = Poses(settings)
        self._things: SeenThings | None = None
        self._tags: TagWatch | None = None

    @abstractmethod
    def send(
        self, drive: str, seq: int, goals: Mapping[str, Point], looks: Mapping[str, float]
    ) -> None:
        """Tell robots, by id, a point to drive straight to, in their frame.

        Args:
            drive: another one in each drive; robots disregard goals of one that was held.
            seq: rises within a drive, one for each call.
            looks: which way robots are to look where their goal is their end, radians about the x
                axis towards the y axis of their frame; for those that are to look anywhere.
        """

    @abstractmethod
    def hold(self, reason: Reason) -> None:
        """Tell all robots to hold, at once; later, surely, where they cannot be told now."""

    def begin(self, judge: Judge = all_believed) -> None:
        """Connect, and have poses come from the camera, where the file has one.

        Messages come in threads of their own: all that they touch is there before.
        """
        self.link.start()
        if self.settings.camera is not None:
            self._tags = TagWatch(self.settings.camera, self.poses, judge)
            self.look = self._tags.top_view

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        """Poses as they were seen last; robots are waited for a while when none were yet."""
        self._check_open()
        ends = time.monotonic() + WAIT
        while len(self.poses.seen()) < len(self.settings.robots) and time.monotonic() < ends:
            await asyncio.sleep(self.settings.period)
        self._check_link(self.link.joined)
        self._check_seen(math.inf if max_age is None else max_age)
        return self.poses.seen()

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Release the paths a little at a time, in their order of passage; poses as they come."""
        self._check_drive(motion.paths)
        if not motion.paths:
            return
        release = Release(motion, self)
        async with aclosing(self._steps(motion.paths, release.goals, release.looks)) as steps:
            async for poses in steps:
                yield poses
                if release.there:
                    return

    async def sightings(self) -> tuple[Sighting, ...]:
        """Where the camera sees the things that are watched; nothing without one."""
        self._check_open()
        return () if self._things is None else await self._things.sightings()

    def watch(self, picture: NDArray[np.uint8], things: Mapping[str, Outline]) -> None:
        """Look out for things from now on; see `Watcher.watch`."""
        self._things = self.look and SeenThings(self.look, picture, things)

    async def accompany(
        self, places: Callable[[], Places]
    ) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Keep robots at places that move; see `Tracker.accompany`."""
        wanted = places()
        self._check_drive(wanted)
        async with aclosing(self._steps(wanted, lambda poses: self._led(places(), poses))) as steps:
            async for poses in steps:
                yield poses

    def _led(self, places: Places, poses: tuple[Pose, ...]) -> dict[str, Point]:
        """Where robots are sent to be at places that move, in the robots' frame."""
        at, most = {pose.id: pose for pose in poses}, AHEAD * self.speed
        goals: dict[str, Point] = {}
        for robot, (x, y, u, v) in places.items():
            pose = at[robot]
            off = np.array([x + LEAD * u - pose.x, y + LEAD * v - pose.y])
            off *= min(1.0, most / max(float(np.hypot(*off)), 1e-9))
            goals[robot] = self.settings.frame.to_robots(pose.x + off[0], pose.y + off[1])
        return goals

    async def _steps(
        self,
        robots: Mapping[str, object],
        goals: Callable[[tuple[Pose, ...]], Mapping[str, Point]],
        looks: Mapping[str, float] = MappingProxyType({}),
    ) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Send robots to their goals every period, and yield the poses; at the end they hold.

        Args:
            robots: by id, those that are driven.
            goals: from the poses, in the robots' frame.
            looks: as of `send`, once the goals are known.
        """
        self._driving, stops, begun = True, self._stops, False
        drive = uuid.uuid4().hex[:12]
        try:
            await self.observe()
            if moving := await self._until_still():
                raise RobotsFailedError(
                    f"Robot {', '.join(moving)} moves, though it is not driven: hold it by hand, "
                    "and look at its watchdog.",
                    moving,
                )
            joined, due = self.link.joined, time.monotonic()
            before = due
            for seq in itertools.count(1):
                self._late = time.monotonic() - before - self.settings.period
                if self._late > LATE:
                    await asyncio.sleep(LISTENING)
                before = time.monotonic()
                poses = self.poses.seen()
                self._check_going(robots, stops, joined)
                begun = True
                self.send(drive, seq, goals(poses), looks)
                yield poses
                due = max(due + self.settings.period, time.monotonic())
                await asyncio.sleep(due - time.monotonic())
        finally:
            if begun:
                self.hold("end")
                await self._until_still()
            self._driving, self._late = False, 0.0

    async def stop(self) -> None:
        """Tell all robots to hold, at once, until `release`."""
        self.latch()
        self.hold("stop")

    async def release(self) -> None:
        """Lift the stop."""
        self.stopped = False

    async def close(self) -> None:
        """Hold the robots if they are driven, and let go of what connects them, and the camera."""
        if self._driving:
            self.hold("end")
        self._closed = True
        await asyncio.to_thread(self.link.close)
        if self._tags is not None:
            await asyncio.to_thread(self._tags.close)

    def saw_others(self) -> None:
        """Note that another program has just driven these robots."""
        self._others = time.monotonic()

    def latch(self) -> None:
        """Note that a person stopped the robots, here or elsewhere."""
        self.stopped = True
        self._stops += 1

    async def _until_still(self) -> tuple[str, ...]:
        """Wait until all robots stand, a while at most; return those that move on."""
        pause = max(3 * self.settings.period, HOLDING / 10)
        slow, before, since = 0.1 * self.speed * pause, self.poses.seen(), time.monotonic()
        middle = before
        while self.link.connected and time.monotonic() < since + HOLDING:
            await asyncio.sleep(pause)
            now = self.poses.seen()
            if any(a.seen == b.seen for a, b in zip(before, now, strict=False)):
                continue
            if not _seen_moving(before, now, max(SETTLED, slow)):
                return ()
            before = now
            if time.monotonic() < since + HOLDING / 2:
                middle = now
        return _seen_moving(middle, before, self.tracking_error)

    def _check_open(self) -> None:
        if self._closed:
            raise FleetClosedError(f"The {self.name} fleet is closed; open it again.")

    def _check_drive(self, robots: Mapping[str, object]) -> None:
        self._check_open()
        if self.stopped:
            raise FleetStoppedError(f"The {self.name} fleet is stopped; release it to drive.")
        if self._driving:
            raise FleetBusyError(f"The {self.name} fleet is driving already; wait, or stop it.")
        unknown = sorted(set(robots) - set(self.settings.robots))
        if unknown:
            raise RobotsFailedError(f"Robot {', '.join(unknown)} is not in the file.", unknown)

    def _check_link(self, joined: int) -> None:
        link = self.link
        if not link.connected or link.joined != joined:
            why = link.trouble or "the connection was lost and is back"
            if self._late > STOOD_STILL:
                why = f"the connection was lost while this program stood still ({self._late:.0f} s)"
            where, alone = self.settings.where, self.settings.alone
            raise FleetUnreachableError(
                f"{where[0].upper()}{where[1:]} is out of reach: {why}. {alone[0].upper()}"
                f"{alone[1:]}; a check of the fleet looks for the cause."
            )

    def _check_going(self, robots: Mapping[str, object], stops: int, joined: int) -> None:
        """Refuse to go on where anything is not as it has to be."""
        self._check_open()
        if self._stops != stops:
            raise FleetStoppedError(
                f"The {self.name} fleet was stopped on the way: its robots are held."
            )
        self._check_link(joined)
        if time.monotonic() - self._others < OTHERS:
            raise FleetBusyError("Another program drives these robots; end it, and drive again.")
        self._check_seen(self.settings.pose_timeout)
        failed = {r: fault for r in robots if (fault := self.poses.tracks[r].fault)}
        if failed:
            told = {robot: f"Robot {robot} cannot drive: {failed[robot]!r}." for robot in failed}
            raise RobotsFailedError(told_of(told), tuple(failed))

    def _check_seen(self, limit: float) -> None:
        old = self.poses.old(time.monotonic(), limit)
        if old:
            raise StalePosesError(
                f"{told_of(old)}{self.poses.trouble} Nothing is driven while a robot is not seen: "
                f"see to it ({len(old)} of {len(self.settings.robots)}), or take those that are "
                "away out of the file.",
                tuple(old),
            )


class Release:
    """How far robots of one drive may go by now.

    Attributes:
        looks: which way those are to look that are sent to their ends, in the robots' frame.
        there: whether all have come to their ends.
    """

    def __init__(self, motion: Motion, fleet: WireFleet) -> None:
        self._following, self._fleet = Following(motion), fleet
        self._off_path = fleet.tracking_error / 2
        self._progress = np.zeros(len(self._following.ids))
        self._ends = self._following.at(self._following.lengths)
        bends = np.sin(np.minimum(self._following.turns, np.pi / 2))
        self._stops = self._following.stops(self._off_path / np.maximum(bends, 1e-9))
        self._stood, self._since = np.full_like(self._ends, np.inf), 0.0
        looks = [motion.headings.get(robot, math.nan) for robot in self._following.ids]
        self._wanted, self._askew = np.array(looks), np.full(len(looks), np.inf)
        self.looks = dict[str, float]()
        self.there = False

    def goals(self, poses: tuple[Pose, ...]) -> dict[str, Point]:
        """What each robot is told next, in the robots' frame.

        Where it is to turn it is sent no further than there.
        """
        at, following = {pose.id: pose for pose in poses}, self._following
        points = points_of([at[robot] for robot in following.ids])
        self._progress = done = following.advance(points, self._progress, self._off_path)
        ahead = np.minimum(following.room(done, self._stops), self._fleet.ahead * self._fleet.speed)
        until = np.minimum(following.limits(done), done + ahead)
        places = following.at(until)
        self._look(points, np.array([at[robot].heading for robot in following.ids], dtype=float))
        frame = self._fleet.settings.frame
        self.looks.clear()
        for i in np.flatnonzero((until >= following.lengths - EXACT) & ~np.isnan(self._wanted)):
            look = frame.turned_back(float(self._wanted[i]))
            self.looks[following.ids[i]] = math.remainder(look, math.tau)
        spoken = [frame.to_robots(x, y) for x, y in places.tolist()]
        return dict(zip(following.ids, spoken, strict=True))

    def _look(self, points: FloatArray, headings: FloatArray) -> None:
        """Note whether robots are there, or as near as they can come."""
        askew = np.nan_to_num(abs(np.remainder(self._wanted - headings + np.pi, math.tau) - np.pi))
        off = np.linalg.norm(points - self._ends, axis=1).max()
        now = time.monotonic()
        moved = np.linalg.norm(points - self._stood, axis=1).max() > SETTLED
        if moved or abs(askew - self._askew).max() > TURNED:
            self._stood, self._askew, self._since = points, askew, now
        turned = askew.max() <= TURNED
        calm = now - self._since >= (CALM if turned else CALM_ASKEW)
        self.there = bool(
            (calm and off <= self._fleet.tracking_error) or (turned and off <= SETTLED)
        )


def _seen_moving(
    before: tuple[Pose, ...], after: tuple[Pose, ...], limit: float
) -> tuple[str, ...]:
    """Robots that were seen further away than so many px."""
    was = {pose.id: (pose.x, pose.y) for pose in before}
    return tuple(
        pose.id
        for pose in after
        if np.hypot(*np.subtract((pose.x, pose.y), was.get(pose.id, (pose.x, pose.y)))) > limit
    )
