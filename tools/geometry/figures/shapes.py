"""Shapes that robots draw: lines, arcs, polygons, stars, letters and grids, at any size.

A sketch is a set of polylines (or places) in its natural proportions; `fitted` puts it in a box.
Frame: x right, y down; angles are in degrees, clockwise as seen, 0 to the right.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import InputError
from ..outline import FloatArray
from .letters import arc

Kind = Literal[
    "line",
    "arc",
    "v",
    "u",
    "circle",
    "grid",
    "polygon",
    "star",
    "letters",
    "outlined_letters",
    "polyline",
]
Opens = Literal["left", "right", "up", "down"]
Box = tuple[float, float, float, float]
WAIST = 0.5
"""Ratio of a star's inner to its outer radius; with 5 points a little fuller than a pentagram."""
V_HALF_WIDTH, U_LEG = 0.75, 1.2
"""Ratio of a V's half width to its height; ratio of a U's legs, above its half circle, to its half
width."""
CIRCLE_STEP = 3.0
"""Largest angle between successive points of a circle, degrees."""


@dataclass(frozen=True)
class Sketch:
    """A shape that has not been placed yet.

    Attributes:
        lines: polylines, (k, 2) each; a loop repeats its first point. For a grid, its rows.
        places: (n, 2) the robots' places in a grid; None if robots are spread over the lines.
        frame: the part of the plane that is fitted into a box, (x0, y0, x1, y1).
        fills: whether it may be stretched to fill a box.
    """

    lines: tuple[FloatArray, ...]
    frame: Box
    places: FloatArray | None = None
    fills: bool = False

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the frame."""
        x0, y0, x1, y1 = self.frame
        return x1 - x0, y1 - y0

    @property
    def points(self) -> FloatArray:
        """All points of the lines and places, (m, 2)."""
        return np.concatenate([*self.lines, *([] if self.places is None else [self.places])])

    def at(self, centre: tuple[float, float], scale: float, stretch: float = 1.0) -> "Sketch":
        """Return the sketch scaled about its middle, y also by `stretch`, and moved to `centre`."""
        x0, y0, x1, y1 = self.frame
        middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
        factor = np.array([scale, scale * stretch])

        def moved(points: FloatArray) -> FloatArray:
            return (points - middle) * factor + np.asarray(centre)

        low, high = moved(np.array([[x0, y0], [x1, y1]]))
        frame = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
        places = None if self.places is None else moved(self.places)
        return Sketch(tuple(moved(line) for line in self.lines), frame, places, self.fills)


def fitted(sketch: Sketch, box: Box) -> Sketch:
    """Return the sketch as large as fits into a box (x0, y0, x1, y1), in the box's middle.

    Raises:
        InputError: the box has no extent in a direction in which the sketch has some.
    """
    x0, y0, x1, y1 = box
    width, height = sketch.size
    centre = ((x0 + x1) / 2, (y0 + y1) / 2)
    if width == height == 0:
        return sketch.at(centre, 1.0)
    across = (x1 - x0) / width if width > 0 else math.inf
    down = (y1 - y0) / height if height > 0 else math.inf
    scale = min(across, down)
    if not 0 < scale < math.inf:
        raise InputError(f"A box from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) holds no such shape.")
    if sketch.fills and max(across, down) < math.inf:
        return sketch.at(centre, across, down / across)
    return sketch.at(centre, scale)


def line_sketch(upright: bool) -> Sketch:
    """Return a straight line from left to right, or from top to bottom if upright."""
    end = (0.0, 1.0) if upright else (1.0, 0.0)
    return Sketch((np.array([(0.0, 0.0), end]),), (0.0, 0.0, *end))


def arc_sketch(begin: float = 0.0, end: float = 360.0) -> Sketch:
    """Return an arc of a circle; its frame, which is fitted into a box, is the whole circle's.

    Args:
        begin, end: degrees clockwise from the right; 360 or more apart give the whole circle.
    """
    round_about = abs(end - begin) >= 360
    if round_about:
        begin, end = -90.0, 270.0
    line = arc((0.0, 0.0), (1.0, 1.0), begin, end, CIRCLE_STEP)
    if round_about:
        line[-1] = line[0]
    return Sketch((line,), (-1.0, -1.0, 1.0, 1.0))


def cup_sketch(kind: Literal["v", "u", "arc"], opens: Opens) -> Sketch:
    """Return a V, a U or a half circle that opens towards a side."""
    bow = arc((0.0, 0.0), (1.0, 1.0), 0.0, 180.0, CIRCLE_STEP)
    upright = {
        "v": np.array([(V_HALF_WIDTH, 0.0), (0.0, 1.0), (-V_HALF_WIDTH, 0.0)]),
        "u": np.concatenate([[(1.0, -U_LEG)], bow, [(-1.0, -U_LEG)]]),
        "arc": bow,
    }[kind]
    across = {"up": (1, 0), "right": (0, 1), "down": (-1, 0), "left": (0, -1)}[opens]
    turn = np.array([across, (-across[1], across[0])], dtype=float)
    return polyline_sketch(upright @ turn)


def polygon_sketch(corners: int) -> Sketch:
    """Return a regular polygon that stands on one of its sides.

    Raises:
        InputError: fewer than 3 corners.
    """
    return _closed_loop(np.full(_checked_corner_count(corners), 1.0), 90 + 180 / corners)


def star_sketch(points: int) -> Sketch:
    """Return a star with one point up.

    Raises:
        InputError: fewer than 3 points.
    """
    return _closed_loop(np.tile([1.0, WAIST], _checked_corner_count(points)), -90)


def polyline_sketch(*lines: FloatArray) -> Sketch:
    """Return a sketch of the given lines, (k, 2) each; its frame is their bounding box."""
    points = np.concatenate(lines)
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return Sketch(lines, (float(x0), float(y0), float(x1), float(y1)))


def grid_sketch(n: int, rows: int) -> Sketch:
    """Return n places in rows and columns one unit apart; the last row may be shorter.

    Raises:
        InputError: there are fewer than 1 or more than n rows.
    """
    if not 1 <= rows <= n:
        raise InputError(f"A grid of {n} places has 1 to {n} rows, not {rows}.")
    columns = math.ceil(n / rows)
    index = np.arange(n)
    places = np.stack([index % columns, index // columns], axis=1).astype(float)
    full = -(-n // columns)  # 5 places in 4 rows of 2 fill only 3
    lines = tuple(np.array([(0.0, y), (columns - 1.0, y)]) for y in range(full) if columns > 1)
    if columns == 1 and full > 1:
        lines = (np.array([(0.0, 0.0), (0.0, full - 1.0)]),)
    return Sketch(lines, (0.0, 0.0, columns - 1.0, full - 1.0), places, fills=True)


def _checked_corner_count(corners: int) -> int:
    if corners < 3:
        raise InputError(f"A polygon or star has 3 or more corners, not {corners}.")
    return corners


def _closed_loop(radii: FloatArray, begin: float) -> Sketch:
    turn = np.radians(begin + 360 * np.arange(len(radii) + 1) / len(radii))
    turn[-1] = turn[0]
    closed = np.concatenate([radii, radii[:1]])
    return polyline_sketch(np.stack([closed * np.cos(turn), closed * np.sin(turn)], axis=1))
