"""Letters and digits as the strokes a pen would make: robots stand on lines, not in outlines.

Every glyph is 6 high, y down, its left edge at x = 0; strokes are parted by semicolons. A stroke
is points "x y" and arcs "@ cx cy rx ry from to" (degrees, clockwise as seen, 0 to the right).
"""

import math
from functools import cache

import numpy as np

from ...errors import InputError
from ..outline import FloatArray

HEIGHT = 6.0
GAP, SPACE = 1.8, 2.4
"""Between two letters and for a blank, as parts of a height of 6."""
ARC_STEP = 6.0
"""Degrees between the points of an arc."""
GLYPHS = {
    "A": "0 6, 2 0, 4 6; 0.6667 4, 3.3333 4",
    "B": "0 3, 0 0, 2.2 0, @ 2.2 1.5 1.5 1.5 -90 90, 0 3, 0 6, 2.5 6, @ 2.5 4.5 1.5 1.5 90 -90",
    "C": "@ 2 2 2 2 -25 -180, @ 2 4 2 2 180 25",
    "D": "0 0, 0 6, 1.6 6, @ 1.6 3.6 2.4 2.4 90 0, @ 1.6 2.4 2.4 2.4 0 -90, 0 0",
    "E": "3.6 0, 0 0, 0 6, 3.6 6; 0 3, 2.8 3",
    "F": "3.6 0, 0 0, 0 6; 0 3, 2.8 3",
    "G": "@ 2 2 2 2 -25 -180, @ 2 4 2 2 180 0, 4 3.2, 2.2 3.2",
    "H": "0 0, 0 6; 4 0, 4 6; 0 3, 4 3",
    "I": "0 0, 0 6",
    "J": "3 0, 3 4.5, @ 1.5 4.5 1.5 1.5 0 165",
    "K": "0 0, 0 6; 3.8 0, 0 3.8; 1.4 2.4, 3.8 6",
    "L": "0 0, 0 6, 3.4 6",
    "M": "0 6, 0 0, 2.3 4, 4.6 0, 4.6 6",
    "N": "0 6, 0 0, 4 6, 4 0",
    "O": "@ 2 2 2 2 -180 0, @ 2 4 2 2 0 180, 0 2",
    "P": "0 6, 0 0, 2.2 0, @ 2.2 1.6 1.6 1.6 -90 90, 0 3.2",
    "Q": "@ 2 2 2 2 -180 0, @ 2 4 2 2 0 180, 0 2; 2.5 4.3, 4.3 6.1",
    "R": "0 6, 0 0, 2.2 0, @ 2.2 1.6 1.6 1.6 -90 90, 0 3.2; 1.8 3.2, 3.9 6",
    "S": "@ 1.8 1.5 1.8 1.5 -25 -270, @ 1.8 4.5 1.8 1.5 -90 155",
    "T": "0 0, 4 0; 2 0, 2 6",
    "U": "0 0, 0 4, @ 2 4 2 2 180 0, 4 0",
    "V": "0 0, 2 6, 4 0",
    "W": "0 0, 1.4 6, 2.8 1, 4.2 6, 5.6 0",
    "X": "0 0, 4 6; 4 0, 0 6",
    "Y": "0 0, 2 3, 4 0; 2 3, 2 6",
    "Z": "0 0, 4 0, 0 6, 4 6",
    "0": "@ 1.7 1.7 1.7 1.7 -180 0, @ 1.7 4.3 1.7 1.7 0 180, 0 1.7",
    "1": "0 1.5, 1.5 0, 1.5 6",
    "2": "@ 1.8 1.8 1.8 1.8 -165 35, 0 6, 3.6 6",
    "3": "@ 1.7 1.5 1.6 1.5 -150 90, @ 1.7 4.5 1.8 1.5 -90 150",
    "4": "2.8 6, 2.8 0, 0 4.2, 4 4.2",
    "5": "3.3 0, 0.5 0, 0.4 2.7, @ 1.7 4.1 1.9 1.9 -133 150",
    "6": "2.7 0, @ 1.8 4.2 1.8 1.8 -143.1 216.9",
    "7": "0 0, 3.8 0, 1.2 6",
    "8": "@ 1.8 1.5 1.5 1.5 90 450; @ 1.8 4.5 1.8 1.5 -90 270",
    "9": "@ 1.8 1.8 1.8 1.8 -323.1 36.9, 0.9 6",
}


def letter_strokes(text: str) -> tuple[FloatArray, ...]:
    """The strokes of a line of text, each (k, 2), x right, y down, 6 high.

    Raises:
        InputError: nothing to write, or a character that has no strokes.
    """
    unknown = sorted({c for c in text.upper() if c not in GLYPHS and c != " "})
    if unknown or not text.strip():
        named = ", ".join(map(repr, unknown)) or repr(text)
        raise InputError(f"Letters are A to Z, 0 to 9 and blanks; {named} cannot be written.")
    strokes: list[FloatArray] = []
    x = 0.0
    for character in text.upper().strip():
        if character == " ":
            x += SPACE
            continue
        drawn = _glyph_strokes(character)
        strokes += [stroke + np.array([x, 0.0]) for stroke in drawn]
        x += max(float(stroke[:, 0].max()) for stroke in drawn) + GAP
    return tuple(strokes)


@cache
def _glyph_strokes(character: str) -> tuple[FloatArray, ...]:
    return tuple(_stroke(text) for text in GLYPHS[character].split(";"))


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
    """Points of an elliptical arc, (k, 2), from one angle to another, a step or less apart.

    Angles are degrees, clockwise as seen in the picture (y down), 0 to the right.
    """
    count = max(math.ceil(abs(end - begin) / step), 2) + 1
    turn = np.radians(np.linspace(begin, end, count))
    return np.stack(
        [centre[0] + radii[0] * np.cos(turn), centre[1] + radii[1] * np.sin(turn)], axis=1
    )
