"""How far a thing of plain colours has moved: its outline laid on the pixels of its colours.

Colours of the thing against those around it (Swain and Ballard 1991), then the outline fitted to
where they end along its normals, without those parts that something covers.
"""

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from ...geometry.outline import FloatArray
from .view import Bytes, Floats, Mask, Points, Step, View

Codes = npt.NDArray[np.intp]

REACH = 16
"""Px of the view along a normal in which an edge is looked for, either way."""
PLACES = 240
"""Most points of the outline that are looked at."""
BINS = 32
FAINT, STRANGE = 1e-3, 0.5
"""What colours never seen count, beside the commonest; of them fewer are the thing's."""
SURE = 2.0
"""The most that one pixel's colour can say."""
NEAR = 0.01
"""How much an edge further off says less, by the square of its px."""
MIXED = 0.4
"""Colours of thing and ground that overlap by more tell nothing."""
HUES = 0.1
"""Colours without their brightness do if they overlap by no more than this beyond those with it."""
TUKEY = (12.0, 8.0, 5.0, 3.0, 3.0)
"""Px beyond which an edge counts for nothing, from round to round."""
AGREES = 2.0
"""Px off the motion found within which an edge agrees with it."""
LOOSE, LEAST = 5.0, 0.5
"""Px that edges lie off the outline in the first frame at most, and the least share that does."""
ROUND = 0.03
"""The turn of a thing whose outline moves less than this by it, of a radian's, cannot be seen."""
CHANCE = 0.25
"""The share that may agree with an outline laid anywhere."""
LEARNT, NEW = 0.8, 0.3
"""Where so much agrees, colours are learnt anew, which count so much: light changes."""
HELD = 0.2
"""Least share of what the whole outline says of each motion."""


class ContourFit:
    """The thing's outline, and its colours in the first view (h, w, 3)."""

    def __init__(self, first: Bytes, view: View) -> None:
        ring = view.outline.polygon.exterior
        count = int(np.clip(ring.length / 2, 40, PLACES))
        along = (np.arange(count) + 0.5) * ring.length / count
        ends = [
            shapely.get_coordinates(ring.interpolate((along + d) % ring.length)) for d in (-1, 1)
        ]
        tangent = ends[1] - ends[0]
        self.points: Points = shapely.get_coordinates(ring.interpolate(along))
        normals = np.column_stack([tangent[:, 1], -tangent[:, 0]])  # outward, as it runs so
        self._normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        arms = self.points - view.centre
        across = self._normals[:, 1] * arms[:, 0] - self._normals[:, 0] * arms[:, 1]
        length = np.sqrt((arms**2).sum(axis=1).mean())
        self._rows = np.column_stack([self._normals, across])
        self._rows[:, 2] *= across.std() >= ROUND * length
        self._units = np.array([1.0, 1.0, 1 / length])
        self._colours = Colours(first, view.mask)
        self._mask, says = view.mask, self._colours.says(first)
        self._alike = float(np.mean(says[self._mask] > 0))
        self._rest, seen = self._edges(says)
        good = seen & (np.abs(self._rest) <= LOOSE)
        self.points, self._normals = self.points[good], self._normals[good]
        self._rows, self._rest = self._rows[good], self._rest[good]
        self.usable = self._colours.overlap <= MIXED and float(good.mean()) >= LEAST

    def step(self, seen: Bytes, within: Mask) -> Step:
        """The thing's motion in a view.

        Args:
            within: (n,), which of `points` lie in the picture.
        """
        says = self._colours.says(seen)
        edges, usable = self._edges(says)
        edges, usable = edges - self._rest, usable & within
        by = np.zeros(3)
        for limit in TUKEY:
            off = edges - self._rows @ by
            weights = np.where(usable, np.clip(1 - (off / limit) ** 2, 0, None) ** 2, 0)
            by = by + self._solved(weights, off)
        agrees = usable & (np.abs(edges - self._rows @ by) < AGREES)
        held = self._held(agrees) >= HELD
        alike = np.mean(says[self._mask] > 0) / self._alike
        share = float(min((agrees[within].mean() - CHANCE) / (1 - CHANCE), alike)) if held else 0.0
        if share >= LEARNT and np.linalg.norm(by[:2]) < 1:
            self._colours.learn(seen, self._mask)
        return Step(by, max(share, 0.0))

    def _edges(self, says: Floats) -> tuple[FloatArray, Mask]:
        """How far out along its normal each point's edge is, (n,) px, and which have one."""
        offsets = np.arange(-REACH, REACH + 1)
        at = (self.points[:, None] + offsets[:, None] * self._normals[:, None]).astype(np.float32)
        soft = cv2.GaussianBlur(says, (5, 5), 0)  # else edges lie at pixels' borders
        profiles = cv2.remap(soft, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderValue=0.0)
        inside = np.cumsum(profiles, axis=1) - NEAR * (offsets + 0.5) ** 2
        best = inside.argmax(axis=1)
        found = np.asarray((best > 0) & (best < 2 * REACH))
        last = np.clip(best, 0, 2 * REACH - 1)
        within, beyond = (profiles[np.arange(len(best)), at] for at in (last, last + 1))
        part = np.clip(within / np.maximum(within - beyond, 1e-6), 0, 1)
        return np.asarray(offsets[last] + part, dtype=float), found

    def _solved(self, weights: FloatArray, off: FloatArray) -> Points:
        rows = self._rows * self._units
        squares = (weights[:, None] * rows).T @ rows + 1e-3 * np.eye(3)
        solved = np.linalg.solve(squares, rows.T @ (weights * off))
        return np.asarray(self._units * solved, dtype=float)

    def _held(self, agrees: Mask) -> float:
        """The least that is known of any motion, as a share of what the whole outline tells."""
        rows = self._rows * self._units
        whole, part = (r.T @ r + 1e-6 * np.eye(3) for r in (rows, rows[agrees]))
        return float(np.linalg.eigvals(np.linalg.solve(whole, part)).real.min())


