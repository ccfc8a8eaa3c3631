"""A segmenter and a detector in a package of their own, which formup finds by entry points."""

from typing import ClassVar

import numpy as np
from formup.tools.perception.contours import outline_of_mask
from formup.tools.perception.detection import Detection
from formup.tools.perception.image import Picture
from formup.tools.perception.referring.attributes import Candidate
from formup.tools.perception.referring.measure_attributes import candidate_of
from formup.tools.perception.segmenters.protocol import Pixels, PromptKind, Segmentation
from formup.tools.perception.target_prompt import TargetPrompt


class EllipseSegmenter:
    """The ellipse that fills a box, whatever the picture shows."""

    name = "example-ellipse"
    takes: frozenset[PromptKind] = frozenset({"box"})
    thresholds: ClassVar[dict[str, float]] = {"box": 0.5, "candidate": 0.5}

    def segment(self, pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
        """The mask, and how far it can be trusted."""
        assert prompt.box is not None
        x0, y0, x1, y1 = prompt.box
        y, x = np.indices(pixels.shape[:2])
        across, down = (2 * x - x0 - x1) / (x1 - x0), (2 * y - y0 - y1) / (y1 - y0)
        mask = np.asarray(across**2 + down**2 <= 1)
        return Segmentation(mask, 0.9, {"example": 0.9})


class BrightDetector:
    """All that is bright, as one thing; of nouns it knows "lamp" alone."""

    name = "example-bright"

    def detect(self, picture: Picture) -> tuple[Candidate, ...]:
        """What stands out, for words that describe its look."""
        bright = picture.pixels.min(axis=2) > 200
        if not bright.any():
            return ()
        return (candidate_of("c1", outline_of_mask(bright), picture, 0.8),)

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """The things that a noun names."""
        y, x = np.nonzero(pixels.min(axis=2) > 200)
        if phrase != "lamp" or not len(x):
            return ()
        box = (float(x.min()), float(y.min()), float(x.max()), float(y.max()))
        return (Detection(box, 0.8),)
