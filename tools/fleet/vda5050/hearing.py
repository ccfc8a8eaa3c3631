"""What vehicles say of themselves: their places go to `Poses`, with why they cannot drive.

A place is believed only while the state of the vehicle is known too: one that says where it is,
and not whether a person has switched it to manual, is not seen.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from ..wire.poses import PoseMessage, Poses
from .messages import read
from .settings import Vda5050Settings
from .spec import Dialect

KINDS = ("state", "visualization", "connection")
STATE_AGE = 35.0
"""A state comes every 30 s at the latest; after so many it is not known."""
ASK_AGAIN = 1.0
MOST_WORDS, MOST_OF_VERSION = 200, 20


@dataclass
class Heard:
    """One vehicle as it was heard of.

    Attributes:
        state: its last message of that kind; None before.
        position: the last it said of where it is.
        link: what was said last of its connection; it is taken to be on-line before.
        order: what hinders the order that it was given; None for nothing.
        headers: the last number of each kind of message.
    """

    state: dict[str, Any] | None = None
    position: dict[str, Any] | None = None
    link: str = "ONLINE"
    order: str | None = None
    headers: dict[str, int] = field(default_factory=dict[str, int])
    stated: float = -math.inf
    spoke: float = -math.inf
    asked: float = -math.inf
    believed: int = 0


class Hearing:
    """Takes in what vehicles say.

    Args:
        ask: is given a robot that is to be asked for its state.

    Attributes:
        vehicles: by the ids of the robots.
    """

    def __init__(
        self, settings: Vda5050Settings, poses: Poses, ask: Callable[[str], object]
    ) -> None:
        self._settings, self._poses, self._ask = settings, poses, ask
        self._robots = {settings.named(robot): robot for robot in settings.robots}
        self.vehicles = {robot: Heard() for robot in settings.robots}

    def forget(self) -> None:
        """Know nothing, as `Poses.forget`."""
        self.vehicles = {robot: Heard() for robot in self.vehicles}
        self._poses.forget()

    def robot_of(self, topic: str) -> str | None:
        """The robot that a topic belongs to; None where it is none of the file."""
        maker, serial = topic.split("/")[-3:-1]
        return self._robots.get((maker, serial))

    def heard(self, topic: str, payload: bytes) -> str | None:
        """Take in a message; the robot, where it is believed."""
        now, kind = time.monotonic(), topic.rpartition("/")[2]
        robot = self.robot_of(topic)
        if robot is None:
            self._poses.heard("/".join(topic.split("/")[-3:-1]), None, now)
            return None
        message = read(self._settings.version, kind, payload)
        if message is None or not self._its_own(robot, message):
            self._poses.heard(robot, in_another_version(self._settings, payload), now)
            return None
        vehicle = self.vehicles[robot]
        if kind == "connection":
            vehicle.link = message["connectionState"]
        elif not self._in_order(vehicle, kind, message["headerId"], now):
            self._poses.heard(robot, "out of order", now)
            return None
        if kind == "state":
            vehicle.state, vehicle.stated = message, now
        elif not self._stated(robot, now):
            return None
        self._place(robot, message.get(self._settings.dialect.position), now)
        return robot

    def seen(self, robot: str, said: PoseMessage) -> PoseMessage | str:
        """What is believed of a vehicle that a camera sees: nothing without its state."""
        if not self._stated(robot, time.monotonic()):
            return "without a state"
        return said.model_copy(update={"fault": self._poses.tracks[robot].fault})

    def judge(self, robot: str) -> str | None:
        """Note anew, and say, why a vehicle cannot drive; None if it can."""
        vehicle = self.vehicles[robot]
        words = [] if vehicle.link == "ONLINE" else [f"connection {vehicle.link}"]
        words += hindrances(self._settings.dialect, vehicle.state or {})
        words += self._doubts(vehicle.position) if vehicle.position else []
        words += [vehicle.order] if vehicle.order else []
        found = "; ".join(words)[:MOST_WORDS] or None
        self._poses.tracks[robot].fault = found
        return found

    def _stated(self, robot: str, now: float) -> bool:
        """Whether the state of a vehicle is known; where it is not, it is asked for."""
        vehicle = self.vehicles[robot]
        known = now - vehicle.stated <= STATE_AGE
        if not known and now - vehicle.asked > ASK_AGAIN:
            vehicle.asked = now
            self._ask(robot)
        return known

    def _its_own(self, robot: str, message: Mapping[str, Any]) -> bool:
        """Whether a message has a header, and that of the robot whose topic it came in."""
        named = message.get("manufacturer"), message.get("serialNumber")
        version = str(message.get("version")).partition(".")[0]
        right = f"v{version}" == self._settings.dialect.level
        return right and named == self._settings.named(robot) and "headerId" in message

    def _in_order(self, vehicle: Heard, kind: str, number: int, now: float) -> bool:
        """Whether a message is newer than those of its kind; after a silence they count anew."""
        if now - vehicle.spoke > self._settings.pose_timeout:
            vehicle.headers.clear()
        newer = number > vehicle.headers.get(kind, -1)
        if newer:
            vehicle.headers[kind], vehicle.spoke = number, now
        return newer

    def _place(self, robot: str, position: dict[str, Any] | None, now: float) -> None:
        vehicle = self.vehicles[robot]
        vehicle.position = position or vehicle.position
        fault = self.judge(robot)
        if position is None or self._doubts(position) or self._settings.camera is not None:
            return
        vehicle.believed += 1
        x, y, heading = position["x"], position["y"], position["theta"]
        try:
            said = PoseMessage(seq=vehicle.believed, x=x, y=y, heading=heading, fault=fault)
        except ValidationError:
            self._poses.heard(robot, None, now)
        else:
            self._poses.heard(robot, said, now)

    def _doubts(self, position: Mapping[str, Any]) -> list[str]:
        """Why a place is none in the robots' frame, and so no news of where a robot is."""
        located, words = self._settings.dialect.located, list[str]()
        if not position[located]:
            words.append(f"not localised ({located} is false)")
        if (where := position["mapId"]) != self._settings.map:
            words.append(f"on the map {where!r}, not {self._settings.map!r}")
        return words


