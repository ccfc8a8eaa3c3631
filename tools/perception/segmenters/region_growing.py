"""Proposes regions that a point may mean, grown by colour at many tolerances and scales.

A click says where a thing is but not how large it is. The few regions with contrast all along
their edge are proposals that the actual segmentation then has to confirm.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

import cv2
import numpy as np
import numpy.typing as npt

from .grabcut import (
    Box,
    Bytes,
    Floats,
    Mask,
    Point,
    Points,
    Window,
    bounding_box,
    open_window,
)

# Proposals need less detail than masks.
SIDE = 128
# Number of window sizes: from the whole picture down to a sixteenth of its side, by halves.
ZOOMS = 5
MIN_WINDOW_PX = 40
# Distances in the window's colour features: from noise to the difference of strong colours.
TOLERANCES = (7, 10, 14, 19, 25, 33, 42, 54, 70)
# A region of more than half the picture is its background, one of fewer pixels has no shape.
MAX_SHARE = 0.5
MIN_PIXELS = 12
# The contrast that scores half as much as an infinite one: a clear edge, in units of the features.
CLEAR_CONTRAST = 22.0
# Colours this near to each other show no edge between them.
NO_EDGE = 8.0
# How far a mask may reach beyond the thing's edge, as a share of its size.
OVERSHOOT = 0.08
# Touching a border of the picture makes a region less likely to be a thing, but not impossible.
BORDER_DISCOUNT = 0.7
# Of two equally good regions the larger is the thing and the smaller its part, by a weak power.
SIZE_PREFERENCE = 0.15
# Proposals whose boxes overlap more than this are the same.
SAME_BOX = 0.75
# A pinned point fixes a disc with a radius of this share of the window's side, and speaks for the
# connected pixels whose colour is within this distance.
PIN_RADIUS = 0.02
PIN_TOLERANCE = 25


@dataclass(frozen=True)
class Region:
    """A grown region's `mask` (h, w) in its window, and how much it looks like a thing."""

    window: Window
    mask: Mask
    score: float

    @property
    def box(self) -> Box:
        """The region's bounding box in picture pixels."""
        corners = np.reshape(bounding_box(self.mask), (2, 2))
        (x0, y0), (x1, y1) = self.window.to_picture_points(corners)
        return float(x0), float(y0), float(x1), float(y1)


def propose(pixels: Bytes, points: Sequence[Point], count: int) -> list[Region]:
    """Propose up to `count` clearly different regions of `pixels` (H, W, 3) that hold the points.

    Best first; empty if nothing with an edge around the points fits in the picture.
    """
    return distinct(_grown(pixels, points), count)


def distinct(regions: Iterable[Region], count: int) -> list[Region]:
    """Return the best `count` regions with different boxes, best first."""
    chosen: list[Region] = []
    for region in sorted(regions, key=lambda r: r.score, reverse=True):
        if all(box_iou(region.box, other.box) < SAME_BOX for other in chosen):
            chosen.append(region)
            if len(chosen) == count:
                break
    return chosen


def pin(image: Bytes, labels: Bytes, positive: Points, negative: Points) -> Bytes:
    """Return GrabCut labels (h, w) with discs around the points forced to thing or background.

    A disc alone is too few pixels to change a colour model, so connected pixels of similar colour
    become probably what the point is, unless their labels are sure.
    """
    height, width = labels.shape
    radius = max(1, round(PIN_RADIUS * max(height, width)))
    pinned = labels.copy()
    on, off = (
        np.round(p).astype(np.int64).clip(0, (width - 1, height - 1)) for p in (positive, negative)
    )
    for seed in on:
        pinned[_like_coloured(image, seed) & (labels == cv2.GC_PR_BGD)] = cv2.GC_PR_FGD
    for seed in off:
        pinned[_like_coloured(image, seed) & (labels != cv2.GC_BGD)] = cv2.GC_PR_BGD
    for seeds, label in ((on, cv2.GC_FGD), (off, cv2.GC_BGD)):
        for x, y in seeds:
            cv2.circle(pinned, (int(x), int(y)), radius, (int(label),), -1)
    return pinned


