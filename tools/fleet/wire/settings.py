"""What a file says of robots that are elsewhere: ids, limits, how their frame lies in the picture.

Robots speak in their own frame, usually metres with y up; everything else here is image pixels.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from ...formation.value import Value
from ..moving import Above0, Pixels, Seconds
from ..physics import RobotId, Spell
from .frame import RobotFrame
from .tags import TagSettings

MOST_ROBOTS = 1_000


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
        turns: whether they turn to a heading at their goal; they have to say how they look then.
        period: seconds between goals.
        pose_timeout: robots that were not seen for so many seconds are held.
        watchdog: robots have to hold by themselves without a goal for so many seconds.
        camera: sees where they are; left out, they say so.
        simulated: what stands in for them.
    """

    robots: tuple[Annotated[RobotId, StringConstraints(pattern=r"^[^/+#\x00-\x1f]{1,64}$")], ...]
    speed: Above0
    radius: Above0
    tracking_error: Above0
    frame: RobotFrame = RobotFrame(y="down")
    turns: bool = False
    period: float = Field(default=0.05, ge=0.01, le=1)
    pose_timeout: Annotated[Seconds, Field(gt=0, le=10)] = 0.5
    watchdog: Annotated[Seconds, Field(gt=0, le=10)] = 0.5
    camera: TagSettings | None = None
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

    @model_validator(mode="after")
    def _all_tagged(self) -> Self:
        if self.camera is None:
            return self
        tags = self.camera.tags
        if set(tags) != set(self.robots) or len(set(tags.values())) < len(tags):
            raise ValueError("camera.tags takes every robot, and a tag of its own for each")
        if "frame" in self.model_fields_set:
            raise ValueError("frame is that of the camera's calibration; leave it out")
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
