"""Stand-ins for robots that speak plain JSON over MQTT."""

from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

from ..wire.fleet import Point
from ..wire.stand_in import StandIns
from .link import Link
from .messages import GoalMessage
from .settings import MqttSettings


class MqttStandIns(StandIns):
    """Simulated robots on MQTT; see `StandIns`."""

    def __init__(self, settings: MqttSettings, told: Callable[[str], None]) -> None:
        super().__init__(settings, told)
        self._topics, self._robot_of = settings.topics, settings.robot_of
        listened = self._topics.goal.replace("{robot}", "+"), self._topics.hold
        self.link = self._link = Link(settings.address, listened, self._heard)
        self._link.start()

    def say(self, robot: str, place: Point) -> None:
        """Say where a robot is seen; see `StandIns.say`."""
        message = self._message(robot, place)
        if message is not None:
            self._link.say(self._topics.pose.replace("{robot}", robot), message)

    def _message(self, robot: str, place: Point) -> dict[str, Any] | None:
        """What a robot says; None for nothing."""
        said = {"seq": self.seq, "x": round(place[0], 6), "y": round(place[1], 6)}
        looks = self.heading(robot)
        return said if looks is None else {**said, "heading": round(looks, 6)}

    def _heard(self, topic: str, payload: bytes) -> None:
        if topic == self._topics.hold:  # whatever it says
            self.hold(self.robots)
            return
        try:
            goal = GoalMessage.model_validate_json(payload)
        except ValidationError:
            return
        robot = self._robot_of(topic, self._topics.goal) or ""
        self.go(robot, goal.drive, goal.seq, (goal.x, goal.y), goal.heading)
