"""A simulated room as a camera on its ceiling or wall sees it, for use without a camera or robots.

The floor is in metres: x to the right and y up in the picture of a camera straight above, z up.
Since the truth is known here, measurements made in such a picture can be compared with it.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.outline import FloatArray

Pose = tuple[float, float, float]
"""x and y on the floor, m, and the heading, radians from the x axis towards the y axis."""
Pixels = NDArray[np.uint8]

FINE = 2
"""Supersampling factor along each axis, which makes edges smooth."""
FLOOR_SCALE = 200
"""Pixels of the floor's texture per metre."""
CELL = 6
"""Side of a printed tag's cell, px."""
MARGIN = 0.25
"""Margin drawn on each side of a picture that is then distorted, as a share of its size."""
BODY, THING, WALL = (70, 66, 62), (40, 110, 215), (52, 50, 48)
SHADE = 0.62


@dataclass(frozen=True)
class Sheet:
    """A picture that lies on the floor, such as a board or a printed tag.

    Attributes:
        pixels: (h, w) or (h, w, 3) BGR uint8.
        pose: pose of its centre; its right side points along the heading.
        width: width of the picture, m; its height follows from its pixels.
    """

    pixels: Pixels
    pose: Pose
    width: float


def tag_sheet(dictionary: str, tag: int, pose: Pose, size: float) -> Sheet:
    """Return a printed tag with its white border.

    Args:
        dictionary: OpenCV's name of the dictionary, such as DICT_4X4_50.
        tag: id of the tag in the dictionary.
        pose: pose of its centre.
        size: side of its black square, m.
    """
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = known.markerSize + 2
    black = cv2.aruco.generateImageMarker(known, tag, cells * CELL)
    white = np.pad(np.asarray(black, np.uint8), CELL, constant_values=255)
    return Sheet(white, pose, size * (cells + 2) / cells)


