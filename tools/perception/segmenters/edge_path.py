"""Finds the edge of a thing in a narrow band along a drawn outline.

A person who draws knows what belongs to the thing but is off by a few per cent; the picture's own
edge next to the drawn line is exact. The closed path of least cost stays near both.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from .grabcut import Bytes, Floats, Mask, Points, distance_inside

Reals = npt.NDArray[np.float64]
Columns = npt.NDArray[np.int64]

# Lengths are shares of the thing's size, the square root of its area, unless they are in px.
# How far the edge may lie from the drawn line, and the number of steps searched on each side.
REACH, STEPS = 0.055, 24
# In thin parts the edge lies inwards by no more than this share of the local half-width.
THIN = 0.7
# Spacing of stations along the outline, px, and their least and greatest number.
SPACING, FEWEST, MOST = 1.5, 120, 900
# Sigmas by which positions, tangents, and colours along the outline are smoothed.
SMOOTH_POSITIONS, SMOOTH_TANGENTS, SMOOTH_COLOURS = 0.006, 0.025, 0.015
# Width of the strips just inside and outside the edge whose mean colours are compared.
STRIP = 0.02
# Colour differences due to texture: this many times the median gradient, plus this much.
TEXTURE, LEAST_NOISE = 6.0, 12.0
# Cost of lying a whole REACH from the drawn line, and of steps in or out between stations.
PULL, BEND = 0.4, 2.5
NEVER = 1e3


@dataclass(frozen=True)
class Band:
    """The strip along an outline, unwrapped: stations along it, offsets across it.

    Attributes:
        stations: (m, 2), points on the outline, px.
        normals: (m, 2), of unit length, pointing outwards.
        spacing, step: distance between stations and between offsets, px.
        colours: (m, k, c), the picture at each station and offset.
    """

    stations: Points
    normals: Points
    spacing: float
    step: float
    colours: Reals


def edge_path(image: Bytes, outline: Points, region: Mask) -> Points:
    """Find the closed path (m, 2), px, of least cost along the picture's edges beside an outline.

    Dynamic programming over offsets along the normals (Amini, Weymouth and Jain 1990), run twice
    to close it: the second time from the opposite station, fixed where the first run passed it.

    Args:
        image: (h, w, c), smoothed.
        outline: (n, 2), px, as drawn.
        region: (h, w), the pixels inside it.
    """
    size = float(np.sqrt(np.count_nonzero(region)))
    strip = max(1, round(STRIP / REACH * STEPS))
    band = _unwrapped(image, outline, size, strip)
    offsets = np.arange(-STEPS, STEPS + 1)
    cost = 1 - _edge_evidence(image, band, strip) + PULL * (offsets / STEPS) ** 2
    cost[-offsets * band.step > THIN * _half_width(region, band, size)[:, None]] = NEVER
    taken = closed_path(cost, BEND * (band.step / band.spacing) ** 2)
    return band.stations + band.normals * (offsets[taken] * band.step)[:, None]


def closed_path(cost: Reals, bend: float) -> Columns:
    """Return the columns (m,), one per row, of the cheapest path that ends where it began.

    Args:
        cost: (m, k), cost of taking a column in a row.
        bend: cost of a step of one column between rows; it grows with the square of the step.
    """
    half = len(cost) // 2
    start = int(_open_path(cost, bend)[half])
    turned = np.vstack([np.roll(cost, -half, axis=0), cost[half : half + 1]])
    for end in (turned[0], turned[-1]):
        kept = end[start]
        end[:] = np.inf
        end[start] = kept
    return np.roll(_open_path(turned, bend)[:-1], half)


def _open_path(cost: Reals, bend: float) -> Columns:
    columns: Columns = np.arange(cost.shape[1], dtype=np.int64)
    change = bend * (columns[:, None] - columns) ** 2
    came_from = np.zeros(cost.shape, dtype=np.int64)
    total = cost[0].copy()
    for i in range(1, len(cost)):
        reached = np.add(change, total)
        came_from[i] = reached.argmin(axis=1)
        total[:] = reached[columns, came_from[i]] + cost[i]
    taken = np.empty(len(cost), dtype=np.int64)
    taken[-1] = int(np.argmin(total))
    for i in range(len(cost) - 1, 0, -1):
        taken[i - 1] = came_from[i, taken[i]]
    return taken


def _unwrapped(image: Bytes, outline: Points, size: float, strip: int) -> Band:
    length = float(np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).sum())
    count = int(np.clip(length / SPACING, FEWEST, MOST))
    spacing = max(length / count, 1e-6)
    even = _resampled(outline, count)
    stations = _smoothed(even, SMOOTH_POSITIONS * size / spacing)
    ahead = _smoothed(even, SMOOTH_TANGENTS * size / spacing)
    tangents = np.roll(ahead, -1, axis=0) - np.roll(ahead, 1, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    x, y = stations.T
    turning = np.sign(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    normals = turning * np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
    step = REACH * size / STEPS
    offsets = np.arange(-STEPS - strip, STEPS + strip + 1) * step
    places = (stations[:, None] + normals[:, None] * offsets[:, None]).astype(np.float32)
    sampled = cv2.remap(
        image, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    colours = _smoothed(np.asarray(sampled, dtype=np.float64), SMOOTH_COLOURS * size / spacing)
    return Band(stations, normals, spacing, step, colours)


def _edge_evidence(image: Bytes, band: Band, strip: int) -> Reals:
    """Rate how clearly colours just inside and outside differ, 0 to 1, at each offset, (m, k)."""
    summed = np.cumsum(np.pad(band.colours, ((0, 0), (1, 0), (0, 0))), axis=1)
    at: Columns = np.arange(strip, summed.shape[1] - strip - 1, dtype=np.int64)
    inside = summed[:, at] - summed[:, at - strip]
    outside = summed[:, at + strip + 1] - summed[:, at + 1]
    differ = np.linalg.norm(outside - inside, axis=2) / strip
    down, across = np.gradient(image.mean(axis=2))
    noise = TEXTURE * float(np.median(np.hypot(down, across))) + LEAST_NOISE
    return differ / (differ + noise)


def _half_width(region: Mask, band: Band, size: float) -> Floats:
    """Return the half-width (m,) of the region near each station, px."""
    side = 2 * int(np.ceil(2 * REACH * size)) + 1
    grown = cv2.dilate(distance_inside(region), np.ones((side, side), np.uint8))
    widest = np.asarray(grown, dtype=np.float32)
    far = (region.shape[1] - 1, region.shape[0] - 1)
    x, y = np.rint(band.stations).astype(np.int64).clip(0, far).T
    return widest[y, x]


def _resampled(ring: Points, count: int) -> Points:
    """Return points (count, 2) at equal arc lengths along a closed ring (n, 2)."""
    closed = np.vstack([ring, ring[:1]])
    arc: Reals = np.r_[0, np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))]
    at: Reals = np.linspace(0, float(arc[-1]), count, endpoint=False)
    return np.stack([np.interp(at, arc, closed[:, 0]), np.interp(at, arc, closed[:, 1])], axis=1)


def _smoothed(values: Reals, sigma: float) -> Reals:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, max(sigma, 1e-3), axis=0, mode="wrap")
