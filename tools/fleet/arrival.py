"""What came of a deployment: requested against observed, and the way there."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from pydantic import Field

from ..formation.plan import Point
from ..formation.value import Value
from ..geometry.outline import FloatArray
from .follow import Followed
from .protocol import Pose

Ended = Literal["arrived", "short", "stopped", "failed"]


class Arrival(Value):
    """Requested against observed, per place of the formation.

    Attributes:
        ended: arrived; short: some are off their places after all corrections; stopped: by the
            fleet's stop; failed: robots or the fleet failed on the way.
        reason: what kept robots from their places, and what stands then; where all arrived, whose
            place was given to another robot.
        robots: ids of the robots that take the places.
        failed: ids of those that the fleet named as having failed, or that did not get on.
        replaced: those of them whose place was given to another robot, with its id.
        waiting: robots that waited for another one to pass when nobody got on, with its id.
        certified: whether what stands was certified; None where all arrived.
        observed: where they were seen last, px.
        residual_px: distance of observed to requested.
        heading_residual_deg: of observed to requested headings; empty where none were requested.
        corrections: how many times robots were sent again after the first drive.
        separation_px: least distance of two robots that was seen on the way; None for one robot.
        track: hash of the file that holds where they were on their way.
        follow: how they followed the thing after that; None where they were not to.
    """

    arrived: bool
    ended: Ended
    reason: str | None = None
    robots: tuple[str, ...]
    failed: tuple[str, ...] = ()
    replaced: dict[str, str] = Field(default_factory=dict[str, str])
    waiting: dict[str, str] = Field(default_factory=dict[str, str])
    certified: bool | None = None
    observed: tuple[Point, ...]
    residual_px: tuple[float, ...]
    heading_residual_deg: tuple[float | None, ...] = ()
    tolerance_px: float
    corrections: int
    separation_px: float | None = None
    track: str | None = None
    follow: Followed | None = None

    @property
    def stopped(self) -> bool:
        """Whether a person's stop ended it, on the way or while robots followed."""
        return "stopped" in (self.ended, self.follow and self.follow.ended)

    @property
    def done(self) -> bool:
        """Whether all that was wanted was done."""
        return self.arrived and (self.follow is None or self.follow.ended == "time")


@dataclass(frozen=True)
class Track:
    """Where robots were over a deployment, for its film.

    Attributes:
        ids: of the robots, in the order of their places.
        points: (f, n, 2) px at f moments, evenly thinned; the last is the last observation.
        moved: (m, 3) how far the thing that was followed had moved at the last m of them, px, and
            turned, radians.
    """

    ids: tuple[str, ...]
    points: FloatArray
    moved: FloatArray = field(default_factory=lambda: np.empty((0, 3)))


@dataclass(frozen=True)
class Deployment:
    """What came of a deployment, and where all robots of the fleet, idle ones too, were last."""

    arrival: Arrival
    poses: tuple[Pose, ...]
    track: Track
