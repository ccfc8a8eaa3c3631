"""Drawn video of a fixed camera above a floor: a thing that moves, robots, and disturbances.

The truth of every frame is known; the benchmark and the tests of tracking share these videos.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt
from shapely import affinity
from shapely.geometry import Point, Polygon

from ..tools.geometry.outline import Outline, make_outline
from ..tools.perception.tracking.tracker import ObjectTracker, Tracked

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]
FINER = 4
"""Supersampling factor: regions are drawn this many times larger, and averaged."""
SHAPES = {
    "box": [(-60, -40), (60, -40), (60, 40), (-60, 40)],
    "ell": [(-70, -60), (70, -60), (70, 0), (0, 0), (0, 60), (-70, 60)],
    "round": [(55 * math.cos(a / 20), 55 * math.sin(a / 20)) for a in range(126)],
}


@dataclass(frozen=True)
class Seen:
    """A tracker's answer for a frame, its overlap with the truth (IoU), and its CPU time in ms."""

    frame: int
    tracked: Tracked
    overlap: float
    ms: float


@dataclass(frozen=True)
class Video:
    """A video: a thing, how it moves, and disturbances.

    Attributes:
        look: of the thing: textured, coloured (plain) or grey (plain).
        floor: plain or textured.
        speed: px per frame; the path bends.
        turn: degrees per frame.
        robots: follow (move along with the thing), stay (where they were), or none.
        noise: standard deviation, in grey levels.
        light: fraction by which the picture has darkened in the end.
        shadow: whether a dark band passes over.
        blur: width of a blur along x, px.
        covered: fraction of the thing that something covers, in the middle third of the frames.
        leaves: whether the thing moves straight out of the picture.
        size: width and height of the frames, px.
        seed: of the noise, the patterns and the path.
    """

    look: str = "textured"
    shape: str = "ell"
    floor: str = "plain"
    speed: float = 3.0
    turn: float = 0.0
    frames: int = 60
    robots: str = "none"
    noise: float = 3.0
    light: float = 0.0
    shadow: bool = False
    blur: int = 0
    covered: float = 0.0
    leaves: bool = False
    size: tuple[int, int] = (640, 480)
    seed: int = 0

    @cached_property
    def outline(self) -> Outline:
        """The outline of the thing in the first frame."""
        at = np.multiply((0.3, 0.35), self.size)
        return make_outline(np.array(SHAPES[self.shape]) + at)

    def motion(self, frame: int) -> tuple[float, float, float]:
        """Return how the thing has moved by a frame: dx and dy, px, and its turn, radians."""
        turn, way = math.radians(self.turn) * frame, self.speed * frame
        if self.leaves:
            return -way, 0.0, turn
        along = 0.5 + 0.35 * math.sin(frame / 9 + self.seed)
        return way * math.cos(along), way * math.sin(along), turn

    def carried(self, region: Polygon, motion: tuple[float, float, float]) -> Polygon:
        """Return a region moved along with the thing."""
        dx, dy, turn = motion
        turned = affinity.rotate(region, turn, self.outline.centre, use_radians=True)
        return affinity.translate(turned, dx, dy)

    def truth(self, frame: int) -> Polygon:
        """Return the region of the thing in a frame."""
        return self.carried(self.outline.polygon, self.motion(frame))

    def follow(self) -> Iterator[Seen]:
        """Run a tracker, and yield its result for each frame from the second on."""
        pictures = self.pictures()
        tracker = ObjectTracker(next(pictures), self.outline)
        for frame, picture in enumerate(pictures, start=1):
            began = time.process_time()
            tracked = tracker.update(picture)
            took, truth = time.process_time() - began, self.truth(frame)
            found = self.carried(self.outline.polygon, (tracked.dx, tracked.dy, tracked.turn))
            overlap = found.intersection(truth).area / found.union(truth).area
            yield Seen(frame, tracked, overlap, 1000 * took)

    def pictures(self) -> Iterator[Bytes]:
        """Yield the frames."""
        random = np.random.default_rng(self.seed)
        floor, cloth = self._floor(random), self._cloth(random)
        for frame in range(self.frames):
            yield self._drawn(frame, floor, cloth, random)

    def _floor(self, random: np.random.Generator) -> Floats:
        w, h = self.size
        plain = np.full((h, w, 3), (150, 160, 165), np.float32)
        shading = np.linspace(0.92, 1.06, w, dtype=np.float32)[None, :, None]
        if self.floor == "textured":
            plain += spots(random, (h, w), 4.0, 22.0)
        return plain * shading

    def _cloth(self, random: np.random.Generator) -> Floats:
        """Return the thing's colours around its centre, (400, 400, 3)."""
        colour = {"textured": (90, 120, 140), "coloured": (60, 70, 190), "grey": (70, 72, 75)}
        cloth = np.full((400, 400, 3), colour[self.look], np.float32)
        return cloth + spots(random, (400, 400), 3.0, 40.0) if self.look == "textured" else cloth

    def _drawn(
        self, frame: int, floor: Floats, cloth: Floats, random: np.random.Generator
    ) -> Bytes:
        w = self.size[0]
        canvas = floor.copy()
        dx, dy, turn = self.motion(frame)
        c, s = math.cos(turn), math.sin(turn)
        matrix = np.array([[c, -s, 0], [s, c, 0]])
        matrix[:, 2] = self.outline.centre + np.array([dx, dy]) - matrix[:, :2] @ (200, 200)
        laid = cv2.warpAffine(cloth, matrix, self.size, borderMode=cv2.BORDER_REPLICATE)
        paint(canvas, self.truth(frame), np.asarray(laid, np.float32))
        self._robots(canvas, frame)
        third = self.frames // 3
        if self.covered and third <= frame < 2 * third:
            x0, y0, x1, y1 = self.truth(frame).bounds
            across = x0 + self.covered * (x1 - x0)
            cover = Polygon.from_bounds(x0 - 5, y0 - 30, across, y1 + 30)
            paint(canvas, cover, (40, 130, 60))
        if self.shadow:
            band = np.abs(np.arange(w) - (w * frame / self.frames) * 1.2 + 60) < 60
            soft = cv2.blur(band[None].astype(np.float32), (9, 1))
            canvas *= 1 - 0.4 * soft.reshape(1, w, 1)
        canvas *= 1 - self.light * frame / self.frames
        if self.blur:
            canvas = cv2.blur(canvas, (self.blur, 1))
        canvas += self.noise * random.standard_normal(canvas.shape, np.float32)
        return np.clip(canvas, 0, 255).astype(np.uint8)

    def _robots(self, canvas: Floats, frame: int) -> None:
        if self.robots == "none":
            return
        ring, middle = self.outline.polygon.exterior, self.outline.polygon.centroid
        for k in range(6):
            x, y = ring.interpolate((k + 0.4) / 6, normalized=True).coords[0]
            far = math.hypot(x - middle.x, y - middle.y)
            reach = (far + 8) / far  # of 12 px radius: 4 px over the edge
            x, y = middle.x + reach * (x - middle.x), middle.y + reach * (y - middle.y)
            disc = Point(x, y).buffer(12)
            tag = Polygon.from_bounds(x - 5, y - 5, x + 5, y + 5)
            if self.robots == "follow":
                disc, tag = (self.carried(part, self.motion(frame)) for part in (disc, tag))
            paint(canvas, disc, (30, 30, 30))
            paint(canvas, tag, (240, 240, 240))