class Colours:
    """What a pixel's colour says of whether it is the thing's: the logarithm of the odds.

    Shares of the colours among each other are taken where they tell thing and ground apart, as
    shadows leave them; else brightness too.

    Attributes:
        overlap: of the colours of thing and ground, 0 to 1.
    """

    def __init__(self, first: Bytes, mask: Mask) -> None:
        self._codes = _hues
        self._shares = self._counted(first, mask)
        hues, self._codes = self._shares, _colours
        self._shares = self._counted(first, mask)
        if _shared(hues) <= _shared(self._shares) + HUES:
            self._codes, self._shares = _hues, hues
        self.overlap = _shared(self._shares)
        self._odds = _odds(self._shares)

    def says(self, bgr: Bytes) -> Floats:
        """Of each pixel of a view (h, w, 3): above 0 where it looks like the thing, (h, w)."""
        return self._odds[self._codes(bgr)]

    def learn(self, bgr: Bytes, mask: Mask) -> None:
        """Take in the colours of a later view (h, w, 3), in which the thing is the mask, (h, w)."""
        if self._codes is _colours:
            self._shares += NEW * (self._counted(bgr, mask) - self._shares)
            self._odds = _odds(self._shares)

    def _counted(self, bgr: Bytes, mask: Mask) -> FloatArray:
        """How common each colour is in the thing, and around it, (2, colours)."""
        from scipy.ndimage import gaussian_filter

        codes, kernel = self._codes(bgr), np.ones((5, 5), np.uint8)
        within = np.asarray(cv2.erode(mask.view(np.uint8), kernel)) > 0
        beyond = np.asarray(cv2.dilate(mask.view(np.uint8), kernel)) == 0
        counts = [
            np.bincount(codes[part], minlength=BINS**3) / part.sum() for part in (within, beyond)
        ]
        return np.stack([gaussian_filter(c.reshape(3 * [BINS]), 1.0).ravel() for c in counts])


def _shared(shares: FloatArray) -> float:
    return float(shares.min(axis=0).sum())


def _odds(shares: FloatArray) -> Floats:
    """By colour, from how common it is, (2, colours)."""
    (thing, ground), rare = shares, FAINT * shares.max()
    odds = np.log((thing + STRANGE * rare) / (ground + rare))
    return np.clip(odds, -SURE, SURE).astype(np.float32)


def _colours(bgr: Bytes) -> Codes:
    """A number for each pixel's colour, (h, w)."""
    b, g, r = np.moveaxis(_smooth(bgr).astype(np.intp) * BINS // 256, 2, 0)
    return (b * BINS + g) * BINS + r


def _hues(bgr: Bytes) -> Codes:
    """The same without its brightness."""
    smooth = _smooth(bgr).astype(np.float32) + 1
    shares = smooth[..., :2] / smooth.sum(axis=2, keepdims=True)
    b, g = np.moveaxis(np.minimum(shares * 1.5 * BINS, BINS - 1).astype(np.intp), 2, 0)
    return (b * BINS + g) * BINS


def _smooth(bgr: Bytes) -> Bytes:
    return np.asarray(cv2.GaussianBlur(bgr, (5, 5), 0), dtype=np.uint8)
