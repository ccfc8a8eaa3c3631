"""Stand-ins for robots that run ROS 2, and for the bridge to them."""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ...geometry.outline import FloatArray
from ..simulator import PERIOD
from ..wire.fleet import Point
from ..wire.stand_in import StandIns, Turning
from .bridge import StandInBridge
from .link import Message
from .messages import CANCEL, goal_of, look_of, stamped
from .settings import RosSettings

GAP = 4
"""After a hold, goals are disregarded until none has come for so many periods: those on their way
belong to what was held."""
THERE = 0.25
"""Nav2's goal is reached within so many px."""
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


class _Told(Turning):
    """Robots with wheels that are told speeds, not places.

    Attributes:
        told: (n, 2) px per second ahead, and radians per second, clockwise in the picture.
    """

    told: FloatArray

    def _kept_up(self, places: FloatArray) -> FloatArray:
        return self.told.copy()


class RosStandIns(StandIns):
    """Simulated robots behind a stand-in bridge; see `StandIns`."""

    def __init__(self, settings: RosSettings, told: Callable[[str], None]) -> None:
        stood_in, by = settings.simulated, settings.drive_by
        if by == "cmd_vel":
            self.simulator = _Told
            stood_in = stood_in.model_copy(update={"drive": "differential"})
        # Nav2 has no watchdog: it goes on to the goal that it has.
        watchdog = math.inf if by == "nav2" else settings.watchdog
        changed = {"simulated": stood_in, "watchdog": watchdog}
        super().__init__(settings.model_copy(update=changed), told)
        self._ros, self._number = settings, 0
        self._drives: dict[str, tuple[str, float]] = {}
        self._rates = dict.fromkeys(settings.robots, (0.0, 0.0))
        self._acting: dict[str, tuple[str, str]] = {}
        self._row = {robot: i for i, robot in enumerate(settings.robots)}
        self._topics = {robot: topic for topic, robot in settings.poses.items()}
        self._goals = settings.goals
        self.link = self._bridge = StandInBridge(settings.address, self._heard)
        self._bridge.start()

    def step(self) -> None:
        """Let a step of time pass; see `StandIns.step`."""
        if isinstance(self._sim, _Told):
            driven = [self.robots[robot].goal is not None for robot in self._rates]
            rates = np.array([*self._rates.values()]) * np.array(driven)[:, None]
            side = math.copysign(1.0, self._ros.frame.turned(1.0) - self._ros.frame.turned(0.0))
            self._sim.told = rates * (1 / self._ros.frame.metres_per_pixel, side)
        super().step()
        for robot, (goal, action) in [*self._acting.items()]:
            aim = self.robots[robot].goal
            if aim is not None and math.dist(aim, self.points[self._row[robot]]) <= THERE:
                self._result(robot, goal, action, SUCCEEDED)

    def say(self, robot: str, place: Point) -> None:
        """Say where a robot is seen; see `StandIns.say`."""
        message = self._message(robot, place)
        if message is not None:
            self._bridge.publish(self._topics[robot], message)

    def _message(self, robot: str, place: Point) -> dict[str, Any] | None:
        """What a robot says; None for nothing."""
        message = stamped(self._ros.frame_id, place, self.heading(robot))
        sec, nanosec = divmod(round(self.seq * PERIOD * 1e9), 10**9)  # clocks of their own
        message["header"]["stamp"] = {"sec": sec, "nanosec": nanosec}
        if self._ros.pose_type.endswith("Odometry"):
            message["pose"] = {"pose": message["pose"]}
        return message

    def _heard(self, message: Message) -> None:
        op, topic = message.get("op"), str(message.get("topic"))
        if op == "publish" and topic == self._ros.topics.hold:  # whatever it says
            if self._ros.drive_by == "pose":
                self.hold(self.robots)
        elif op == "publish" and topic in self._goals:
            self._goes(self._goals[topic], message.get("msg"))
        elif op == "send_action_goal":
            self._acts(message)
        elif op in ("cancel_action_goal", "call_service"):
            for robot, (goal, action) in [*self._acting.items()]:
                if goal == message.get("id") or f"{action}{CANCEL}" == message.get("service"):
                    self.hold([robot])
                    self._result(robot, goal, action, CANCELED)

    def _goes(self, robot: str, message: Any) -> None:
        told = goal_of(message)
        if told is None:
            return
        now, by = time.monotonic(), self._ros.drive_by
        if by == "cmd_vel":
            self._rates[robot], told = (
                told,
                self._ros.frame.to_robots(*self.points[self._row[robot]]),
            )
        drive, last = self._drives.get(robot, ("", -math.inf))
        self._number += 1
        if by == "cmd_vel" or now - last > GAP * self._ros.period:
            drive = str(self._number)
        self._drives[robot] = drive, now
        self.go(robot, drive, self._number, told, self._look_of(message))

    def _acts(self, message: Message) -> None:
        goal, action = str(message.get("id")), str(message.get("action"))
        args: Any = message.get("args") or {}
        pose = args.get("pose")
        robot, told = self._goals.get(action), goal_of(pose)
        if robot is None or told is None:
            return
        if robot in self._acting:
            self._result(robot, *self._acting[robot], ABORTED)
        self._acting[robot] = goal, action
        self.go(robot, goal, 0, told, self._look_of(pose))

    def _look_of(self, message: Any) -> float | None:
        return look_of(message) if self._ros.turns else None

    def _result(self, robot: str, goal: str, action: str, status: int) -> None:
        del self._acting[robot]
        done = {"op": "action_result", "id": goal, "action": action, "status": status}
        self._bridge.say({**done, "result": True})
