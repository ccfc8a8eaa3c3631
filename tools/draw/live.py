"""The page on which robots are watched while they drive: ground, bodies, figures.

A window shows it, puts the bodies where `LivePage.at` says, and hands on what a person does.
"""

from collections import deque
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from ..fleet.deploy import tolerance
from ..fleet.pace import Pace
from ..fleet.protocol import Pose, points_of
from ..formation.plan import Plan
from ..formation.units import length_text
from ..geometry.outline import FloatArray
from ..geometry.sampling import nearest
from ..perception.image import Picture
from ..world import World
from .canvas import (
    ALLOWED,
    CERTIFIED,
    FINDING,
    FINE,
    FORBIDDEN,
    INK,
    MUTED,
    PAPER,
    PARTIAL,
    ROBOT,
    WHITE,
    Canvas,
    Colour,
)
from .captions import left_text
from .marks import draw_met, draw_outline
from .text import drawable, font, shortened
from .view import part_of

BAR, PANEL, EDGE = 40, 270, 16
"""Height of the title, width of the figures, and the room around text, px."""
TEXT, ROW = 14, 21
TITLE_TEXT = 17.0
ZOOM = (1.0, 16.0)
LEAST_BODY = 3.0
"""A robot is drawn with this radius at least, px of the page."""
TRAIL = 60
"""Steps that a trail is long."""
GOOD: Colour = (94, 220, 140)
BAD: Colour = (255, 110, 110)


class Course:
    """What was seen of a drive to a plan so far, px.

    Attributes:
        apart: (m,) from the centre of each robot of the fleet to that of the nearest other one.
        least: the least of these so far.
        demanded: how far centres have to be apart.
        residual: (n,) from each place to its robot, in the order of the places.
        ended: whether nothing is driven any more.
    """

    def __init__(self, plan: Plan, size: tuple[float, float], radius: float) -> None:
        self.robots, self._goals = plan.formation.robot_of_place, plan.formation.points
        self.radius, self.demanded, self.tolerance = radius, 2 * radius, tolerance(size)
        self.poses: tuple[Pose, ...] = ()
        self.trail = deque[FloatArray](maxlen=TRAIL)
        self.apart = self.residual = np.empty(0)
        self.least, self.seconds, self._began = np.inf, 0.0, -np.inf
        self.ended = False

    def see(self, poses: tuple[Pose, ...]) -> None:
        """Take in where all robots of the fleet are."""
        points, now = points_of(poses), max(pose.seen for pose in poses)
        if self.trail and len(self.trail[-1]) != len(points):
            self.trail.clear()
        self.trail.append(points)
        self.poses, row = poses, {pose.id: i for i, pose in enumerate(poses)}
        self._began = now if self._began == -np.inf else self._began
        self.seconds = now - self._began
        self.apart = _apart(points)
        self.least = min(self.least, float(self.apart.min(initial=np.inf)))
        at = points[[row[robot] for robot in self.robots]]
        self.residual = np.linalg.norm(at - self._goals, axis=1)

    @property
    def links(self) -> FloatArray:
        """From each robot that has a place to that place, (n, 2, 2)."""
        row = {pose.id: i for i, pose in enumerate(self.poses)}
        points = self.trail[-1][[row[robot] for robot in self.robots]]
        return np.stack([points, self._goals], axis=1)


