"""What is known of a floor before its camera is calibrated, and where a picture shows it.

These are points that somebody clicked, or tags or a board on the floor.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self, cast

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ...errors import InputError
from ...geometry.outline import FloatArray
from ...yaml_files import content_of, validated
from .calibration import CameraFileModel, Lens, Metres, Number, Place
from .tags import Dictionary, centre, tags_in

Squares = Annotated[int, Field(ge=3, le=100)]
Above0 = Annotated[float, Field(gt=0, le=100)]
PointMatches = tuple[list[str], FloatArray, FloatArray]
"""Names of points, where they are seen, (n, 2) px, and where they are on the floor, (n, 2) m."""


class KnownPoint(CameraFileModel):
    """A known point: where it is seen, px, and where it is on the floor, m."""

    name: str = Field(default="", max_length=100)
    pixel: tuple[Number, Number]
    floor: Place


class Board(CameraFileModel):
    """A board that lies on the floor, aligned with its axes.

    Attributes:
        squares: number of squares in a row and in a column.
        square: side of a square, m.
        at: position of the inner corner that is at the upper left in the picture (of a ChArUco
            board, in the print), m. From there rows run along x, and columns against y.
        marker: side of a ChArUco board's tags, m; None for a chessboard.
        dictionary: OpenCV's dictionary of these tags.
    """

    squares: tuple[Squares, Squares]
    square: Above0
    at: Place = (0.0, 0.0)
    marker: Above0 | None = None
    dictionary: Dictionary = "DICT_4X4_50"


class Known(CameraFileModel):
    """What is known of a floor and its camera: the content of a file for `formup calibrate`.

    Attributes:
        points: points that somebody clicked.
        tags: centres of the tags on the floor, m, by tag id.
        dictionary: OpenCV's dictionary of these tags.
        board: a board on the floor.
        floor: x0, y0, x1, y1 of what the top view is to show, m; by default, the bounds of the
            known points.
        camera: its x and y on the floor and its height above it, m.
        lens: an OpenCV file with camera_matrix and distortion_coefficients, relative to this one.
    """

    points: tuple[KnownPoint, ...] = Field(default=(), max_length=1_000)
    tags: Mapping[Annotated[int, Field(ge=0)], Place] = Field(default={}, max_length=1_000)
    dictionary: Dictionary = "DICT_4X4_50"
    board: Board | None = None
    floor: tuple[Metres, Metres, Metres, Metres] | None = None
    camera: tuple[Metres, Metres, Above0] | None = None
    lens: Path | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if sum(map(bool, (self.points, self.tags, self.board))) != 1:
            raise ValueError("give one of points, tags and board")
        if self.board and not self.floor:
            raise ValueError("a board does not say how far the floor reaches: give floor too")
        return self

    def found(self, pixels: NDArray[np.uint8]) -> PointMatches:
        """Find the known points in a picture.

        Args:
            pixels: (H, W, 3) RGB.

        Raises:
            InputError: a tag is not seen exactly once, or the board is not seen.
        """
        if self.points:
            names = [p.name or f"{p.pixel[0]:g},{p.pixel[1]:g}" for p in self.points]
            floor = np.array([p.floor for p in self.points])
            return names, np.array([p.pixel for p in self.points], dtype=float), floor
        if self.board:
            grey = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), np.uint8)
            return _on_board(grey, self.board)
        seen = tags_in(np.ascontiguousarray(pixels[..., ::-1]), self.dictionary)
        if missing := [str(tag) for tag in self.tags if tag not in seen]:
            others = ", ".join(map(str, sorted(seen))) or "none"
            raise InputError(
                f"Tag {', '.join(missing)} of {self.dictionary} is not seen once in the picture "
                f"(seen: {others}); take another picture, or take it out of the file."
            )
        at = np.array([centre(seen[tag]) for tag in self.tags])
        return [f"tag {tag}" for tag in self.tags], at, np.array([*self.tags.values()])


def read_known(path: Path) -> Known:
    """Read what a person wrote down about a floor.

    Raises:
        InputError: the file cannot be read, or has another content; names every mistake.
    """
    known = validated(path, "what is known of a floor", Known, content_of(path, "points:"))
    return known.model_copy(update={"lens": known.lens and path.parent / known.lens})


def read_lens(path: Path, size: tuple[int, int]) -> Lens:
    """Read a lens as OpenCV's calibration stores it, in YAML, JSON or XML.

    Args:
        path: the file.
        size: width and height of the picture, px.

    Raises:
        InputError: the file cannot be read, is for pictures of another size, or has no
            camera_matrix.
    """
    try:
        path.read_bytes()
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        names = "camera_matrix", "distortion_coefficients", "image_width", "image_height"
        matrix, distortion, width, height = map(file.getNode, names)
        rows = np.asarray(matrix.mat(), dtype=float).reshape(3, 3).tolist()
        more = (
            [] if distortion.empty() else np.asarray(distortion.mat(), dtype=float).ravel().tolist()
        )
        stated = size if width.empty() else (int(width.real()), int(height.real()))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except (cv2.error, TypeError, ValueError, SystemError):
        raise InputError(
            f"{path} holds no lens; give a file that OpenCV's FileStorage wrote, with "
            "camera_matrix and distortion_coefficients."
        ) from None
    if stated != size:
        raise InputError(
            f"{path} is for pictures of {stated[0]} x {stated[1]} pixels, and this one has "
            f"{size[0]} x {size[1]}; calibrate the lens at that size."
        )
    return validated(path, "a lens", Lens, {"camera_matrix": rows, "distortion": more})


def _on_board(grey: NDArray[np.uint8], board: Board) -> PointMatches:
    columns, rows = board.squares[0] - 1, board.squares[1] - 1
    if board.marker is None:
        kind = "chessboard"
        ok, corners = cv2.findChessboardCornersSB(grey, (columns, rows), flags=0)
        at = np.asarray(corners, dtype=float).reshape(-1, 2) if ok else np.empty((0, 2))
        if ok and at[-1].sum() < at[0].sum():  # a chessboard looks the same after a half turn
            at = at[::-1]
        ids = np.arange(len(at))
    else:
        kind = "ChArUco board"
        family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        made = cv2.aruco.CharucoBoard(board.squares, board.square, board.marker, family)
        corners, numbers, _, _ = cast("Any", cv2.aruco.CharucoDetector(made)).detectBoard(grey)
        at = np.asarray([] if corners is None else corners, dtype=float).reshape(-1, 2)
        ids = np.asarray([] if numbers is None else numbers, dtype=int).ravel()
    if len(at) < 4:
        raise InputError(
            f"No {kind} of {board.squares[0]} x {board.squares[1]} squares is seen in the picture; "
            "see that all of it is in view, flat, lit evenly, and has a white border."
        )
    floor = np.array(board.at) + board.square * np.column_stack([ids % columns, -(ids // columns)])
    return [f"corner {i}" for i in ids], np.asarray(at, float), np.asarray(floor, float)
