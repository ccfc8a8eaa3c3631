"""Watches whether robots that drive keep as far apart as their motion was certified for."""

import numpy as np

from ..geometry.outline import FloatArray
from ..geometry.sampling import min_spacing


class Supervisor:
    """The same rule as that of the planner and the checker, on what is observed.

    Args:
        demanded: least distance of two robots' centres, px.
        error: how far a robot that nothing pushes may come off its path, px.

    Attributes:
        least: the least distance that was seen, px.
    """

    def __init__(self, demanded: float, error: float) -> None:
        self._allowed = demanded - 2 * error
        self.least = np.inf

    def saw(self, points: FloatArray) -> bool:
        """Whether robots at (n, 2) px keep apart; if not, something else moved one of them."""
        now = min_spacing(points)
        self.least = min(self.least, now)
        return now >= self._allowed