def spots(random: np.random.Generator, size: tuple[int, int], wide: float, strong: float) -> Floats:
    """Return smooth noise, (h, w, 3).

    Args:
        size: height and width, px.
        wide: standard deviation of the blur, px.
        strong: standard deviation of the noise.
    """
    noise = cv2.GaussianBlur(random.standard_normal((*size, 3), np.float32), (0, 0), wide)
    return strong * noise / noise.std()


def paint(canvas: Floats, region: Polygon, colour: Floats | tuple[int, int, int]) -> None:
    """Paint a region with a colour, or a picture of the canvas's size, with soft edges."""
    h, w = canvas.shape[:2]
    x0, y0, x1, y1 = (int(edge) for edge in region.bounds)
    part = np.s_[max(y0 - 2, 0) : min(y1 + 3, h), max(x0 - 2, 0) : min(x1 + 3, w)]
    rows, columns = canvas[part].shape[:2]
    if not rows or not columns:
        return
    origin = (part[1].start, part[0].start)
    points = (np.array(region.exterior.coords) - origin + 0.5) * FINER - 0.5
    mask = np.zeros((rows * FINER, columns * FINER), np.uint8)
    cv2.fillPoly(mask, [np.round(points * 256).astype(np.int32)], (255,), shift=8)
    share = cv2.resize(mask, (columns, rows), interpolation=cv2.INTER_AREA)[..., None] / 255.0
    laid = colour[part] if isinstance(colour, np.ndarray) else np.array(colour)
    canvas[part] += share * (laid - canvas[part])