class LivePage:
    """A part of the picture with what a plan demands, a title above, figures at the right.

    Args:
        radius: of the robots, source px; 0 for points.
    """

    def __init__(
        self, picture: Picture, world: World, plan: Plan, title: str, radius: float
    ) -> None:
        self._picture, self._world, self._plan = picture, world, plan
        self._title, self._radius = title, radius
        self._centre, self._zoom = np.array(picture.size) / 2, 1.0
        self._canvas = Canvas(picture, 1, 1.0)

    def ground(self, size: tuple[int, int]) -> Image.Image:
        """What stands still, on a page of a size."""
        whole, area = np.array(self._picture.size), np.maximum(np.array(size) - (PANEL, BAR), 1)
        scale = self._zoom * float((area / whole).min())
        cut = np.clip(np.round(area / scale), 1, whole).astype(int)
        low = np.clip(np.round(self._centre - cut / 2), 0, whole - cut).astype(int)
        self._centre = low + cut / 2
        part, origin = part_of(self._picture, (*low.tolist(), *(low + cut).tolist()))
        shown = np.maximum((cut * min(scale, float((area / cut).min()))).astype(int), 1)
        left, top = (area - shown) // 2 + (0, BAR)
        right, bottom = np.array(size) - shown - (left, top)
        margins = int(left), int(top), int(right), int(bottom)
        self._canvas = canvas = Canvas(part, int(shown.max()), 1.0, margins, origin)
        self._draw_ground(canvas)
        canvas.fill_margins(INK)
        title = canvas.shortened(drawable(self._title), TITLE_TEXT, size[0] - 2 * EDGE)
        left_text(canvas, EDGE, BAR / 2, title, TITLE_TEXT, PAPER)
        return canvas.finish()

    def at(self, points: FloatArray) -> FloatArray:
        """Where points of the picture are on the page, (n, 2) px."""
        return self._canvas.at(points)

    @property
    def scale(self) -> float:
        """Px of the page a px of the picture."""
        return self._canvas.page_length(1.0)

    @property
    def body(self) -> float:
        """The radius of a robot on the page, px."""
        return max(self._radius * self.scale, LEAST_BODY)

    @property
    def photo(self) -> tuple[int, int, int, int]:
        """Where the picture lies on the page: left, top, width, height."""
        left, top, right, bottom = map(int, self._canvas.photo)
        return left, top, right - left, bottom - top

    def pan(self, by: tuple[float, float]) -> None:
        """Move the picture by so many px of the page."""
        self._centre = self._centre - np.array(by) / self._canvas.scale

    def zoom(self, factor: float, where: tuple[float, float] | None = None) -> None:
        """Enlarge the picture around a point of the page, by default its middle."""
        before, centre = self._zoom, self._centre
        self._zoom = float(np.clip(before * factor, *ZOOM))
        if where is not None:
            fixed = (np.array(where) - self._canvas.offset) / self._canvas.scale
            fixed = fixed + self._canvas.origin
            self._centre = fixed + (centre - fixed) * before / self._zoom

    def _draw_ground(self, canvas: Canvas) -> None:
        contract, goals = self._plan.formation.contract, self._plan.formation.points
        for name in contract.keep_out:
            outline = self._world.outline(name)
            canvas.tint(outline.filled, FORBIDDEN, 0.35)
            draw_outline(canvas, outline, FORBIDDEN)
        for name in contract.target_ids:
            draw_outline(canvas, self._world.outline(name))
        draw_met(canvas, self._world.met(self._plan.id).values())
        for goal in goals:
            canvas.body(goal, self.body / self.scale)

    def panel(self, height: int, course: Course, pace: Pace | None, *, held: bool) -> Image.Image:
        """The figures and the keys."""
        lines = _Lines(height)
        lines.badge(*_state(course, pace, held=held))
        scale = self._world.metres_per_pixel

        def length(px: float) -> str:
            return length_text(px, scale) if np.isfinite(px) else "none"

        lines.row("time", f"{course.seconds:.2f} s")
        if pace is not None:
            speed = "as fast as can be" if pace.speed is None else f"{pace.speed:g} x real time"
            lines.row("speed", speed)
        lines.head("closest pair, between centres")
        close = course.demanded > course.least
        lines.row("now", length(float(course.apart.min(initial=np.inf))))
        lines.row("least so far", length(course.least), BAD if close else PAPER)
        lines.row("demanded", length(course.demanded))
        lines.head("from their places")
        there = course.residual <= course.tolerance
        lines.row("arrived", f"{there.sum()} of {len(there)}", GOOD if there.all() else PAPER)
        lines.row("furthest", length(float(course.residual.max(initial=0.0))))
        keys = _keys(paced=pace is not None, driving=not course.ended)
        room = lines.room(len(keys) + 1) - 2
        most = len(there) if len(there) <= room else room - 1
        for i in sorted(np.argsort(-course.residual, kind="stable")[: max(most, 0)]):
            colour = GOOD if there[i] else PAPER
            lines.row(f"robot {course.robots[i]}", length(float(course.residual[i])), colour)
        if most < len(there):
            lines.row(f"and {len(there) - max(most, 0)} nearer ones", "")
        lines.foot(keys)
        return lines.image


def _state(course: Course, pace: Pace | None, *, held: bool) -> tuple[str, Colour]:
    """What the robots do, and the colour for it."""
    if course.ended and (course.residual <= course.tolerance).all():
        return "all arrived", CERTIFIED
    if held or course.ended:
        return "held" if held else "not all arrived", FINDING
    return ("paused", PARTIAL) if pace is not None and pace.paused else ("driving", ROBOT)


