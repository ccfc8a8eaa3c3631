"""The detectors by name: built-in ones, and those of packages, under `formup.detectors`."""

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
    """Return the detector with a name, or with NAME:CHECKPOINT.

    Raises:
        InputError: there is no such detector, or it cannot be loaded.
    """
    return built(DETECTORS, name)
