"""Where things are by now that a camera above a fleet sees, from where a picture shows them."""

import asyncio
import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.outline import Outline
from ..perception.cameras.reader import CameraError, Frame
from ..perception.tracking.tracker import ObjectTracker
from .protocol import Sighting

WAIT, PAUSE = 3.0, 0.02
"""Seconds for which a camera that was just opened is waited for, and between two looks."""

Look = Callable[[], Frame]
"""The newest frame of a camera that stands still, seen straight from above."""


class SeenThings:
    """Things that are looked for in each frame.

    Those without texture or colours of their own are never seen.

    Args:
        look: gives frames in the picture's size and place.
        picture: (H, W, 3) BGR, in which things have their outlines.
        things: by the ids of their targets.
    """

    def __init__(
        self, look: Look, picture: NDArray[np.uint8], things: Mapping[str, Outline]
    ) -> None:
        self._look = look
        self._seen, self._last = -math.inf, tuple[Sighting, ...]()
        self._trackers: dict[str, ObjectTracker] = {}
        for name, outline in things.items():
            with suppress(InputError):
                self._trackers[name] = ObjectTracker(picture, outline)

    async def sightings(self) -> tuple[Sighting, ...]:
        """Where things are seen in the newest frame; the first is waited for a while.

        None that are lost, and none where there is no frame.
        """
        ends = time.monotonic() + WAIT
        while True:
            found = await asyncio.to_thread(self._looked)
            if self._seen > -math.inf or time.monotonic() > ends:
                return found
            await asyncio.sleep(PAUSE)

    def _looked(self) -> tuple[Sighting, ...]:
        try:
            frame = self._look()
        except CameraError:  # said by whoever misses the robots' poses, or soon these
            return ()
        if frame.seen > self._seen:
            self._seen = frame.seen
            found = {name: way.update(frame.pixels) for name, way in self._trackers.items()}
            self._last = tuple(
                Sighting(name, at.dx, at.dy, at.turn, frame.seen)
                for name, at in found.items()
                if not at.lost
            )
        return self._last