def _keys(*, paced: bool, driving: bool) -> list[tuple[str, str]]:
    """What can be pressed, and what it does."""
    time = [("Space", "pause, go on"), (".", "one step"), ("+   -", "faster, slower")]
    return [
        *(time if paced else ()),
        ("wheel, I O", "zoom in, out"),
        ("drag, arrows", "move the picture"),
        ("F", "whole picture"),
        ("Q", "hold robots, close" if driving else "close"),
    ]


class _Lines:
    """Text in lines from the top of a panel down."""

    def __init__(self, height: int) -> None:
        self.image = Image.new("RGB", (PANEL, height), INK)
        self._draw, self._y, self._height = ImageDraw.Draw(self.image), 0, height

    def badge(self, text: str, ground: Colour) -> None:
        """A word on a coloured ground."""
        box = (EDGE, 0, PANEL - EDGE, 30)
        self._draw.rounded_rectangle(box, 4, ground)
        self._draw.text((PANEL / 2, 15), text, PAPER, font(TEXT + 1), anchor="mm")
        self._y = 40

    def head(self, text: str) -> None:
        """What the next rows are about."""
        self._y += 10
        self._draw.line([(EDGE, self._y), (PANEL - EDGE, self._y)], (60, 66, 76))
        self._y += 4
        self._put(EDGE, text, MUTED, "lm")
        self._y += ROW

    def row(self, name: str, value: str, colour: Colour = PAPER) -> None:
        """A name and, at the right, its value."""
        room = PANEL - 2 * EDGE - font(TEXT).getlength(value) - 8
        self._put(EDGE, shortened(drawable(name), room, font(TEXT)), MUTED, "lm")
        self._put(PANEL - EDGE, value, colour, "rm")
        self._y += ROW

    def room(self, below: int) -> int:
        """How many rows there is room for above so many at the bottom."""
        return (self._height - EDGE - self._y) // ROW - below

    def foot(self, rows: Sequence[tuple[str, str]]) -> None:
        """Rows at the bottom."""
        self._y = max(self._height - EDGE - ROW * len(rows), self._y)
        for key, meaning in rows:
            self._put(EDGE, key, ALLOWED, "lm")
            self._put(EDGE + 105, meaning, MUTED, "lm")
            self._y += ROW

    def _put(self, x: float, text: str, colour: Colour, anchor: str) -> None:
        self._draw.text((x, self._y + ROW / 2), text, colour, font(TEXT), anchor=anchor)


def _apart(points: FloatArray) -> FloatArray:
    """From each point to the nearest other one, (n,); infinite where there is none."""
    return nearest(points, points, 2)[0][:, 1] if len(points) > 1 else np.full(len(points), np.inf)


def body(radius: float, colour: Colour) -> Image.Image:
    """A robot of a radius in px, white at its rim, with a soft edge, RGBA."""
    half = int(np.ceil(radius + 1.5))
    side = (2 * half + 1) * FINE
    image = Image.new("RGBA", (side, side), (*INK, 0))
    draw, rim = ImageDraw.Draw(image), float(np.clip(0.17 * radius, 0.8, 2.0))
    for reach, fill in (
        (radius + 1.2, (*INK, 130)),
        (radius, (*WHITE, 255)),
        (radius - rim, (*colour, 255)),
    ):
        low, high = side / 2 - reach * FINE, side / 2 + reach * FINE
        draw.ellipse((low, low, high - 1, high - 1), fill)
    return image.reduce(FINE)


def name(text: str, size: int, colour: Colour, seam: Colour) -> Image.Image:
    """A robot's name with a seam around it, RGBA."""
    face, text = font(size * FINE), drawable(text)
    x0, y0, x1, y1 = face.getbbox(text, anchor="mm", stroke_width=2 * FINE)
    half = np.ceil(np.array([x1 - x0, y1 - y0]) / 2 / FINE).astype(int)
    wide, high = (int(v) for v in (2 * half + 1) * FINE)
    image = Image.new("RGBA", (wide, high), (*seam, 0))
    ImageDraw.Draw(image).text(
        (wide / 2 - (x0 + x1) / 2, high / 2 - (y0 + y1) / 2),
        text,
        colour,
        face,
        anchor="mm",
        stroke_width=2 * FINE,
        stroke_fill=seam,
    )
    return image.reduce(FINE)
