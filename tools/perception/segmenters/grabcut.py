"""GrabCut on a small window around the prompt: the engine behind every pointing prompt.

A window of fixed size makes a 50-megapixel picture cost no more than a thumbnail, and gives
smoothing, rings and clean-up one scale to be tuned at.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]
Points = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Box = tuple[float, float, float, float]
Point = tuple[float, float]

# Masks from 160 px windows measured as good as those from 224 or 320 px and cost half as much.
WORK_SIDE = 160
# Small things need pixels for the smoothing to act on, but hold no more detail than this.
MAX_UPSCALE = 3.0
# Margin around the prompt as a share of its size: enough to learn the background's colours.
MARGIN = 0.3
# Averaging this many samples a side for one working pixel is plenty; more cost seconds at 50 MP.
SAMPLES = 4
# Even a prompt of one pixel needs some surroundings.
MIN_MARGIN_PX = 3.0
# A fifth iteration improved no measured mask.
ITERATIONS = 4
# Lightness counts half and chroma one and a half: a shadow changes lightness much more than hue.
LAB_WEIGHTS = (0.5, 1.5, 1.5)
# If a prompt leaves less background than this share of the window, the window's rim, this share of
# its side wide, serves as a sample.
MIN_BACKGROUND = 0.05
RIM = 0.04
# Pieces smaller than this share of the largest are noise; a band may cut the object in two.
MIN_PIECE = 0.15
# Holes smaller than this share of the mask are highlights and labels more often than openings.
MIN_HOLE = 0.03


@dataclass(frozen=True)
class Window:
    """The part of a picture around a prompt, resampled to the working size.

    `features` (h, w, 3) uint8 is smoothed, weighted Lab; `origin` and `extent` give the part's
    corner and size in picture pixels, `picture` the picture's (height, width).
    """

    features: Bytes
    origin: tuple[int, int]
    extent: tuple[int, int]
    picture: tuple[int, int]

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width at the working scale."""
        return self.features.shape[0], self.features.shape[1]

    @property
    def scale(self) -> Points:
        """Working pixels per picture pixel, along x and y."""
        height, width = self.shape
        return np.array([width / self.extent[0], height / self.extent[1]])

    def to_work(self, points: npt.ArrayLike) -> Points:
        """Convert picture coordinates (n, 2) to the working scale; pixel centres stay at .0."""
        shifted = np.asarray(points, dtype=np.float64).reshape(-1, 2) - self.origin + 0.5
        return shifted * self.scale - 0.5

    def to_picture_points(self, points: npt.ArrayLike) -> Points:
        """Convert working coordinates (n, 2) to the picture, the inverse of `to_work`."""
        return (np.asarray(points) + 0.5) / self.scale - 0.5 + self.origin

    def picture_area(self, mask: Mask) -> float:
        """Return the area of a mask at the working scale, in picture pixels."""
        return float(np.count_nonzero(mask) / np.prod(self.scale))

    def transfer(self, mask: Mask, other: Window) -> Mask:
        """Resample a mask of this window to another window, (h, w) of the other."""
        corners = np.array(((0, 0), (1, 0), (0, 1)), dtype=np.float64)
        here = self.to_work(other.to_picture_points(corners)).astype(np.float32)
        mapping = cv2.getAffineTransform(corners.astype(np.float32), here)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        soft = mask.astype(np.float32)
        moved = cv2.warpAffine(soft, mapping, other.shape[::-1], flags=flags)
        return np.asarray(moved) > 0.5

    def to_picture(self, mask: Mask) -> Mask:
        """Resize the mask to the picture; interpolating a soft edge keeps outlines smooth."""
        soft = cv2.GaussianBlur(mask.astype(np.uint8) * 255, (0, 0), 0.8)
        x0, y0 = self.origin
        width, height = self.extent
        full = np.zeros(self.picture, dtype=np.bool_)
        large = cv2.resize(soft, (width, height), interpolation=cv2.INTER_LINEAR)
        full[y0 : y0 + height, x0 : x0 + width] = np.asarray(large) >= 128
        return full


def window_around(pixels: Bytes, box: Box, side: int = WORK_SIDE) -> Window:
    """Open the window of `pixels` (H, W, 3) RGB around `box` and a margin, ready to segment."""
    mx = MARGIN * (box[2] - box[0]) + MIN_MARGIN_PX
    my = MARGIN * (box[3] - box[1]) + MIN_MARGIN_PX
    return open_window(pixels, (box[0] - mx, box[1] - my, box[2] + mx, box[3] + my), side)


