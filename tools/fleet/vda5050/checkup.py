"""Looks at vehicles that speak VDA 5050: they are asked for their states, and told nothing."""

import threading
import uuid

from ..mqtt.checkup import guarded
from ..mqtt.link import Link
from ..wire.checkup import checkup
from ..wire.poses import PoseMessage, Poses
from .hearing import KINDS, Hearing, error_told
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
        if not topic.endswith("/order"):
            with lock:
                hearing.heard(topic, payload)
        elif robot := hearing.robot_of(topic):
            others.add(robot)

    def judged(robot: str, seen: PoseMessage) -> PoseMessage | str:
        with lock:
            return hearing.seen(robot, seen)

    listened = [settings.topic("+", kind) for kind in (*KINDS, "order")]
    link = Link(settings.address, listened, heard)
    guard = guarded(settings.address[2])
    told, fit = checkup(settings, link, poses, others, seconds, guard, judged)
    told[-1:-1] = [
        f"Robot {robot} says: {error_told(error)}."
        for robot, vehicle in hearing.vehicles.items()
        for error in (vehicle.state or {}).get("errors", [])
    ]
    return told, fit
