"""A page with a photograph, drawn on in the photograph's own pixel coordinates.

Everything is drawn at three times the page's resolution and averaged down, which smooths every
edge. Strokes and text are sized in units of the page, never of the photograph.
"""

from collections.abc import Sequence
from copy import copy
from itertools import pairwise

import numpy as np
import shapely
from PIL import Image, ImageDraw
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..geometry.outline import FloatArray
from ..perception.image import Picture
from ..perception.target_prompt import Box
from .text import font, shortened

Colour = tuple[int, int, int]
Margins = tuple[int, int, int, int]

INK: Colour = (20, 24, 31)
PAPER: Colour = (246, 247, 249)
WHITE: Colour = (255, 255, 255)
MUTED: Colour = (166, 173, 184)
ROBOT: Colour = (0, 92, 184)
IDLE: Colour = (120, 126, 134)
FINDING: Colour = (214, 30, 38)
TARGET: Colour = (255, 209, 26)
ALLOWED: Colour = (72, 190, 255)
FORBIDDEN: Colour = (196, 52, 72)
CERTIFIED: Colour = (0, 122, 90)
PARTIAL: Colour = (176, 92, 0)
MET: Colour = (255, 128, 14)
MARKS: tuple[Colour, ...] = (
    (255, 209, 26),
    (86, 204, 255),
    (255, 128, 14),
    (94, 220, 140),
    (255, 130, 200),
    (190, 160, 255),
)
"""Light colours for numbered things; ink is legible on all of them."""

FINE = 3
"""Supersampling factor: drawn pixels per page pixel, along each axis."""


