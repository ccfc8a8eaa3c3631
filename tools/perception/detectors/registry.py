"""The detectors by name: those built in, and those of packages with `formup.detectors`."""

from collections.abc import Callable
from functools import cache

from ...registry import Registry, built
from .protocol import Detector

_HERE = "formup.tools.perception.detectors"
DETECTORS = Registry[Callable[..., Detector]](
    "detector",
    "formup.detectors",
    {
        "standout": f"{_HERE}.candidates:StandoutDetector",
        "groundingdino": f"{_HERE}.grounding_dino:GroundingDinoDetector",
        "mm-groundingdino": f"{_HERE}.grounding_dino:MmGroundingDinoDetector",
        "vlm": f"{_HERE}.vlm:VlmDetector",
    },
)


@cache  # a network's weights are loaded once
def detector_named(name: str) -> Detector:
    """The detector of a name, or NAME:CHECKPOINT.

    Raises:
        InputError: there is none, or it cannot be loaded.
    """
    return built(DETECTORS, name)
