"""Measures how far a thing of plain colours has moved, by fitting its outline to its colours.

Pixels are classified by colours of the thing and of its surroundings (Swain and Ballard 1991); the
outline is then fitted to where the thing's colours end along its normals, except covered parts.
"""

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from ...geometry.outline import FloatArray
from .view import Bytes, Floats, Mask, Points, Step, View

Codes = npt.NDArray[np.intp]

REACH = 16
"""Distance along a normal, either way, within which an edge is searched for, px of the view."""
PLACES = 240
"""The most points of the outline that are used."""
BINS = 32
FAINT, STRANGE = 1e-3, 0.5
"""Share that colours never seen are given, relative to the commonest one, and a factor on it for
the thing, which has fewer of them than the ground."""
SURE = 2.0
"""Greatest absolute log odds of a pixel's colour."""
NEAR = 0.01
"""Penalty on an edge further off, per square of its px."""
MIXED = 0.4
"""Greatest overlap of the colours of thing and ground for them to be of use."""
HUES = 0.1
"""Hues are used if their overlap exceeds that of full colours by no more than this."""
TUKEY = (12.0, 8.0, 5.0, 3.0, 3.0)
"""Tukey's biweight limits: px beyond which an edge counts for nothing, from round to round."""
AGREES = 2.0
"""Distance from the motion found within which an edge agrees with it, px."""
LOOSE, LEAST = 5.0, 0.5
"""Greatest distance of an edge from the outline in the first frame, px, and the least share of
points that must have such an edge."""
ROUND = 0.03
"""A turn cannot be seen if, per radian, it moves the outline along its normals by less than this
share of the outline's mean radius."""
CHANCE = 0.25
"""Share of the edges that may agree with an outline anywhere, by chance."""
LEARNT, NEW = 0.8, 0.3
"""If this share agrees, colours are learnt anew with this weight, because light changes."""
HELD = 0.2
"""Least share of the whole outline's information on every motion."""


class ContourFit:
    """Fit of the thing's outline, with its colours in the first view (h, w, 3).

    Attributes:
        points: (n, 2), the points of the outline that have an edge in the first view, px of it.
        usable: whether the thing's colours and edges are distinct enough.
    """

    def __init__(self, first: Bytes, view: View) -> None:
        ring = view.outline.polygon.exterior
        count = int(np.clip(ring.length / 2, 40, PLACES))
        along = (np.arange(count) + 0.5) * ring.length / count
        ends = [
            shapely.get_coordinates(ring.interpolate((along + d) % ring.length)) for d in (-1, 1)
        ]
        tangent = ends[1] - ends[0]
        self.points: Points = shapely.get_coordinates(ring.interpolate(along))
        normals = np.column_stack([tangent[:, 1], -tangent[:, 0]])  # outward for this ring
        self._normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        arms = self.points - view.centre
        across = self._normals[:, 1] * arms[:, 0] - self._normals[:, 0] * arms[:, 1]
        length = np.sqrt((arms**2).sum(axis=1).mean())
        self._rows = np.column_stack([self._normals, across])
        self._rows[:, 2] *= across.std() >= ROUND * length
        self._units = np.array([1.0, 1.0, 1 / length])
        self._colours = Colours(first, view.mask)
        self._mask, log_odds = view.mask, self._colours.log_odds(first)
        self._alike = float(np.mean(log_odds[self._mask] > 0))
        self._rest, seen = self._edges(log_odds)
        good = seen & (np.abs(self._rest) <= LOOSE)
        self.points, self._normals = self.points[good], self._normals[good]
        self._rows, self._rest = self._rows[good], self._rest[good]
        self.usable = self._colours.overlap <= MIXED and float(good.mean()) >= LEAST

    def step(self, seen: Bytes, within: Mask) -> Step:
        """Measure the thing's motion in a view.

        Args:
            seen: (h, w, 3), the view.
            within: (n,), which of `points` lie in the picture.
        """
        log_odds = self._colours.log_odds(seen)
        edges, usable = self._edges(log_odds)
        edges, usable = edges - self._rest, usable & within
        by = np.zeros(3)
        for limit in TUKEY:
            off = edges - self._rows @ by
            weights = np.where(usable, np.clip(1 - (off / limit) ** 2, 0, None) ** 2, 0)
            by = by + self._solved(weights, off)
        agrees = usable & (np.abs(edges - self._rows @ by) < AGREES)
        held = self._least_information(agrees) >= HELD
        alike = np.mean(log_odds[self._mask] > 0) / self._alike
        share = float(min((agrees[within].mean() - CHANCE) / (1 - CHANCE), alike)) if held else 0.0
        if share >= LEARNT and np.linalg.norm(by[:2]) < 1:
            self._colours.learn(seen, self._mask)
        return Step(by, max(share, 0.0))

    def _edges(self, log_odds: Floats) -> tuple[FloatArray, Mask]:
        """Return how far out along the normals the edges are, (n,), px, and a mask (n,) of them."""
        offsets = np.arange(-REACH, REACH + 1)
        at = (self.points[:, None] + offsets[:, None] * self._normals[:, None]).astype(np.float32)
        soft = cv2.GaussianBlur(log_odds, (5, 5), 0)  # otherwise edges lie at pixels' borders
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

    def _least_information(self, agrees: Mask) -> float:
        """Return the least information on any motion, as a share of the whole outline's."""
        rows = self._rows * self._units
        whole, part = (r.T @ r + 1e-6 * np.eye(3) for r in (rows, rows[agrees]))
        return float(np.linalg.eigvals(np.linalg.solve(whole, part)).real.min())


