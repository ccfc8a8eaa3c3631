"""The outlines of a font, for letters that robots draw around instead of along.

The font in `typeface.json`, the printable ASCII characters of Aileron Regular 1.102 by Sora Sagano,
is in the public domain (CC0) and comes with Pillow too. A glyph is its advance width and SVG path
data (absolute M, L, H, V, Q, Z), y up, at 1000 units to the em.
"""

import json
import math
import re
from functools import cache
from importlib.resources import files

import numpy as np

from ..outline import FloatArray
from .letters import ARC_STEP, Glyph, in_a_row

Point = tuple[float, float]

SPACE = 216
"""Advance width of a blank, font units."""


def letter_outlines(text: str) -> tuple[FloatArray, ...]:
    """Return the outlines of a line of text as rings (k, 2) that repeat their first point.

    Frame: font units, x right, y down, with the baseline at y = 0.

    Raises:
        InputError: the text is blank, or the font lacks a character.
    """
    refusal = "Outlined letters are printing ASCII and blanks; {} cannot be drawn."
    return in_a_row(text, _glyphs(), SPACE, refusal)


@cache
def _glyphs() -> dict[str, Glyph]:
    font = json.loads((files(__package__ or "") / "typeface.json").read_text("utf-8"))
    return {character: _glyph(**written) for character, written in font["glyphs"].items()}


def _glyph(width: float, path: str) -> Glyph:
    return Glyph(width, tuple(map(_contour_polyline, path.split("Z")[:-1])))


def _contour_polyline(contour: str) -> FloatArray:
    """Convert a closed contour of path data into a polyline (k, 2), y down."""
    points: list[tuple[float, float]] = []
    for command, written in re.findall(r"([MLHVQ])([^MLHVQ]*)", contour):
        numbers = [float(word) for word in written.split()]
        if command == "H":
            points.append((numbers[0], points[-1][1]))
        elif command == "V":
            points.append((points[-1][0], numbers[0]))
        else:
            at = [*zip(numbers[::2], numbers[1::2], strict=True)]
            points += _bend(points[-1], *at) if command == "Q" else at
    if points[-1] != points[0]:
        points.append(points[0])
    return np.array(points) * (1.0, -1.0)


def _bend(begin: Point, control: Point, end: Point) -> list[Point]:
    """Return a quadratic Bézier curve without its first point, turning ARC_STEP or less a step."""
    a, b, c = np.array([begin, control, end])
    first, last = np.arctan2(*(b - a)), np.arctan2(*(c - b))
    turn = abs(math.remainder(last - first, 2 * math.pi))
    t = np.linspace(0, 1, math.ceil(math.degrees(turn) / ARC_STEP) + 1)[1:, None]
    return [(x, y) for x, y in (a * (1 - t) ** 2 + b * 2 * t * (1 - t) + c * t**2).tolist()]
