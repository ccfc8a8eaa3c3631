"""Looks at robots that speak plain JSON over MQTT, without telling them anything."""

import os
import time

from ..wire.checkup import checkup
from ..wire.poses import Poses
from .link import Link
from .messages import pose_message
from .settings import MqttSettings


def checked(settings: MqttSettings, seconds: float) -> tuple[list[str], bool]:
    """What is to be told, and whether all could be driven, after listening for so many seconds.

    Raises:
        InputError: as of `Link`.
    """
    poses, others, topics = Poses(settings), set[str](), settings.topics

    def heard(topic: str, payload: bytes) -> None:
        robot = settings.robot_of(topic, topics.pose)
        if robot is None:
            others.add(settings.robot_of(topic, topics.goal) or "")
        elif settings.camera is None:
            poses.heard(robot, pose_message(payload), time.monotonic())

    listened = [pattern.replace("{robot}", "+") for pattern in (topics.pose, topics.goal)]
    link, guard = Link(settings.address, listened, heard), guarded(settings.address[2])
    return checkup(settings, link, poses, others, seconds, guard)


def guarded(secure: bool) -> str:
    """How a link to a broker is guarded, in words."""
    if not secure:
        return ", in the clear: whoever is on the way can read and steer"
    named = "with" if os.environ.get("FORMUP_MQTT_USERNAME") else "without"
    return f" over TLS, {named} a name to log in"
