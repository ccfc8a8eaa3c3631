"""Training curves over seeds: interquartile mean with a bootstrap interval, and their picture.

A seed that stopped before the others keeps its last score.
"""

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw
from scipy.stats import trim_mean

from ...tools.draw.text import font
from ...tools.geometry.outline import FloatArray
from .policy import Checkpoint
from .teams import CATEGORIES

DRAWS, LEVEL = 2_000, 0.95
SIZE, FRAME = (800, 440), (60, 40, 580, 390)
"""Size of the picture, and the box of its axes, px."""
COLOURS = dict(zip(CATEGORIES, ((31, 119, 180), (44, 160, 44), (214, 39, 40)), strict=True))


def summary(checkpoints: Sequence[Checkpoint]) -> tuple[list[int], FloatArray, FloatArray]:
    """Return the steps (n), the interquartile mean over seeds (n,), and its 95 % interval (2, n).

    Args:
        checkpoints: of one category, one per seed.
    """
    steps = sorted({step for c in checkpoints for step, _ in c.curve})
    scores = np.array(
        [np.interp(steps, *np.transpose(np.asarray(c.curve))) for c in checkpoints], dtype=float
    )
    drawn = np.random.default_rng(0).integers(len(scores), size=(DRAWS, len(scores)))
    means = trim_mean(scores[drawn], 0.25, axis=1)
    tails = ((1 - LEVEL) / 2, (1 + LEVEL) / 2)
    return steps, np.asarray(trim_mean(scores, 0.25, axis=0)), np.quantile(means, tails, axis=0)


def picture(checkpoints: Sequence[Checkpoint]) -> bytes:
    """Return the training curves of all categories, as a PNG."""
    image, most = Image.new("RGB", SIZE, "white"), max(c.curve[-1][0] for c in checkpoints)
    draw = ImageDraw.Draw(image, "RGBA")
    x0, y0, x1, y1 = FRAME
    for tenth in range(0, 11, 2):
        y = y1 - tenth / 10 * (y1 - y0)
        draw.line([(x0, y), (x1, y)], (220, 220, 220))
        draw.text((x0 - 8, y), f"{tenth / 10:.1f}", "black", font(13), anchor="rm")
    title = "Mean reward at the end of an episode: interquartile mean over seeds, 95 % interval"
    draw.text((x0, 12), title, "black", font(14))
    draw.text((x1, y1 + 10), f"{most:,} steps of robots", "black", font(13), anchor="ra")
    for row, (category, colour) in enumerate(COLOURS.items()):
        own = [c for c in checkpoints if c.category == category]
        if not own:
            continue
        steps, mean, ends = summary(own)
        across = x0 + np.asarray(steps) / most * (x1 - x0)
        low, line, high = (
            list(zip(across, y1 - np.clip(values, 0, 1) * (y1 - y0), strict=True))
            for values in (ends[0], mean, ends[1])
        )
        if len(line) > 1:
            draw.polygon([*low, *reversed(high)], (*colour, 60))
        draw.line(line, colour, 2)
        late = "" if all(c.converged for c in own) else ", unconverged"
        label = f"{category}, {len(own)} seed{'s'[: len(own) > 1]}{late}"
        draw.text((x1 + 8, y0 + 20 * row), label, colour, font(13))
    file = io.BytesIO()
    image.save(file, "PNG")
    return file.getvalue()
