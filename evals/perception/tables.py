"""Samples as tables: how exact they are, how many are used, how reliable the confidence is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...tools.geometry.outline import FloatArray
from ...tools.perception.segmenters.confidence import RIGHT
from .samples import Mode, Sample

BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
"""Bounds of the confidence in the reliability table."""


class Bin(NamedTuple):
    """Masks of similar confidence: the bounds, how many, their mean confidence, the share right."""

    low: float
    high: float
    masks: int
    confidence: float
    right: float


@dataclass(frozen=True)
class Row:
    """Results of a way of pointing on a suite; shares are of the masks, errors as in `Sample`.

    Attributes:
        right: share whose overlap is .8 or more.
        wrong_if_placed: the share of those placed that are not right; None if none are placed.
        time_ratio: CPU time over that of one GrabCut on the same windows.
    """

    segmenter: str
    mode: Mode
    suite: str
    masks: int
    overlap: float
    overlap_median: float
    right: float
    boundary_error: float
    boundary_error_median: float
    placed: float
    wrong_if_placed: float | None
    seconds: float
    time_ratio: float
    reliability: tuple[Bin, ...]


def row(segmenter: str, mode: Mode, suite: str, samples: Sequence[Sample]) -> Row:
    """Return the row of samples, of which there must be at least one."""
    overlap = np.array([s.overlap for s in samples])
    error = np.array([s.boundary_error for s in samples])
    right = overlap >= RIGHT
    placed = np.array([s.placed for s in samples])
    sure = np.array([s.confidence for s in samples])
    bare = sum(s.bare_seconds for s in samples)
    seconds = sum(s.seconds for s in samples)
    return Row(
        segmenter=segmenter,
        mode=mode,
        suite=suite,
        masks=len(samples),
        overlap=float(overlap.mean()),
        overlap_median=float(np.median(overlap)),
        right=float(right.mean()),
        boundary_error=float(error.mean()),
        boundary_error_median=float(np.median(error)),
        placed=float(placed.mean()),
        wrong_if_placed=float(np.mean(~right[placed])) if placed.any() else None,
        seconds=seconds / len(samples),
        time_ratio=seconds / max(bare, 1e-9),
        reliability=tuple(reliability(sure, right.astype(float))),
    )


def reliability(likely: FloatArray, right: FloatArray) -> Iterator[Bin]:
    """Yield how often masks of similar confidence are right, for `BINS` that are not empty.

    Args:
        likely: (n,) the confidence, 0 to 1.
        right: (n,), 0 or 1.
    """
    at = np.clip(np.digitize(likely, BINS) - 1, 0, len(BINS) - 2)
    for k in np.unique(at):
        these = at == k
        mean, share = float(likely[these].mean()), float(right[these].mean())
        yield Bin(BINS[k], BINS[k + 1], int(these.sum()), round(mean, 3), round(share, 3))


def markdown(rows: Sequence[Row]) -> str:
    """Return two tables: what was measured, and the reliability of the confidence."""
    lines = [
        "| segmenter | pointed by | suite | masks | IoU | median | IoU >= .8 | e95 | median |"
        " placed | wrong, if placed | CPU s | times one GrabCut |",
        "|" + "---|" * 13,
    ]
    for r in rows:
        wrong = "-" if r.wrong_if_placed is None else f"{r.wrong_if_placed:.3f}"
        lines.append(
            f"| {r.segmenter} | {r.mode} | {r.suite} | {r.masks} | {r.overlap:.3f} |"
            f" {r.overlap_median:.3f} | {r.right:.3f} | {r.boundary_error:.4f} |"
            f" {r.boundary_error_median:.4f} | {r.placed:.3f} | {wrong} | {r.seconds:.3f} |"
            f" {r.time_ratio:.1f} |"
        )
    head = "| segmenter | pointed by | suite | confidence | masks | mean confidence | right |"
    lines += ["", head, "|" + "---|" * 7]
    lines += [
        f"| {r.segmenter} | {r.mode} | {r.suite} | {b.low:g} to {b.high:g} | {b.masks} |"
        f" {b.confidence:.2f} | {b.right:.2f} |"
        for r in rows
        for b in r.reliability
    ]
    return "\n".join(lines)
