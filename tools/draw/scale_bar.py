"""A scale bar in metres, at the right of the footer, where it hides nothing of the photograph."""

import math

import numpy as np

from .canvas import PAPER, Canvas
from .captions import FOOTER, PAD, footer_middle

LONGEST = 0.18
"""Greatest length of the bar, as a share of the photograph's width."""
HEIGHT, END = 3.0, 12.0
"""Heights of the bar and of its end marks, units."""


def round_metres(longest: float) -> float:
    """Return the greatest number of the form 1, 2 or 5 times 10^k that does not exceed a length."""
    power = 10.0 ** math.floor(math.log10(longest) + 1e-9)
    return max(lead * power for lead in (1, 2, 5) if lead * power <= longest * (1 + 1e-9))


def length_label(metres: float) -> str:
    """Format a round length with the unit that keeps its number short."""
    for name, size in (("km", 1e3), ("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)):
        if metres >= size * (1 - 1e-9):
            return f"{metres / size:g} {name}"
    return f"{metres * 1e6:g} µm"


def draw_scale_bar(canvas: Canvas, metres_per_pixel: float) -> float:
    """Draw a bar of a round length, labelled with that length.

    Returns:
        Width that it takes at the right of the footer, page px.
    """
    unit, scale = canvas.unit, float(canvas.scale[0])
    widest = LONGEST * (canvas.photo[2] - canvas.photo[0])
    metres = round_metres(widest / scale * metres_per_pixel)
    long, words = metres / metres_per_pixel * scale, length_label(metres)
    y, end = footer_middle(canvas), canvas.size[0] - PAD * unit
    start, half = end - long, unit / 2
    canvas.box((start, y - HEIGHT * half, end, y + HEIGHT * half), PAPER)
    for x in (start, end - HEIGHT * unit):
        canvas.box((x, y - END * half, x + HEIGHT * unit, y + END * half), PAPER)
    width = canvas.text_size(words, FOOTER)[0]
    middle = start - PAD * unit - width / 2
    canvas.text(np.array([middle, y]), words, FOOTER, PAPER)
    return long + width + 3 * PAD * unit
