"""What is seen of robots while they drive: the ground they are on, bodies, figures.

A window puts them together, and hands on what a person does.
"""

from collections import deque

import numpy as np
from PIL import Image, ImageDraw

from ..fleet.deploy import tolerance
from ..fleet.follow import Rigid
from ..fleet.pace import Pace
from ..fleet.protocol import Pose, points_of
from ..formation.plan import Plan
from ..formation.units import length_text
from ..geometry.outline import FloatArray
from ..geometry.sampling import nearest
from ..perception.image import Picture
from ..world import World
from .canvas import (
    CERTIFIED,
    FINDING,
    FINE,
    FORBIDDEN,
    INK,
    PAPER,
    PARTIAL,
    ROBOT,
    WHITE,
    Canvas,
    Colour,
    shown_size,
)
from .captions import left_text
from .marks import draw_met, draw_outline, rings
from .text import drawable, font
from .view import part_of

BAR, PANEL, EDGE = 40, 270, 16
"""Height of the title, width of the figures, and the room around text, px."""
TEXT, TITLE_TEXT = 14, 17.0
MOST_ZOOM = 16.0
LEAST_BODY = 3.0
"""A robot is drawn with this radius at least, px of the page."""
TRAIL = 60
"""Steps that a trail is long."""
GOOD, BAD, HEAD = (94, 220, 140), (255, 110, 110), (60, 66, 76)
"""Colours of figures: as they should be, as they must not be, and what the next ones are about."""


class Course:
    """What was seen of a drive to a plan so far, px.

    Attributes:
        trail: (m, 2) where all robots of the fleet were, step by step.
        apart: (m,) from the centre of each of them to that of the nearest other one.
        least: the least of these so far.
        demanded: how far centres have to be apart.
        robots: ids of those that have places, in the order of the fleet.
        links: (n, 2, 2) from each of them to its place.
        residual: (n,) how far it is there.
        moved: how the thing that they follow has moved; None where they follow none.
        ended: whether nothing is driven any more.
    """

    def __init__(self, plan: Plan, size: tuple[float, float], radius: float) -> None:
        form = plan.formation
        self._places = dict(zip(form.robot_of_place, form.points, strict=True))
        self.demanded, self.tolerance = 2 * radius, tolerance(size)
        self.poses: tuple[Pose, ...] = ()
        self.trail = deque[FloatArray](maxlen=TRAIL)
        self.least, self.ended = np.inf, False

    def see(self, poses: tuple[Pose, ...], moved: Rigid | None = None) -> None:
        """Take in where all robots of the fleet are, and how the thing that they follow moved."""
        self.moved = moved
        points, now = points_of(poses), max(pose.seen for pose in poses)
        if len(poses) != len(self.poses):
            self.trail.clear()
            self._began = now
        self.poses, self.seconds = poses, now - self._began
        self.trail.append(points)
        alone = len(points) == 1
        self.apart = np.array([np.inf]) if alone else nearest(points, points, 2)[0][:, 1]
        self.least = min(self.least, float(self.apart.min()))
        rows = [i for i, pose in enumerate(poses) if pose.id in self._places]
        self.robots = tuple(poses[i].id for i in rows)
        goals = np.array([self._places[robot] for robot in self.robots])
        goals = goals if moved is None else moved.carried(goals)
        self.links = np.stack([points[rows], goals], axis=1)
        self.residual = np.linalg.norm(points[rows] - goals, axis=1)

    def state(self, pace: Pace | None, *, held: bool) -> tuple[str, Colour]:
        """What the robots do, and the colour for it."""
        if self.ended and (self.residual <= self.tolerance).all():
            return "all arrived", CERTIFIED
        if held or self.ended:
            return "held" if held else "not all arrived", FINDING
        return ("paused", PARTIAL) if pace is not None and pace.paused else ("driving", ROBOT)

    def figures(
        self, pace: Pace | None, scale: float | None, most: int
    ) -> list[tuple[str, str, Colour]]:
        """At most so many rows of a name, a value and its colour."""

        def length(px: float) -> str:
            return length_text(px, scale) if px < np.inf else "none"

        there, least = self.residual <= self.tolerance, self.least
        speed = "as fast as can be" if pace is None or pace.speed is None else f"{pace.speed:g} x"
        rows: list[tuple[str, str, Colour]] = [
            ("time", f"{self.seconds:.2f} s", PAPER),
            *([("speed", speed, PAPER)] if pace else ()),
            ("closest pair, between centres", "", HEAD),
            ("now", length(float(self.apart.min())), PAPER),
            ("least so far", length(least), BAD if least < self.demanded else PAPER),
            ("demanded", length(self.demanded or np.inf), PAPER),
            ("from their places", "", HEAD),
            ("arrived", f"{there.sum()} of {len(there)}", GOOD if there.all() else PAPER),
            ("furthest", length(float(self.residual.max())), PAPER),
        ]
        room = max(most - len(rows) - (len(there) > most - len(rows)), 0)
        for i in sorted(np.argsort(-self.residual, kind="stable")[:room]):
            colour = GOOD if there[i] else PAPER
            rows.append((f"robot {self.robots[i]:.12}", length(float(self.residual[i])), colour))
        more = [(f"and {len(there) - room} nearer ones", "", PAPER)] if room < len(there) else []
        return rows + more


