"""Rulers along the edges of a photograph, in its own pixels.

They stand in the page's margins and hide nothing; an edge without a margin gets no ruler.
"""

import numpy as np

from .canvas import INK, PAPER, Canvas, Margins

TEXT, LABELS = 15.0, 16
RULER: Margins = (52, 30, 52, 30)
"""Margins for the rulers, units of the page."""


def draw_rulers(canvas: Canvas) -> None:
    """Draw ticks at round pixels of the photograph, with their numbers, in every margin."""
    canvas.fill_margins(PAPER)
    for axis in (0, 1):
        step = _label_step(canvas, axis)
        minor, first = max(step // 5, 1), canvas.origin[axis]
        for value in range(-(-first // minor) * minor, first + canvas.source[axis], minor):
            _draw_tick(canvas, axis, value, labelled=value % step == 0)


def _draw_tick(canvas: Canvas, axis: int, value: int, *, labelled: bool) -> None:
    """Draw one tick on each of the rulers for x (axis 0) or y (axis 1)."""
    unit = canvas.unit
    along = float(canvas.at(np.full((1, 2), float(value)))[0, axis]) + 0.5
    reach, half = (8 if labelled else 4) * unit, 0.75 * unit
    middle = (RULER[1] / 2 + 3 if axis == 0 else RULER[0] / 2 + 3) * unit
    near, far = canvas.photo[1 - axis], canvas.photo[3 - axis]
    for edge, out in ((near, -1), (far, 1)):
        if not 0 < edge < canvas.size[1 - axis]:
            continue
        low, high = sorted((edge, edge + out * reach))
        tick = (along - half, low, along + half, high)
        canvas.box(tick if axis == 0 else (tick[1], tick[0], tick[3], tick[2]), INK)
        if labelled:  # kept whole on the page: half a number reads as another number
            half_label = canvas.text_size(str(value), TEXT)[axis] / 2
            whole = min(max(along - 0.5, half_label), canvas.size[axis] - 1 - half_label)
            where = np.array([whole, edge + out * middle])
            canvas.text(where if axis == 0 else where[::-1], str(value), TEXT, INK)


def _label_step(canvas: Canvas, axis: int) -> int:
    """Return the smallest of 1, 2, 5, 10, ... px with labels neither too many nor too close."""
    count = canvas.source[axis]
    widest = canvas.text_size(f"{canvas.origin[axis] + count}0", TEXT)[axis]
    for power in range(6):
        for lead in (1, 2, 5):
            step = lead * 10**power
            if count <= LABELS * step and step * canvas.scale[axis] >= 1.2 * widest:
                return step
    return 10**6
