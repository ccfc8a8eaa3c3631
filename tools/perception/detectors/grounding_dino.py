"""Grounding DINO (Liu et al., 2023) and MM Grounding DINO: boxes with scores from words."""

import numpy as np

from ..detection import Detection
from ..image import Picture
from ..networks.runtime import array, load_network
from ..networks.settings import detection_threshold
from ..segmenters.protocol import Pixels
from ..target_prompt import MIN_SIDE

SCORE, TEXT_SCORE = 0.3, 0.25
"""Least scores of a box and of the words that label it, as its authors use them."""
CLASSES = {
    "grounding-dino": "GroundingDinoForObjectDetection",
    "mm-grounding-dino": "MMGroundingDinoForObjectDetection",
}


class GroundingDinoDetector:
    """Detector of the things that a phrase names, as boxes; without a phrase it finds nothing."""

    name = "groundingdino"
    checkpoint = "IDEA-Research/grounding-dino-tiny"

    def __init__(self, checkpoint: str = "") -> None:
        self._network = load_network(checkpoint or self.checkpoint, CLASSES, processor=True)
        self._score = detection_threshold(SCORE)

    def detect(self, picture: Picture) -> tuple[()]:
        """See `Detector.detect`: without words it finds nothing."""
        return ()

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """See `Finder.find`."""
        network = self._network
        # It was trained on lower case with a full stop after each phrase.
        text = phrase.lower().rstrip(".") + "."
        inputs = network.processor(images=pixels, text=text, return_tensors="pt")
        made = network.run(network.model, inputs)
        found = network.processor.post_process_grounded_object_detection(
            made,
            inputs["input_ids"],
            threshold=self._score,
            text_threshold=TEXT_SCORE,
            target_sizes=[pixels.shape[:2]],
        )[0]
        far = np.array((pixels.shape[1] - 1, pixels.shape[0] - 1))
        corners = array(found["boxes"]).reshape(-1, 2, 2).clip(0, far)
        detections = [
            Detection((float(x0), float(y0), float(x1), float(y1)), float(score))
            for ((x0, y0), (x1, y1)), score in zip(corners, array(found["scores"]), strict=True)
            if min(x1 - x0, y1 - y0) >= MIN_SIDE
        ]
        return tuple(sorted(detections, key=lambda d: -d.score))


class MmGroundingDinoDetector(GroundingDinoDetector):
    """The same detector, retrained on more pictures."""

    name = "mm-groundingdino"
    checkpoint = "openmmlab-community/mm_grounding_dino_tiny_o365v1_goldg_v3det"