class Ground:
    """A part of the picture with what a plan demands, below a title, left of room for figures.

    Args:
        radius: of the robots, source px; 0 for points.

    Attributes:
        canvas: it was drawn on last, which says where on the page points of the picture are.
    """

    def __init__(
        self, picture: Picture, world: World, plan: Plan, title: str, radius: float
    ) -> None:
        self._picture, self._world, self._plan = picture, world, plan
        self._title, self._radius = drawable(title), radius
        self._centre: FloatArray = np.array(picture.size, dtype=float) / 2
        self._magnified = 1.0

    def draw(self, size: tuple[int, int]) -> Image.Image:
        """A page of a size."""
        whole, area = np.array(self._picture.size), np.maximum(np.array(size) - (PANEL, BAR), 1)
        scale = self._magnified * float((area / whole).min())
        cut = np.clip(np.round(area / scale), 1, whole).astype(int)
        low = np.clip(np.round(self._centre - cut / 2), 0, whole - cut).astype(int)
        self._centre = np.asarray(low + cut / 2, dtype=float)
        x0, y0, x1, y1 = np.concatenate([low, low + cut], dtype=float).tolist()
        part, origin = part_of(self._picture, (x0, y0, x1, y1))
        long = max(int(cut.max() * min(scale, float((area / cut).min()))), 1)
        shown = np.array(shown_size(part, long))
        left, top = ((area - shown) // 2 + (0, BAR)).tolist()
        right, bottom = (np.array(size) - shown - (left, top)).tolist()
        margins = left, top, right, bottom
        self.canvas = canvas = Canvas(part, long, 1.0, margins, origin)
        contract = self._plan.formation.contract
        for name in contract.keep_out:
            canvas.tint(self._world.outline(name).filled, FORBIDDEN, 0.35)
        for name in contract.target_ids:
            draw_outline(canvas, self._world.outline(name))
        draw_met(canvas, self._world.met(self._plan.id).values())
        for goal in self._plan.formation.points:
            canvas.body(goal, self.body / canvas.page_length(1.0))
        canvas.fill_margins(INK)
        title = canvas.shortened(self._title, TITLE_TEXT, size[0] - 2 * EDGE)
        left_text(canvas, EDGE, BAR / 2, title, TITLE_TEXT, PAPER)
        return canvas.finish()

    def seen(self, moved: Rigid) -> list[FloatArray]:
        """Where the rings of a thing that has moved lie on the page, (k, 2) each."""
        outline = self._world.outline(moved.sighting.id).polygon
        return [self.canvas.at(ring) for ring in rings(moved.moved(outline))]

    @property
    def body(self) -> float:
        """The radius of a robot on the page, px."""
        return max(self.canvas.page_length(self._radius), LEAST_BODY)

    @property
    def look(self) -> tuple[float, ...]:
        """Which part of the picture is looked at."""
        return float(self._centre[0]), float(self._centre[1]), self._magnified

    def pan(self, by: tuple[float, float]) -> None:
        """Move the picture by so many px of the page."""
        self._centre = self._centre - np.array(by) / self.canvas.scale

    def zoom(self, factor: float, where: tuple[float, float] | None = None) -> None:
        """Enlarge the picture around a point of the page, by default its middle."""
        before = self._magnified
        self._magnified = float(np.clip(before * factor, 1.0, MOST_ZOOM))
        if where is not None:
            kept = (np.array(where) - self.canvas.offset) / self.canvas.scale + self.canvas.origin
            self._centre = kept + (self._centre - kept) * before / self._magnified


def body(radius: float, colour: Colour) -> Image.Image:
    """A robot of a radius in px, white at its rim, with a soft edge, RGBA."""
    middle = (int(np.ceil(radius + 1.5)) + 0.5) * FINE
    image = Image.new("RGBA", (round(2 * middle), round(2 * middle)), (*INK, 0))
    draw, rim = ImageDraw.Draw(image), float(np.clip(0.17 * radius, 0.8, 2.0))
    for reach, fill in ((radius + 1.2, (*INK, 130)), (radius, WHITE), (radius - rim, colour)):
        low, high = middle - reach * FINE, middle + reach * FINE - 1
        draw.ellipse((low, low, high, high), fill)
    return image.reduce(FINE)


def words(text: str, colour: Colour, seam: Colour | None = None) -> Image.Image:
    """A line of text, within a seam where it has to be legible on a picture, RGBA."""
    face, text, stroke = font(TEXT), drawable(text), 2 if seam else 0
    ascent, descent = face.getmetrics()
    size = round(face.getlength(text)) + 2 * stroke + 1, ascent + descent + 2 * stroke
    image = Image.new("RGBA", size, (*(seam or colour), 0))
    draw, where = ImageDraw.Draw(image), (stroke, stroke)
    draw.text(where, text, colour, face, stroke_width=stroke, stroke_fill=seam)
    return image