class Canvas:
    """A page with the photograph on it.

    Points are (n, 2) in pixels of the photograph (x right, y down, pixel centres at integers).
    Lengths are in units of the page unless documented as source px (pixels of the photograph) or
    page px.
    """

    def __init__(
        self,
        picture: Picture,
        long: int,
        unit: float,
        margins: Margins = (0, 0, 0, 0),
        origin: tuple[int, int] = (0, 0),
    ) -> None:
        """Lay out the page.

        Args:
            picture: the photograph.
            long: length of its long side on the page, page px.
            unit: page px per unit of strokes and text.
            margins: left, top, right, bottom, page px.
            origin: coordinates of the photograph's first pixel, if it is cut from a larger one.
        """
        left, top, right, bottom = margins
        width, height = shown_size(picture, long)
        self.unit = unit
        self.source, self.origin = picture.size, origin
        self.scale = np.array([width / picture.width, height / picture.height])
        self.offset = np.array([left, top], dtype=float)
        self.size = (left + width + right, top + height + bottom)
        self.photo: Box = (left, top, left + width, top + height)
        photo = Image.fromarray(picture.pixels).resize(
            (width, height),
            Image.Resampling.LANCZOS,
            reducing_gap=1.0,  # average photographs of twice the size or more first: far faster
        )
        self._image = Image.new("RGB", (self.size[0] * FINE, self.size[1] * FINE), INK)
        # Averaging down undoes repeated pixels without loss.
        fine = photo.resize((width * FINE, height * FINE), Image.Resampling.NEAREST)
        self._image.paste(fine, (left * FINE, top * FINE))
        self._draw = ImageDraw.Draw(self._image, "RGBA")

    def copy(self) -> "Canvas":
        """Return a second canvas that starts with everything drawn on this one."""
        twin = copy(self)
        twin._image = self._image.copy()
        twin._draw = ImageDraw.Draw(twin._image, "RGBA")
        return twin

    def finish(self) -> Image.Image:
        """Return the page as an RGB image."""
        return self._image.reduce(FINE)

    def at(self, points: FloatArray) -> FloatArray:
        """Map points (n, 2) of the photograph to the page, (n, 2), page px, pixel centres."""
        return self.offset + (points - np.array(self.origin) + 0.5) * self.scale - 0.5

    def page_length(self, source_px: float) -> float:
        """Convert a length in source px to units of the page."""
        return source_px * float(self.scale.mean()) / self.unit

    def tint(self, geometry: BaseGeometry, colour: Colour, strength: float) -> None:
        """Colour an area given in source px; strength 0 leaves the photograph, 1 covers it."""
        mask = self._mask()
        draw = ImageDraw.Draw(mask)
        for part in shapely.get_parts(geometry):
            if isinstance(part, Polygon) and not part.is_empty:
                draw.polygon(self._path(part.exterior), fill=round(255 * strength))
                for hole in part.interiors:
                    draw.polygon(self._path(hole), fill=0)
        self._cover(mask, colour)

    def strokes(
        self, lines: Sequence[FloatArray], colour: Colour, width: float, strength: float = 1.0
    ) -> None:
        """Draw polylines, each (k, 2)."""
        paths = [[(x, y) for x, y in self._fine(line)] for line in lines]
        if strength == 1:
            for path in paths:
                self._draw.line(path, colour, self._thick(width), joint="curve")
            return
        mask = self._mask()
        draw = ImageDraw.Draw(mask)
        for path in paths:
            draw.line(path, round(255 * strength), self._thick(width), joint="curve")
        self._cover(mask, colour)

    def trails(self, paths: FloatArray, colour: Colour, width: float) -> None:
        """Draw polylines that fade toward their beginnings, (steps, n, 2), as one layer."""
        mask = self._mask()
        draw = ImageDraw.Draw(mask)
        for step, (before, after) in enumerate(pairwise(paths), start=1):
            strength = round(200 * step / len(paths))
            for a, b in zip(self._fine(before), self._fine(after), strict=True):
                draw.line([(a[0], a[1]), (b[0], b[1])], strength, self._thick(width))
        self._cover(mask, colour)

    def cased(self, lines: Sequence[FloatArray], colour: Colour, width: float) -> None:
        """Draw polylines with a dark seam on both sides, legible on any background."""
        self.strokes(lines, INK, width + 2.4, 0.75)
        self.strokes(lines, colour, width)

    def dashes(self, lines: Sequence[FloatArray], colour: Colour, width: float) -> None:
        """Draw polylines as cased dashes."""
        scale = float(self.scale.mean()) / self.unit
        cut = [piece for line in lines for piece in _dashes(line, 7 / scale, 5 / scale)]
        self.cased(cut, colour, width)

    def disc(self, centre: FloatArray, radius: float, fill: Colour, rim: float) -> None:
        """Draw a disc with a white rim of width `rim` and a soft dark edge."""
        self._ellipse(centre, radius + 1.7 * rim, (*INK, 120))
        self._ellipse(centre, radius + rim, (*WHITE, 255))
        self._ellipse(centre, radius, (*fill, 255))

    def circle(self, centre: FloatArray, radius: float, colour: Colour, width: float) -> None:
        """Draw a circle with a dark casing and a darkened inside."""
        self._ellipse(centre, radius, (*INK, 120))
        self._ellipse(centre, radius + width / 2 + 0.8, None, INK, width + 1.6)
        self._ellipse(centre, radius + width / 2, None, colour, width)

    def body(self, centre: FloatArray, radius: float) -> None:
        """Draw a robot's true extent as a thin circle; the radius is in source px."""
        reach = self.page_length(radius)
        self._ellipse(centre, reach, (*ROBOT, 60))
        self._ellipse(centre, reach + 0.8, None, INK, 2.0)
        self._ellipse(centre, reach, None, WHITE, 1.0)

    def cross(self, centre: FloatArray, reach: float, colour: Colour, width: float) -> None:
        """Draw an x through a point."""
        x, y = self._fine(centre[None])[0]
        d = reach * self.unit * FINE
        for slope in (-1, 1):
            self._draw.line(
                [(x - d, y - slope * d), (x + d, y + slope * d)], colour, self._thick(width)
            )

    def text_size(self, text: str, size: float) -> tuple[float, float]:
        """Return the width and height of a line of text, page px."""
        points = self.font_px(size)
        return font(points * FINE).getlength(text) / FINE, float(points)

    def shortened(self, text: str, size: float, room: float) -> str:
        """Return as much of a drawable text as fits a width of `room` page px."""
        return shortened(text, room * FINE, font(self.font_px(size) * FINE))

    def font_px(self, size: float) -> int:
        """Convert a text size to page px."""
        return max(round(size * self.unit), 6)

    def text(
        self, where: FloatArray, text: str, size: float, colour: Colour, seam: Colour | None = None
    ) -> None:
        """Draw text centred on a point of the page, page px, outlined in `seam` if given."""
        face = font(self.font_px(size) * FINE)
        # Centre on capitals and digits: descenders must not push a line up.
        x0, top, x1, bottom = face.getbbox("0", anchor="ls")
        x0, _, x1, _ = face.getbbox(text, anchor="ls")
        x, y = (where + 0.5) * FINE - 0.5
        width = 0 if seam is None else max(round(size * self.unit * FINE * 0.13), 1)
        self._draw.text(
            (x - (x0 + x1) / 2, y - (top + bottom) / 2),
            text,
            (*colour, 255),
            face,
            anchor="ls",
            stroke_width=width,
            stroke_fill=(*(seam or colour), 255),
        )

    def box(self, box: Box, colour: Colour, corner: float = 0.0, strength: float = 1.0) -> None:
        """Fill a box of the page, page px, with its corners rounded to a radius in units."""
        x0, y0, x1, y1 = (round(v * FINE) for v in box)
        self._draw.rounded_rectangle(
            (x0, y0, max(x1 - 1, x0), max(y1 - 1, y0)),
            corner * self.unit * FINE,
            (*colour, round(255 * strength)),
        )

    def fill_margins(self, colour: Colour) -> None:
        """Colour the page around the photograph, covering whatever was drawn there."""
        x0, y0, x1, y1 = self.photo
        width, height = self.size
        for box in (
            (0, 0, width, y0),
            (0, y1, width, height),
            (0, y0, x0, y1),
            (x1, y0, width, y1),
        ):
            if box[2] > box[0] and box[3] > box[1]:
                self.box(box, colour)

    def chip(
        self,
        where: FloatArray,
        text: str,
        size: float,
        colour: Colour,
        ground: Colour,
        seam: float = 0.0,
    ) -> None:
        """Draw text on a rounded background, centred on a point of the page, page px.

        `seam` is the width of the dark rim around the background, units; 0 draws none.
        """
        x, y = where
        width, height = self.chip_size(text, size)
        box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        if seam:
            out = seam * self.unit
            around = (box[0] - out, box[1] - out, box[2] + out, box[3] + out)
            self.box(around, INK, corner=4 + seam, strength=0.75)
        self.box(box, ground, corner=4)
        self.text(where, text, size, colour)

    def chip_size(self, text: str, size: float) -> tuple[float, float]:
        """Return the width and height of a chip, page px."""
        width, height = self.text_size(text, size)
        return width + 0.8 * height, 1.4 * height

    def _mask(self) -> Image.Image:
        return Image.new("L", self._image.size, 0)

    def _cover(self, mask: Image.Image, colour: Colour) -> None:
        box = mask.getbbox()
        if box is not None:  # most masks are empty except for a small part
            self._image.paste(colour, box, mask.crop(box))

    def _fine(self, points: FloatArray) -> FloatArray:
        return (self.at(points) + 0.5) * FINE - 0.5

    def _path(self, ring: BaseGeometry) -> list[tuple[float, float]]:
        return [(x, y) for x, y in self._fine(shapely.get_coordinates(ring))]

    def _thick(self, width: float) -> int:
        return max(round(width * self.unit * FINE), 1)

    def _ellipse(
        self,
        centre: FloatArray,
        radius: float,
        fill: tuple[int, int, int, int] | None,
        outline: Colour | None = None,
        width: float = 0.0,
    ) -> None:
        x, y = self._fine(centre[None])[0]
        r = radius * self.unit * FINE
        self._draw.ellipse((x - r, y - r, x + r, y + r), fill, outline, self._thick(width))


