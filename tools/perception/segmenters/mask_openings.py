"""Cuts openings out of a mask: the ground seen through finger loops, rings and handles.

GrabCut learns the ground inside a loop as one of the thing's own colours. Plain ground can be told
apart; on patterned ground a window or a marking looks just the same, and stays.
"""

import cv2
import numpy as np

from .grabcut import MIN_HOLE, Bytes, Floats, Mask, Points, pieces

# The ground is plain if its median deviation from one even gradient is less than this, in features.
PLAIN = 4.0
# An opening shows the ground: its distance from the ground's colour is less than this share of the
# distance of the thing's own colours. Openings measured .11 to .16, and windows, shades and
# lettering .5 or more.
LIKENESS = 0.35
# Fewer ground pixels than this are no sample.
MIN_GROUND = 100


def cut_openings(image: Bytes, mask: Mask, keep: Points) -> Mask:
    """Return the mask without enclosed parts that show plain ground, except at `keep` points."""
    ground = np.asarray(cv2.erode((~mask).astype(np.uint8), np.ones((7, 7)), borderValue=(1,))) > 0
    if np.count_nonzero(ground) < MIN_GROUND or not mask.any():
        return mask
    distance = _distance_from(image, ground)
    if np.median(distance[ground]) >= PLAIN:
        return mask
    levels = distance[mask].clip(0, 255).astype(np.uint8)
    split, _ = cv2.threshold(levels[:, None], 0, 255, cv2.THRESH_OTSU)
    own = levels[levels > split]
    if not own.size:
        return mask
    return mask & ~_openings(mask, distance, split, LIKENESS * float(own.mean()), keep)


def _distance_from(image: Bytes, ground: Mask) -> Floats:
    """Return each pixel's colour distance (h, w) from the plane fitted to the ground's colours."""
    y, x = np.indices(ground.shape)
    places = np.stack([np.ones_like(x), x, y], axis=-1).astype(np.float64)
    plane = np.linalg.lstsq(places[ground], image[ground].astype(np.float64), rcond=None)[0]
    return np.linalg.norm(image - places @ plane, axis=2).astype(np.float32)


def _openings(mask: Mask, distance: Floats, split: float, alike: float, keep: Points) -> Mask:
    """Return the enclosed pieces (h, w) of the mask below the split that look like the ground.

    A piece does if its median distance from the ground is less than `alike`.
    """
    low = (mask & (distance <= split)).astype(np.uint8)
    labels, areas = pieces(
        np.asarray(cv2.morphologyEx(low, cv2.MORPH_OPEN, np.ones((3, 3)))) > 0, 4
    )
    shell = np.asarray(cv2.dilate((~mask).astype(np.uint8), np.ones((3, 3)))) > 0
    height, width = mask.shape
    x, y = np.round(keep).astype(np.int64).clip(0, (width - 1, height - 1)).T
    refused = {0, *np.unique(labels[shell]).tolist(), *labels[y, x].tolist()}
    large = np.flatnonzero(areas >= MIN_HOLE * np.count_nonzero(mask)).tolist()
    shown = [i for i in large if i not in refused and np.median(distance[labels == i]) < alike]
    return np.isin(labels, shown)
