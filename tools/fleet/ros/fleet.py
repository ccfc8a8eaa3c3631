"""The fleet of robots that run ROS 2, behind a rosbridge."""

import math
import time
import uuid
from collections import deque
from collections.abc import Mapping
from typing import Any

from ..described import described_for
from ..protocol import FleetRequest
from ..wire.fleet import SETTLED, Point, Reason, WireFleet
from ..wire.poses import PoseMessage
from .link import Link, Message
from .messages import CANCEL, HOLD, goal_of, hold_of, pose_message, stamped, twist
from .settings import GOALS, RosSettings
from .tracking import velocity

NAV2_AHEAD = 4.0
"""Nav2 is sent goals as far ahead as robots drive in so many seconds, as it plans anew once a
second,"""
NAV2_STEP = 0.25
"""another one when that has moved by this share of the way there."""
NEAR = 0.8 * SETTLED
"""Robots that are driven by velocities stand within so many px."""
ECHOES = 100
"""What was said, for each robot, that is known again when it comes back."""
SUCCEEDED = 4
"""As of action_msgs/GoalStatus."""
ALL_GOALS = {"goal_info": {"goal_id": {"uuid": [0] * 16}, "stamp": {"sec": 0, "nanosec": 0}}}
"""As of action_msgs/CancelGoal: those of other programs too, which alone know their ids."""
OF_PROGRAMS = ("end", "gone")
"""Begin messages to hold that no person sent: a drive of another program ended."""