class Labels:
    """The occupied parts of a page, so that labels keep clear of them and of each other."""

    def __init__(self, room: Box) -> None:
        self._room = np.asarray(room, dtype=float)
        self._taken = np.empty((0, 4))

    def take(self, boxes: FloatArray) -> None:
        """Mark boxes (m, 4), page px, as occupied."""
        self._taken = np.concatenate([self._taken, boxes])

    def place(
        self, anchor: FloatArray, size: tuple[float, float], away: FloatArray, gap: float
    ) -> FloatArray:
        """Choose the freest place beside a point, mark it occupied, and return its centre (2,).

        All lengths are in page px.

        Args:
            anchor: the point (2,) that is labelled.
            size: width and height of the label.
            away: the preferred direction (2,), of any length.
            gap: least distance between label and point.
        """
        half = np.array(size) / 2
        first = float(np.arctan2(away[1], away[0])) if np.any(away) else -np.pi / 4
        turns = first + np.array([0, 1, -1, 2, -2, 3, -3, 4]) * np.pi / 4
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        # The box touches a circle of radius gap, so add the box's support in that direction.
        reach = np.concatenate([gap + half.min() + 0 * turns, 2.2 * gap + half.max() + 0 * turns])
        ways = np.concatenate([ways, ways])
        support = np.abs(ways) @ (half - half.min())
        return self.pick(anchor + ways * (reach + support)[:, None], np.array(size))

    def pick(
        self, centres: FloatArray, size: FloatArray, hidden: FloatArray | float = 0.0
    ) -> FloatArray:
        """Pick the best centre (2,) of candidates (n, 2) for a label, and mark it occupied.

        `hidden` is the area that each would hide besides the occupied parts, square page px.
        """
        half = size / 2
        boxes = np.concatenate([centres - half, centres + half], axis=1)
        best = int(np.argmin(np.array([self._cost(box) for box in boxes]) + hidden))
        centre = np.clip(centres[best], self._room[:2] + half, self._room[2:] - half)
        self.take(np.concatenate([centre - half, centre + half])[None])
        return centre

    def _cost(self, box: FloatArray) -> float:
        """Return how much of the box is occupied or off the page, square page px."""
        shared = np.minimum(self._taken[:, 2:], box[2:]) - np.maximum(self._taken[:, :2], box[:2])
        inner = np.minimum(self._room[2:], box[2:]) - np.maximum(self._room[:2], box[:2])
        taken = float(np.prod(np.maximum(shared, 0), axis=1).sum())
        return taken + float(np.prod(box[2:] - box[:2]) - np.prod(np.maximum(inner, 0)))


def shown_size(picture: Picture, long: int) -> tuple[int, int]:
    """Return the photograph's width and height scaled to a long side; each is at least 1."""
    factor = long / max(picture.size)
    return max(round(picture.width * factor), 1), max(round(picture.height * factor), 1)


def _dashes(line: FloatArray, dash: float, gap: float) -> list[FloatArray]:
    """Cut a polyline (k, 2) into dashes with gaps between, with a dash at either end."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    stations = np.concatenate([[0.0], np.cumsum(steps)])
    length = float(stations[-1])
    count = max(round((length + gap) / (dash + gap)), 1)
    pitch = (length + gap) / count
    pieces: list[FloatArray] = []
    for start in pitch * np.arange(count):
        end = min(start + max(pitch - gap, 0.0), length)
        between = stations[(stations > start) & (stations < end)]
        where = np.concatenate([[start], between, [end]])
        pieces.append(np.stack([np.interp(where, stations, line[:, k]) for k in (0, 1)], axis=1))
    return pieces
