"""A fleet in a package of its own: two carts that a task moves in real time."""

import asyncio
import time
from collections.abc import AsyncGenerator

import numpy as np
from formup.tools.fleet.protocol import (
    FleetBusyError,
    FleetClosedError,
    FleetRequest,
    FleetStoppedError,
    Motion,
    Pose,
    RobotsFailedError,
    check_ages,
)
from formup.tools.motion.routes import along

PERIOD_S, SPEED = 0.005, 800.0


class Carts:
    """Robots that go on driving by themselves until they are held."""

    name, real, radius, speed, turns = "example", True, 5.0, SPEED, False
    tracking_error = 0.1

    def __init__(self, width: float) -> None:
        self.stopped = False
        self._carts = {
            "left": np.array([0.1 * width, 20.0]),
            "right": np.array([0.1 * width, 60.0]),
        }
        self._task: asyncio.Task[None] | None = None
        self._closed = False

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        """Where the carts are seen now."""
        if self._closed:
            raise FleetClosedError("The carts were let go of.")
        now = time.monotonic()
        poses = tuple(Pose(i, float(x), float(y), None, now) for i, (x, y) in self._carts.items())
        check_ages(poses, now, max_age)
        return poses

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Drive along the paths, and yield the poses on the way."""
        await self.observe()
        if self.stopped:
            raise FleetStoppedError("The carts are stopped.")
        if self._task is not None:
            raise FleetBusyError("The carts are on their way.")
        unknown = tuple(set(motion.paths) - set(self._carts))
        if unknown:
            raise RobotsFailedError(f"There is no cart {unknown}.", unknown)
        going = self._task = asyncio.create_task(self._go(motion))
        try:
            while not going.done():
                yield await self.observe()
                await asyncio.sleep(PERIOD_S)
            if going.cancelled():
                raise FleetStoppedError("The carts were stopped on the way.")
            yield await self.observe()
        finally:
            self._hold()

    async def stop(self) -> None:
        """Hold the carts until they are released."""
        self.stopped = True
        self._hold()

    async def release(self) -> None:
        """Let them be driven again."""
        self.stopped = False

    async def close(self) -> None:
        """Hold the carts and let go of them."""
        self._closed = True
        self._hold()

    async def _go(self, motion: Motion) -> None:
        paths = list(motion.paths.values())
        longest = max(np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths)
        steps = max(int(longest / SPEED / PERIOD_S), 1)
        for step in range(1, steps + 1):
            await asyncio.sleep(PERIOD_S)
            places = along(paths, np.full(len(paths), step / steps))
            self._carts |= dict(zip(motion.paths, places, strict=True))

    def _hold(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None


def open_fleet(request: FleetRequest) -> Carts:
    """What the entry point names: a fleet for a picture of this size."""
    return Carts(request.size[0])
