"""Proposes regions of a picture that may be things, from many cues and no trained weights.

Every connected piece of every threshold of every cue is a proposal, as in a component tree
(Matas et al., 2002); what is a thing among them is for `candidates` to judge.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from ..segmenters.grabcut import Bytes, Floats, Mask

# Shares of the picture: smaller ones cannot be told from texture, larger ones are ground.
LEAST, MOST = 4e-4, 0.35
LEAST_PIXELS = 20
# Thresholds of one channel by quantile, of a distance by value, in units of the features.
QUANTILES = np.linspace(0.02, 0.98, 15)
DISTANCES = np.array((6.0, 9.0, 13.0, 18.0, 25.0, 34.0, 46.0, 60.0))
NEARNESS = np.array((-50.0, -38.0, -28.0, -20.0, -14.0, -8.0))
# Palettes: few colours keep things whole, more of them tell things of like colour apart.
PALETTES = (3, 6)
SAMPLES = 5_000
# What stands out from its surroundings, blurred by these shares of the picture's side.
SURROUNDINGS = (0.04, 0.12)
# A colour is ground where it is common, along the picture's border, and all over: so many cells
# a side, each counting when so much of it has the colour.
CELLS, IN_CELL = 8, 0.15
# Boxes that agree to this many pixels, filled to the same quarter, hold the same region.
SAME, FILLS = 3, 4


@dataclass(frozen=True)
class Proposal:
    """A region in its box at `origin` (x, y).

    Attributes:
        raw: (h, w) pixels, mask: the same with holes filled.
        ring: (n, 2) the outermost pixels in order around it, in the box.
    """

    origin: tuple[int, int]
    raw: Mask
    mask: Mask
    ring: npt.NDArray[np.int32]

    @cached_property
    def area(self) -> int:
        """Pixels, holes filled."""
        return int(np.count_nonzero(self.mask))

    @cached_property
    def gap_share(self) -> float:
        """Share of the filled region that is holes."""
        return 1 - int(np.count_nonzero(self.raw)) / self.area


def proposals(features: Bytes) -> list[Proposal]:
    """Different regions of `features` (h, w, 3), each once, in no order."""
    found: dict[tuple[int, ...], Proposal] = {}
    least = max(LEAST_PIXELS, LEAST * features[..., 0].size)
    most = MOST * features[..., 0].size
    for cue, levels in _cues(features.astype(np.float32)):
        for level in levels:
            above = np.asarray(cue > level, dtype=np.uint8)
            _, labels, stats, _ = cv2.connectedComponentsWithStats(above, connectivity=4)
            areas = stats[:, cv2.CC_STAT_AREA]
            for i in 1 + np.flatnonzero((areas[1:] >= least) & (areas[1:] <= most)):
                x, y, width, height = (int(v) for v in stats[i, :4])
                sides = tuple(round(v / SAME) for v in (x, y, x + width, y + height))
                key = (*sides, round(FILLS * int(areas[i]) / (width * height)))
                if key not in found:
                    found[key] = _proposal_of(labels[y : y + height, x : x + width] == i, (x, y))
    return list(found.values())


def _proposal_of(raw: Mask, origin: tuple[int, int]) -> Proposal:
    contours, _ = cv2.findContours(raw.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    mask = np.zeros(raw.shape, np.uint8)
    cv2.drawContours(mask, contours, -1, (1,), cv2.FILLED)
    return Proposal(origin, raw, mask > 0, np.asarray(max(contours, key=len)[:, 0], np.int32))


def _cues(colours: Floats) -> Iterator[tuple[Floats, npt.NDArray[np.floating]]]:
    """Scalar pictures (h, w) with the thresholds to cut them at."""
    for channel in np.moveaxis(colours, 2, 0):
        levels = np.unique(np.quantile(channel, QUANTILES))
        yield channel, levels
        yield -channel, -levels
    for count in PALETTES:
        distance = _palette_distance(colours, count)
        yield from ((-d, NEARNESS) for d in distance)
        order = np.argsort([-_groundness(d) for d in distance == distance.min(axis=0)])
        for k in range(1, min(count, 4)):  # the likeliest ground, and the next colours with it
            yield distance[order[:k]].min(axis=0), DISTANCES
    for share in SURROUNDINGS:
        blurred = cv2.GaussianBlur(colours, (0, 0), share * max(colours.shape))
        yield np.linalg.norm(colours - blurred, axis=2).astype(np.float32), DISTANCES


def _palette_distance(colours: Floats, count: int) -> Floats:
    """Distance (count, h, w) of each pixel to each of the picture's main colours."""
    pixels = colours.reshape(-1, 3)
    sample = pixels[np.linspace(0, len(pixels) - 1, SAMPLES).astype(np.int64)]
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 12, 1.0)
    labels = np.empty(0, np.int32)
    _, _, centres = cv2.kmeans(sample, count, labels, stop, 1, cv2.KMEANS_PP_CENTERS)
    away = [np.linalg.norm(colours - centre, axis=2) for centre in np.asarray(centres)]
    return np.asarray(away, dtype=np.float32)


def _groundness(mine: Mask) -> float:
    """How much a colour's pixels (h, w) look like the ground: common, at the border, everywhere."""
    rim = np.concatenate(
        [mine[:4].ravel(), mine[-4:].ravel(), mine[:, :4].ravel(), mine[:, -4:].ravel()]
    )
    cells = cv2.resize(mine.astype(np.float32), (CELLS, CELLS), interpolation=cv2.INTER_AREA)
    spread = float(np.mean(np.asarray(cells) > IN_CELL))
    return float(mine.mean()) + float(rim.mean()) + spread
