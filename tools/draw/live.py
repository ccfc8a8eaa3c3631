"""The parts of a live view of robots that drive: the ground, their bodies and the figures.

A window puts them together and handles a person's input.
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
"""Height of the title bar, width of the panel of figures, and padding around text, px."""
TEXT, TITLE_TEXT = 14, 17.0
MOST_ZOOM = 16.0
LEAST_BODY = 3.0
"""Least radius that a robot is drawn with, page px."""
TRAIL = 60
"""Length of a trail, in steps."""
GOOD, BAD, HEAD = (94, 220, 140), (255, 110, 110), (60, 66, 76)
"""Colours of figures: as they should be, as they must not be, and of headings."""


class Course:
    """What has been seen so far of a drive to a plan; lengths in px.

    Attributes:
        trail: positions (m, 2) of all robots of the fleet, step by step.
        apart: (m,) distance from each robot's centre to that of its nearest neighbour.
        least: the least of these distances so far.
        demanded: how far apart centres have to be.
        robots: ids of the robots that have places, in the order of the fleet.
        links: (n, 2, 2) line from each of these robots to its place.
        residual: (n,) length of these lines.
        moved: how the thing that the robots follow has moved; None if they follow none.
        ended: whether driving has ended.
    """

    def __init__(self, plan: Plan, size: tuple[float, float], radius: float) -> None:
        form = plan.formation
        self._places = dict(zip(form.robot_of_place, form.points, strict=True))
        self.demanded, self.tolerance = 2 * radius, tolerance(size)
        self.poses: tuple[Pose, ...] = ()
        self.trail = deque[FloatArray](maxlen=TRAIL)
        self.least, self.ended = np.inf, False

    def see(self, poses: tuple[Pose, ...], moved: Rigid | None = None) -> None:
        """Update from the fleet's current poses and the motion of the thing that robots follow."""
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
        """Return what the robots are doing, as a label, and the colour to show it in."""
        if self.ended and (self.residual <= self.tolerance).all():
            return "all arrived", CERTIFIED
        if held or self.ended:
            return "held" if held else "not all arrived", FINDING
        return ("paused", PARTIAL) if pace is not None and pace.paused else ("driving", ROBOT)

    def figures(
        self, pace: Pace | None, scale: float | None, most: int
    ) -> list[tuple[str, str, Colour]]:
        """Return the rows of the panel: a name, a value and its colour.

        The last rows list the robots furthest from their places, as many as fit in `most` rows.
        `scale` is in metres per pixel.
        """

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
    """Part of the picture with what a plan demands, under a title, beside a panel of figures.

    Args:
        radius: radius of the robots, source px; 0 for points.

    Attributes:
        canvas: the canvas drawn last; it maps points of the picture to the page.
    """

    def __init__(
        self, picture: Picture, world: World, plan: Plan, title: str, radius: float
    ) -> None:
        self._picture, self._world, self._plan = picture, world, plan
        self._title, self._radius = drawable(title), radius
        self._centre: FloatArray = np.array(picture.size, dtype=float) / 2
        self._magnified = 1.0

    def draw(self, size: tuple[int, int]) -> Image.Image:
        """Draw a page of a width and height, px; the panel is left empty."""
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
        """Return the rings of a thing that has moved, (k, 2) each, page px."""
        outline = self._world.outline(moved.sighting.id).polygon
        return [self.canvas.at(ring) for ring in rings(moved.moved(outline))]

    @property
    def body(self) -> float:
        """The radius to draw a robot with, page px."""
        return max(self.canvas.page_length(self._radius), LEAST_BODY)

    @property
    def look(self) -> tuple[float, ...]:
        """The part of the picture in view: its centre x, y, image pixels, and the zoom."""
        return float(self._centre[0]), float(self._centre[1]), self._magnified

    def pan(self, by: tuple[float, float]) -> None:
        """Move the picture by (x, y) page px."""
        self._centre = self._centre - np.array(by) / self.canvas.scale

    def zoom(self, factor: float, where: tuple[float, float] | None = None) -> None:
        """Zoom in by a factor around a point of the page, px; by default around the centre.

        The zoom stays between 1 and 16.
        """
        before = self._magnified
        self._magnified = float(np.clip(before * factor, 1.0, MOST_ZOOM))
        if where is not None:
            kept = (np.array(where) - self.canvas.offset) / self.canvas.scale + self.canvas.origin
            self._centre = kept + (self._centre - kept) * before / self._magnified


def body(radius: float, colour: Colour) -> Image.Image:
    """Draw a robot of a radius in px, with a white rim and a soft edge, as an RGBA image."""
    middle = (int(np.ceil(radius + 1.5)) + 0.5) * FINE
    image = Image.new("RGBA", (round(2 * middle), round(2 * middle)), (*INK, 0))
    draw, rim = ImageDraw.Draw(image), float(np.clip(0.17 * radius, 0.8, 2.0))
    for reach, fill in ((radius + 1.2, (*INK, 130)), (radius, WHITE), (radius - rim, colour)):
        low, high = middle - reach * FINE, middle + reach * FINE - 1
        draw.ellipse((low, low, high, high), fill)
    return image.reduce(FINE)


def words(text: str, colour: Colour, seam: Colour | None = None) -> Image.Image:
    """Draw a line of text as an RGBA image; a seam keeps it legible on a picture."""
    face, text, stroke = font(TEXT), drawable(text), 2 if seam else 0
    ascent, descent = face.getmetrics()
    size = round(face.getlength(text)) + 2 * stroke + 1, ascent + descent + 2 * stroke
    image = Image.new("RGBA", size, (*(seam or colour), 0))
    draw, where = ImageDraw.Draw(image), (stroke, stroke)
    draw.text(where, text, colour, face, stroke_width=stroke, stroke_fill=seam)
    return image
