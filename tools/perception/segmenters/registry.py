"""The segmenters by name: those built in, and those of packages with `formup.segmenters`."""

from collections.abc import Callable
from functools import cache

from ...registry import Registry
from .protocol import Segmenter

SEGMENTERS = Registry[Callable[[], Segmenter]](
    "segmenter",
    "formup.segmenters",
    {"grabcut": "formup.tools.perception.segmenters.grabcut_segmenter:GrabCutSegmenter"},
)


@cache  # a network's weights are loaded once
def segmenter_named(name: str) -> Segmenter:
    """The segmenter of a name.

    Raises:
        InputError: there is none, or its package cannot be imported.
    """
    return SEGMENTERS.load(name)()
