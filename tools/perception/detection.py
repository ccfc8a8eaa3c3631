"""Things found by a noun phrase: where, with what score, and with which mask."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from .segmenters.protocol import Pixels, Segmentation
from .target_prompt import Box


@dataclass(frozen=True)
class Detection:
    """A thing that a phrase may name.

    Attributes:
        box: x0, y0, x1, y1, px; it may reach beyond the picture.
        score: the detector's own score in [0, 1] that it is such a thing. It says nothing about
            the quality of a mask, which has its own confidence.
        mask: its mask, if one was made.
        most: upper limit on the confidence of its mask.
    """

    box: Box
    score: float
    mask: Segmentation | None = None
    most: float = 1.0


@runtime_checkable
class Finder(Protocol):
    """A finder of things by words: some detectors, and the segmenters that take text."""

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """Find the things that a bare noun phrase names, such as "car"; none is no error.

        Args:
            pixels: (H, W, 3) RGB.
            phrase: lower case, no article, no relation and no rank.
        """
        ...
