"""What a file says of robots that run ROS 2 beside what it says of all that are elsewhere: the
bridge, the topics, and what robots are driven by."""

import re
from collections.abc import Mapping
from typing import Annotated, Literal, Self
from urllib.parse import urlsplit

from pydantic import Field, StringConstraints, field_validator, model_validator

from ...formation.value import Value
from ..moving import Above0
from ..wire.settings import WireSettings

PORT = 9090
NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
DriveBy = Literal["pose", "cmd_vel", "nav2"]
GOALS: Mapping[DriveBy, tuple[str, str]] = {
    "pose": ("/{robot}/goal_pose", "geometry_msgs/msg/PoseStamped"),
    "cmd_vel": ("/{robot}/cmd_vel", "geometry_msgs/msg/Twist"),
    "nav2": ("/{robot}/navigate_to_pose", "nav2_msgs/action/NavigateToPose"),
}
"""Where goals go if a file does not say, and their type."""
Name = Annotated[str, StringConstraints(max_length=200)]


class RosTopics(Value):
    """Absolute names of topics, with `{robot}` where a robot's id is.

    Attributes:
        pose: where robots are.
        goal: where they are to go, the velocities that they are to have, or an action's name; left
            out, /{robot}/goal_pose, /{robot}/cmd_vel or /{robot}/navigate_to_pose.
        hold: tells all robots to hold (std_msgs/String).
    """

    pose: Name = "/{robot}/pose"
    goal: Name | None = None
    hold: Name = "/formup/hold"


class RosSettings(WireSettings):
    """Robots that run ROS 2, behind a rosbridge; lengths are metres.

    Attributes:
        bridge: ws://HOST:PORT of rosbridge, or wss:// for TLS.
        drive_by: what they are sent: poses just ahead of them, velocities, or goals of Nav2.
        pose_type: what they say where they are with.
        frame_id: of all poses, theirs and those they are sent.
        topics: where messages go.
        turn_speed: the greatest that is sent, by velocities alone, radians per second.
    """

    bridge: Annotated[str, Field(max_length=300)]
    drive_by: DriveBy = "pose"
    pose_type: Annotated[
        str,
        StringConstraints(pattern=r"^(geometry_msgs/(msg/)?PoseStamped|nav_msgs/(msg/)?Odometry)$"),
    ] = "geometry_msgs/msg/PoseStamped"
    frame_id: Annotated[str, StringConstraints(min_length=1, max_length=100)] = "map"
    topics: RosTopics = RosTopics()
    turn_speed: Above0 = 1.0

    @field_validator("bridge")
    @classmethod
    def _is_address(cls, bridge: str) -> str:
        parts = urlsplit(bridge)
        if "@" in parts.netloc:
            raise ValueError("leave out who logs in: rosbridge for ROS 2 asks for nobody's name")
        if parts.scheme not in ("ws", "wss") or not parts.hostname:
            raise ValueError(f"give ws://HOST:PORT, or wss:// for TLS, got {bridge!r}")
        if parts.port == 0:  # looking at it raises where it is no number
            raise ValueError("a port is 1 to 65535, got 0")
        return bridge

    @model_validator(mode="after")
    def _names_are_names(self) -> Self:
        if "frame" not in self.model_fields_set and self.camera is None:
            raise ValueError(
                "say in `frame` how the map lies in the picture: metres_per_pixel, origin"
            )
        names = [*self.poses, *self.goals, self.topics.hold]
        for name in names:
            if not NAME.fullmatch(name):
                raise ValueError(f"{name!r} is no name of ROS, such as /r1/pose")
        if len(set(names)) < 2 * len(self.robots) + 1:
            raise ValueError("topics have to differ, and pose and goal to have {robot} in them")
        return self

    @property
    def poses(self) -> Mapping[str, str]:
        """The robots whose poses topics carry, by these."""
        return {self.topics.pose.replace("{robot}", robot): robot for robot in self.robots}

    @property
    def read(self) -> Mapping[str, str]:
        """Those of `poses` that are listened to: none where a camera sees the robots."""
        return self.poses if self.camera is None else {}

    @property
    def goals(self) -> Mapping[str, str]:
        """The robots whose goals topics carry, or whose actions they name, by these."""
        goal = self.topics.goal or GOALS[self.drive_by][0]
        return {goal.replace("{robot}", robot): robot for robot in self.robots}

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the bridge."""
        parts = urlsplit(self.bridge)
        return parts.hostname or "", parts.port or PORT

    @property
    def url(self) -> str:
        """The bridge with its port, which browsers would take to be another."""
        parts = urlsplit(self.bridge)
        return self.bridge if parts.port else f"{self.bridge.rstrip('/')}:{PORT}"

    @property
    def where(self) -> str:
        """The bridge in words."""
        host, port = self.address
        return f"the bridge {host}:{port}"
