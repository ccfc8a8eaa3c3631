"""Combines a drawn outline with the measured one where the drawing is known to be right.

That is beside points that say so, and along the sides of a thing with straight sides.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon, box

from ...geometry.outline import (
    FloatArray,
    Outline,
    distances,
    largest_part,
    make_outline,
    outline_of,
)
from . import grabcut as gc
from .grabcut import Bytes, Mask, Point
from .protocol import Segmentation
from .segment import BESIDE, discs, segment_outline

STRAY = 0.1
"""Measured edges further than this from a drawn side, as a share of the size, are not its."""
ENDS = 0.08
"""Share of a side at each end that is not measured: corners come out rounded."""
LEAST = 0.5
"""Where less than this share of a side was measured, the drawn one stays."""
DRAWN = 0.5
"""How much the drawn side counts beside the measured one."""
AGREED = 0.5
"""Least overlap (intersection over union) of the polygon and what was measured."""
SAMPLES = 120
"""Places of a side that are measured."""


def segment_corrected(
    pixels: Bytes,
    vertices: Sequence[Point],
    *,
    positive: Iterable[Point] = (),
    negative: Iterable[Point] = (),
) -> Segmentation:
    """As `segment_outline`; near points that the outline agrees with, it is what was drawn.

    Points on the thing that lie in the outline say that nothing drawn is to be left out beside
    them, negative ones outside of it that nothing beyond it is kept. Only points against the
    outline have the thing cut out anew.
    """
    shape = (pixels.shape[0], pixels.shape[1])
    drawn = gc.polygon_region(np.asarray(vertices, dtype=float), shape)
    on, off = list(positive), list(negative)
    found = segment_outline(
        pixels,
        vertices,
        positive=[p for p in on if not _contains_point(drawn, p)],
        negative=[p for p in off if _contains_point(drawn, p)],
    )
    reach = BESIDE * float(np.sqrt(np.count_nonzero(drawn)))
    kept = discs(shape, [p for p in on if _contains_point(drawn, p)], reach)
    cleared = discs(shape, [p for p in off if not _contains_point(drawn, p)], reach)
    return replace(found, mask=(found.mask | (drawn & kept)) & (drawn | ~cleared))


def with_straight_sides(outline: Outline, vertices: Sequence[Point]) -> Outline:
    """The polygon of a drawn one's sides, each midway between it and the measured edge beside it.

    The measured edge is taken as its Theil-Sen line (Sen 1968), which up to 29 % of it do not
    move: who draws errs by reading, the mask by colour, and the mean of both by less than either.
    Where little was measured beside a side, the drawn one stays.

    Args:
        outline: as measured.
        vertices: three or more (x, y), px, of a polygon with straight sides.

    Returns:
        With as many corners, or `outline` itself where those lines make no polygon or one that is
        another thing.
    """
    drawn = np.asarray(shapely.get_coordinates(shapely.normalize(Polygon(vertices))))[:-1]
    edge = outline.filled.exterior
    stations = np.linspace(0, edge.length, SAMPLES * len(drawn), endpoint=False)
    places = shapely.get_coordinates(shapely.line_interpolate_point(edge, stations))
    sides = np.stack([drawn, np.roll(drawn, -1, axis=0)], axis=1)
    away = np.stack([distances(LineString(side), places) for side in sides])
    nearest = np.argmin(away, axis=0)
    own = away[nearest, np.arange(len(places))] <= STRAY * outline.size
    lines = [_fitted_side(side, places[own & (nearest == i)]) for i, side in enumerate(sides)]
    corners = [_side_crossing(lines[i - 1], line) for i, line in enumerate(lines)]
    far = np.linalg.norm(np.asarray(corners) - drawn, axis=1) > 2 * STRAY * outline.size
    made = Polygon(np.where(far[:, None], drawn, corners))
    if not made.is_valid:
        return outline
    shared = made.intersection(outline.filled).area
    agreed = shared >= AGREED * made.union(outline.filled).area
    return make_outline(made.exterior.coords) if agreed else outline


def clipped_to_picture(outline: Outline, width: int, height: int) -> Outline:
    """What lies in the picture of an outline whose sides were laid out past its border."""
    seen = largest_part(outline.polygon.intersection(box(-0.5, -0.5, width - 0.5, height - 0.5)))
    return outline if seen is None or seen.equals(outline.polygon) else outline_of(seen)


def _contains_point(region: Mask, point: Point) -> bool:
    x, y = (round(v) for v in point)
    return bool(region[y, x])


def _fitted_side(side: FloatArray, places: FloatArray) -> FloatArray:
    """A drawn side, (2, 2), moved and turned towards the line of places measured beside it."""
    way = side[1] - side[0]
    length = float(np.hypot(*way))
    normal = np.array([-way[1], way[0]]) / length
    share = (places - side[0]) @ way / length**2
    middle = (share > ENDS) & (share < 1 - ENDS)
    if not middle.any() or np.ptp(share[middle]) < LEAST:
        return side
    x, y = share[middle], ((places - side[0]) @ normal)[middle]
    first, second = np.triu_indices(len(x), 1)
    apart = np.abs(x[second] - x[first]) > 1e-9
    slope = float(np.median(((y[second] - y[first])[apart]) / (x[second] - x[first])[apart]))
    start = float(np.median(y - slope * x))
    return side + (1 - DRAWN) * np.array([start, start + slope])[:, None] * normal


def _side_crossing(before: FloatArray, after: FloatArray) -> FloatArray:
    """Where two sides meet that follow each other; nearly in line, midway between their ends."""
    a, b = before[1] - before[0], after[1] - after[0]
    cross = float(a[0] * b[1] - a[1] * b[0])
    if abs(cross) < 0.2 * float(np.hypot(*a) * np.hypot(*b)):
        return (before[1] + after[0]) / 2
    gap = after[0] - before[0]
    return before[0] + a * float(gap[0] * b[1] - gap[1] * b[0]) / cross