def open_window(pixels: Bytes, box: Box, side: int) -> Window:
    """Open the window of `pixels` (H, W, 3) RGB on `box`, its longer side at most `side` px."""
    height, width = pixels.shape[:2]
    x0, x1 = max(0, int(box[0])), min(width, int(np.ceil(box[2])) + 1)
    y0, y1 = max(0, int(box[1])), min(height, int(np.ceil(box[3])) + 1)
    scale = min(MAX_UPSCALE, side / max(x1 - x0, y1 - y0))
    size = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    small = resampled(pixels[y0:y1, x0:x1], size)
    return Window(features(small), (x0, y0), (x1 - x0, y1 - y0), (height, width))


def resampled(pixels: Bytes, size: tuple[int, int]) -> Bytes:
    """Resize `pixels` (H, W, 3) to (width, height); of a very large picture, read only some."""
    scale = size[0] / pixels.shape[1]
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    step = max(1, min(int(1 / (scale * SAMPLES)), *pixels.shape[:2]))  # a picture may be a sliver
    sampled = pixels[step // 2 :: step, step // 2 :: step]
    found = cv2.resize(np.ascontiguousarray(sampled), size, interpolation=how)
    return np.asarray(found, dtype=np.uint8)


def features(rgb: npt.ArrayLike) -> Bytes:
    """Return smoothed, weighted CIE Lab (h, w, 3) of an RGB picture, 8-bit as GrabCut needs it."""
    smooth = cv2.bilateralFilter(np.asarray(rgb, dtype=np.uint8), 7, 40, 5)
    lab = np.asarray(cv2.cvtColor(smooth.astype(np.float32) / 255, cv2.COLOR_RGB2LAB))
    scaled = lab * np.multiply(LAB_WEIGHTS, (2.55, 1, 1)) + (0, 128, 128)
    return scaled.clip(0, 255).round().astype(np.uint8)


def lightness_and_chroma(image: Bytes) -> tuple[Floats, Floats]:
    """Return CIE lightness L* and chroma, (h, w) each, from features (h, w, 3)."""
    weights = np.multiply(LAB_WEIGHTS, (2.55, 1, 1)).astype(np.float32)
    lab: Floats = (image.astype(np.float32) - np.array((0, 128, 128), np.float32)) / weights
    return lab[..., 0], np.linalg.norm(lab[..., 1:], axis=2).astype(np.float32)


def box_region(shape: tuple[int, int], box: npt.ArrayLike) -> Mask:
    """Return a mask (h, w) of the pixels with centres in the box, or of the nearest if none."""
    x0, y0, x1, y1 = np.asarray(box, dtype=np.float64)
    y, x = np.ogrid[: shape[0], : shape[1]]
    inside = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
    return inside if inside.any() else _nearest_pixel(shape, (x0 + x1) / 2, (y0 + y1) / 2)


def polygon_region(vertices: Points, shape: tuple[int, int]) -> Mask:
    """Return a mask (h, w) of the pixels in the polygon `vertices` (n, 2), or of one if none."""
    region = np.zeros(shape, dtype=np.uint8)
    cv2.fillPoly(region, [np.round(vertices * 16).astype(np.int32)], (1,), shift=4)
    inside = region.astype(np.bool_)
    return inside if inside.any() else _nearest_pixel(shape, *vertices.mean(axis=0))


def _nearest_pixel(shape: tuple[int, int], x: float, y: float) -> Mask:
    region = np.zeros(shape, dtype=np.bool_)
    region[int(np.clip(round(y), 0, shape[0] - 1)), int(np.clip(round(x), 0, shape[1] - 1))] = True
    return region


def trimap(inside: Mask, near: Mask, core: Mask | None = None) -> Bytes:
    """Return GrabCut labels (h, w): `core` is sure object, all beyond `near` is sure background.

    A prompt that fills the window leaves no background to learn from: then the window's rim is
    labelled probable background, as things rarely fill a picture to its edges.
    """
    labels = np.full(inside.shape, cv2.GC_BGD, dtype=np.uint8)
    labels[near] = cv2.GC_PR_BGD
    labels[inside] = cv2.GC_PR_FGD
    if np.mean(~inside) < MIN_BACKGROUND:
        height, width = inside.shape
        rim = max(1, round(RIM * min(height, width)))
        labels[:rim], labels[-rim:] = cv2.GC_PR_BGD, cv2.GC_PR_BGD
        labels[:, :rim], labels[:, -rim:] = cv2.GC_PR_BGD, cv2.GC_PR_BGD
    if core is not None:
        labels[core] = cv2.GC_FGD
    return labels


def grabcut(image: Bytes, labels: Bytes) -> Mask:
    """Find the object's pixels (h, w) by iterated graph cuts (Rother, Kolmogorov and Blake, 2004).

    The mask is empty if there is only one colour, or no object or no background to learn from,
    which OpenCV refuses.
    """
    probable = _is_object(labels)
    plain = not np.ptp(image, axis=(0, 1)).any()
    if plain or probable.all() or not probable.any():
        return np.zeros(labels.shape, dtype=np.bool_)
    # OpenCV seeds its colour clusters from a global generator.
    cv2.setRNGSeed(0)
    background, foreground = np.zeros((1, 65)), np.zeros((1, 65))
    mode = cv2.GC_INIT_WITH_MASK
    cut, _, _ = cv2.grabCut(
        image, labels.copy(), (0, 0, 0, 0), background, foreground, ITERATIONS, mode
    )
    return _is_object(np.asarray(cut, dtype=np.uint8))


def _is_object(labels: Bytes) -> Mask:
    return (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)


def clean(mask: Mask, keep: Points) -> Mask:
    """Return the mask without specks and small holes; pieces that hold a `keep` point stay."""
    width = 2 * max(1, round(0.01 * np.sqrt(np.count_nonzero(mask)))) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    opened = np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, kernel)) > 0
    if not opened.any():
        return mask
    labels, areas = pieces(opened, connectivity=8)
    kept = areas >= MIN_PIECE * areas[1:].max()
    height, width = mask.shape
    x, y = np.round(keep).astype(np.int64).clip(0, (width - 1, height - 1)).T
    kept[labels[y, x]] = True
    kept[0] = False
    return _close_small_holes(kept[labels])


