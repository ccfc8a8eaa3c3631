"""What a file says of robots that are elsewhere: ids, limits, how their frame lies in the picture.

Robots speak in their own frame, usually metres with y up; everything else here is image pixels.
"""

import math
from abc import ABC, abstractmethod
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from ...formation.value import Value
from ..moving import Above0, Pixels, Seconds
from ..physics import RobotId, Spell

MOST_ROBOTS = 1_000


class RobotFrame(Value):
    """How the frame that robots speak in lies in the picture; left out, they speak in pixels.

    Attributes:
        metres_per_pixel: of the picture, taken straight from above.
        origin: (x, y) px, where the robots have (0, 0).
        turn: degrees, clockwise in the picture, from its x axis to that of the robots.
        y: which way the robots' y axis points in a picture, if nothing is turned.
    """

    metres_per_pixel: Above0 = 1.0
    origin: tuple[Pixels, Pixels] = (0.0, 0.0)
    turn: float = Field(default=0.0, ge=-360, le=360)
    y: Literal["up", "down"] = "up"

    def to_picture(self, x: float, y: float) -> tuple[float, float]:
        """A point of the robots' frame, px."""
        x, y = x / self.metres_per_pixel, self._side * y / self.metres_per_pixel
        cos, sin = self._way
        return self.origin[0] + cos * x - sin * y, self.origin[1] + sin * x + cos * y

    def to_robots(self, x: float, y: float) -> tuple[float, float]:
        """A point of the picture in the robots' frame."""
        x, y = x - self.origin[0], y - self.origin[1]
        cos, sin = self._way
        along, across = cos * x + sin * y, cos * y - sin * x
        return along * self.metres_per_pixel, self._side * across * self.metres_per_pixel

    def turned(self, heading: float) -> float:
        """A heading of the robots', about their x axis towards their y axis, in the picture."""
        return math.radians(self.turn) + self._side * heading

    def turned_back(self, heading: float) -> float:
        """A heading in the picture as robots have it."""
        return self._side * (heading - math.radians(self.turn))

    @property
    def _side(self) -> float:
        return -1.0 if self.y == "up" else 1.0

    @property
    def _way(self) -> tuple[float, float]:
        return math.cos(math.radians(self.turn)), math.sin(math.radians(self.turn))


class StandIn(Value):
    """What `formup fleet simulate` puts in the robots' place, in the robots' frame.

    Attributes:
        starts: where robots stand at first, in their order; left out, in a row.
        drive: as of simulated robots.
        stuck, lost: robots that do not move, or are not seen, and when.
    """

    starts: tuple[tuple[Pixels, Pixels], ...] = Field(default=(), max_length=MOST_ROBOTS)
    drive: Literal["point", "differential"] = "point"
    stuck: tuple[Spell, ...] = ()
    lost: tuple[Spell, ...] = ()


class WireSettings(Value, ABC):
    """Robots that are elsewhere; lengths are in the robots' frame.

    Attributes:
        robots: their ids.
        speed: greatest of a robot, per second.
        radius: of a robot.
        tracking_error: how far one that nothing pushes may come off the straight way to its goal.
        period: seconds between goals.
        pose_timeout: robots that were not seen for so many seconds are held.
        watchdog: robots have to hold by themselves without a goal for so many seconds.
        simulated: what stands in for them.
    """

    robots: tuple[Annotated[RobotId, StringConstraints(pattern=r"^[^/+#\x00-\x1f]{1,64}$")], ...]
    speed: Above0
    radius: Above0
    tracking_error: Above0
    frame: RobotFrame = RobotFrame(y="down")
    period: float = Field(default=0.05, ge=0.01, le=1)
    pose_timeout: Annotated[Seconds, Field(gt=0, le=10)] = 0.5
    watchdog: Annotated[Seconds, Field(gt=0, le=10)] = 0.5
    simulated: StandIn = StandIn()

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if not 1 <= len(self.robots) <= MOST_ROBOTS:
            raise ValueError(f"name 1 to {MOST_ROBOTS} robots")
        twice = sorted({robot for robot in self.robots if self.robots.count(robot) > 1})
        if twice:
            raise ValueError(f"robot {', '.join(twice)} is named twice")
        if min(self.pose_timeout, self.watchdog) < 3 * self.period:
            raise ValueError("pose_timeout and watchdog have to be three periods or more")
        stand_in = self.simulated
        if stand_in.starts and len(stand_in.starts) != len(self.robots):
            raise ValueError("simulated.starts takes one place for each robot")
        named = {spell.robot for spell in (*stand_in.stuck, *stand_in.lost)}
        if unknown := sorted(named - set(self.robots)):
            raise ValueError(f"simulated names robot {', '.join(unknown)}, which there is not")
        return self

    def pixels(self, length: float) -> float:
        """A length in the robots' frame, px."""
        return length / self.frame.metres_per_pixel

    @property
    @abstractmethod
    def where(self) -> str:
        """What they are reached through, in words: "the broker localhost:1883"."""

    @property
    def alone(self) -> str:
        """What robots do that hear nothing more, in words."""
        return f"robots have to hold by themselves when no goal has come for {self.watchdog:g} s"
