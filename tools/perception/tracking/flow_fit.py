"""Measures how far a thing with texture has moved, by the optical flow of its corners.

Pyramidal Lucas-Kanade (Bouguet 2000), forward and back, then the rigid motion that most agree on.
"""

from typing import cast

import cv2
import numpy as np

from .view import Bytes, Floats, Mask, Points, Step, View, rotation

CORNERS, QUALITY, APART = 150, 0.05, 5
"""The most corners, the least response as a share of the best one's, and least px between two."""
ENOUGH = 12
"""Least number of corners for a thing to have texture, or a motion to be measured."""
WINDOW, LEVELS = (15, 15), 3
THERE_AND_BACK, RIGID = 1.0, 2.0
"""Greatest error of a corner when followed back, and from the rigid motion, px."""
ALIKE, PATCH = 0.5, (11, 11)
"""Least correlation of the patch around a corner with that in the first frame, and its size, px."""
EVEN, CONTRAST = 8.0, 40.0
"""Sigma over which light is evened out, px, and what a standard deviation of grey becomes."""
GRAIN = 8.0
"""Spread of grey levels that is noise rather than texture."""


class FlowFit:
    """Fit of the thing's corners in the first view (h, w, 3) to later views.

    Attributes:
        points: (n, 2), the corners in the first view, px of it.
        usable: whether there are enough of them.
    """

    def __init__(self, first: Bytes, view: View) -> None:
        self._first, self._centre = _evened(first), view.centre
        inside = np.asarray(cv2.erode(view.mask.view(np.uint8), np.ones((5, 5), np.uint8)))
        found = cv2.goodFeaturesToTrack(self._first, CORNERS, QUALITY, APART, mask=inside)
        found = cast("Floats | None", found)  # it may be None, which the stubs do not say
        self._corners = np.zeros((0, 1, 2), np.float32) if found is None else found
        self.points: Points = self._corners[:, 0].astype(float)
        self.usable = len(self.points) >= ENOUGH

    def step(self, seen: Bytes, within: Mask) -> Step:
        """Measure the thing's motion in a view.

        Args:
            seen: (h, w, 3), the view.
            within: (n,), which of `points` lie in the picture.
        """
        now = _evened(seen)
        if np.count_nonzero(within) < ENOUGH:
            return Step(np.zeros(3), 0.0)
        before = self._corners[within]
        there, found, _ = cv2.calcOpticalFlowPyrLK(
            self._first,
            now,
            before,
            before.copy(),
            winSize=WINDOW,
            maxLevel=LEVELS,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        back, found_back, _ = cv2.calcOpticalFlowPyrLK(
            now,
            self._first,
            there,
            before.copy(),
            winSize=WINDOW,
            maxLevel=LEVELS,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        off = np.linalg.norm(back - before, axis=2)[:, 0]
        good = (found[:, 0] > 0) & (found_back[:, 0] > 0) & (off < THERE_AND_BACK)
        start = before[:, 0].astype(float) - self._centre
        end = there[:, 0].astype(float) - self._centre
        by, agrees = _rigid(start, end, good)
        alike = _correlation(self._first, now)
        x, y = np.round(before[:, 0]).astype(int).T
        return Step(by, float(np.mean(agrees & (alike[y, x] >= ALIKE))))


def _rigid(start: Points, end: Points, good: Mask) -> tuple[Points, Mask]:
    """Fit the rigid motion (3,) that most good points (n, 2) share, and say which do, (n,).

    Without enough such points, the motion is zero and none do.
    """
    none = np.zeros(3), np.zeros(len(start), dtype=np.bool_)
    if np.count_nonzero(good) < ENOUGH:
        return none
    _, inliers = cv2.estimateAffinePartial2D(
        start[good], end[good], method=cv2.RANSAC, ransacReprojThreshold=RIGID
    )
    agrees = good.copy()
    agrees[good] = inliers[:, 0] > 0
    by = np.zeros(3)
    for _ in range(2):
        if np.count_nonzero(agrees) < ENOUGH:
            return none
        by = _procrustes(start[agrees], end[agrees])
        off = np.linalg.norm(start @ rotation(by[2]).T + by[:2] - end, axis=1)
        agrees = good & (off < RIGID)
    return by, agrees


def _procrustes(start: Points, end: Points) -> Points:
    """Return the least-squares rigid motion (3,) about (0, 0) from points (n, 2) to others."""
    a, b = start - start.mean(axis=0), end - end.mean(axis=0)
    turn = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    shift = end.mean(axis=0) - rotation(turn) @ start.mean(axis=0)
    return np.array([shift[0], shift[1], turn])


def _evened(bgr: Bytes) -> Bytes:
    """Return grey (h, w) with shading and contrast evened out, so that shadows change little."""
    grey = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY).astype(np.float32)
    kernel = (0, 0)
    less = grey - cv2.GaussianBlur(grey, kernel, EVEN)
    spread = np.sqrt(cv2.GaussianBlur(less * less, kernel, EVEN)) + GRAIN
    return np.clip(128 + CONTRAST * less / spread, 0, 255).astype(np.uint8)


def _correlation(a: Bytes, b: Bytes) -> Floats:
    """Return the correlation of the patches around each pixel of two pictures (h, w), -1 to 1."""
    x, y = (picture.astype(np.float32) - 128 for picture in (a, b))
    both, xx, yy = (cv2.boxFilter(p, -1, PATCH) for p in (x * y, x * x, y * y))
    return np.asarray(both / np.sqrt(xx * yy + 1), dtype=np.float32)
