"""Segment Anything (Kirillov et al., 2023) and SAM 2 (Ravi et al., 2024): from prompts to masks.

Pictures are prepared here as in the training of both, so that SAM 2 does not need torchvision.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from shapely.geometry import Polygon

from ..networks.runtime import Floats, array, load_network, resized
from ..target_prompt import Point, TargetPrompt
from .grabcut import Mask, bounding_box, iou, polygon_region
from .grabcut_segmenter import visible_vertices
from .mask_scores import rate_mask
from .protocol import Pixels, PromptKind, Segmentation
from .region_growing import box_iou

# ImageNet's statistics, for pixels from 0 to 255.
MEAN, DEVIATION = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
STEP = 1.0
"""By how much the threshold on a mask's logits is shifted to test the mask's stability."""
THRESHOLDS = MappingProxyType({"point": 0.7, "box": 0.6, "outline": 0.6, "candidate": 0.6})


@dataclass(frozen=True)
class _Frame:
    """How a picture lies in the square that the network sees.

    Attributes:
        side: side of the square, px.
        size: height and width of the resized picture, in the square's upper left, px.
        picture: height and width of the picture itself, px.
    """

    side: int
    size: tuple[int, int]
    picture: tuple[int, int]

    def points(self, points: Any) -> Floats:
        """Convert points (n, 2) of the picture to the square."""
        (height, width), (tall, wide) = self.picture, self.size
        scale = (wide / width, tall / height)
        return np.asarray(points, dtype=np.float32).reshape(-1, 2) * np.asarray(scale, np.float32)

    def logits(self, masks: Any) -> Floats:
        """Resize mask logits (n, h, w) of the square to the picture's size."""
        square = resized(masks, (self.side, self.side))
        return array(resized(square[..., : self.size[0], : self.size[1]], self.picture))


class SamSegmenter:
    """Segmenter that takes points, boxes and outlines, with SAM.

    Attributes:
        network: SAM; it caches the embeddings of the last pictures.
    """

    name = "sam"
    takes: frozenset[PromptKind] = frozenset({"box", "points", "outline"})
    thresholds: Mapping[str, float] = THRESHOLDS
    checkpoint = "facebook/sam-vit-base"
    classes: Mapping[str, str] = MappingProxyType({"sam": "SamModel"})
    squashes = False
    """Whether the picture is stretched to fill the square; otherwise it keeps its proportions."""

    def __init__(self, checkpoint: str = "") -> None:
        self.network = load_network(checkpoint or self.checkpoint, self.classes, processor=False)

    def segment(self, pixels: Pixels, prompt: TargetPrompt) -> Segmentation:
        """See `Segmenter.segment`."""
        height, width = pixels.shape[:2]
        frame = self._frame((height, width))
        embedding = self.network.remembered(pixels, lambda: self._embedding(pixels, frame))
        box, on, drawn = _sam_prompt(prompt, width, height)
        inputs: dict[str, Any] = {"image_embeddings": embedding, "multimask_output": True}
        if box is not None:
            inputs["input_boxes"] = frame.points(box).reshape(1, 1, 4)
        if on or prompt.negative:
            inputs["input_points"] = frame.points([*on, *prompt.negative])[None, None]
            labels = [1] * len(on) + [0] * len(prompt.negative)
            inputs["input_labels"] = np.array([[labels]], dtype=np.int64)
        made = self.network.run(self.network.model, inputs)
        scores = array(made.iou_scores)[0, 0]
        best = int(scores.argmax())
        logits = frame.logits(made.pred_masks[0, 0, best : best + 1])[0]
        parts = {
            "predicted_iou": float(scores[best].clip(0, 1)),
            "stability": _stability(logits),
            **_prompt_fit(logits > 0, box, drawn),
        }
        return rate_mask(pixels, logits > 0, parts)

    def _frame(self, picture: tuple[int, int]) -> _Frame:
        side = int(self.network.model.config.prompt_encoder_config.image_size)
        if self.squashes:
            return _Frame(side, (side, side), picture)
        scale = side / max(picture)
        size = int(picture[0] * scale + 0.5), int(picture[1] * scale + 0.5)
        return _Frame(side, (max(size[0], 1), max(size[1], 1)), picture)

    def _embedding(self, pixels: Pixels, frame: _Frame) -> Any:
        planes = np.moveaxis(pixels, 2, 0).astype(np.float32)
        small = array(resized(planes, frame.size))
        square = np.zeros((1, 3, frame.side, frame.side), dtype=np.float32)
        normal = (small - np.reshape(MEAN, (3, 1, 1))) / np.reshape(DEVIATION, (3, 1, 1))
        square[0, :, : frame.size[0], : frame.size[1]] = normal
        network = self.network
        return network.run(network.model.get_image_embeddings, {"pixel_values": square})


class Sam2Segmenter(SamSegmenter):
    """Segmenter that takes points, boxes and outlines, with SAM 2.1."""

    name = "sam2.1"
    checkpoint = "facebook/sam2.1-hiera-small"
    classes: Mapping[str, str] = MappingProxyType(
        dict.fromkeys(("sam2", "sam2_video"), "Sam2Model")
    )
    squashes = True


def _stability(logits: Floats) -> float:
    """Rate how little a mask depends on the threshold of its logits: the overlap of two masks."""
    loose = int(np.count_nonzero(logits > -STEP))
    return int(np.count_nonzero(logits > STEP)) / loose if loose else 0.0


def _sam_prompt(
    prompt: TargetPrompt, width: int, height: int
) -> tuple[tuple[float, ...] | None, list[Point], Mask | None]:
    """Convert a prompt to what SAM takes: a box and points on the thing.

    An outline becomes its box and a point well inside. The third value is a mask of the outline's
    pixels, None without an outline.
    """
    on = list(prompt.points or ())
    if prompt.outline is None:
        if prompt.box is None:
            return None, on, None
        x0, y0, x1, y1 = prompt.box
        return (max(x0, 0.0), max(y0, 0.0), min(x1, width - 1.0), min(y1, height - 1.0)), on, None
    vertices = visible_vertices(prompt.outline, width, height)
    region = Polygon(vertices)
    inside = region.representative_point()
    drawn = polygon_region(np.asarray(vertices), (height, width))
    return region.bounds, [*on, (inside.x, inside.y)], drawn


def _prompt_fit(mask: Mask, box: tuple[float, ...] | None, drawn: Mask | None) -> dict[str, float]:
    """Return how far a mask agrees with a box or outline; empty for points alone."""
    if drawn is not None:
        return {"prompt_fit": iou(mask, drawn)}
    if box is None or not mask.any():
        return {}
    x0, y0, x1, y1 = box
    return {"prompt_fit": box_iou(bounding_box(mask), (x0, y0, x1, y1))}
