"""The built-in segmenter: GrabCut and other classical methods, without trained weights."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from shapely.geometry import Polygon

from ...geometry.outline import largest_part
from ..target_prompt import Point, TargetPrompt
from .drawn_outline import segment_corrected
from .protocol import Pixels, PromptKind, Segmentation
from .segment import segment_box, segment_points

# Below these, most formations on the photographs were wrong; a person who sees a mask below them
# may still accept it.
THRESHOLDS = MappingProxyType({"point": 0.55, "box": 0.35, "outline": 0.35, "candidate": 0.5})


class GrabCutSegmenter:
    """Segmenter that takes a box, points or an outline; points correct the other two."""

    name = "grabcut"
    takes: frozenset[PromptKind] = frozenset({"box", "points", "outline"})
    thresholds: Mapping[str, float] = THRESHOLDS

    def segment(self, pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
        """See `Segmenter.segment`."""
        height, width = pixels.shape[:2]
        positive, negative = prompt.points or (), prompt.negative
        if prompt.outline is not None:
            vertices = visible_vertices(prompt.outline, width, height)
            return segment_corrected(pixels, vertices, positive=positive, negative=negative)
        if prompt.box is not None:
            x0, y0, x1, y1 = prompt.box
            box = (max(x0, 0.0), max(y0, 0.0), min(x1, width - 1.0), min(y1, height - 1.0))
            return segment_box(pixels, box, positive=positive, negative=negative)
        return segment_points(pixels, positive, negative=negative)


def visible_vertices(outline: Sequence[Point], width: int, height: int) -> list[Point]:
    """Return the vertices of the part of a drawn outline that lies in the picture."""
    frame = Polygon([(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)])
    visible = largest_part(Polygon(outline).intersection(frame))
    assert visible is not None  # TargetPrompt.problems has been checked
    return [(float(x), float(y)) for x, y in visible.exterior.coords[:-1]]
