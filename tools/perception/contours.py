"""Masks to outlines: the pixel borders of a mask as a polygon with holes."""

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from ..geometry.outline import Outline, largest_part, outline_of


def outline_of_mask(mask: NDArray[np.bool_]) -> Outline:
    """The outline of a mask's largest connected part, holes kept.

    OpenCV traces pixel centres (Suzuki and Abe 1985); growing the polygon by half a pixel gives
    the pixels' borders: exact for upright edges, up to half a pixel wide of slanted ones.

    Args:
        mask: (H, W).

    Raises:
        InputError: nothing in the mask is wide enough to have an area.
    """
    contours, hierarchy = cv2.findContours(
        mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE
    )
    parts: list[BaseGeometry] = []
    for i, contour in enumerate(contours):
        if hierarchy[0][i][3] >= 0 or len(contour) < 3:
            continue  # a hole, taken with its parent, or a speck without area
        holes = [c[:, 0] for c, h in zip(contours, hierarchy[0], strict=True) if h[3] == i]
        region = Polygon(contour[:, 0], [h for h in holes if len(h) >= 3])
        parts.append(shapely.make_valid(region).buffer(0.5, join_style="mitre"))
    largest = largest_part(shapely.union_all(parts)) if parts else None
    if largest is None:
        raise InputError(f"The mask's {int(mask.sum())} pixels form lines or specks, no shape.")
    return outline_of(largest)


def mask_of_outline(outline: Outline, width: int, height: int) -> NDArray[np.bool_]:
    """Pixels whose centres lie in the outline, (height, width)."""
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
