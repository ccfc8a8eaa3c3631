"""What is believed of what robots say of themselves: how old it is by our own clock, and in order.

Nobody's clock is trusted but this computer's. A robot that was silent, or is elsewhere than it can
have come to, is believed again once two messages in order agree.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from pydantic import BaseModel, ConfigDict, Field

from ..protocol import Pose
from .settings import WireSettings

JUMP_FACTOR = 2.0
"""A robot has not come further than its greatest speed would take it, times this, in the time
since it was seen and
"""
JITTER = 0.2
"""so many seconds more, as messages come in bursts."""
MOST_JUMPS = 3
"""A robot that jumps so often within `pose_timeout` may be two of one name: it is not believed."""
MOST_UNKNOWN = MOST_REASONS = 20
MOST_TOLD = 5
"""Robots that are spoken of at length; the others are named."""


class PoseMessage(BaseModel):
    """What a robot says of itself; what else it says is not read, nor whether it is done.

    Attributes:
        seq: a number that is greater in each message than in the one before.
        x, y: where it is, in the robots' frame.
        heading: radians, about the x axis towards the y axis.
        fault: why it cannot drive, such as a switch at manual; left out while it can.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False)
    seq: int = Field(ge=0)
    x: float = Field(ge=-1e6, le=1e6)
    y: float = Field(ge=-1e6, le=1e6)
    heading: float | None = None
    fault: str | None = Field(default=None, max_length=200)


@dataclass
class Track:
    """One robot as it was heard of.

    Attributes:
        pose: the last that is believed; None before.
        fault: as in its last message.
        heard: how many messages came.
        refused: how many of them were not believed, and why.
        why: the last time, if none was believed since.
    """

    pose: Pose | None = None
    fault: str | None = None
    heard: int = 0
    refused: Counter[str] = field(default_factory=Counter[str])
    why: str | None = None
    last: tuple[int, Pose] | None = None
    jumps: tuple[float, ...] = ()


class Poses:
    """Where robots are, from their messages; these may come in another thread.

    Attributes:
        unknown: robots that spoke and are none of the fleet's, a few of them.
        trouble: why nothing is seen, as a sentence after a blank; empty where nothing is wrong.
    """

    def __init__(self, settings: WireSettings) -> None:
        self._settings = settings
        self._reach = JUMP_FACTOR * settings.pixels(settings.speed)
        self._tracks = {robot: Track() for robot in settings.robots}
        self.unknown: set[str] = set()
        self.trouble = ""

    @property
    def tracks(self) -> Mapping[str, Track]:
        """By the ids of the robots, in their order."""
        return self._tracks

    def forget(self) -> None:
        """Know nothing: what is seen next counts."""
        self._tracks = {robot: Track() for robot in self._tracks}

    def heard(self, robot: str, said: PoseMessage | str | None, now: float) -> None:
        """Take in a message that came at a time on our own clock.

        One that is not to be believed is given as the reason, None if it cannot be read.
        """
        track = self._tracks.get(robot)
        if track is None:
            if len(self.unknown) < MOST_UNKNOWN:
                self.unknown.add(robot)
            return
        track.heard += 1
        if isinstance(said, PoseMessage) and said.heading is None and self._settings.turns:
            said = "without a heading"
        if not isinstance(said, PoseMessage):
            self._refuse(track, said or "malformed", now)
            return
        frame = self._settings.frame
        looks = None if said.heading is None else frame.turned(said.heading)
        pose = Pose(robot, *frame.to_picture(said.x, said.y), looks, now)
        refused, agrees = self._judged(track, said.seq, pose)
        if refused:
            self._refuse(track, refused, now)
            return
        track.last, track.fault = (said.seq, pose), said.fault
        if agrees:
            track.pose, track.why = pose, None

    def age(self, robot: str, now: float) -> float:
        """Seconds since a robot was seen; infinite if it never was, or may be two."""
        track = self._tracks[robot]
        torn = len(track.jumps) == MOST_JUMPS and now - track.jumps[0] <= self._timeout
        return math.inf if track.pose is None or torn else now - track.pose.seen

    def old(self, now: float, limit: float) -> dict[str, str]:
        """What is to be said of each robot that was not seen for longer, or never."""
        ages = {robot: self.age(robot, now) for robot in self._tracks}
        return {
            robot: self._told(robot, age)
            for robot, age in ages.items()
            if age > limit or self._tracks[robot].pose is None
        }

    def seen(self) -> tuple[Pose, ...]:
        """The poses that are believed, however old."""
        return tuple(track.pose for track in self._tracks.values() if track.pose is not None)

    @property
    def _timeout(self) -> float:
        return self._settings.pose_timeout

    def _judged(self, track: Track, seq: int, pose: Pose) -> tuple[str | None, bool]:
        """Why a message is refused, if it is, and whether it agrees with one before."""
        if track.last is None or pose.seen - track.last[1].seen > self._timeout:
            return None, False
        before, at = track.last
        if seq <= before:
            return "out of order", False
        way = math.dist((pose.x, pose.y), (at.x, at.y))
        if way > self._reach * (pose.seen - at.seen + JITTER):
            return "jumped", False
        return None, True

    def _refuse(self, track: Track, why: str, now: float) -> None:
        track.refused[why if len(track.refused) < MOST_REASONS else "malformed"] += 1
        track.why = why
        if why == "jumped":
            track.jumps = (*track.jumps, now)[-MOST_JUMPS:]

    def _told(self, robot: str, age: float) -> str:
        track = self._tracks[robot]
        seen = "not seen yet" if track.pose is None else f"not seen for {age:.1f} s"
        if math.isinf(age) and track.pose is not None:
            return f"Robot {robot} is said to be in two places: do two robots use its id?"
        why = f"; its last message was {track.why}" if track.why else ""
        why += f"; it cannot drive: {track.fault!r}" if track.fault else ""
        return f"Robot {robot} {seen}{why}."


def told_of(robots: Mapping[str, str]) -> str:
    """Sentences on the first robots, by id, and the names of all others."""
    more = [*robots][MOST_TOLD:]
    likewise = [f"Likewise robot {', '.join(more)}."] if more else []
    return " ".join([*[*robots.values()][:MOST_TOLD], *likewise])
