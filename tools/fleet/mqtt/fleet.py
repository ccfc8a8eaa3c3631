"""The fleet of robots that speak plain JSON over MQTT."""

import json
import time
from collections.abc import Mapping

from ..described import described_for
from ..protocol import FleetRequest
from ..wire.fleet import Point, Reason, WireFleet
from .link import Link
from .messages import pose_message
from .settings import MqttSettings


def _holding(reason: Reason) -> dict[str, str]:
    return {"reason": reason}


OF_PROGRAMS = [json.dumps(_holding(reason)).encode() for reason in ("end", "gone")]
"""Messages to hold that no person sent: a drive of another program ended."""


class MqttFleet(WireFleet):
    """Robots on MQTT, as a file describes them."""

    name = "mqtt"

    def __init__(self, settings: MqttSettings) -> None:
        super().__init__(settings)
        self._topics, self._robot_of = settings.topics, settings.robot_of
        patterns = (self._topics.pose, self._topics.goal)
        listened = [*(p.replace("{robot}", "+") for p in patterns), self._topics.hold]
        will = self._topics.hold, _holding("gone"), False
        self.link = self._link = Link(
            settings.address, listened, self._heard, will=will, left=self.poses.forget
        )
        self.begin()

    def send(
        self, drive: str, seq: int, goals: Mapping[str, Point], looks: Mapping[str, float]
    ) -> None:
        """Tell robots where to go; see `WireFleet.send`."""
        for robot, (x, y) in goals.items():
            message: dict[str, str | float] = {"drive": drive, "seq": seq}
            message |= {"x": round(x, 6), "y": round(y, 6)}
            if robot in looks:
                message["heading"] = round(looks[robot], 6)
            self._link.say(self._topics.goal.replace("{robot}", robot), message)

    def hold(self, reason: Reason) -> None:
        """Tell all robots to hold; see `WireFleet.hold`."""
        self._link.say(self._topics.hold, _holding(reason), surely=True)

    def _heard(self, topic: str, payload: bytes) -> None:
        if (robot := self._robot_of(topic, self._topics.pose)) is not None:
            if self.settings.camera is None:
                self.poses.heard(robot, pose_message(payload), time.monotonic())
        elif topic != self._topics.hold or payload in OF_PROGRAMS:
            self.saw_others()
        else:  # a person stopped the robots elsewhere
            self.latch()


def open_fleet(request: FleetRequest) -> MqttFleet:
    """The robots of the file that was given.

    Raises:
        InputError: it does not describe robots on MQTT, or its camera has not seen the picture.
    """
    return MqttFleet(described_for(MqttSettings, request))
