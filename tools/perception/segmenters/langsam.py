"""The pair that the ZeroCAP paper uses: Grounding DINO finds things by words, SAM makes masks."""

from dataclasses import replace

from ..detection import Detection
from ..detectors.grounding_dino import GroundingDinoDetector
from ..target_prompt import TargetPrompt
from .protocol import Pixels, PromptKind
from .sam import SamSegmenter


class LangSamSegmenter(SamSegmenter):
    """Segmenter that takes words, points, boxes and outlines.

    Args:
        checkpoints: those of the detector and of SAM, separated by a comma.
    """

    name = "langsam"
    takes: frozenset[PromptKind] = frozenset({"text", "box", "points", "outline"})

    def __init__(self, checkpoints: str = "") -> None:
        detector, _, masks = checkpoints.partition(",")
        super().__init__(masks)
        self._detector = GroundingDinoDetector(detector)

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """See `Finder.find`."""
        return tuple(
            replace(found, mask=self.segment(pixels, TargetPrompt(box=found.box)))
            for found in self._detector.find(pixels, phrase)
        )
