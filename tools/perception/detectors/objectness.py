"""Scores how much a region looks like a thing: an edge all round, and plain ground around it."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from ..segmenters.grabcut import Bytes, Floats, Mask
from ..segmenters.region_growing import solidity
from .proposals import Proposal

Coordinates = npt.NDArray[np.floating]

# Number of points on an outline at which the colours on both sides of it are compared.
STATIONS = 48
# How far inside and outside the outline these colours are sampled, px.
INSIDE, OUTSIDE = 2.0, 3.0
# A fifth of an outline may have weak contrast: shadows and touching neighbours.
WEAK = 0.2
# The contrast, and the unevenness of the ground, that each halve the score.
CLEAR, UNEVEN = 15.0, 20.0
# The most that a sample counts as uneven, so that a neighbouring thing does not spoil the ground.
UNEVEN_MOST = 60.0
# Factor on a region's score for every border of the picture that cuts it.
CUT = 0.6
# Of two equally good regions the larger is the thing and the smaller its part, by a weak power.
SIZE_POWER = 0.1
# Regions thinner than this, px, are lines and cracks rather than things.
BROAD = 4.0
# The most gap masks that are kept, the least share of a region that its gaps take, and the share of
# pixels by which two gap masks differ.
MOST_GAPS, LEAST_GAP, SAME_GAPS = 6, 0.03, 0.02


@dataclass(frozen=True)
class Region:
    """A proposal, its score, and points of its outline with outward normals, (n, 2) each.

    `borders` is the number of the picture's borders that cut it; `gaps` are alternative masks of
    the gaps in it, (h, w) each, in its box.
    """

    proposal: Proposal
    score: float
    points: Floats
    normals: Floats
    borders: int
    gaps: tuple[Mask, ...] = ()

    @property
    def area(self) -> int:
        """Number of its pixels, holes filled."""
        return self.proposal.area

    def holds(self, points: Coordinates) -> npt.NDArray[np.bool_]:
        """Return a mask (n,) of the points (n, 2) that lie in the region, holes filled."""
        mask = self.proposal.mask
        x, y = (np.rint(points) - self.proposal.origin).astype(np.int64).T
        height, width = mask.shape
        held = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        held[held] = mask[y[held], x[held]]
        return held

    def shared(self, other: "Region", body: Mask | None = None) -> int:
        """Count the pixels that two regions share; of the other, only `body` counts if given."""
        (ax, ay), (bx, by) = self.proposal.origin, other.proposal.origin
        one, two = self.proposal.mask, other.proposal.mask if body is None else body
        x0, y0 = max(ax, bx), max(ay, by)
        x1 = min(ax + one.shape[1], bx + two.shape[1])
        y1 = min(ay + one.shape[0], by + two.shape[0])
        if x1 <= x0 or y1 <= y0:
            return 0
        first = one[y0 - ay : y1 - ay, x0 - ax : x1 - ax]
        second = two[y0 - by : y1 - by, x0 - bx : x1 - bx]
        return int(np.count_nonzero(first & second))

    def overlap(self, other: "Region") -> float:
        """Return the intersection over union of two regions."""
        shared = self.shared(other)
        return shared / (self.area + other.area - shared)

    def with_gaps_of(self, other: "Region") -> "Region":
        """Return this region with the gaps added that another region of the same thing has."""
        if other.proposal.gap_share < LEAST_GAP or len(self.gaps) >= MOST_GAPS:
            return self
        height, width = self.proposal.mask.shape
        (ax, ay), (bx, by) = self.proposal.origin, other.proposal.origin
        y, x = np.nonzero(other.proposal.mask & ~other.proposal.raw)
        y, x = y + by - ay, x + bx - ax
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        gaps = np.zeros((height, width), dtype=np.bool_)
        gaps[y[inside], x[inside]] = True
        known = any(np.mean(g ^ gaps) < SAME_GAPS for g in self.gaps)
        return self if known else replace(self, gaps=(*self.gaps, gaps))


def scored_regions(found: Iterable[Proposal], features: Bytes) -> list[Region]:
    """Score the proposals as regions of `features` (h, w, 3), best first."""
    traced = [(p, t) for p in found if (t := _outline_samples(p.ring)) is not None]
    if not traced:
        return []
    points = np.asarray([t[0] + p.origin for p, t in traced], dtype=np.float32)
    normals = np.stack([t[1] for _, t in traced])
    blurred = cv2.GaussianBlur(features.astype(np.float32), (0, 0), 1.0)
    colours = np.asarray(blurred, dtype=np.float32)
    inner, _ = _sampled_colours(colours, points - INSIDE * normals)
    outer, seen = _sampled_colours(colours, points + OUTSIDE * normals)
    contrast = np.where(seen, np.linalg.norm(outer - inner, axis=2), np.inf)
    weak = (WEAK * seen.sum(axis=1)).astype(np.int64)
    clear = np.sort(contrast, axis=1)[np.arange(len(weak)), weak]
    clear[~seen.any(axis=1)] = 0
    spread = np.linalg.norm(outer - np.median(outer, axis=1, keepdims=True), axis=2)
    uneven = np.minimum(spread, UNEVEN_MOST).mean(axis=1)
    plain = clear / (clear + CLEAR) * UNEVEN / (UNEVEN + uneven)
    regions: list[Region] = []
    for k, (proposal, _) in enumerate(traced):
        borders = _borders_reached(proposal, features.shape)
        shape = (
            solidity(proposal.ring, proposal.area) ** 0.5
            * proposal.area**SIZE_POWER
            * _breadth(proposal)
        )
        score = float(plain[k]) * shape * CUT**borders
        regions.append(Region(proposal, score, points[k], normals[k], borders))
    return sorted(regions, key=lambda r: -r.score)


def _outline_samples(outermost: npt.NDArray[np.int32]) -> tuple[Floats, Floats] | None:
    """Return points on an outline with outward normals, (n, 2) each; None for a speck."""
    ring = outermost.astype(np.float32)
    count = len(ring)
    if count < 8:
        return None
    reach = max(1, count // 80)
    kernel = np.full((2 * reach + 1, 1), 1 / (2 * reach + 1), dtype=np.float32)
    smooth = cv2.filter2D(np.concatenate([ring[-reach:], ring, ring[:reach]]), -1, kernel)
    smooth = np.asarray(smooth)[reach:-reach]
    at = np.arange(STATIONS) * count // STATIONS
    step = max(1, count // STATIONS)
    along = smooth[(at + step) % count] - smooth[at - step]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-6)
    # OpenCV traces outer contours anticlockwise, as seen with y down.
    return ring[at], np.stack([-along[:, 1], along[:, 0]], axis=1)


def _breadth(proposal: Proposal) -> float:
    """Return 1, or less for a region as thin as a line."""
    return min(1.0, 2 * proposal.area / (len(proposal.ring) * BROAD))


def _sampled_colours(colours: Floats, points: Coordinates) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Sample colours (k, n, 3) at points (k, n, 2), and return a mask (k, n) of those inside.

    Points beyond the picture get the nearest pixel's colour.
    """
    far = np.array([colours.shape[1] - 1, colours.shape[0] - 1])
    x, y = np.moveaxis(np.rint(points.clip(0, far)).astype(np.int64), 2, 0)
    seen = (points >= 0) & (points <= far)
    return colours[y, x], np.asarray(seen.all(axis=2))


def _borders_reached(proposal: Proposal, shape: tuple[int, ...]) -> int:
    """Count the borders of the picture that the region reaches."""
    (x, y), (height, width) = proposal.origin, proposal.mask.shape
    reached = (x <= 1, y <= 1, x + width >= shape[1] - 1, y + height >= shape[0] - 1)
    return sum(reached)
