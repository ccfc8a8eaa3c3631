"""The part of a frame around a thing, moved back to where the thing was in the first frame.

Both ways of tracking compare with the first frame only, so that no errors add up.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from shapely import affinity

from ...geometry.outline import Outline, outline_of
from ..contours import mask_of_outline

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Points = npt.NDArray[np.float64]

LARGEST = 320.0
"""Length beyond which a thing is viewed at a smaller scale, px."""
MARGIN_SHARE, LEAST_MARGIN = 0.3, 24.0
"""Margin seen beyond the outline, as a share of its length, and at least in px."""


@dataclass(frozen=True)
class Step:
    """How far a thing is from where a view expects it, and how well that is supported.

    Attributes:
        by: (3,), dx, dy in view pixels and the turn in radians.
        share: share of the thing's points in the picture that agree with this, 0 to 1.
    """

    by: Points
    share: float


class View:
    """A window on frames that moves along with a thing.

    Motions are (3,): dx, dy in px of the picture, and a turn about the outline's centre, radians,
    clockwise as seen.

    Args:
        outline: outline of the thing in the first frame.

    Attributes:
        size: width and height, px of the view.
        scale: px of the view per px of the picture.
        outline, mask: the thing's outline, px of the view, and its mask (h, w).
        centre: centre (2,) of the outline, px of the view.
    """

    def __init__(self, outline: Outline) -> None:
        x0, y0, x1, y1 = outline.bounds
        length = max(x1 - x0, y1 - y0)
        margin = max(MARGIN_SHARE * length, LEAST_MARGIN)
        self.scale = min(1.0, LARGEST / length)
        self._origin = np.floor([x0 - margin, y0 - margin])
        extent = np.array([x1 + margin, y1 + margin]) - self._origin
        self.size = int(self.scale * extent[0]) + 2, int(self.scale * extent[1]) + 2
        self._centre = np.asarray(outline.centre)
        self.centre = (self._centre - self._origin) * self.scale
        grown = [self.scale, 0, 0, self.scale, *(-self._origin * self.scale)]
        self.outline = outline_of(affinity.affine_transform(outline.polygon, grown))
        self.mask = mask_of_outline(self.outline, *self.size)
        self._reach = length / 2

    def _matrix(self, motion: Points) -> Points:
        """Return the affine transform (2, 3) from the view to a frame."""
        turn = rotation(motion[2])
        shift = turn @ (self._origin - self._centre) + self._centre + motion[:2]
        return np.column_stack([turn / self.scale, shift])

    def seen(self, frame: Bytes, motion: Points) -> Bytes:
        """Return the view (h, w, 3) of a frame (H, W, 3) for a thing that has made a motion."""
        flags = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        return np.asarray(
            cv2.warpAffine(
                frame, self._matrix(motion), self.size, flags=flags, borderMode=cv2.BORDER_REPLICATE
            ),
            dtype=np.uint8,
        )

    def within(self, points: Points, motion: Points, frame: Bytes) -> Mask:
        """Return a mask (n,) of the points (n, 2) of the view that lie in a frame."""
        matrix = self._matrix(motion)
        places = points @ matrix[:, :2].T + matrix[:, 2]
        far = np.array([frame.shape[1] - 1, frame.shape[0] - 1])
        return np.all((places >= 0) & (places <= far), axis=1)

    def way(self, motion: Points) -> float:
        """Return how far a motion moves any part of the thing at most, px."""
        return float(np.linalg.norm(motion[:2]) + abs(motion[2]) * self._reach)

    def moved(self, motion: Points, step: Points) -> Points:
        """Return the motion with a step added that was measured in its view."""
        along = rotation(motion[2]) @ step[:2] / self.scale
        return motion + np.array([along[0], along[1], step[2]])


def rotation(turn: float) -> Points:
    """Return the rotation matrix (2, 2) that turns column vectors."""
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s], [s, c]])
