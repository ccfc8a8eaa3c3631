"""The part of a frame around a thing, moved back to where the thing was in the first frame.

Both ways of tracking compare with the first frame alone: nothing adds up from frame to frame.
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
"""Things longer than this, px, are looked at on a smaller scale."""
MARGIN_SHARE, LEAST_MARGIN = 0.3, 24.0
"""Surroundings seen beyond the outline, as a share of its length, and px at least."""


@dataclass(frozen=True)
class Step:
    """How far a thing is off where a view has it, and how much speaks for that.

    Attributes:
        by: (3,), view pixels and radians.
        share: of what is looked at in the thing and lies in the picture, what agrees, 0 to 1.
    """

    by: Points
    share: float


class View:
    """A window on frames that is moved along with a thing.

    Motions are (3,): dx, dy in px of the picture, and a turn about the outline's centre, radians,
    clockwise as seen.

    Args:
        outline: of the thing in the first frame.

    Attributes:
        size: width and height, px of the view, to which the rest refers.
        scale: its px per px of the picture.
        outline, mask: of the thing in it, (h, w).
        centre: of the outline.
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
        """(2, 3), from the view to a frame."""
        turn = rotation(motion[2])
        shift = turn @ (self._origin - self._centre) + self._centre + motion[:2]
        return np.column_stack([turn / self.scale, shift])

    def seen(self, frame: Bytes, motion: Points) -> Bytes:
        """A frame (H, W, 3) through the view of a thing that has moved so, (h, w, 3)."""
        flags = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        return np.asarray(
            cv2.warpAffine(
                frame, self._matrix(motion), self.size, flags=flags, borderMode=cv2.BORDER_REPLICATE
            ),
            dtype=np.uint8,
        )

    def within(self, points: Points, motion: Points, frame: Bytes) -> Mask:
        """Which points (n, 2) of the view lie in a frame, (n,)."""
        matrix = self._matrix(motion)
        places = points @ matrix[:, :2].T + matrix[:, 2]
        far = np.array([frame.shape[1] - 1, frame.shape[0] - 1])
        return np.all((places >= 0) & (places <= far), axis=1)

    def way(self, motion: Points) -> float:
        """How far a motion moves any part of the thing at most, px."""
        return float(np.linalg.norm(motion[:2]) + abs(motion[2]) * self._reach)

    def moved(self, motion: Points, step: Points) -> Points:
        """The motion, with what the view has seen in addition."""
        along = rotation(motion[2]) @ step[:2] / self.scale
        return motion + np.array([along[0], along[1], step[2]])


def rotation(turn: float) -> Points:
    """(2, 2), of columns."""
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s], [s, c]])