def in_another_version(settings: Vda5050Settings, payload: bytes) -> str | None:
    """Why a message is not believed, if its header says another version than the file."""
    try:
        version = str(json.loads(payload)["version"])[:MOST_OF_VERSION]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    other = version.partition(".")[0] != settings.version.partition(".")[0]
    return f"in VDA 5050 {version}, where the file says {settings.version}" if other else None


def hindrances(dialect: Dialect, state: Mapping[str, Any]) -> list[str]:
    """Why a vehicle cannot drive, by its state; refused orders aside."""
    words: list[str] = []
    if (mode := state.get("operatingMode", "AUTOMATIC")) != "AUTOMATIC":
        words.append(f"operating mode {mode}")
    safety = state.get("safetyState", {})
    if (stop := safety.get(dialect.emergency, "NONE")) != "NONE":
        words.append(f"emergency stop ({dialect.emergency} {stop})")
    if safety.get("fieldViolation"):
        words.append("protective field violated (fieldViolation)")
    if state.get("paused"):
        words.append("paused")
    if state.get(dialect.power, {}).get("charging"):
        words.append("charging")
    errors = state.get("errors", [])
    grave = [e for e in errors if e["errorLevel"] in dialect.grave]
    return words + [error_told(e) for e in grave if e["errorType"] not in dialect.refused]


def error_told(error: Mapping[str, Any]) -> str:
    """An error in words."""
    more = f": {error['errorDescription']}" if error.get("errorDescription") else ""
    return f"{error['errorType']} ({error['errorLevel']}){more}"
