"""The detectors by name: those built in, and those of packages with `formup.detectors`."""

from collections.abc import Callable
from functools import cache

from ...registry import Registry
from .protocol import Detector

DETECTORS = Registry[Callable[[], Detector]](
    "detector",
    "formup.detectors",
    {"standout": "formup.tools.perception.detectors.candidates:StandoutDetector"},
)


@cache  # a network's weights are loaded once
def detector_named(name: str) -> Detector:
    """The detector of a name.

    Raises:
        InputError: there is none, or its package cannot be imported.
    """
    return DETECTORS.load(name)()
