"""What is found by a noun phrase: where, how surely, and as which mask."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from .segmenters.protocol import Pixels, Segmentation
from .target_prompt import Box


@dataclass(frozen=True)
class Detection:
    """A thing that a phrase may name.

    Attributes:
        box: x0, y0, x1, y1, px; it may reach beyond the picture.
        score: the detector's own, in [0, 1]: that it is such a thing. What a mask is worth is
            another matter, and its own score.
        mask: where one was made.
        most: the greatest confidence that a mask of it is given.
    """

    box: Box
    score: float
    mask: Segmentation | None = None
    most: float = 1.0


@runtime_checkable
class Finder(Protocol):
    """What finds things by words: some detectors, and the segmenters that take text."""

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """The things that a bare noun phrase names, such as "car"; none is no error.

        Args:
            pixels: (H, W, 3) RGB.
            phrase: lower case, no article, no relation and no rank.
        """
        ...
