"""Robots that are not there, on the same wire: they show what a robot has to do on its side.

They drive to the goals they are sent, say where they are, and hold when they are told to, when no
goal has come for a while, and at goals of a drive that was held.
"""

import math
import time
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...geometry.outline import FloatArray
from ..physics import Physics, braking_speed
from ..simulator import PERIOD, Simulator
from .fleet import Connection, Point
from .settings import WireSettings

FULL_SPEED = 0.25
"""Seconds in which they come to their speed."""


@dataclass
class Robot:
    """What one robot has been told.

    Attributes:
        goal: px; None while it holds.
        look: which way it is to look there, radians, clockwise in the picture; None for any.
        said: when that was, on this computer's clock.
        drive, seq: of it.
        over: drives that were held.
    """

    goal: Point | None = None
    look: float | None = None
    said: float = 0.0
    drive: str = ""
    seq: int = -1
    over: set[str] = field(default_factory=set[str])


class Turning(Simulator):
    """Robots that keep up with places, and turn where they stand."""

    def look(self, looks: Sequence[float | None]) -> None:
        """Turn to headings from now on; None for any."""
        self._looks = np.array(looks, dtype=float)

    def _kept_up(self, places: FloatArray) -> FloatArray:
        told = super()._kept_up(places)
        if self._wheels:
            radius, change = self.physics.radius, self._push * PERIOD
            off = np.remainder(self._looks - self.headings + np.pi, math.tau) - np.pi
            turning = (abs(told[:, 0]) <= change / 4) & ~np.isnan(off)
            about = braking_speed(radius * abs(off[turning]), self._push, self._smoothing)
            about = np.minimum(about, self.physics.speed / 2) * np.sign(off[turning]) / radius
            told[turning] = np.column_stack([np.zeros(len(about)), about])
        return told


class StandIns(ABC):
    """Simulated robots on a wire; how they are spoken to is up to who derives from it.

    Args:
        told: is given, in words, which robots drive and which hold, whenever that changes.

    Attributes:
        robots: what each has been told, by id.
        seq: how many times they have spoken.
        link: what connects them; to be set before they run.
        simulator: what moves them.
    """

    link: Connection
    simulator: type[Turning] = Turning

    def __init__(self, settings: WireSettings, told: Callable[[str], None]) -> None:
        self._settings, self._told, self.seq = settings, told, 0
        self.robots = {robot: Robot() for robot in settings.robots}
        speed, stand_in = settings.pixels(settings.speed), settings.simulated
        physics = Physics(
            drive=stand_in.drive,
            speed=speed,
            acceleration=speed / FULL_SPEED,
            radius=settings.pixels(settings.radius),
            stuck=stand_in.stuck,
            lost=stand_in.lost,
        )
        n = len(self.robots)
        has_heading = settings.turns or stand_in.drive == "differential"
        looks = np.full(n, 0.0 if has_heading else math.nan)
        self._sim = self.simulator(settings.robots, self._starts(), looks, physics)
        self._sim.accompany(settings.robots)
        self._changes: dict[str, list[str]] = defaultdict(list)

    @abstractmethod
    def say(self, robot: str, place: Point) -> None:
        """Say where a robot is seen, in the robots' frame."""

    @property
    def points(self) -> FloatArray:
        """Where they truly are, (n, 2) px."""
        return self._sim.points

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Go on, in real time."""
        due = time.monotonic()
        while not until():
            self.step()
            due = max(due + PERIOD, time.monotonic() - PERIOD)
            time.sleep(max(due - time.monotonic(), 0.0))

    def step(self) -> None:
        """Let a step of time pass, and say where robots are."""
        now, limit = time.monotonic(), self._settings.watchdog
        for name, robot in self.robots.items():
            if robot.goal is not None and now - robot.said > limit:
                robot.goal = None
                self._changes[f"no goal came for {limit:g} s: held"].append(name)
        here = self._sim.points.tolist()
        goals = [r.goal or at for r, at in zip(self.robots.values(), here, strict=True)]
        self._sim.look([r.look if r.goal else None for r in self.robots.values()])
        self._sim.step(np.hstack([np.array(goals), np.zeros((len(goals), 2))]))
        self.seq += 1
        for i, name in enumerate(self.robots):
            if self._sim.seen[i] >= self._sim.now:  # else it is not seen
                self.say(name, self._settings.frame.to_robots(*self._sim.sensed[i].tolist()))
        for what, names in [*self._changes.items()]:
            self._told(f"{what}: {', '.join(names)}")
        self._changes.clear()

    def close(self) -> None:
        """Leave the wire."""
        self.link.close()

    def hold(self, robots: Iterable[str]) -> None:
        """Robots are told to hold: they do, and go on only in another drive."""
        for name in robots:
            robot = self.robots[name]
            robot.over.add(robot.drive)
            if robot.goal is not None:
                robot.goal = None
                self._changes["told to hold"].append(name)

    def heading(self, robot: str) -> float | None:
        """How a robot looks, radians about the x axis towards the y axis of its frame."""
        looks = float(self._sim.headings[[*self.robots].index(robot)])
        if math.isnan(looks):
            return None
        return math.remainder(self._settings.frame.turned_back(looks), math.tau)

    def go(self, name: str, drive: str, seq: int, place: Point, look: float | None = None) -> None:
        """A robot is told to go to a point of its frame, and how to look there.

        Disregarded where that is not due.
        """
        robot = self.robots.get(name)
        if robot is None or drive in robot.over:
            return
        if drive == robot.drive and seq <= robot.seq:
            return
        if robot.goal is None:
            self._changes["driving"].append(name)
        robot.drive, robot.seq, robot.said = drive, seq, time.monotonic()
        robot.goal = self._settings.frame.to_picture(*place)
        robot.look = None if look is None else self._settings.frame.turned(look)

    def _starts(self) -> FloatArray:
        """Where robots stand at first, (n, 2) px."""
        given, apart = self._settings.simulated.starts, 4 * self._settings.radius
        starts = given or [(apart * (i + 1), apart) for i in range(len(self.robots))]
        return np.array([self._settings.frame.to_picture(x, y) for x, y in starts])
