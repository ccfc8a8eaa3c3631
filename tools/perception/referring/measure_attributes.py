"""Measures a thing's attributes: its colours in the picture, its shape on the outline."""

import cv2
import numpy as np
from numpy.typing import NDArray
from shapely.affinity import affine_transform

from ...geometry.outline import Outline, outline_of
from ..contours import mask_of_outline
from ..image import Picture
from ..segmenters.grabcut import polygon_region, resampled
from .attributes import Attributes, Candidate
from .colours import colour_shares, lab_of
from .shape_classes import shape_fits

SIDE = 384
"""Longer side of the reduced picture in which colours are measured, px."""
SMOOTHING = 0.7
"""Simplification that removes an outline's pixel staircase, px at that scale."""


def measure_attributes(
    outline: Outline,
    patch: NDArray[np.uint8],
    mask: NDArray[np.bool_],
    *,
    area: int,
    touches_border: bool,
) -> Attributes:
    """Measure the attributes of a thing.

    Args:
        outline: image px.
        patch: (h, w, 3) RGB, a part of the picture at any scale.
        mask: (h, w), the thing's pixels in the patch, at least one.
        area: pixels of the thing at that scale, holes filled.
        touches_border: whether the picture's border cuts it.
    """
    core = np.asarray(cv2.erode(mask.astype(np.uint8), np.ones((3, 3)), borderValue=(0,))) > 0
    pixels = patch[core if core.any() else mask]
    axis, long, short = outline.long_axis
    filled, polygon = outline.filled, outline.polygon
    smooth = filled.simplify(SMOOTHING * float(np.sqrt(polygon.area / area)))
    low, a, b = (float(v) for v in lab_of(pixels).mean(axis=0))
    return Attributes(
        colours=colour_shares(pixels),
        lab=(low, a, b),
        area=outline.area,
        centre=(polygon.centroid.x, polygon.centroid.y),
        orientation=float(np.degrees(np.arctan2(axis[1], axis[0])) % 180),
        elongation=long / max(short, 1e-9),
        roundness=min(4 * np.pi * smooth.area / smooth.length**2, 1.0),
        shapes=shape_fits(polygon),
        hole=1 - polygon.area / filled.area,
        touches_border=touches_border,
    )


def candidate_of(name: str, outline: Outline, picture: Picture, salience: float) -> Candidate:
    """Make a candidate from its outline alone, for detectors that find boxes or masks.

    Args:
        name: its id: c1, c2, ...
        outline: image px.
        picture: the picture it is in.
        salience: 0 to 1.
    """
    scale = min(1.0, SIDE / max(picture.size))
    width, height = (max(1, round(side * scale)) for side in picture.size)
    sx, sy = width / picture.width, height / picture.height
    shift = (sx - 1) / 2, (sy - 1) / 2  # pixel centres stay at .0
    small = outline_of(affine_transform(outline.polygon, (sx, 0, 0, sy, *shift)))
    solid = polygon_region(np.asarray(small.filled.exterior.coords), (height, width))
    mask = mask_of_outline(small, width, height)
    x0, y0, x1, y1 = outline.bounds
    attributes = measure_attributes(
        outline,
        resampled(picture.pixels, (width, height)),
        mask if mask.any() else solid,
        area=int(np.count_nonzero(solid)),
        touches_border=min(x0, y0, picture.width - 1 - x1, picture.height - 1 - y1) < 1,
    )
    return Candidate(name, outline, attributes, salience)