class RosFleet(WireFleet):
    """Robots that run ROS 2, as a file describes them."""

    name = "ros"

    def __init__(self, settings: RosSettings) -> None:
        super().__init__(settings)
        self._ros, self._me = settings, uuid.uuid4().hex[:12]
        self._seen_at, self._sent_at = settings.read, settings.goals
        self._goal_of = {robot: topic for topic, robot in self._sent_at.items()}
        self._said = {robot: deque[Point](maxlen=ECHOES) for robot in settings.robots}
        self._aims: dict[str, Point] = {}
        self._sent: dict[str, tuple[str, Point]] = {}
        self._failed: dict[str, str] = {}
        kind, hold = GOALS[settings.drive_by][1], (settings.topics.hold, HOLD)
        topics = [(topic, settings.pose_type) for topic in self._seen_at]
        goals = [(topic, kind) for topic in settings.goals if settings.drive_by != "nav2"]
        if settings.drive_by == "nav2":
            self.ahead = NAV2_AHEAD
        self.link = self._link = Link(
            settings.url,
            [*topics, *goals, hold],
            [*goals, hold],
            self._heard,
            left=self.poses.forget,
        )
        self.begin(self._judged)

    def send(
        self, drive: str, seq: int, goals: Mapping[str, Point], looks: Mapping[str, float]
    ) -> None:
        """Tell robots where to go; see `WireFleet.send`."""
        for robot, place in goals.items():
            look = looks.get(robot)
            if self._ros.drive_by == "nav2":
                self._navigate(robot, (place, look), f"{drive}-{seq}-{robot}")
            elif self._ros.drive_by == "cmd_vel":
                told = self._velocity(robot, place, look)
                self._publish(robot, told, twist(told))
            else:
                place = round(place[0], 6), round(place[1], 6)
                self._publish(robot, place, self._stamped(robot, place, look))

    def hold(self, reason: Reason) -> None:
        """Tell all robots to hold; see `WireFleet.hold`."""
        said = {"data": f"{reason} {self._me}"}
        messages: list[Message] = [{"op": "publish", "topic": self._ros.topics.hold, "msg": said}]
        if self._ros.drive_by == "cmd_vel":
            zero = twist((0.0, 0.0))
            messages += [{"op": "publish", "topic": t, "msg": zero} for t in self._goal_of.values()]
        for robot, (goal, _) in self._sent.items():
            action = self._goal_of[robot]
            messages.append({"op": "cancel_action_goal", "action": action, "id": goal})
        if self._ros.drive_by == "nav2" and reason == "stop":
            services = [f"{action}{CANCEL}" for action in self._goal_of.values()]
            messages += [{"op": "call_service", "service": s, "args": ALL_GOALS} for s in services]
        self._link.say(*messages, surely=True)
        for of_a_drive in (self._sent, self._aims, self._failed):
            of_a_drive.clear()

    def _publish(self, robot: str, told: Point, message: Message) -> None:
        self._said[robot].append(told)
        self._link.say({"op": "publish", "topic": self._goal_of[robot], "msg": message})

    def _looks(self, robot: str) -> tuple[Point, float]:
        """Where a robot is, and how it looks, in its own frame."""
        pose, frame = self.poses.tracks[robot].pose, self._ros.frame
        assert pose is not None  # nothing is sent before all were seen
        return frame.to_robots(pose.x, pose.y), frame.turned_back(pose.heading or 0.0)

    def _velocity(self, robot: str, goal: Point, look: float | None) -> Point:
        limits, near = (
            (self._ros.speed, self._ros.turn_speed),
            NEAR * self._ros.frame.metres_per_pixel,
        )
        ahead, about = velocity(*self._looks(robot), goal, limits, near, look)
        return round(ahead, 6), round(about, 6)

    def _stamped(self, robot: str, goal: Point, look: float | None) -> dict[str, Any]:
        """A goal; where a robot may look any way, it does as it drives there, and then as it is."""
        (x, y), looks = self._looks(robot)
        if look is None and math.dist((x, y), goal) > SETTLED * self._ros.frame.metres_per_pixel:
            look = math.atan2(goal[1] - y, goal[0] - x)
        return stamped(self._ros.frame_id, goal, looks if look is None else look)

    def _navigate(self, robot: str, end: tuple[Point, float | None], goal: str) -> None:
        """Send Nav2 another goal where that has moved on by a step, or has come to stand."""
        place, look = end
        stands, self._aims[robot] = self._aims.get(robot) == place, place
        step = NAV2_STEP * NAV2_AHEAD * self._ros.speed
        if robot in self._sent:
            moved = math.dist(self._sent[robot][1], place)
            if moved == 0 or (moved < step and not stands):
                return
        self._sent[robot] = goal, place
        name, kind = self._goal_of[robot], GOALS["nav2"][1]
        args = {"pose": self._stamped(robot, place, look), "behavior_tree": ""}
        sent = {"action": name, "action_type": kind, "args": args, "feedback": False}
        self._link.say({"op": "send_action_goal", "id": goal, **sent})

    def _heard(self, message: Message, new: bool) -> None:
        topic, said = str(message.get("topic")), message.get("msg")
        if message.get("op") == "action_result":
            self._ended(message)
        elif (robot := self._seen_at.get(topic)) is not None:
            told = pose_message(said, self._ros, self._failed.get(robot))
            self.poses.heard(robot, told, time.monotonic())
        elif topic == self._ros.topics.hold:
            why = hold_of(said).split()
            if len(why) != 2 or why[0] not in OF_PROGRAMS:
                if why[1:] != [self._me]:
                    self.latch()  # a person stopped the robots elsewhere
            elif why[1] != self._me and new:
                self.saw_others()
        elif (robot := self._sent_at.get(topic)) is not None:
            goal = goal_of(said)
            zero = self._ros.drive_by == "cmd_vel" and goal == (0.0, 0.0)
            if new and goal not in self._said[robot] and not zero:
                self.saw_others()

    def _judged(self, robot: str, seen: PoseMessage) -> PoseMessage:
        return seen.model_copy(update={"fault": self._failed.get(robot)})

    def _ended(self, message: Message) -> None:
        """Note that Nav2 gave up a goal that was its robot's last."""
        for robot, (goal, _) in [*self._sent.items()]:
            if goal == message.get("id"):
                status = message.get("status")
                if not message.get("result") or status != SUCCEEDED:
                    self._failed[robot] = f"Nav2 gave up its goal, status {status}"


def open_fleet(request: FleetRequest) -> RosFleet:
    """The robots of the file that was given.

    Raises:
        InputError: it does not describe robots that run ROS 2, or its camera has not seen the
            picture.
    """
    return RosFleet(described_for(RosSettings, request))
