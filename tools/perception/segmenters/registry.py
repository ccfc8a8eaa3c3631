"""The segmenters by name: built-in ones, and those of packages, under `formup.segmenters`."""

from collections.abc import Callable
from functools import cache

from ...registry import Registry, built
from .protocol import Segmenter

_HERE = "formup.tools.perception.segmenters"
SEGMENTERS = Registry[Callable[..., Segmenter]](
    "segmenter",
    "formup.segmenters",
    {
        "grabcut": f"{_HERE}.grabcut_segmenter:GrabCutSegmenter",
        "clipseg": f"{_HERE}.clipseg:ClipSegSegmenter",
        "langsam": f"{_HERE}.langsam:LangSamSegmenter",
        "sam": f"{_HERE}.sam:SamSegmenter",
        "sam2.1": f"{_HERE}.sam:Sam2Segmenter",
    },
)


@cache  # a network's weights are loaded once
def segmenter_named(name: str) -> Segmenter:
    """Return the segmenter with a name, or with NAME:CHECKPOINT.

    Raises:
        InputError: there is no such segmenter, or it cannot be loaded.
    """
    return built(SEGMENTERS, name)
