"""Robots that are not there, on the same wire: they show what a robot has to do on its side.

They drive to the goals they are sent, say where they are, and hold when they are told to, when no
goal has come for a while, and at goals of a drive that was held.
"""

import math
import time
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from ...geometry.outline import FloatArray
from ..physics import Physics
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
        said: when that was, on this computer's clock.
        drive, seq: of it.
        over: drives that were held.
    """

    goal: Point | None = None
    said: float = 0.0
    drive: str = ""
    seq: int = -1
    over: set[str] = field(default_factory=set[str])


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
    simulator: type[Simulator] = Simulator

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
        looks = np.full(n, 0.0 if stand_in.drive == "differential" else math.nan)
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

    def go(self, name: str, drive: str, seq: int, place: Point) -> None:
        """A robot is told to go to a point of its frame; disregarded where that is not due."""
        robot = self.robots.get(name)
        if robot is None or drive in robot.over:
            return
        if drive == robot.drive and seq <= robot.seq:
            return
        if robot.goal is None:
            self._changes["driving"].append(name)
        robot.drive, robot.seq, robot.said = drive, seq, time.monotonic()
        robot.goal = self._settings.frame.to_picture(*place)

    def _starts(self) -> FloatArray:
        """Where robots stand at first, (n, 2) px."""
        given, apart = self._settings.simulated.starts, 4 * self._settings.radius
        starts = given or [(apart * (i + 1), apart) for i in range(len(self.robots))]
        return np.array([self._settings.frame.to_picture(x, y) for x, y in starts])