@dataclass(frozen=True)
class Room:
    """A room, its camera, and what its robots and its one object look like.

    Attributes:
        size: width and depth of the floor, m, a corner of which is (0, 0).
        eye, aim: position (x, y, z) of the camera and the point (x, y) on the floor it looks at, m.
        picture: width and height of the camera's picture, px.
        view: the camera's horizontal field of view, degrees.
        distortion: lens distortion k1, k2, p1, p2, k3 as in OpenCV; empty for none.
        sheets: pictures that lie on the floor.
        dictionary: OpenCV's name of the dictionary of the tags on robots.
        tag_size, tag_height: side of these tags and their height above the floor, m.
        thing: width, depth and height of the box-shaped object, m.
        textured: whether the object is textured rather than plain.
        light: offset (x, y) of a shadow for each metre of height.
        noise: standard deviation of the sensor noise, grey levels.
        blur: length of a blur along the picture's rows, px; 0 or 1 for none.
        seed: seed of the textures and of the noise pattern.
    """

    size: tuple[float, float] = (4.0, 3.0)
    eye: tuple[float, float, float] = (2.0, 1.5, 3.0)
    aim: tuple[float, float] = (2.0, 1.5)
    picture: tuple[int, int] = (1280, 720)
    view: float = 85.0
    distortion: tuple[float, ...] = ()
    sheets: tuple[Sheet, ...] = ()
    dictionary: str = "DICT_4X4_50"
    tag_size: float = 0.1
    tag_height: float = 0.0
    thing: tuple[float, float, float] = (0.6, 0.4, 0.3)
    textured: bool = False
    light: tuple[float, float] = (0.4, -0.25)
    noise: float = 2.0
    blur: int = 0
    seed: int = 0

    @property
    def camera_matrix(self) -> FloatArray:
        """The camera matrix (3, 3), px, with pixel centres at integers."""
        width, height = self.picture
        focal = width / 2 / math.tan(math.radians(self.view) / 2)
        return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])

    @property
    def homography(self) -> FloatArray:
        """The homography (3, 3) from the undistorted picture, px, to the floor, m."""
        found = np.linalg.inv(self.camera_matrix @ self._pose[:, [0, 1, 3]])
        return found / found[2, 2]

    def seen_at(self, points: FloatArray) -> FloatArray:
        """Project points (n, 3), m, into the distorted picture, (n, 2), px."""
        turn, _ = cv2.Rodrigues(self._pose[:, :3])
        lens = np.array(self.distortion or (0.0, 0.0, 0.0, 0.0))
        found, _ = cv2.projectPoints(points, turn, self._pose[:, 3], self.camera_matrix, lens)
        return np.asarray(found, dtype=float).reshape(-1, 2)

    def frame(self, robots: Mapping[int, Pose], thing: Pose | None = None, seed: int = 0) -> Pixels:
        """Render what the camera sees.

        Args:
            robots: poses of the robots by tag id; a tag's right side points ahead.
            thing: pose of the box-shaped object; None leaves it out.
            seed: seed that varies the noise from frame to frame.

        Returns:
            (H, W, 3) BGR uint8.
        """
        canvas, tall = self._empty.copy(), self.thing[2]
        boxes = [] if thing is None else [(_corners(thing, *self.thing[:2]), tall)]
        discs = {tag: _disc(pose, self.tag_size) for tag, pose in robots.items()}
        for base, height in [*boxes, *((disc, self.tag_height) for disc in discs.values())]:
            self._shadow(canvas, base, height)
        for base, height in boxes:
            self._box(canvas, base, height)
        for tag in sorted(robots, key=lambda tag: -math.dist(robots[tag][:2], self.eye[:2])):
            self._prism(canvas, discs[tag], self.tag_height, BODY)
            sheet = tag_sheet(self.dictionary, tag, robots[tag], self.tag_size)
            self._lay(canvas, sheet, self.tag_height)
        return self._camera_picture(canvas, seed)

    def _camera_picture(self, canvas: Pixels, seed: int) -> Pixels:
        """Apply lens, blur and sensor noise to the canvas."""
        if self.distortion:
            canvas = np.asarray(cv2.remap(canvas, *self._lens, cv2.INTER_LINEAR), np.uint8)
        seen = cv2.resize(canvas, self.picture, interpolation=cv2.INTER_AREA)
        if self.blur > 1:
            seen = cv2.blur(seen, (self.blur, 1))
        if self.noise:
            away = np.random.default_rng(seed).integers(0, self.picture[::-1])
            seen = cv2.add(seen, np.roll(self._grain, away, (0, 1)), dtype=cv2.CV_8U)
        return np.asarray(seen, np.uint8)

    @cached_property
    def _pose(self) -> FloatArray:
        """The transform (3, 4) from floor to camera coordinates; the camera looks along its z."""
        eye = np.array(self.eye)
        ahead = np.array([*self.aim, 0.0]) - eye
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 1.0, 0.0))
        right /= np.linalg.norm(right)
        turn = np.array([right, np.cross(ahead, right), ahead])
        return np.column_stack([turn, -turn @ eye])

    @cached_property
    def _margin(self) -> tuple[int, int]:
        share = MARGIN if self.distortion else 0.0
        return round(share * self.picture[0]), round(share * self.picture[1])

    @cached_property
    def _projection(self) -> FloatArray:
        """The projection (3, 4) from floor coordinates, m, to the canvas, px."""
        matrix = self.camera_matrix.copy()
        matrix[:2, 2] += self._margin
        matrix[:2] *= FINE
        matrix[:2, 2] += (FINE - 1) / 2
        return matrix @ self._pose

    def _on_canvas(self, points: FloatArray, height: float) -> FloatArray:
        """Project points (n, 2), m, at a height, m, onto the canvas, (n, 2), px."""
        rows = np.column_stack([points, np.full(len(points), height), np.ones(len(points))])
        found = rows @ self._projection.T
        return found[:, :2] / found[:, 2:]

    @cached_property
    def _lens(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The x and y coordinates on the canvas of each supersampled pixel of the picture."""
        width, height = self.picture
        rows, columns = np.mgrid[0 : height * FINE, 0 : width * FINE].astype(np.float32)
        seen = (np.stack([columns, rows], axis=-1).reshape(-1, 1, 2) + 0.5) / FINE - 0.5
        matrix, lens = self.camera_matrix, np.array(self.distortion)
        straight = cv2.undistortPoints(seen, matrix, lens, P=matrix).reshape(*rows.shape, 2)
        at = (straight + np.array(self._margin) + 0.5) * FINE - 0.5
        return at[..., 0].astype(np.float32), at[..., 1].astype(np.float32)

    @cached_property
    def _empty(self) -> Pixels:
        """The canvas with the floor and the sheets on it."""
        width, height = np.add(self.picture, np.multiply(2, self._margin)) * FINE
        canvas = np.full((height, width, 3), WALL, np.uint8)
        centre = self.size[0] / 2, self.size[1] / 2, 0.0
        self._lay(canvas, Sheet(self._floor(), centre, self.size[0]), 0.0)
        for sheet in self.sheets:
            self._lay(canvas, sheet, 0.0)
        return canvas

    def _floor(self) -> Pixels:
        """Return a floor with tiles of half a metre and spots of many sizes, (h, w, 3) BGR."""
        width, height = (round(side * FLOOR_SCALE) for side in self.size)
        grey = 158.0 + _cloud((height, width), self.seed)
        for at in range(FLOOR_SCALE // 2, max(width, height), FLOOR_SCALE // 2):
            grey[at : at + 1] -= 22
            grey[:, at : at + 1] -= 22
        tint = np.array([0.94, 1.0, 1.03])
        return np.clip(grey[..., None] * tint, 0, 255).astype(np.uint8)

    @cached_property
    def _grain(self) -> NDArray[np.int16]:
        width, height = self.picture
        grain = np.random.default_rng(self.seed).normal(0, self.noise, (height, width, 3))
        return np.rint(grain).astype(np.int16)

    def _lay(self, canvas: Pixels, sheet: Sheet, height: float) -> None:
        """Lay a sheet flat at a height, m."""
        rows, columns = sheet.pixels.shape[:2]
        places = _corners(sheet.pose, sheet.width, sheet.width * rows / columns)
        self._put(canvas, sheet.pixels, self._on_canvas(places, height))

    def _put(self, canvas: Pixels, pixels: Pixels, corners: FloatArray) -> None:
        """Warp a picture into a convex quadrilateral (4, 2), px, its top left corner first."""
        rows, columns = pixels.shape[:2]
        left, top = np.clip(np.floor(corners.min(axis=0)), 0, None).astype(int)
        right, bottom = np.minimum(np.ceil(corners.max(axis=0)) + 1, canvas.shape[1::-1])
        size = int(right) - left, int(bottom) - top
        if min(size) < 1:
            return
        edges = np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)]) - 0.5
        inside = (corners - (left, top)).astype(np.float32)
        way = cv2.getPerspectiveTransform(edges.astype(np.float32), inside)
        colours = pixels if pixels.ndim == 3 else cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR)
        drawn = cv2.warpPerspective(colours, way, size, borderMode=cv2.BORDER_REPLICATE)
        mask = np.zeros(size[::-1], np.uint8)
        _fill(mask, corners - (left, top), (1,))
        part = canvas[top : top + size[1], left : left + size[0]]
        part[mask > 0] = np.asarray(drawn)[mask > 0]

    def _shadow(self, canvas: Pixels, base: FloatArray, height: float) -> None:
        """Darken the floor where a body on a base (n, 2), m, casts its shadow."""
        if height > 0:
            away = base + height * np.array(self.light)
            hull = _hull(self._on_canvas(np.vstack([base, away]), 0.0))
            mask = np.zeros(canvas.shape[:2], np.uint8)
            _fill(mask, hull, (1,))
            canvas[mask > 0] = (canvas[mask > 0] * SHADE).astype(np.uint8)

    def _prism(
        self, canvas: Pixels, base: FloatArray, height: float, colour: tuple[int, int, int]
    ) -> None:
        """Draw a body with upright sides on a base (n, 2), m."""
        ends = [self._on_canvas(base, 0.0), self._on_canvas(base, height)]
        dark = tuple(round(0.6 * part) for part in colour)
        _fill(canvas, _hull(np.vstack(ends)), dark)
        _fill(canvas, ends[1], colour)

    def _box(self, canvas: Pixels, base: FloatArray, height: float) -> None:
        self._prism(canvas, base, height, THING)
        if self.textured:
            shape = tuple(round(side * 2 * FLOOR_SCALE) for side in self.thing[1::-1])
            spots = _cloud(shape, self.seed + 1)[..., None] * 4.0
            pixels = np.clip(np.array(THING) + spots, 0, 255).astype(np.uint8)
            self._put(canvas, pixels, self._on_canvas(base, height))


def _corners(pose: Pose, width: float, depth: float) -> FloatArray:
    """Return a rectangle's corners (4, 2), m, clockwise from above, the far left one first."""
    half = np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)]) * (width / 2, depth / 2)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return half @ np.array([(cos, sin), (-sin, cos)]) + pose[:2]


def _disc(pose: Pose, radius: float) -> FloatArray:
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return np.array(pose[:2]) + radius * np.column_stack([np.cos(turns), np.sin(turns)])


def _cloud(shape: tuple[int, ...], seed: int) -> FloatArray:
    """Return noise of several scales, grey levels around 0."""
    rng, found = np.random.default_rng(seed), np.zeros(shape)
    for cell, strength in ((64, 5.0), (16, 3.5), (4, 2.5), (1, 1.5)):
        coarse = rng.normal(0, strength, (shape[0] // cell + 2, shape[1] // cell + 2))
        found += cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_LINEAR)
    return found


def _hull(points: FloatArray) -> FloatArray:
    return np.asarray(cv2.convexHull(points.astype(np.float32)), dtype=float).reshape(-1, 2)


def _fill(canvas: Pixels, points: FloatArray, colour: Iterable[int]) -> None:
    """Fill a convex polygon (n, 2), px, to a sixteenth of a pixel."""
    sixteenths = np.rint(points * 16).astype(np.int32)
    cv2.fillConvexPoly(canvas, sixteenths, tuple(colour), shift=4)
