"""Proposes regions of a picture that may be things, from many cues and no trained weights.

Every connected component at every threshold of every cue is a proposal, as in a component tree
(Matas et al., 2002); `candidates` judges which of them are things.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from ..segmenters.grabcut import Bytes, Floats, Mask

# Shares of the picture: smaller regions cannot be told from texture, larger ones are ground.
LEAST, MOST = 4e-4, 0.35
LEAST_PIXELS = 20
# Thresholds of a channel are quantiles, those of a distance values in units of the features.
QUANTILES = np.linspace(0.02, 0.98, 15)
DISTANCES = np.array((6.0, 9.0, 13.0, 18.0, 25.0, 34.0, 46.0, 60.0))
NEARNESS = np.array((-50.0, -38.0, -28.0, -20.0, -14.0, -8.0))
# Palette sizes: few colours keep things whole, more of them separate things of similar colour.
PALETTES = (3, 6)
SAMPLES = 5_000
# Surroundings that things stand out from are the picture blurred by these shares of its side.
SURROUNDINGS = (0.04, 0.12)
# A colour is ground if it is common, along the picture's border, and all over: the picture has this
# many cells a side, each of which counts if this share of it has the colour.
CELLS, IN_CELL = 8, 0.15
# Boxes that agree to this many pixels and are filled to the same quarter hold the same region.
SAME, FILLS = 3, 4


@dataclass(frozen=True)
class Proposal:
    """A region in its box at `origin` (x, y).

    Attributes:
        raw: mask (h, w) of its pixels.
        mask: the same with holes filled.
        ring: its outermost pixels in order, (n, 2), in the box.
    """

    origin: tuple[int, int]
    raw: Mask
    mask: Mask
    ring: npt.NDArray[np.int32]

    @cached_property
    def area(self) -> int:
        """Number of its pixels, holes filled."""
        return int(np.count_nonzero(self.mask))

    @cached_property
    def gap_share(self) -> float:
        """Share of the filled region that its holes take."""
        return 1 - int(np.count_nonzero(self.raw)) / self.area


def proposals(features: Bytes) -> list[Proposal]:
    """Propose different regions of `features` (h, w, 3), each once, in no particular order."""
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
    """Yield scalar pictures (h, w) with the thresholds to cut them at."""
    for channel in np.moveaxis(colours, 2, 0):
        levels = np.unique(np.quantile(channel, QUANTILES))
        yield channel, levels
        yield -channel, -levels
    for count in PALETTES:
        distance = _palette_distance(colours, count)
        yield from ((-d, NEARNESS) for d in distance)
        order = np.argsort([-_groundness(d) for d in distance == distance.min(axis=0)])
        for k in range(1, min(count, 4)):  # the likeliest ground colour, then the next ones too
            yield distance[order[:k]].min(axis=0), DISTANCES
    for share in SURROUNDINGS:
        blurred = cv2.GaussianBlur(colours, (0, 0), share * max(colours.shape))
        yield np.linalg.norm(colours - blurred, axis=2).astype(np.float32), DISTANCES


def _palette_distance(colours: Floats, count: int) -> Floats:
    """Return the distance (count, h, w) of each pixel to each of the picture's main colours."""
    pixels = colours.reshape(-1, 3)
    sample = pixels[np.linspace(0, len(pixels) - 1, SAMPLES).astype(np.int64)]
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 12, 1.0)
    labels = np.empty(0, np.int32)
    _, _, centres = cv2.kmeans(sample, count, labels, stop, 1, cv2.KMEANS_PP_CENTERS)
    away = [np.linalg.norm(colours - centre, axis=2) for centre in np.asarray(centres)]
    return np.asarray(away, dtype=np.float32)


def _groundness(mine: Mask) -> float:
    """Rate how much a colour's pixels (h, w) look like ground: common, at the border, all over."""
    rim = np.concatenate(
        [mine[:4].ravel(), mine[-4:].ravel(), mine[:, :4].ravel(), mine[:, -4:].ravel()]
    )
    cells = cv2.resize(mine.astype(np.float32), (CELLS, CELLS), interpolation=cv2.INTER_AREA)
    spread = float(np.mean(np.asarray(cells) > IN_CELL))
    return float(mine.mean()) + float(rim.mean()) + spread