def _like_coloured(image: Bytes, seed: npt.NDArray[np.int64]) -> Mask:
    """Return the connected pixels (h, w) of the seed's colour."""
    return _pieces_at(_colour_distance(image, seed[None]) <= PIN_TOLERANCE, seed[None])


def box_iou(one: Box, other: Box) -> float:
    """Return the intersection over union of two boxes of pixel centres."""
    width = min(one[2], other[2]) - max(one[0], other[0]) + 1
    height = min(one[3], other[3]) - max(one[1], other[1]) + 1
    shared = max(0.0, width) * max(0.0, height)
    areas = ((b[2] - b[0] + 1) * (b[3] - b[1] + 1) for b in (one, other))
    return shared / (sum(areas) - shared)


def _grown(pixels: Bytes, points: Sequence[Point]) -> Iterator[Region]:
    for window in windows(pixels, points):
        seeds = seeds_of(window, points)
        distance = _colour_distance(window.features, seeds)
        for tolerance in TOLERANCES:
            mask = pieces_grown(distance <= tolerance, seeds)
            if np.count_nonzero(mask) >= MIN_PIXELS and ends_inside(mask, window):
                yield Region(window, mask, region_score(mask, window))


def seeds_of(window: Window, points: Sequence[Point]) -> npt.NDArray[np.int64]:
    """Return the window's pixels (n, 2), as x and y, under the points."""
    height, width = window.shape
    seeds = np.round(window.to_work(points)).astype(np.int64)
    return seeds.clip(0, (width - 1, height - 1))


def windows(pixels: Bytes, points: Sequence[Point]) -> Iterator[Window]:
    """Yield windows around the points, from the whole picture down by halves."""
    height, width = pixels.shape[:2]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    smallest = max(MIN_WINDOW_PX, 2 * float(np.max(high - low)))
    centre = (low + high) / 2
    yield open_window(pixels, (0, 0, width, height), SIDE)
    sides = (max(height, width) * 0.5**zoom for zoom in range(1, ZOOMS))
    for side in takewhile(lambda s: s >= smallest, sides):
        (x0, y0), (x1, y1) = centre - side / 2, centre + side / 2
        yield open_window(pixels, (x0, y0, x1, y1), SIDE)


def _colour_distance(image: Bytes, seeds: npt.NDArray[np.int64]) -> Floats:
    """Return the distance (h, w) of each pixel's colour to that of the nearest-coloured seed."""
    colours = image.astype(np.float32)
    distance = np.full(image.shape[:2], np.inf, dtype=np.float32)
    patches = [(slice(max(0, y - 1), y + 2), slice(max(0, x - 1), x + 2)) for x, y in seeds]
    for patch in patches:
        seed = np.median(colours[patch].reshape(-1, 3), axis=0)
        distance = np.minimum(distance, np.linalg.norm(colours - seed, axis=2))
    for patch in patches:
        distance[patch] = 0
    return distance


def pieces_grown(near: Mask, seeds: npt.NDArray[np.int64]) -> Mask:
    """Return the pieces of `near` at the seeds, holes filled and hair-thin leaks cut off."""
    solid = filled(_pieces_at(near, seeds)).astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    return _pieces_at(np.asarray(cv2.morphologyEx(solid, cv2.MORPH_OPEN, kernel)) > 0, seeds)


def _pieces_at(mask: Mask, seeds: npt.NDArray[np.int64]) -> Mask:
    labels = np.asarray(cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)[1])
    wanted = labels[seeds[:, 1], seeds[:, 0]]
    return np.isin(labels, wanted[wanted > 0])


def filled(mask: Mask) -> Mask:
    """Return the mask (h, w) with its holes filled."""
    outside = np.pad(~mask, 1, constant_values=True).astype(np.uint8)
    cv2.floodFill(outside, None, (0, 0), (2,))
    return outside[1:-1, 1:-1] != 2


