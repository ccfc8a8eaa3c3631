"""What ROS has to say of poses and velocities, in the JSON of rosbridge."""

import math
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from ..wire.fleet import Point
from ..wire.poses import PoseMessage
from .settings import RosSettings

SHOWN = 40
"""Characters of a foreign frame's name that are told."""
UNIT_OFF = 0.1
"""How far the length of a quaternion may be from 1; one of zeros says that it is not known."""
HOLD = "std_msgs/msg/String"
CANCEL = "/_action/cancel_goal"
"""After the name of an action, that of the service which cancels its goals."""


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Stamp(_Part):
    sec: int = Field(ge=0, lt=2**32)
    nanosec: int = Field(ge=0, lt=10**9)


class _Header(_Part):
    stamp: _Stamp
    frame_id: str


class _Position(_Part):
    x: float
    y: float


class _Quaternion(_Position):
    z: float
    w: float


class _Pose(_Part):
    position: _Position
    orientation: _Quaternion


class _Covaried(_Part):
    pose: _Pose


class _Report(_Part):
    """PoseStamped, or as much of Odometry."""

    header: _Header
    pose: _Pose | _Covaried


def pose_message(
    message: object, settings: RosSettings, fault: str | None = None
) -> PoseMessage | str:
    """What a robot says of itself, or why that is not believed.

    The time it was stamped with is its number, and nothing else: robots' clocks are not read.

    Args:
        message: PoseStamped or Odometry.
        fault: why the robot cannot drive, if that is known.
    """
    try:
        report = _Report.model_validate(message)
        frame = report.header.frame_id.removeprefix("/")  # as ROS 1 wrote it
        if frame != settings.frame_id:
            return f"in the frame {frame[:SHOWN]!r}, not {settings.frame_id!r}"
        pose = report.pose.pose if isinstance(report.pose, _Covaried) else report.pose
        heading = _yaw(pose.orientation)
        if heading is None and settings.drive_by == "cmd_vel":
            return "without a heading"
        return PoseMessage(
            seq=report.header.stamp.sec * 10**9 + report.header.stamp.nanosec,
            x=pose.position.x,
            y=pose.position.y,
            heading=heading,
            fault=fault,
        )
    except ValueError:
        return "malformed"


def stamped(frame_id: str, place: Point, heading: float | None = 0.0) -> dict[str, Any]:
    """A PoseStamped; the bridge stamps it."""
    half, known = (heading or 0.0) / 2, heading is not None
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half) if known else 0.0}
    position = {"x": round(place[0], 6), "y": round(place[1], 6), "z": 0.0}
    return {
        "header": {"frame_id": frame_id},
        "pose": {"position": position, "orientation": turned},
    }


def twist(velocity: Point) -> dict[str, Any]:
    """A Twist of a speed ahead and a turn rate."""
    ahead, about = (round(value, 6) for value in velocity)
    return {
        "linear": {"x": ahead, "y": 0.0, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": about},
    }


def goal_of(message: Any) -> Point | None:
    """Where a PoseStamped sends a robot, or the velocity that a Twist demands; None of neither."""
    try:
        if "pose" in message:
            place = message["pose"]["position"]
            found = float(place["x"]), float(place["y"])
        else:
            found = float(message["linear"]["x"]), float(message["angular"]["z"])
    except (KeyError, TypeError, ValueError):
        return None
    return found if all(map(math.isfinite, found)) else None


def look_of(message: Any) -> float | None:
    """Which way a PoseStamped has a robot look; None of others."""
    try:
        return _yaw(_Quaternion.model_validate(message["pose"]["orientation"]))
    except (KeyError, TypeError, ValueError):
        return None


def hold_of(message: Any) -> str:
    """Why all are to hold, as the message has it, which may be anything."""
    try:
        return str(message["data"])
    except (KeyError, TypeError):
        return ""


def _yaw(q: _Quaternion) -> float | None:
    size = math.hypot(q.x, q.y, q.z, q.w)
    if size == 0:
        return None
    if abs(size - 1) > UNIT_OFF:
        raise ValueError(f"a quaternion has the length 1, not {size:g}")
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
