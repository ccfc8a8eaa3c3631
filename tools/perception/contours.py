"""Converts masks to outlines, polygons with holes along the pixels' borders, and back."""

import math

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from ..geometry.outline import Outline, largest_part, outline_of

WHOLE = 0.9
"""Least share of a mask that one piece must hold to represent it."""
GAP_SHARES = (0.0, 0.02, 0.05, 0.1)
"""Half the width of the gaps to bridge, as a share of the mask's size; tried in order."""

FINEST = 5e-4
"""Simplification tolerance as a share of the size; below half a pixel up to a size of 700 px."""


def outline_of_mask(mask: NDArray[np.bool_]) -> Outline:
    """Return the outline of a mask, with its holes; parts split by a narrow gap are joined.

    OpenCV traces pixel centres (Suzuki and Abe 1985); growing the polygon by half a pixel gives
    the pixels' borders: exact for upright edges, up to half a pixel too wide for slanted ones.

    Args:
        mask: (H, W).

    Raises:
        InputError: nothing in the mask is wide enough to have an area, or it falls into pieces
            none of which holds nine tenths of it.
    """
    raster = np.ascontiguousarray(mask).view(np.uint8)
    x, y, width, height = cv2.boundingRect(raster)  # most of a large picture is background
    part = np.ascontiguousarray(raster[y : y + height, x : x + width])
    contours, hierarchy = cv2.findContours(
        part, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE, offset=(x, y)
    )
    parts: list[BaseGeometry] = []
    for i, contour in enumerate(contours):
        if hierarchy[0][i][3] >= 0 or len(contour) < 3:
            continue  # a hole, taken with its parent, or a speck without area
        holes = [c[:, 0] for c, h in zip(contours, hierarchy[0], strict=True) if h[3] == i]
        region = Polygon(contour[:, 0], [h for h in holes if len(h) >= 3])
        parts.append(shapely.make_valid(region).buffer(0.5, join_style="mitre"))
    region = shapely.union_all(parts)
    if region.is_empty:
        raise InputError(f"The mask's {int(mask.sum())} pixels form lines or specks, no shape.")
    whole = in_one_piece(region)
    return outline_of(whole.simplify(FINEST * math.sqrt(whole.area)))


def in_one_piece(region: BaseGeometry) -> BaseGeometry:
    """Return the region's largest part, with narrow gaps bridged as far as that is needed.

    Raises:
        InputError: no part holds nine tenths of the region, even with gaps bridged.
    """
    for share in GAP_SHARES:
        reach = share * math.sqrt(region.area)
        joined = region if share == 0 else region.buffer(reach).buffer(-reach).union(region)
        largest = largest_part(joined)
        if largest is not None and largest.intersection(region).area >= WHOLE * region.area:
            return largest
    count = len(shapely.get_parts(region))
    raise InputError(f"The mask falls into {count} pieces, none of which is the whole thing.")


def mask_of_outline(outline: Outline, width: int, height: int) -> NDArray[np.bool_]:
    """Return a mask (height, width) of the pixels whose centres lie in the outline."""
    mask = np.zeros((height, width), dtype=bool)
    x0, y0, x1, y1 = outline.bounds
    columns = np.arange(max(int(x0), 0), min(int(x1) + 2, width))
    rows = np.arange(max(int(y0), 0), min(int(y1) + 2, height))
    if len(columns) and len(rows):
        x, y = np.meshgrid(columns, rows)
        shapely.prepare(outline.polygon)
        mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = shapely.contains_xy(
            outline.polygon, x, y
        )
    return mask
