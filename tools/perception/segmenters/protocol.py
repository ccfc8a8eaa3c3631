"""The interface of a segmenter: a picture and a prompt go in, a mask with confidence comes out."""

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
        mask: (H, W), over the whole picture.
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
        """The name by which it is chosen."""
        ...

    @property
    def takes(self) -> frozenset[PromptKind]:
        """The kinds of prompt that it takes; points also correct the other ones.

        A segmenter that takes text also implements `detection.Finder`.
        """
        ...

    @property
    def thresholds(self) -> Mapping[str, float]:
        """The confidence below which a mask is refused (t in the paper), by way of pointing.

        These are `point`, `box` and `outline` as far as it takes them, and `candidate` if it takes
        a box, an outline or text.
        """
        ...

    def segment(self, pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
        """Return the mask of the thing pointed at; empty, with confidence 0, if nothing is found.

        Args:
            pixels: (H, W, 3) RGB.
            prompt: of a kind that it takes, checked on this picture; coordinates in px, x right,
                y down, pixel centres at .0. Boxes and outlines may reach beyond the picture.
        """
        ...
