"""Printed tags in a picture: ArUco's or AprilTag's, their corners to a fraction of a pixel.

Corners as the detector has them turn a tag of 24 px by up to 4 degrees, so that lines are fitted to
its sides and met.
"""

import math
from collections import Counter
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from ...geometry.outline import FloatArray

PASSES = 2
ALONG = np.linspace(0.12, 0.88, 16)
"""Where a side is looked at, as shares of its length: not where others begin."""
REACH = 2.5
"""A side is looked for within so many px, or"""
SHARE = 0.1
"""this share of it, as the cells of a small tag are not much larger."""


def _known(name: str) -> str:
    if not (name.startswith("DICT_") and hasattr(cv2.aruco, name)):
        raise ValueError(f"no such dictionary, such as DICT_4X4_50 or DICT_APRILTAG_36h11: {name}")
    return name


Dictionary = Annotated[str, AfterValidator(_known)]
"""What OpenCV calls a family of tags."""


def tags_in(pixels: NDArray[np.uint8], dictionary: Dictionary) -> dict[int, FloatArray]:
    """The tags of a picture that are there once.

    Args:
        pixels: (H, W, 3) BGR.

    Returns:
        by the tags' ids their corners, (4, 2) px, clockwise from the upper left of the print.
    """
    grey = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), np.uint8)
    family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
    corners, ids, _ = cv2.aruco.ArucoDetector(family, settings).detectMarkers(grey)
    tags = [int(tag) for tag in np.ravel(ids)] if len(corners) else []
    often = Counter(tags)
    return {
        tag: _refined(grey, np.asarray(four, dtype=float).reshape(4, 2))
        for tag, four in zip(tags, corners, strict=True)
        if often[tag] == 1
    }


def centre(corners: FloatArray) -> FloatArray:
    """Where the centre of a square is seen: where its diagonals meet, (2,) px."""
    a, b, c, d = corners
    (ax, ay), (bx, by), (cx, cy) = (b - a).tolist(), (c - a).tolist(), (d - b).tolist()
    return a + (c - a) * (ax * cy - ay * cx) / (bx * cy - by * cx)


def heading(corners: FloatArray) -> float:
    """Where the right side of a tag points to, radians about x towards y, from (4, 2) m."""
    x, y = corners[1] + corners[2] - corners[0] - corners[3]
    return math.atan2(y, x)


def _refined(grey: NDArray[np.uint8], corners: FloatArray) -> FloatArray:
    """Corners where lines meet that were fitted to the sides, black within and white without."""
    for _ in range(PASSES):
        ways = np.roll(corners, -1, axis=0) - corners
        sides = np.linalg.norm(ways, axis=1, keepdims=True)
        outward = np.column_stack([ways[:, 1], -ways[:, 0]]) / sides
        steps = np.linspace(-1, 1, 21) * min(REACH, SHARE * float(sides.mean()))
        on = corners[:, None] + ALONG[:, None] * ways[:, None]
        at = on[:, :, None] + steps[:, None] * outward[:, None, None]
        flat = at.reshape(-1, len(steps), 2).astype(np.float32)
        seen = np.asarray(cv2.remap(grey, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR), float)
        rise = np.clip(np.diff(seen, axis=1), 0, None)
        off = rise @ ((steps[1:] + steps[:-1]) / 2) / np.maximum(rise.sum(axis=1), 1e-9)
        edges = on + off.reshape(4, -1, 1) * outward[:, None]
        middles = edges.mean(axis=1)
        normals = np.linalg.svd(edges - middles[:, None])[2][:, 1]
        reach = (normals * middles).sum(axis=1)
        pairs = np.stack([np.roll(normals, 1, axis=0), normals], axis=1)
        reaches = np.stack([np.roll(reach, 1), reach], axis=1)[..., None]
        met = np.asarray(np.linalg.pinv(pairs) @ reaches, dtype=float)[..., 0]
        if np.abs(met - corners).max() > 2 * REACH:  # something lies across a side
            return corners
        corners = met
    return corners
