"""Rates masks of networks: the confidence alpha is the geometric mean of its parts."""

from collections.abc import Mapping

import cv2
import numpy as np

from .grabcut import Bytes, Mask, bounding_box, clean, colour_separation, window_around
from .protocol import Segmentation

MOST = 0.9
"""Greatest share of the picture that a thing in it may cover."""


def rate_mask(pixels: Bytes, mask: Mask, parts: Mapping[str, float]) -> Segmentation:
    """Clean a mask (H, W) and rate it; it becomes empty, with confidence 0, if it is no thing.

    Args:
        pixels: (H, W, 3) RGB.
        mask: (H, W).
        parts: the network's own scores in [0, 1]; how far the mask stands out in colour is added.
    """
    mask = clean(mask, np.empty((0, 2))) if mask.any() else mask
    if not mask.any() or float(np.mean(mask)) > MOST:
        return Segmentation(np.zeros_like(mask), 0.0, {**parts})
    parts = {**parts, "colour_separation": _colour_separation(pixels, mask)}
    return Segmentation(mask, float(np.prod(list(parts.values())) ** (1 / len(parts))), parts)


def _colour_separation(pixels: Bytes, mask: Mask) -> float:
    window = window_around(pixels, bounding_box(mask))
    (x, y), (width, height) = window.origin, window.extent
    part = mask[y : y + height, x : x + width].astype(np.float32)
    small = np.asarray(cv2.resize(part, window.shape[::-1], interpolation=cv2.INTER_AREA)) > 0.5
    return colour_separation(window.features, small)
