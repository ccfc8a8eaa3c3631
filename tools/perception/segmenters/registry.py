"""The segmenters by name: those built in, and those of packages with `formup.segmenters`."""

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
    """The segmenter of a name, or NAME:CHECKPOINT.

    Raises:
        InputError: there is none, or it cannot be loaded.
    """
    return built(SEGMENTERS, name)