class Colours:
    """The log odds that a pixel belongs to the thing, from its colour.

    Hues alone are used if they tell thing and ground apart, because shadows do not change them;
    otherwise brightness is used too.

    Attributes:
        overlap: overlap of the colours of thing and ground, 0 to 1.
    """

    def __init__(self, first: Bytes, mask: Mask) -> None:
        self._codes = _hues
        self._shares = self._colour_shares(first, mask)
        hues, self._codes = self._shares, _colours
        self._shares = self._colour_shares(first, mask)
        if _shared(hues) <= _shared(self._shares) + HUES:
            self._codes, self._shares = _hues, hues
        self.overlap = _shared(self._shares)
        self._odds = _odds(self._shares)

    def log_odds(self, bgr: Bytes) -> Floats:
        """Return the log odds (h, w) of a view (h, w, 3): above 0 where it looks like the thing."""
        return self._odds[self._codes(bgr)]

    def learn(self, bgr: Bytes, mask: Mask) -> None:
        """Learn the colours of a later view (h, w, 3), in which the thing is the mask, (h, w).

        Hues are not learnt anew.
        """
        if self._codes is _colours:
            self._shares += NEW * (self._colour_shares(bgr, mask) - self._shares)
            self._odds = _odds(self._shares)

    def _colour_shares(self, bgr: Bytes, mask: Mask) -> FloatArray:
        """Return how common each colour is in the thing, and around it, (2, colours)."""
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
    """Return each colour's log odds, (colours,), from how common it is, (2, colours)."""
    (thing, ground), rare = shares, FAINT * shares.max()
    odds = np.log((thing + STRANGE * rare) / (ground + rare))
    return np.clip(odds, -SURE, SURE).astype(np.float32)


def _colours(bgr: Bytes) -> Codes:
    """Return a code for each pixel's colour, (h, w)."""
    b, g, r = np.moveaxis(_smooth(bgr).astype(np.intp) * BINS // 256, 2, 0)
    return (b * BINS + g) * BINS + r


def _hues(bgr: Bytes) -> Codes:
    """Return a code for each pixel's colour without its brightness, (h, w)."""
    smooth = _smooth(bgr).astype(np.float32) + 1
    shares = smooth[..., :2] / smooth.sum(axis=2, keepdims=True)
    b, g = np.moveaxis(np.minimum(shares * 1.5 * BINS, BINS - 1).astype(np.intp), 2, 0)
    return (b * BINS + g) * BINS


def _smooth(bgr: Bytes) -> Bytes:
    return np.asarray(cv2.GaussianBlur(bgr, (5, 5), 0), dtype=np.uint8)