def _close_small_holes(mask: Mask) -> Mask:
    gaps, areas = pieces(~mask, connectivity=4)
    small = areas < MIN_HOLE * np.count_nonzero(mask)
    small[0] = False
    return mask | small[gaps]


def pieces(mask: Mask, connectivity: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Label connected components: labels (h, w), 0 outside the mask, and the area of each label."""
    found = cv2.connectedComponents(mask.astype(np.uint8), connectivity=connectivity)[1]
    labels = np.asarray(found, dtype=np.int32)
    return labels, np.bincount(labels.ravel())


def watershed(image: Bytes, core: Mask, labels: Bytes) -> Mask:
    """Segment by flooding from the core and the sure background, as a second opinion (h, w)."""
    markers = np.zeros(labels.shape, dtype=np.int32)
    markers[labels == cv2.GC_BGD] = 1
    markers[core] = 2
    return np.asarray(cv2.watershed(image, markers)) == 2


def colour_separation(image: Bytes, mask: Mask) -> float:
    """Return 1 minus the Bhattacharyya coefficient of colours inside and close around the mask.

    It is 0 if there is nothing inside or around it.
    """
    width = 2 * max(2, round(0.08 * np.sqrt(np.count_nonzero(mask)))) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    around = np.asarray(cv2.dilate(mask.astype(np.uint8), kernel)).astype(np.bool_) & ~mask
    if not mask.any() or not around.any():
        return 0.0
    inside, outside = _histogram(image[mask]), _histogram(image[around])
    return float(1 - np.sqrt(inside * outside).sum())


def _histogram(colours: Bytes) -> npt.NDArray[np.float64]:
    bins = (colours.astype(np.int64) >> 4) @ (256, 16, 1)
    return np.bincount(bins, minlength=4096) / len(colours)


def iou(one: Mask, other: Mask) -> float:
    """Return the intersection over union of two masks; 0 if both are empty."""
    union = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / union if union else 0.0


def distance_inside(mask: Mask) -> npt.NDArray[np.float32]:
    """Return each pixel's distance (h, w) to the nearest one outside the mask or the window."""
    padded = np.pad(mask, 1).astype(np.uint8)
    return np.asarray(cv2.distanceTransform(padded, cv2.DIST_L2, 5), np.float32)[1:-1, 1:-1]


def signed_distance(mask: Mask) -> Floats:
    """Return each pixel's distance (h, w) to the mask's edge, px, positive inside."""
    inside, outside = (
        np.asarray(cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5), np.float32)
        for part in (mask, ~mask)
    )
    return np.where(mask, inside - 0.5, 0.5 - outside)


def bounding_box(mask: Mask) -> Box:
    """Return the outermost pixel centres x0, y0, x1, y1 of a mask that is not empty."""
    y, x = np.nonzero(mask)
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def majority(masks: Iterable[Mask]) -> Mask:
    """Return the pixels that are in more than half of the masks."""
    return np.mean(list(masks), axis=0) > 0.5
