"""Letters and digits as pen strokes, for robots that stand on lines instead of outlines.

In `letters.json` every glyph is 6 high, y down, with its left edge at x = 0. Semicolons separate
strokes; each has points "x y" and arcs "@ cx cy rx ry from to", separated by commas (degrees,
clockwise as seen, 0 to the right).
"""

import json
import math
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ..outline import FloatArray

HEIGHT = 6.0
GAP, SPACE = 1.8, 2.4
"""Gap between two letters, and width of a blank, for a height of 6."""
ARC_STEP = 6.0
"""Largest angle between successive points of an arc, degrees."""


class Glyph(NamedTuple):
    """A character: its advance width (to the start of the next one) and its lines, (k, 2) each."""

    advance: float
    lines: tuple[FloatArray, ...]


def letter_strokes(text: str) -> tuple[FloatArray, ...]:
    """Return the strokes of a line of text, (k, 2) each, x right, y down, 6 high.

    Raises:
        InputError: the text is blank, or a character has no strokes.
    """
    refusal = "Letters are A to Z, 0 to 9 and blanks; {} cannot be written."
    return in_a_row(text.upper(), stroke_glyphs(), SPACE, refusal)


def in_a_row(
    text: str, glyphs: Mapping[str, Glyph], space: float, refusal: str
) -> tuple[FloatArray, ...]:
    """Return the lines of a text's glyphs side by side, with blanks `space` wide.

    Raises:
        InputError: the text is blank, or a character has no glyph; `refusal` has a {} for those.
    """
    lacking = sorted({c for c in text if c not in glyphs and c != " "})
    if lacking or not text.strip():
        named = ", ".join(map(repr, lacking)) or repr(text)
        raise InputError(refusal.format(named))
    lines: list[FloatArray] = []
    x = 0.0
    for character in text.strip():
        if character == " ":
            x += space
            continue
        lines += [line + np.array([x, 0.0]) for line in glyphs[character].lines]
        x += glyphs[character].advance
    return tuple(lines)


@cache
def stroke_glyphs() -> dict[str, Glyph]:
    """Load the glyphs of the letters and digits that have strokes."""
    written = json.loads((files(__package__ or "") / "letters.json").read_text("utf-8"))
    strokes = {letter: tuple(map(_stroke, text.split(";"))) for letter, text in written.items()}
    return {
        letter: Glyph(max(float(line[:, 0].max()) for line in lines) + GAP, lines)
        for letter, lines in strokes.items()
    }


def _stroke(text: str) -> FloatArray:
    parts: list[FloatArray] = []
    for part in text.split(","):
        numbers = [float(word) for word in part.replace("@", " ").split()]
        if "@" in part:
            cx, cy, rx, ry, begin, end = numbers
            parts.append(arc((cx, cy), (rx, ry), begin, end))
        else:
            parts.append(np.array([numbers]))
    points = np.concatenate(parts)
    new = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9
    return points[np.concatenate([[True], new])]


def arc(
    centre: tuple[float, float],
    radii: tuple[float, float],
    begin: float,
    end: float,
    step: float = ARC_STEP,
) -> FloatArray:
    """Return points of an elliptical arc, (k, 2), from one angle to another, at most `step` apart.

    Angles are in degrees, clockwise as seen in the picture (y down), with 0 to the right.
    """
    count = max(math.ceil(abs(end - begin) / step), 2) + 1
    turn = np.radians(np.linspace(begin, end, count))
    return np.stack(
        [centre[0] + radii[0] * np.cos(turn), centre[1] + radii[1] * np.sin(turn)], axis=1
    )
