"""CLIPSeg (Lueddecke and Ecker, 2022): from words to a soft mask, whose separate pieces are things.

It sees the picture squashed to a small square: outlines are soft, and things that touch are merged.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ..detection import Detection
from ..networks.runtime import Floats, array, load_network, resized
from ..networks.settings import detection_threshold
from ..target_prompt import TargetPrompt
from .grabcut import bounding_box, pieces
from .mask_scores import rate_mask
from .protocol import Pixels, PromptKind, Segmentation

CHECKPOINT = "CIDAS/clipseg-rd64-refined"
LEVEL, STEP = 0.4, 0.1
"""Threshold on a mask's probability, and by how much it is shifted to test the mask's stability."""
LEAST = 4e-4
"""Least share of the picture in a piece; smaller ones are specks."""


class ClipSegSegmenter:
    """Segmenter that takes words alone."""

    name = "clipseg"
    takes: frozenset[PromptKind] = frozenset({"text"})
    thresholds: Mapping[str, float] = MappingProxyType({"candidate": 0.5})

    def __init__(self, checkpoint: str = "") -> None:
        classes = {"clipseg": "CLIPSegForImageSegmentation"}
        self._network = load_network(checkpoint or CHECKPOINT, classes, processor=True)
        self._level = detection_threshold(LEVEL)

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """See `Finder.find`."""
        chance = self._probabilities(pixels, phrase)
        labels, areas = pieces(chance > self._level, connectivity=8)
        loose, loose_areas = pieces(chance > self._level - STEP, connectivity=8)
        found: list[Detection] = []
        for label in 1 + np.flatnonzero(areas[1:] >= LEAST * chance.size):
            piece = labels == label
            tight = int(np.count_nonzero(chance[piece] > self._level + STEP))
            parts = {
                "probability": float(chance[piece].mean()),
                "stability": tight / int(loose_areas[loose[piece][0]]),
            }
            mask = rate_mask(pixels, piece, parts)
            if mask.confidence > 0:
                found.append(Detection(bounding_box(piece), float(chance[piece].max()), mask))
        return tuple(sorted(found, key=lambda d: -d.score))

    def segment(self, pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
        """See `Segmenter.segment`."""
        found = self.find(pixels, prompt.text or "")
        mask = found[0].mask if found else None
        return mask or Segmentation(np.zeros(pixels.shape[:2], dtype=np.bool_), 0.0, {})

    def _probabilities(self, pixels: Pixels, phrase: str) -> Floats:
        """Return each pixel's probability (H, W) of belonging to what the phrase names."""
        network = self._network
        inputs = network.processor(
            text=[phrase],
            images=[pixels],
            padding="max_length",
            max_length=network.model.config.text_config.max_position_embeddings,
            truncation=True,
            return_tensors="pt",
        )
        logits = network.run(network.model, inputs).logits
        logits = logits.reshape(logits.shape[-2:])  # one prompt may lose its axis
        return array(resized(logits.sigmoid(), pixels.shape[:2]))
