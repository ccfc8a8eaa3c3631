"""Robots as a camera above them sees them, by the tags on them, in place of what they say.

A tag is located by the homography of the floor, raised to the height of the tag: what faces the
camera has no sure pose of its own.
"""

import threading
from collections.abc import Callable

import numpy as np

from ...geometry.outline import FloatArray
from ...perception.cameras.calibration import Calibration, read_calibration
from ...perception.cameras.reader import Camera, CameraError, Frame
from ...perception.cameras.tags import heading, tags_in
from .poses import PoseMessage, Poses
from .tags import TagSettings

PAUSE = 0.005
ALIKE = 0.25
"""Share by which a tag may seem larger or smaller than it is."""
Judge = Callable[[str, PoseMessage], PoseMessage | str]
"""What is believed of a robot that is seen: the same, perhaps with a fault; or why nothing is."""


def all_believed(robot: str, seen: PoseMessage) -> PoseMessage:
    """For robots that have nothing to say beside where they are."""
    return seen


class TagWatch:
    """Feeds poses with what a camera sees, until it is closed; the judge is asked in a thread."""

    def __init__(self, settings: TagSettings, poses: Poses, judge: Judge = all_believed) -> None:
        self._settings, self._poses, self._judge = settings, poses, judge
        self._calibration: Calibration = read_calibration(settings.calibration)
        self._camera, self._seq = Camera(settings.source), 0
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="tags", daemon=True)
        self._thread.start()

    def top_view(self) -> Frame:
        """The newest frame as the floor is seen from straight above.

        Raises:
            CameraError: there is none.
        """
        frame = self._camera.newest()
        return Frame(self._calibration.rectified(frame.pixels), frame.seen)

    def close(self) -> None:
        """Let go of the camera."""
        self._closed.set()
        self._thread.join()
        self._camera.close()

    def _watch(self) -> None:
        last = 0.0
        while not self._closed.wait(PAUSE):
            try:
                frame = self._camera.newest()
            except CameraError as error:
                self._poses.trouble = f" {error}"
                continue
            if frame.seen > last:
                last = frame.seen
                self._take(frame)

    def _take(self, frame: Frame) -> None:
        """Believe what a frame shows."""
        size, trouble = self._settings.tag_size, ""
        shape = frame.pixels.shape[1::-1]
        if shape != self._calibration.picture:
            self._poses.trouble = (
                f" The camera gives {shape[0]} x {shape[1]} pixels, and its calibration is for "
                f"{self._calibration.picture[0]} x {self._calibration.picture[1]}."
            )
            return
        seen, self._seq = tags_in(frame.pixels, self._settings.dictionary), self._seq + 1
        for robot, tag in self._settings.tags.items():
            if tag not in seen:
                continue
            corners = self._calibration.on_floor(seen[tag], self._settings.tag_height)
            side = _side(corners)
            if abs(side - size) > ALIKE * size:
                trouble += f" The tag of robot {robot} seems {side:.3f} m wide, and not {size:g} m."
                continue
            x, y = corners.mean(axis=0).tolist()
            said = PoseMessage(seq=self._seq, x=x, y=y, heading=heading(corners))
            self._poses.heard(robot, self._judge(robot, said), frame.seen)
        self._poses.trouble = trouble


def _side(corners: FloatArray) -> float:
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean())
