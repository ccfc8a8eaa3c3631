"""Looks at vehicles that speak VDA 5050: they are asked for their states, and told nothing."""

import threading
import time
import uuid

from ..mqtt.checkup import guarded
from ..mqtt.link import Link
from ..wire.checkup import checkup
from ..wire.poses import PoseMessage, Poses
from .hearing import KINDS, Hearing, error_told, in_another_version
from .messages import Writer, action
from .settings import Vda5050Settings


def checked(settings: Vda5050Settings, seconds: float) -> tuple[list[str], bool]:
    """What is to be told, and whether all could be driven, after listening for so many seconds.

    Raises:
        InputError: as of `Link`.
    """
    poses, others, writer = Poses(settings), set[str](), Writer(settings)
    lock = threading.RLock()

    def ask(robot: str) -> None:
        body = {"actions": [action("stateRequest", uuid.uuid4().hex)]}
        message = writer.message(robot, "instantActions", body)
        link.say(settings.topic(robot, "instantActions"), message)

    hearing = Hearing(settings, poses, ask)

    def heard(topic: str, payload: bytes) -> None:
        if (level := topic.split("/")[1]) != settings.dialect.level:
            if robot := hearing.robot_of(topic):
                why = in_another_version(settings, payload) or f"in topics of {level}"
                poses.heard(robot, why, time.monotonic())
        elif not topic.endswith("/order"):
            with lock:
                hearing.heard(topic, payload)
        elif robot := hearing.robot_of(topic):
            others.add(robot)

    def judged(robot: str, seen: PoseMessage) -> PoseMessage | str:
        with lock:
            return hearing.seen(robot, seen)

    listened = [f"{settings.interface}/+/+/+/{kind}" for kind in (*KINDS, "order")]
    link = Link(settings.address, listened, heard)
    guard = guarded(settings.address[2])
    told, fit = checkup(settings, link, poses, others, seconds, guard, judged)
    told[-1:-1] = [
        f"Robot {robot} says: {error_told(error)}."
        for robot, vehicle in hearing.vehicles.items()
        for error in (vehicle.state or {}).get("errors", [])
        if error["errorType"] != settings.dialect.idle  # it was told to hold, and stood already
    ]
    return told, fit
