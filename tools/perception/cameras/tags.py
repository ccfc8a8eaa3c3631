"""Finds printed ArUco or AprilTag tags in a picture, with corners to a fraction of a pixel.

The detector's own corners can turn a tag of 24 px by up to 4 degrees, so lines are fitted to its
sides and intersected.
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
"""Where a side is sampled, as shares of its length: away from its ends, where others begin."""
REACH = 2.5
"""Greatest distance within which a side's edge is searched for, px."""
SHARE = 0.1
"""The same as a share of the side, if that is less: a small tag's cells are not much larger."""


def _known_dictionary(name: str) -> str:
    if not (name.startswith("DICT_") and hasattr(cv2.aruco, name)):
        raise ValueError(f"no such dictionary, such as DICT_4X4_50 or DICT_APRILTAG_36h11: {name}")
    return name


Dictionary = Annotated[str, AfterValidator(_known_dictionary)]
"""OpenCV's name of a family of tags."""


def tags_in(pixels: NDArray[np.uint8], dictionary: Dictionary) -> dict[int, FloatArray]:
    """Find the tags that a picture shows exactly once.

    Args:
        pixels: (H, W, 3) BGR.
        dictionary: the family of tags to look for.

    Returns:
        The corners (4, 2) by tag id, px, clockwise from the upper left of the print.
    """
    grey = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), np.uint8)
    family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
    corners, ids, _ = cv2.aruco.ArucoDetector(family, settings).detectMarkers(grey)
    tags = [int(tag) for tag in np.ravel(ids)] if len(corners) else []
    often = Counter(tags)
    return {
        tag: _refine_corners(grey, np.asarray(four, dtype=float).reshape(4, 2))
        for tag, four in zip(tags, corners, strict=True)
        if often[tag] == 1
    }


def centre(corners: FloatArray) -> FloatArray:
    """Return where the centre of a square is seen, (2,), px: the intersection of its diagonals."""
    a, b, c, d = corners
    (ax, ay), (bx, by), (cx, cy) = (b - a).tolist(), (c - a).tolist(), (d - b).tolist()
    return a + (c - a) * (ax * cy - ay * cx) / (bx * cy - by * cx)


def heading(corners: FloatArray) -> float:
    """Return where a tag's right side points, radians from x towards y, from corners (4, 2), m."""
    x, y = corners[1] + corners[2] - corners[0] - corners[3]
    return math.atan2(y, x)


def _refine_corners(grey: NDArray[np.uint8], corners: FloatArray) -> FloatArray:
    """Refine corners (4, 2) as the intersections of lines fitted to the tag's sides.

    A side is where black inside turns to white outside. Corners that would move too far are
    returned as they are.
    """
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
        if np.abs(met - corners).max() > 2 * REACH:  # something covers part of a side
            return corners
        corners = met
    return corners
