"""Draws the picture a model is shown: what it needs to point, in as few pixels as possible.

The photograph is at the upper left, unscaled if it has a common size, so that coordinates read
off the image and off the rulers agree. Providers bill by the pixel, and shrink pictures longer
than some 1,500 px.
"""

from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO

import numpy as np

from ..formation.plan import Plan
from ..geometry.outline import Outline
from ..perception.image import Picture
from ..perception.referring.attributes import Candidate
from ..perception.target_prompt import Box, TargetPrompt
from ..world import World
from .canvas import ALLOWED, CERTIFIED, FINDING, WHITE, Canvas
from .marks import rings
from .overlay import draw_world
from .rulers import RULER, draw_rulers

MOST_LONG, LEAST_LONG = 1024, 400
"""Greatest and least long side of the photograph in a view, px.

A longer one is shrunk, a shorter one enlarged by a whole factor."""
CLOSER = 768
"""Long side of a region that is looked at more closely, px."""
QUALITY = 90


def view_scale(picture: Picture) -> float:
    """Return the scale of a view: its pixels per pixel of the picture."""
    long = max(picture.size)
    if long > MOST_LONG:
        return MOST_LONG / long
    return float(-(-LEAST_LONG // long))


def draw_view(
    picture: Picture,
    world: World,
    *,
    plan: Plan | None = None,
    candidates: Sequence[Candidate] = (),
    region: Box | None = None,
    drawn: TargetPrompt | None = None,
    before: Outline | None = None,
) -> bytes:
    """Draw the photograph with rulers along its right and lower edges, as a JPEG file.

    Args:
        world: the world whose targets are outlined and tagged with their ids.
        plan: the plan whose robots are drawn.
        candidates: outlined and numbered, 3 for c3.
        region: x0, y0, x1, y1, a part to look at more closely, image pixels; the rulers show its
            coordinates in the whole picture.
        drawn: a hand-drawn outline, dashed in white, and the points that correct it.
        before: the outline as it was before somebody drew, dashed in blue.

    Raises:
        ToolError: the plan names a target that the world does not have.
    """
    origin = (0, 0)
    long = max(round(view_scale(picture) * max(picture.size)), 1)
    if region is not None:
        picture, origin = part_of(picture, region)
        long = CLOSER
    canvas = Canvas(picture, long, 1.0, (0, 0, RULER[2], RULER[3]), origin)
    if before is not None:
        canvas.dashes(rings(before.polygon), ALLOWED, 1.0)
    if drawn is not None and drawn.outline is not None:
        canvas.dashes([np.asarray([*drawn.outline, drawn.outline[0]], dtype=float)], WHITE, 1.0)
    draw_world(canvas, world, plan, candidates)
    if drawn is not None:
        for point in drawn.points or ():
            canvas.disc(np.asarray(point), 5.0, CERTIFIED, 1.0)
        for point in drawn.negative:
            canvas.cross(np.asarray(point), 5.0, FINDING, 2.0)
    draw_rulers(canvas)
    file = BytesIO()
    canvas.finish().save(file, "JPEG", quality=QUALITY, subsampling=0)
    return file.getvalue()


def part_of(picture: Picture, region: Box) -> tuple[Picture, tuple[int, int]]:
    """Cut a region out of the picture, widened to whole pixels.

    Returns:
        The part, and the (x, y) of its first pixel in the whole picture.
    """
    low = np.maximum(np.floor(region[:2]), 0).astype(int)
    high = np.minimum(np.ceil(region[2:]), picture.size).astype(int)
    (x0, y0), (x1, y1) = low, high
    cut = np.ascontiguousarray(picture.pixels[y0:y1, x0:x1])
    return replace(picture, pixels=cut), (int(x0), int(y0))
