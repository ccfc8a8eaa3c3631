"""Robots whose poses were recorded: they can be looked at and planned for, but not driven."""

import time
from bisect import bisect_right
from collections.abc import AsyncGenerator
from pathlib import Path

from ..errors import FleetError
from ..motion.motion import Motion
from .described import described_as
from .protocol import FleetClosedError, FleetRequest, Pose, check_ages
from .recording import RecordedSettings, recorded_rows


class RecordedFleet:
    """Poses as they were recorded, from when all robots had been seen; the last ones stay."""

    name, real, turns, stopped, tracking_error = "recorded", True, False, False, 0.0

    def __init__(self, path: Path, settings: RecordedSettings) -> None:
        self._path, frame = path, settings.frame
        self.radius = self.speed = settings.radius / frame.metres_per_pixel
        self._tracks: dict[str, list[Pose]] = {}
        for row in recorded_rows(path):
            looks = None if row.heading is None else frame.turned(row.heading)
            pose = Pose(row.robot, *frame.to_picture(row.x, row.y), looks, row.time)
            self._tracks.setdefault(row.robot, []).append(pose)
        first = max(track[0].seen for track in self._tracks.values())
        seen = {pose.seen for track in self._tracks.values() for pose in track}
        self._times = sorted(t for t in seen if t >= first)
        self._fast, self._looks, self._closed = settings.pace == "fast", -1, False
        self._began = time.monotonic()

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        """Where robots were at the moment that has come; see `Fleet.observe`."""
        if self._closed:
            raise FleetClosedError("The recorded fleet is closed; open it again.")
        self._looks = min(self._looks + 1, len(self._times) - 1)
        passed = self._times[0] + time.monotonic() - self._began
        now = self._times[self._looks] if self._fast else min(passed, self._times[-1])
        seen = [
            track[bisect_right(track, now, key=lambda pose: pose.seen) - 1]
            for track in self._tracks.values()
        ]
        check_ages(seen, now, max_age)
        return tuple(seen)

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Refuse to: there is nobody to drive."""
        raise FleetError(
            f"The robots of {self._path} were recorded and cannot be driven; plan for them "
            "without driving, or name another fleet."
        )
        yield ()

    async def stop(self) -> None:
        """Do nothing: nothing is driven."""

    async def release(self) -> None:
        """Do nothing: nothing was stopped."""

    async def close(self) -> None:
        """See nothing more."""
        self._closed = True


def open_fleet(request: FleetRequest) -> RecordedFleet:
    """The robots of the recording that a file names.

    Raises:
        InputError: it does not describe such, or the recording cannot be read.
    """
    assert request.config is not None  # see `fleet_named`
    settings = described_as(RecordedSettings, request.config)
    return RecordedFleet(request.config.parent / settings.file, settings)
