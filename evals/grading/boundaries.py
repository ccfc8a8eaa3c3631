"""The error of an outline's boundary, which is what matters for a clearance."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ...tools.geometry.outline import FloatArray, distances

SPACING = 0.5
"""Spacing of the points of a boundary whose distances are taken, px."""


def boundary_error(found: BaseGeometry, truth: BaseGeometry) -> float:
    """Return e95: the larger 95 % quantile of the distances from either boundary to the other.

    It is a share of the square root of the true area, 1 at most, for regions in px.
    """
    one, other = found.boundary, truth.boundary
    apart = (distances(other, _along(one)), distances(one, _along(other)))
    error = max(float(np.quantile(d, 0.95)) for d in apart) / float(np.sqrt(truth.area))
    return min(error, 1.0)


def _along(line: BaseGeometry) -> FloatArray:
    parts = [
        shapely.line_interpolate_point(part, np.arange(0.0, part.length, SPACING))
        for part in shapely.get_parts(line)
    ]
    return shapely.get_coordinates(np.concatenate(parts))
