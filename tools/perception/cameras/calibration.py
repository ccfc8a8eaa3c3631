"""Maps the pixels of a camera to the floor, as measured by `formup calibrate`.

Once lens distortion is removed, the floor is seen through a homography. Something above the floor
seems further from the point below the camera the higher it is; correcting that takes only the
camera's position.
"""

from dataclasses import replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any, Self

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ...errors import InputError
from ...geometry.outline import FloatArray
from ...yaml_files import content_of, validated
from ..geotiff import Georeference
from ..image import MAX_PIXELS, MAX_SIDE, MIN_SIDE, STRIP, Picture, picture_from_bytes

Floats = NDArray[np.floating[Any]]
Number = Annotated[float, Field(ge=-1e9, le=1e9)]
Row = tuple[Number, Number, Number]
Matrix = tuple[Row, Row, Row]
Metres = Annotated[float, Field(ge=-10_000, le=10_000)]
Place = tuple[Metres, Metres]
Side = Annotated[int, Field(ge=MIN_SIDE, le=MAX_SIDE)]
PRECISE = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-9)
BORDER = 40
"""Number of points on each side of the floor that are checked to be in the picture."""


class CameraFileModel(BaseModel):
    """Base of the models that files about cameras hold; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Residuals(CameraFileModel):
    """Errors of the known points, in the picture and on the floor.

    Attributes:
        corners_mm: expected error of the floor's worst corner, if pixels were off by as much as the
            known points are; the less of the floor these cover, the larger it is.
    """

    mean_px: float
    worst_px: float
    mean_mm: float
    worst_mm: float
    corners_mm: float


class Lens(CameraFileModel):
    """The distortion of a camera's lens, as OpenCV models it.

    Attributes:
        camera_matrix: (3, 3), px.
        distortion: k1, k2, p1, p2 and so on; empty for no distortion.
    """

    camera_matrix: Matrix
    distortion: tuple[Number, ...] = Field(default=(), max_length=14)

    def undistorted(self, pixels: FloatArray) -> FloatArray:
        """Return where pixels (n, 2) would be without the distortion."""
        if not self.distortion or not len(pixels):
            return pixels
        matrix, coefficients = np.array(self.camera_matrix), np.array(self.distortion)
        found = cv2.undistortImagePoints(
            pixels.reshape(-1, 1, 2), matrix, coefficients, arg1=PRECISE
        )
        return np.asarray(found, dtype=float).reshape(-1, 2)

    def distorted(self, pixels: FloatArray) -> FloatArray:
        """Return where undistorted pixels (n, 2) are in the picture."""
        if not self.distortion or not len(pixels):
            return pixels
        matrix, none = np.array(self.camera_matrix), np.zeros(3)
        rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(matrix).T
        found, _ = cv2.projectPoints(rays, none, none, matrix, np.array(self.distortion))
        return np.asarray(found, dtype=float).reshape(-1, 2)


class Calibration(CameraFileModel):
    """A calibrated camera above a floor.

    Attributes:
        picture: width and height of its pictures, px.
        homography: from the undistorted picture, px, to the floor, m.
        lens: its distortion; None for a lens without any.
        camera: its x and y on the floor and its height above it, m; None if not known.
        floor: x0, y0, x1, y1 of the part of the floor that the top view shows, m.
        metres_per_pixel: scale of the top view.
        residuals: errors of the known points that it was fitted to.
    """

    picture: tuple[Side, Side]
    homography: Matrix
    lens: Lens | None = None
    camera: tuple[Metres, Metres, Annotated[float, Field(gt=0, le=10_000)]] | None = None
    floor: tuple[Metres, Metres, Metres, Metres]
    metres_per_pixel: Annotated[float, Field(gt=0, le=1_000)]
    residuals: Residuals

    @model_validator(mode="after")
    def _whole(self) -> Self:
        x0, y0, x1, y1 = self.floor
        if not (x0 < x1 and y0 < y1):
            raise ValueError(f"floor is x0, y0, x1, y1 with x0 < x1 and y0 < y1, got {self.floor}")
        width, height = self.size
        if min(width, height) < MIN_SIDE or width * height > MAX_PIXELS:
            raise ValueError(f"the floor would be shown in {width} x {height} pixels")
        if abs(np.linalg.det(np.array(self.homography))) < 1e-15:
            raise ValueError("homography takes the picture to a line, not to a floor")
        if not self.sees(_border_points(self.floor)).all():
            raise ValueError(
                f"the floor {x0:g}, {y0:g} to {x1:g}, {y1:g} m is not all in the picture: give one "
                "that is, as `floor: [x0, y0, x1, y1]`"
            )
        return self

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the top view, px."""
        x0, y0, x1, y1 = self.floor
        return round((x1 - x0) / self.metres_per_pixel), round((y1 - y0) / self.metres_per_pixel)

    @property
    def y_up(self) -> bool:
        """Whether y points up in the top view, which is never a mirror image."""
        return bool(np.linalg.det(np.array(self.homography)) < 0)

    @cached_property
    def to_top(self) -> FloatArray:
        """The transform (3, 3) from the floor, m, to the top view, px."""
        x0, y0, _, y1 = self.floor
        m = self.metres_per_pixel
        down = (0, -1 / m, y1 / m - 0.5) if self.y_up else (0, 1 / m, -y0 / m - 0.5)
        return np.array([(1 / m, 0, -x0 / m - 0.5), down, (0, 0, 1)])

    def on_floor(self, pixels: FloatArray, height: float = 0.0) -> FloatArray:
        """Return the places (n, 2), m, of what is seen at pixels (n, 2).

        Args:
            pixels: (n, 2), px of the picture.
            height: height of what is seen above the floor, m.

        Raises:
            InputError: the height is not 0, and the camera's position is not known.
        """
        straight = pixels if self.lens is None else self.lens.undistorted(pixels)
        found = through(np.array(self.homography), straight)
        if not height:
            return found
        if self.camera is None:
            raise InputError(
                "What is above the floor cannot be located, as the calibration does not say where "
                "the camera is; calibrate with `camera: [x, y, height]` or a lens file."
            )
        x, y, above = self.camera
        return found + (np.array([x, y]) - found) * height / above

    def in_picture(self, places: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) at which places (n, 2) on the floor, m, are seen."""
        straight = through(np.linalg.inv(np.array(self.homography)), places)
        return straight if self.lens is None else self.lens.distorted(straight)

    def sees(self, places: FloatArray) -> NDArray[np.bool_]:
        """Return a mask (n,) of the places (n, 2) on the floor, m, that the camera sees."""
        back = np.linalg.inv(np.array(self.homography))
        ahead = np.column_stack([places, np.ones(len(places))]) @ back[2] > 0
        at = self.in_picture(places)
        inside = ((at > -0.5) & (at < np.array(self.picture) - 0.5)).all(axis=1)
        # Far outside, a lens model can map points back into the picture.
        again = np.abs(self.on_floor(at) - places).max(axis=1) < self.metres_per_pixel
        return ahead & inside & again

    def _seen_at(self, top: int, bottom: int) -> NDArray[np.float32]:
        """Return where rows of the top view are in the picture, (bottom - top, w, 2), px."""
        rows, columns = np.mgrid[top:bottom, 0 : self.size[0]].astype(float)
        places = np.column_stack([columns.ravel(), rows.ravel()])
        floor = through(np.linalg.inv(self.to_top), places)
        return self.in_picture(floor).astype(np.float32).reshape(*rows.shape, 2)

    @cached_property
    def all_seen_at(self) -> NDArray[np.float32]:
        """Where each pixel of the top view is in the picture, (h, w, 2), px."""
        return self._seen_at(0, self.size[1])

    def rectified(self, frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Warp one of many frames (H, W, 3) into a view from straight above, (h, w, 3)."""
        at = self.all_seen_at
        return np.asarray(cv2.remap(frame, at[..., 0], at[..., 1], cv2.INTER_LINEAR), np.uint8)

    def top_view(self, picture: Picture, source: str) -> Picture:
        """Warp a picture into the top view: the floor from straight above, with its scale.

        Args:
            picture: taken by this camera.
            source: name of the calibration, for messages and the picture's note.

        Raises:
            InputError: the picture is not of the camera's size.
        """
        if picture.size != self.picture:
            (width, height), (w, h) = self.picture, picture.size
            raise InputError(
                f"{picture.name} has {w} x {h} pixels, but {source} is for {width} x {height}; "
                "take it as the picture for that was taken, or calibrate anew."
            )
        (width, height), to_floor = self.size, np.asarray(np.linalg.inv(self.to_top), dtype=float)
        seen = np.empty((height, width, 3), np.uint8)
        for top in range(0, height, STRIP):
            at, strip = self._seen_at(top, min(top + STRIP, height)), seen[top : top + STRIP]
            cv2.remap(picture.pixels, at[..., 0], at[..., 1], cv2.INTER_LINEAR, dst=strip)
        x0, y0, x1, y1 = self.floor
        note = f"straight from above by {source}: x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m"
        place = Georeference(to_floor, False, 0, self.metres_per_pixel, note)
        file = BytesIO()
        Image.fromarray(seen).save(file, "PNG")
        found = picture_from_bytes(file.getvalue(), f"{Path(picture.name).stem}-top.png")
        return replace(found, place=place, notes=(note,))

    def to_yaml(self) -> str:
        """Return the content of a calibration file."""
        return yaml.safe_dump(
            self.model_dump(mode="json"), default_flow_style=None, sort_keys=False
        )


def read_calibration(path: Path) -> Calibration:
    """Read a calibration that `formup calibrate` wrote.

    Raises:
        InputError: the file cannot be read, or holds no calibration; names every mistake.
    """
    content = content_of(path, "picture: [1280, 720]")
    return validated(path, "a camera above a floor", Calibration, content)


def through(matrix: Floats, points: FloatArray) -> FloatArray:
    """Map points (n, 2) through a homography (3, 3)."""
    found = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return found[:, :2] / found[:, 2:]


def _border_points(floor: tuple[float, float, float, float]) -> FloatArray:
    """Return points (n, 2), m, along the border of a floor."""
    x0, y0, x1, y1 = floor
    x, y = np.linspace(x0, x1, BORDER), np.linspace(y0, y1, BORDER)
    sides = [(x, np.full(BORDER, y0)), (x, np.full(BORDER, y1)), (np.full(BORDER, x0), y)]
    return np.vstack([np.column_stack(side) for side in (*sides, (np.full(BORDER, x1), y))])
