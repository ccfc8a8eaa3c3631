"""What a file says of a camera above robots, and of the tags that it tells them by."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from ...errors import InputError
from ...formation.value import Value
from ...perception.cameras.calibration import read_calibration, through
from ...perception.cameras.tags import Dictionary
from ..moving import Above0
from ..physics import RobotId
from .frame import RobotFrame


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
                f"its floor in {width} x {height}; give a picture of the camera with "
                f"its calibration, {self.calibration}."
            )
