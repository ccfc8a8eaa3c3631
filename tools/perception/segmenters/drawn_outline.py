"""Combines a drawn outline with the measured one where the drawing is known to be right.

That is so near points that confirm it, and along the sides of a thing with straight sides.
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
"""Greatest distance of measured edges from the drawn side they belong to, over the size."""
ENDS = 0.08
"""Share of a side at each end that is ignored, because measured corners come out rounded."""
LEAST = 0.5
"""Least share of a side that must be measured; otherwise the drawn side stays."""
DRAWN = 0.5
"""Weight of the drawn side against the measured one."""
AGREED = 0.5
"""Least overlap (intersection over union) of the polygon and the measured outline."""
SAMPLES = 120
"""Number of samples of the measured edge per side."""


def segment_corrected(
    pixels: Bytes,
    vertices: Sequence[Point],
    *,
    positive: Iterable[Point] = (),
    negative: Iterable[Point] = (),
) -> Segmentation:
    """Segment as `segment_outline` does, but as drawn near points that agree with the outline.

    Near a point on the thing inside the outline, nothing drawn is left out; near a negative point
    outside it, nothing beyond the outline is kept. Only points that contradict the outline affect
    the segmentation itself.
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
    """Move each side of a drawn polygon midway to the measured edge beside it.

    The measured edge is taken as its Theil-Sen line (Sen 1968), which outliers of up to 29 % do not
    affect: a person errs in reading, the mask in colour, and their mean by less than either. If
    little was measured beside a side, the drawn side stays.

    Args:
        outline: the measured outline.
        vertices: three or more (x, y), px, of the drawn polygon with straight sides.

    Returns:
        A polygon with as many corners as the drawn one; `outline` itself if the sides make no valid
        polygon, or one that overlaps too little with it.
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
    """Return the part inside the picture of an outline that may reach beyond its border."""
    seen = largest_part(outline.polygon.intersection(box(-0.5, -0.5, width - 0.5, height - 0.5)))
    return outline if seen is None or seen.equals(outline.polygon) else outline_of(seen)


def _contains_point(region: Mask, point: Point) -> bool:
    x, y = (round(v) for v in point)
    return bool(region[y, x])


def _fitted_side(side: FloatArray, places: FloatArray) -> FloatArray:
    """Move and turn a drawn side (2, 2) halfway to the line of the places measured beside it."""
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
    """Return where two successive sides meet; if nearly in line, midway between their ends."""
    a, b = before[1] - before[0], after[1] - after[0]
    cross = float(a[0] * b[1] - a[1] * b[0])
    if abs(cross) < 0.2 * float(np.hypot(*a) * np.hypot(*b)):
        return (before[1] + after[0]) / 2
    gap = after[0] - before[0]
    return before[0] + a * float(gap[0] * b[1] - gap[1] * b[0]) / cross
