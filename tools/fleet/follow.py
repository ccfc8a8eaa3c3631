"""Leave to follow a thing that moves, how the thing has moved, and what came of it."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely import affinity
from shapely.geometry import Polygon

from ..formation.units import length_text
from ..formation.value import Value
from ..geometry.outline import FloatArray
from .protocol import Sighting

SECONDS = 60.0
"""Of a follow where nobody says how long."""
SPEED_SHARE = 0.05
"""Share of the picture's diagonal that robots drive in a second where nobody says how fast."""

Bound = Literal["speed", "area", "obstacle", "contract", "separation", "unseen"]
Left = Bound | Literal["time", "stopped", "failed"]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class Follow(Value):
    """Leave to keep a formation about its thing as that moves.

    Attributes:
        seconds: for how long.
        speed: the greatest that any robot may be taken along with, px per second.
        area: x0, y0, x1, y1 that robots stay in, px; left out, the picture.
    """

    seconds: float = Field(default=SECONDS, gt=0, le=86_400)
    speed: float | None = Field(default=None, gt=0, le=1e6)
    area: tuple[Coordinate, Coordinate, Coordinate, Coordinate] | None = None

    def most(self, size: tuple[float, float]) -> float:
        """The greatest speed in a picture of a size, px per second."""
        return self.speed or round(SPEED_SHARE * math.hypot(*size), 1)

    def room(self, size: tuple[float, float]) -> Polygon:
        """What robots stay in, in a picture of a size."""
        return shapely.box(*self.area or (-0.5, -0.5, size[0] - 0.5, size[1] - 0.5))

    def said(self, target: str, size: tuple[float, float]) -> str:
        """The same in words."""
        area = "the picture" if self.area is None else "({:g}, {:g}) to ({:g}, {:g})"
        return (
            f"follow {target} for {self.seconds:g} s at no more than "
            f"{self.most(size):g} px/s within {area.format(*self.area or ())}"
        )


class Followed(Value):
    """How a thing was followed.

    Attributes:
        target: its id.
        seconds: how long.
        moved_px: from where the picture shows it to where it was at the end.
        speed_px_s: the greatest of a robot's place.
        lag_px: the greatest distance of a robot from its place.
        separation_px: least distance of two robots that was seen; None for one robot.
        certified: share of the time in which robots as observed met the contract.
        ended: time: as was wanted; stopped, failed: the fleet; else the bound that was left.
        reason: the same in words; None where the time was up.
    """

    target: str
    seconds: float
    moved_px: float
    speed_px_s: float
    lag_px: float
    separation_px: float | None
    certified: float
    ended: Left
    reason: str | None = None

    def told(self, scale: float | None) -> str:
        """It in words.

        Args:
            scale: metres per pixel, where they are known.
        """
        moved, lag = length_text(self.moved_px, scale), length_text(self.lag_px, scale)
        met = math.floor(100 * self.certified)
        return (
            f"They followed {self.target} for {self.seconds:.1f} s, until it was {moved} from "
            f"where the picture shows it: at most {lag} behind, as demanded {met} % of the time. "
            f"{self.reason or ''}"
        ).rstrip()


@dataclass(frozen=True)
class Rigid:
    """How a thing has moved: turned about the centre of its outline, (2,) px, then moved."""

    centre: FloatArray
    sighting: Sighting

    @property
    def _turn(self) -> FloatArray:
        c, s = math.cos(self.sighting.turn), math.sin(self.sighting.turn)
        return np.array([[c, s], [-s, c]])  # of rows

    @property
    def numbers(self) -> tuple[float, float, float]:
        """How far it has moved, px, and turned, radians."""
        return self.sighting.dx, self.sighting.dy, self.sighting.turn

    @property
    def way(self) -> FloatArray:
        """How far it has moved, (2,) px."""
        return np.array([self.sighting.dx, self.sighting.dy])

    def carried(self, points: FloatArray) -> FloatArray:
        """Points of the picture that move with the thing, (n, 2)."""
        return (points - self.centre) @ self._turn + self.centre + self.way

    def back(self, points: FloatArray) -> FloatArray:
        """Points as they lie about the thing where the picture shows it, (n, 2)."""
        return (points - self.way - self.centre) @ self._turn.T + self.centre

    def moved(self, region: Polygon) -> Polygon:
        """A region that moves with the thing."""
        x, y = self.centre
        turned = affinity.rotate(region, self.sighting.turn, (x, y), use_radians=True)
        return affinity.translate(turned, self.sighting.dx, self.sighting.dy)
