"""How fast simulated time passes: as fast as can be computed, in real time, or by hand."""

import asyncio
import time
from dataclasses import dataclass

from .protocol import Fleet

PAUSE = 0.02
"""Seconds between looks at whether a pause has ended."""


@dataclass
class Pace:
    """The clock of a simulator, which whoever watches it may change at any time.

    Attributes:
        speed: simulated seconds a second; None for as many as can be computed.
        paused: whether time stands still, but for single steps.
        steps: so many single steps are still to be made while it stands still.
    """

    speed: float | None = None
    paused: bool = False
    steps: int = 0
    _due: float = 0.0

    async def step(self, seconds: float) -> None:
        """Wait until the next step of so many simulated seconds is due."""
        while self.paused and not self.steps:
            await asyncio.sleep(PAUSE)
        self.steps = max(self.steps - 1, 0)
        if self.speed is None or self.paused:
            await asyncio.sleep(0)  # whoever wants to stop the robots gets a turn
            return
        now = time.monotonic()
        self._due = max(self._due + seconds / self.speed, now)
        await asyncio.sleep(self._due - now)


def pace_of(fleet: Fleet) -> Pace | None:
    """The clock of a fleet whose time is simulated; None for others."""
    pace = getattr(fleet, "pace", None)
    return pace if isinstance(pace, Pace) else None
