"""Robots that are not there, on the same wire: they show what a robot has to do on its side.

They drive to the goals they are sent, say where they are, and hold at any message to hold, when no
goal has come for a while, and at goals of a drive that was held.
"""

import math
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ...geometry.outline import FloatArray
from ..physics import Physics
from ..simulator import PERIOD, Simulator
from .link import Link
from .settings import MqttSettings

FULL_SPEED = 0.25
"""Seconds in which they come to their speed."""


class GoalMessage(BaseModel):
    """Where a robot is to go, straight.

    Attributes:
        drive: names the drive it belongs to; after a hold, goals of the same drive are not obeyed.
        seq: a number that rises within a drive; what comes later with a lower one is not obeyed.
        x, y: in the robots' frame.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False)
    drive: str = Field(max_length=100)
    seq: int
    x: float
    y: float


@dataclass
class Robot:
    """What one robot has been told.

    Attributes:
        goal: px; None while it holds.
        said: when that was, on this computer's clock.
        drive, seq: of it.
        over: drives that were held.
    """

    goal: tuple[float, float] | None = None
    said: float = 0.0
    drive: str = ""
    seq: int = 0
    over: set[str] = field(default_factory=set[str])


class StandIns:
    """Simulated robots on MQTT.

    Args:
        told: is given, in words, which robots drive and which hold, whenever that changes.

    Attributes:
        points: where they truly are, (n, 2) px.
    """

    def __init__(self, settings: MqttSettings, told: Callable[[str], None]) -> None:
        self._settings, self._told = settings, told
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
        self._sim = Simulator(settings.robots, self._starts(), looks, physics)
        self._sim.accompany(settings.robots)
        self._seq = 0
        self._changes: dict[str, list[str]] = defaultdict(list)
        topics = settings.topics
        listened = topics.goal.replace("{robot}", "+"), topics.hold
        self.link = Link(settings.address, listened, self._heard)

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
        self._seq += 1
        for i, name in enumerate(self.robots):
            message = self._message(i)
            if message is not None:
                self.link.say(self._settings.topics.pose.replace("{robot}", name), message)
        for what, names in [*self._changes.items()]:
            self._told(f"{what}: {', '.join(names)}")
        self._changes.clear()

    def close(self) -> None:
        """Leave the wire."""
        self.link.close()

    def _message(self, i: int) -> dict[str, object] | None:
        """What a robot says; None where it is not seen."""
        if self._sim.seen[i] < self._sim.now:
            return None
        x, y = self._settings.frame.to_robots(*self._sim.sensed[i].tolist())
        return {"seq": self._seq, "x": round(x, 6), "y": round(y, 6)}

    def _heard(self, topic: str, payload: bytes) -> None:
        if topic == self._settings.topics.hold:  # whatever it says
            for name, robot in self.robots.items():
                robot.over.add(robot.drive)
                if robot.goal is not None:
                    robot.goal = None
                    self._changes["told to hold"].append(name)
            return
        name = self._settings.robot_of(topic, self._settings.topics.goal) or ""
        robot = self.robots.get(name)
        try:
            goal = GoalMessage.model_validate_json(payload)
        except ValidationError:
            return
        if robot is None or goal.drive in robot.over:
            return
        if goal.drive == robot.drive and goal.seq <= robot.seq:
            return
        if robot.goal is None:
            self._changes["driving"].append(name)
        robot.drive, robot.seq, robot.said = goal.drive, goal.seq, time.monotonic()
        robot.goal = self._settings.frame.to_picture(goal.x, goal.y)

    def _starts(self) -> FloatArray:
        """Where robots stand at first, (n, 2) px."""
        given, apart = self._settings.simulated.starts, 4 * self._settings.radius
        starts = given or [(apart * (i + 1), apart) for i in range(len(self.robots))]
        return np.array([self._settings.frame.to_picture(x, y) for x, y in starts])
