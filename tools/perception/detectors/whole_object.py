"""Proposes the whole object around the part that a point hit: what stands out from the ground.

A click on a car's roof grows the roof alone. If a region is not surrounded by one plain ground, the
piece of the picture that differs from the ground further out is proposed as the whole.
"""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from ..segmenters.grabcut import Bytes, Floats, Mask, Point, Window
from ..segmenters.region_growing import (
    MIN_PIXELS,
    Region,
    distinct,
    ends_inside,
    filled,
    pieces_grown,
    region_score,
    seeds_of,
    touches_border,
    windows,
)

RIM = 0.06
# The most colours of the ground, and the share of the rim below which a colour is an accident.
GROUND_COLOURS, RARE = 5, 0.04
LEAST_SPREAD = 4.0
# Standard deviations from the ground's colours beyond which a pixel is not ground; all are tried.
DEVIATIONS = (2.0, 3.0, 4.5)
# Surroundings are plain when this share of them is within this distance of their median colour.
PLAIN_SHARE, PLAIN_DISTANCE = 0.8, 14.0
SURROUNDINGS = 0.1


def propose_whole(pixels: Bytes, points: Sequence[Point], count: int) -> list[Region]:
    """Propose up to `count` clearly different regions that hold the points and are not ground.

    `pixels` is (H, W, 3) RGB.
    """
    return distinct(_regions_off_ground(pixels, points), count)


def on_plain_ground(window: Window, mask: Mask) -> bool:
    """Return whether one colour surrounds the mask (h, w), so that it is a thing, not a part."""
    reach = max(3, round(SURROUNDINGS * float(np.sqrt(np.count_nonzero(mask)))))
    size = 2 * reach + 1
    region = mask.astype(np.uint8)
    near = np.asarray(cv2.dilate(region, np.ones((5, 5), np.uint8))) > 0
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    around = (np.asarray(cv2.dilate(region, kernel)) > 0) & ~near
    if not around.any():
        return True
    colours: Floats = window.features[around].astype(np.float32)
    distance = np.linalg.norm(colours - np.median(colours, axis=0), axis=1)
    return int(np.count_nonzero(distance < PLAIN_DISTANCE)) > PLAIN_SHARE * len(distance)


def _regions_off_ground(pixels: Bytes, points: Sequence[Point]) -> Iterator[Region]:
    kernel = np.ones((3, 3), np.uint8)
    for window in windows(pixels, points):
        seeds = seeds_of(window, points)
        distance = _distance_from_ground(window.features.astype(np.float32))
        for deviations in DEVIATIONS:
            off = (distance > deviations).astype(np.uint8)
            closed = np.asarray(cv2.morphologyEx(off, cv2.MORPH_CLOSE, kernel)) > 0
            mask = pieces_grown(filled(closed), seeds)
            whole = np.count_nonzero(mask) >= MIN_PIXELS and not touches_border(mask).any()
            if whole and ends_inside(mask, window):
                yield Region(window, mask, region_score(mask, window))


def _distance_from_ground(colours: Floats) -> Floats:
    """Return each pixel's distance (h, w) from the nearest colour along the window's rim.

    It is in standard deviations of that colour.
    """
    height, width = colours.shape[:2]
    reach = max(2, round(RIM * max(height, width)))
    rim = np.ones((height, width), dtype=np.bool_)
    rim[reach:-reach, reach:-reach] = False
    samples = colours[rim]
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 10, 1.0)
    count = min(GROUND_COLOURS, samples.shape[0])
    _, labels, _ = cv2.kmeans(samples, count, np.empty(0, np.int32), stop, 2, cv2.KMEANS_PP_CENTERS)
    owner = np.asarray(labels).ravel()
    distance = np.full((height, width), np.inf, dtype=np.float32)
    for k in range(count):
        mine = samples[owner == k]
        if len(mine) >= RARE * samples.shape[0]:
            spread = np.maximum(mine.std(axis=0), LEAST_SPREAD)
            off = np.linalg.norm((colours - mine.mean(axis=0)) / spread, axis=2)
            distance = np.minimum(distance, off.astype(np.float32))
    return distance
