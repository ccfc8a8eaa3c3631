"""The page around a photograph: a title above it, a line of text below.

Neither hides any of the photograph. Lengths are in units of the page, see Canvas.
"""

import numpy as np

from ..perception.image import Picture
from .canvas import FINE, INK, MUTED, PAPER, Canvas, Colour, shown_size
from .text import font, wrapped

TITLE, FOOTER = 25.0, 19.0
LINE, PAD = 1.35, 12.0
"""Line height as a multiple of the text size; padding above, below and beside text."""
FOOTER_HEIGHT = FOOTER * LINE + 2 * PAD


def make_page(
    picture: Picture, long: int, unit: float, title: str, lines: int, narrowest: float
) -> tuple[Canvas, list[str]]:
    """Return a canvas with room for a title above and a footer below, and the title's lines.

    Args:
        picture: the photograph.
        long: length of its long side on the page, page px.
        unit: page px per unit of strokes and text.
        title: any text; an empty one takes no room.
        lines: the most lines that the title may take.
        narrowest: the page's least width, units; the photograph is centred on it.
    """
    width = shown_size(picture, long)[0]
    side = max(round(narrowest * unit) - width, 0)
    face = font(max(round(TITLE * unit), 6) * FINE)
    kept = wrapped(title, (width + side - 2 * PAD * unit) * FINE, face, lines)
    top = round((len(kept) * TITLE * LINE + 2 * PAD) * unit) if kept else 0
    margins = (side // 2, top, side - side // 2, round(FOOTER_HEIGHT * unit))
    return Canvas(picture, long, unit, margins), kept


def draw_bars(canvas: Canvas, title: list[str]) -> None:
    """Fill the margins, over whatever was drawn beyond the photograph, and write the title."""
    canvas.fill_margins(INK)
    for row, line in enumerate(title):
        y = (PAD + (row + 0.5) * TITLE * LINE) * canvas.unit
        left_text(canvas, PAD * canvas.unit, y, line, TITLE, PAPER)


def footer_middle(canvas: Canvas) -> float:
    """Return the y coordinate of the footer's middle, page px."""
    return (canvas.photo[3] + canvas.size[1]) / 2


def left_text(canvas: Canvas, x: float, y: float, text: str, size: float, colour: Colour) -> None:
    """Draw text that starts at x and is vertically centred on y, page px."""
    width = canvas.text_size(text, size)[0]
    canvas.text(np.array([x + width / 2, y]), text, size, colour)


def draw_footer(
    canvas: Canvas, badge: str, ground: Colour, items: list[str], taken: float = 0.0
) -> None:
    """Draw a badge, followed by as many of the items (most important first) as fit.

    `taken` is the width at the right to leave free for something else, page px.
    """
    y, pad = footer_middle(canvas), PAD * canvas.unit
    width, _ = canvas.chip_size(badge, FOOTER)
    canvas.chip(np.array([pad + width / 2, y]), badge, FOOTER, PAPER, ground)
    x = 2 * pad + width
    room = canvas.size[0] - x - pad - taken
    kept = list(items)
    while len(kept) > 1 and canvas.text_size("   ·   ".join(kept), FOOTER)[0] > room:
        kept.pop()
    left_text(canvas, x, y, canvas.shortened("   ·   ".join(kept), FOOTER, room), FOOTER, MUTED)
