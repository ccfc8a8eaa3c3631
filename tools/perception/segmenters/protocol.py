"""What a segmenter is: a picture and a prompt go in, a mask and its confidence come out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..target_prompt import TargetPrompt

Pixels = NDArray[np.uint8]
PromptKind = Literal["text", "box", "points", "outline"]


@dataclass(frozen=True)
class Segmentation:
    """A mask of the thing pointed at, and how far it can be trusted.

    Attributes:
        mask: (H, W) of the whole picture.
        confidence: in [0, 1], compared with the threshold t; what it is made of is the
            segmenter's choice, but never a claim about accuracy.
        parts: the cues in [0, 1] that the confidence combines, by name.
    """

    mask: NDArray[np.bool_]
    confidence: float
    parts: Mapping[str, float]


class Segmenter(Protocol):
    """A way to make masks."""

    @property
    def name(self) -> str:
        """What it is chosen by."""
        ...

    @property
    def takes(self) -> frozenset[PromptKind]:
        """The kinds of prompt it can be pointed with; points also correct the other ones.

        One that takes text is a `detection.Finder` as well.
        """
        ...

    @property
    def thresholds(self) -> Mapping[str, float]:
        """The confidence below which a mask is refused (t in the paper), by way of pointing.

        `point`, `box` and `outline` as far as it takes these, and `candidate` where it takes a
        box, an outline or text.
        """
        ...

    def segment(self, pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
        """The mask of the thing pointed at; empty, with confidence 0, where nothing is found.

        Args:
            pixels: (H, W, 3) RGB.
            prompt: of a kind it takes and checked on this picture; coordinates in px, x right,
                y down, pixel centres at .0. Boxes and outlines may reach beyond the picture.
        """
        ...
