"""Robots as a camera above them sees them, by the tags on them, in place of what they say.

A tag is located by the homography of the floor, raised to the height of the tag: what faces the
camera has no sure pose of its own.
"""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from ...errors import InputError
from ...formation.value import Value
from ...geometry.outline import FloatArray
from ...perception.cameras.calibration import Calibration, read_calibration, through
from ...perception.cameras.reader import Camera, CameraError, Frame
from ...perception.cameras.tags import Dictionary, heading, tags_in
from ..moving import Above0
from ..physics import RobotId
from .poses import PoseMessage, Poses
from .settings import RobotFrame

PAUSE = 0.005
ALIKE = 0.25
"""Share by which a tag may seem larger or smaller than it is."""


class TagSettings(Value):
    """A camera that sees robots; the robots' frame is that of its calibration.

    Attributes:
        source: the number of a device, the URL of a stream, or a video file.
        calibration: the file that `formup calibrate` wrote, beside the fleet's.
        tags: the tag on each robot, whose right side points ahead, and centre is the robot's.
        dictionary: of the tags, as OpenCV calls it.
        tag_size: side of a tag's black square, m.
        tag_height: of the tags above the floor, m.
    """

    source: Annotated[str, Field(max_length=300, coerce_numbers_to_str=True)]
    calibration: Path
    tags: Mapping[RobotId, Annotated[int, Field(ge=0)]]
    dictionary: Dictionary = "DICT_4X4_50"
    tag_size: Above0
    tag_height: Annotated[float, Field(ge=0, le=100)] = 0.0

    def beside(self, folder: Path) -> tuple[Self, RobotFrame]:
        """The same with its calibration where that is, and how its floor lies in the top view.

        Raises:
            InputError: as of `read_calibration`; or it does not say where the camera is, and tags
                are above the floor.
        """
        path = folder / self.calibration
        found = read_calibration(path)
        found.on_floor(np.zeros((1, 2)), self.tag_height)
        if found.camera is not None and self.tag_height >= found.camera[2]:
            raise InputError(f"{path} has the camera at {found.camera[2]:g} m, below the tags.")
        origin = through(found.to_top, np.zeros((1, 2)))[0]
        frame = RobotFrame(
            metres_per_pixel=found.metres_per_pixel,
            origin=(float(origin[0]), float(origin[1])),
            y="up" if found.y_up else "down",
        )
        return self.model_copy(update={"calibration": path}), frame

    def check_seen(self, size: tuple[float, float]) -> None:
        """Refuse a picture, of so many px, that is not the camera's floor from above."""
        width, height = read_calibration(self.calibration).size
        if size != (width, height):
            raise InputError(
                f"The picture has {size[0]:g} x {size[1]:g} pixels, and the fleet's camera shows "
                f"its floor in {width} x {height}; give the picture with --calibration "
                f"{self.calibration}."
            )


class TagWatch:
    """Feeds poses with what a camera sees, until it is closed."""

    def __init__(self, settings: TagSettings, poses: Poses) -> None:
        self._settings, self._poses = settings, poses
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
            self._poses.heard(robot, said, frame.seen)
        self._poses.trouble = trouble


def _side(corners: FloatArray) -> float:
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean())
