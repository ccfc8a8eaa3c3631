"""Looks at robots that run ROS 2, behind a rosbridge, without telling them anything."""

import time

from ..wire.checkup import checkup
from ..wire.poses import Poses
from .link import Link, Message
from .messages import goal_of, pose_message
from .settings import GOALS, RosSettings


def checked(settings: RosSettings, seconds: float) -> tuple[list[str], bool]:
    """What is to be told, and whether all could be driven, after listening for so many seconds.

    Raises:
        InputError: as of `Link`.
    """
    poses, others, heard_at, sent_at = Poses(settings), set[str](), settings.read, settings.goals

    def heard(message: Message, new: bool) -> None:
        topic, said = str(message.get("topic")), message.get("msg")
        if (robot := heard_at.get(topic)) is not None:
            poses.heard(robot, pose_message(said, settings), time.monotonic())
        elif topic in sent_at and new and goal_of(said) != (0.0, 0.0):
            others.add(sent_at[topic])

    topics = [(topic, settings.pose_type) for topic in heard_at]
    if settings.drive_by != "nav2":
        topics += [(topic, GOALS[settings.drive_by][1]) for topic in sent_at]
    link = Link(settings.url, topics, (), heard)
    guard = "" if settings.bridge.startswith("wss") else ", in the clear"
    guard += "; whoever reaches it can steer"
    return checkup(settings, link, poses, others, seconds, guard)