def touches_border(mask: Mask) -> npt.NDArray[np.bool_]:
    """Return whether the mask touches the left, right, top and bottom side of its window, (4,)."""
    return np.array([side.any() for side in (mask[:, 0], mask[:, -1], mask[0], mask[-1])])


def ends_inside(mask: Mask, window: Window) -> bool:
    """Return whether the region ends within its window, or at a border of the picture.

    A region of more than half the picture, or one that touches more than two sides, does not.
    """
    (x0, y0), (width, height) = window.origin, window.extent
    rows, columns = window.picture
    open_sides = np.array((x0 > 0, x0 + width < columns, y0 > 0, y0 + height < rows))
    touched = touches_border(mask)
    small = window.picture_area(mask) < MAX_SHARE * rows * columns
    return small and touched.sum() <= 2 and not (touched & open_sides).any()


def region_score(mask: Mask, window: Window) -> float:
    """Rate how much a region looks like a thing: edge contrast, compactness and, weakly, size."""
    contrast = _edge_contrast(window.features.astype(np.float32), mask)
    compact = mask_solidity(mask)
    inside = BORDER_DISCOUNT ** int(touches_border(mask).sum())
    clear = contrast / (contrast + CLEAR_CONTRAST)
    return clear * compact * inside * window.picture_area(mask) ** SIZE_PREFERENCE


def mask_solidity(mask: Mask) -> float:
    """Return the share of its convex hull that a mask fills."""
    return solidity(np.argwhere(mask), int(np.count_nonzero(mask)))


def solidity(pixels: npt.NDArray[np.integer], area: int) -> float:
    """Return the share of its convex hull that a region fills.

    Args:
        pixels: (n, 2), all of its pixels or the outermost ones.
        area: the number of all its pixels.
    """
    hull = cv2.convexHull(pixels.astype(np.int32))
    # Pixels reach half a pixel beyond their centres.
    return area / (cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1)


def _edge_contrast(colours: Floats, mask: Mask) -> float:
    """Return the contrast that all but the weakest tenth of the region's edge exceeds."""
    contrast = _contrast_along_edge(colours, mask)
    return float(np.quantile(contrast, 0.1)) if len(contrast) else 0.0


def edge_support(image: Bytes, mask: Mask) -> float:
    """Return the share of the mask's (h, w) edge along which the picture has an edge too.

    Masks of small things overshoot, so the best of the mask and slightly smaller ones counts.
    """
    colours, region, best = image.astype(np.float32), mask, 0.0
    for _ in range(2 + int(OVERSHOOT * float(np.sqrt(np.count_nonzero(mask))))):
        contrast = _contrast_along_edge(colours, region)
        best = max(best, int(np.count_nonzero(contrast >= NO_EDGE)) / max(len(contrast), 1))
        region = np.asarray(cv2.erode(region.astype(np.uint8), np.ones((3, 3), np.uint8))) > 0
        if not region.any():
            break
    return best


def _contrast_along_edge(colours: Floats, mask: Mask) -> Floats:
    """Return the colour distance (n,) of pixels just outside the edge from the region nearby."""
    region = mask.astype(np.uint8)
    inner, outer = np.ones((3, 3), np.uint8), np.ones((5, 5), np.uint8)
    core = np.asarray(cv2.erode(region, inner, borderValue=(1,)), dtype=np.float32)
    rim = np.asarray(cv2.dilate(region, outer)) > np.asarray(cv2.dilate(region, inner))
    weight = np.asarray(cv2.blur(core, (7, 7)))
    rim &= weight > 1e-3
    inside = np.asarray(cv2.blur(colours * core[..., None], (7, 7)))[rim] / weight[rim][:, None]
    return np.asarray(np.linalg.norm(colours[rim] - inside, axis=1), dtype=np.float32)
