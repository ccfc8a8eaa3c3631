"""How the frame that robots speak in lies in the picture."""

import math
from typing import Literal

from pydantic import Field

from ...formation.value import Value
from ..moving import Above0, Pixels


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
