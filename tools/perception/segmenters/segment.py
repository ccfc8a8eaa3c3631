"""Segments the thing that a person points at, without trained weights.

A box, points or a rough outline are enough for classical segmentation to work on real photographs,
so formup runs with no download and no GPU.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..detectors.whole_object import on_plain_ground, propose_whole
from . import grabcut as gc
from .cast_shadow import without_cast_shadow
from .confidence import Way, fitted_confidence
from .edge_path import edge_path
from .grabcut import Box, Bytes, Mask, Point, Points, Window
from .mask_openings import cut_openings
from .protocol import Segmentation
from .region_growing import Region, box_iou, edge_support, filled, mask_solidity, pin, propose

# The ring around a box into which the thing may reach, in box sizes: boxes are drawn tight.
RING = 0.1
# How far the sides of perturbed boxes move, in box sizes: about the error of a drawn box.
BOX_SHIFT = 0.06
# A larger box, a smaller one, a wider one and a taller one.
BOX_MOVES = ((-1, -1, 1, 1), (1, 1, -1, -1), (-1, 1, 1, -1), (1, -1, -1, 1))
# The middle of a box that the second opinion floods from, as a share of the box.
CORE = 0.35
# A mask smaller than this share of the prompt's extent has lost the thing.
COLLAPSED = 0.1
# The vertices of a rough outline are off by up to about 5 % of the thing's size.
OUTLINE_ERROR = 0.05
# Few vertices cut the corners of round things more often than they overshoot.
OUTLINE_REACH = 0.06
# Outlines keep more detail than boxes: GrabCut runs once, on a larger window.
OUTLINE_SIDE = 320
# Around a point that contradicts the outline, within this share of the size, colours alone decide
# where the edge is.
BESIDE = 0.2
# Eroding by no more than this share of the local half-width keeps thin parts.
THIN = 0.5
# Number of different regions tried that a point may mean; a fourth was right now and then.
PROPOSALS = 4
# A whole holds this share of its part, is this many times as large (a thing with its shadow is
# not) and stands out this share as much; it is a thing if it fills this share of its hull.
HELD, MUCH_LARGER, RIVAL, SOLID = 0.85, 2.2, 0.6, 0.88
# A mask that runs along the sure background for this many times its size was cut short; the box
# is widened by this share on each side, at most this often.
CUT_SHORT, WIDER, WIDENINGS = 0.05, 0.15, 3
NEXT_TO = np.ones((3, 3), np.uint8)
# Number of other points of a mask that should lead back to it, and how deep inside it they lie, as
# a share of the greatest depth.
REPROPOSALS = 4
DEPTH = 0.35

Proposer = Callable[[Bytes, Sequence[Point], int], list[Region]]


@dataclass(frozen=True)
class _Prompt:
    """A prompt at the working scale.

    `trimaps` are GrabCut labels, first for the prompt as given and then for perturbed ones;
    `extent` is the area that the prompt says the thing covers, `core` the part that is most surely
    the thing.
    """

    window: Window
    trimaps: Sequence[Bytes]
    extent: Mask
    core: Mask
    positive: Points
    box: Box
    way: Way


def segment_box(
    pixels: Bytes, box: Box, *, positive: Iterable[Point] = (), negative: Iterable[Point] = ()
) -> Segmentation:
    """Segment the thing in a box (x0, y0, x1, y1), by GrabCut (Rother et al., 2004).

    `pixels` is (H, W, 3) uint8 RGB; the box and the points that are surely on the thing
    (`positive`) or surely not (`negative`) are in pixels, x right, y down, pixel centres at .0.
    The thing may reach a little beyond the box. If nothing stands out from its surroundings, the
    mask is empty and the confidence 0.
    """
    window = gc.window_around(pixels, box)
    drawn = window.to_work((box[:2], box[2:])).ravel()
    on, off = window.to_work(list(positive)), window.to_work(list(negative))
    boxes = [drawn, *_moved_boxes(drawn)]
    trimaps = [pin(window.features, _box_trimap(window.shape, b), on, off) for b in boxes]
    extent = gc.box_region(window.shape, drawn)
    prompt = _Prompt(window, trimaps, extent, _middle_ellipse(window.shape, drawn), on, box, "box")
    masks = [_object_mask(prompt, trimap) for trimap in trimaps]
    mask = gc.clean(gc.majority(masks), on)
    stability = float(np.mean([gc.iou(mask, other) for other in masks[1:]]))
    if mask.any():
        ground = trimaps[0] == cv2.GC_BGD
        mask = without_cast_shadow(window.features, mask, drawn, ground, on)
    return _rated(prompt, mask, {"stability": stability})


def segment_outline(
    pixels: Bytes,
    vertices: Sequence[Point],
    *,
    positive: Iterable[Point] = (),
    negative: Iterable[Point] = (),
) -> Segmentation:
    """Segment the thing in a rough outline of 3 or more vertices (x, y), as `segment_box` does.

    Well inside the outline is surely the thing and well outside surely not, so four vertices act as
    a rotated box, and more of them decide what a box leaves open.
    """
    box = _bounding_box(vertices)
    window = gc.window_around(pixels, box, OUTLINE_SIDE)
    drawn = window.to_work(vertices)
    on, off = window.to_work(list(positive)), window.to_work(list(negative))
    region = gc.polygon_region(drawn, window.shape)
    core = _eroded(region)
    trimap = pin(window.features, gc.trimap(region, _dilated(region), core), on, off)
    prompt = _Prompt(window, [trimap], region, core, on, box, "outline")
    cut = _object_mask(prompt, trimap)
    if not cut.any():
        return _empty_segmentation(window.picture)
    path = gc.polygon_region(edge_path(window.features, drawn, region), window.shape)
    near = discs(window.shape, (*on, *off), BESIDE * float(np.sqrt(np.count_nonzero(region))))
    mask = np.where(near, cut, _combined(cut, path))
    return _rated(prompt, mask, {"path_agreement": gc.iou(filled(cut), path)})


def _combined(cut: Mask, path: Mask) -> Mask:
    """Return the mask midway between the cut by colour and the path; its holes are the cut's."""
    whole = filled(cut)
    return (gc.signed_distance(whole) + gc.signed_distance(path) > 0) & ~(whole & ~cut)


def segment_points(
    pixels: Bytes, points: Sequence[Point], *, negative: Iterable[Point] = ()
) -> Segmentation:
    """Segment the thing under one or more points (x, y), as `segment_box` does.

    Of the regions that grow from the points, the one is taken whose segmentation agrees with it
    best and stands out most in colour; if that is only a part of a larger thing that stands out
    too, the whole is taken. Its stability is how far other points of the mask lead back to it. A
    thing of several colours needs points on each, or a box.
    """
    off = list(negative)
    parts = _tried_regions(pixels, propose(pixels, points, PROPOSALS), points, off)
    best = max(parts, key=lambda tried: tried.distinctness, default=None)
    if best is not None and on_plain_ground(best.prompt.window, best.mask):
        return _rated(best.prompt, best.mask, _reproposal_stability(pixels, best, propose))
    whole_objects = _tried_regions(pixels, propose_whole(pixels, points, PROPOSALS), points, off)
    if best is not None:
        whole_objects = [tried for tried in whole_objects if _is_whole_of(tried, best)]
    solid = [tried for tried in whole_objects if mask_solidity(tried.mask) >= SOLID]
    chosen = max(solid, key=lambda tried: tried.distinctness, default=best)
    if chosen is None:
        return _empty_segmentation((pixels.shape[0], pixels.shape[1]))
    proposer = propose if chosen is best else propose_whole
    stable = _reproposal_stability(pixels, chosen, proposer)
    if chosen is best and whole_objects:  # it may well be a part of one of them
        rival = max(tried.distinctness for tried in whole_objects)
        stable["unrivalled"] = chosen.distinctness / (chosen.distinctness + rival)
    return _rated(chosen.prompt, chosen.mask, stable)


def _object_mask(prompt: _Prompt, trimap: Bytes) -> Mask:
    """Segment from one trimap; if the mask collapses, try again with the ring as probable object.

    A box drawn inside the thing puts its colours into the ring and so into the background.
    """
    image = prompt.window.features
    mask = gc.clean(gc.grabcut(image, trimap), prompt.positive)
    if np.count_nonzero(mask) >= COLLAPSED * np.count_nonzero(prompt.extent):
        return mask
    generous = np.where(trimap == cv2.GC_PR_BGD, np.uint8(cv2.GC_PR_FGD), trimap)
    return gc.clean(gc.grabcut(image, generous), prompt.positive)


def _rated(prompt: _Prompt, mask: Mask, stable: dict[str, float]) -> Segmentation:
    """Return the mask in the picture, with its confidence and the cues that make it up.

    `stable` has the cues on how far other ways to the mask lead to the same result.
    """
    window = prompt.window
    if not mask.any() or mask.all():
        return _empty_segmentation(window.picture)
    mask = cut_openings(window.features, mask, prompt.positive)
    flooded = gc.watershed(window.features, prompt.core, prompt.trimaps[0])
    parts = stable | {
        "agreement": gc.iou(mask, flooded),
        "colour_separation": gc.colour_separation(window.features, mask),
        "prompt_fit": _prompt_fit(prompt, mask),
        "compactness": _compactness(mask),
        "edge_support": edge_support(window.features, mask),
    }
    return Segmentation(window.to_picture(mask), fitted_confidence(prompt.way, parts), parts)


def _empty_segmentation(picture: tuple[int, int]) -> Segmentation:
    return Segmentation(np.zeros(picture, dtype=np.bool_), 0.0, {})


def _prompt_fit(prompt: _Prompt, mask: Mask) -> float:
    """Return the overlap of the bounding boxes of the mask and of the prompt's extent."""
    return box_iou(gc.bounding_box(mask), gc.bounding_box(prompt.extent)) if mask.any() else 0.0


def _compactness(mask: Mask) -> float:
    """Return the share of its bounding box that a mask fills: thin things go wrong more easily."""
    x0, y0, x1, y1 = gc.bounding_box(mask)
    return np.count_nonzero(mask) / ((x1 - x0 + 1) * (y1 - y0 + 1))


def _box_trimap(shape: tuple[int, int], box: Points) -> Bytes:
    reach = RING * np.tile(box[2:] - box[:2], 2) * (-1, -1, 1, 1)
    return gc.trimap(gc.box_region(shape, box), gc.box_region(shape, box + reach))


def _moved_boxes(box: Points) -> list[Points]:
    step = BOX_SHIFT * np.tile(box[2:] - box[:2], 2)
    return [box + step * move for move in BOX_MOVES]


def _middle_ellipse(shape: tuple[int, int], box: Points) -> Mask:
    half = np.maximum(CORE * (box[2:] - box[:2]) / 2, 1)
    y, x = np.ogrid[: shape[0], : shape[1]]
    (cx, cy), (rx, ry) = (box[:2] + box[2:]) / 2, half
    return ((x - cx) / rx) ** 2 + ((y - cy) / ry) ** 2 <= 1


def _eroded(region: Mask) -> Mask:
    reach = OUTLINE_ERROR * np.sqrt(np.count_nonzero(region))
    depth = gc.distance_inside(region)
    size = 2 * int(np.ceil(2 * reach)) + 1
    half_width = np.asarray(cv2.dilate(depth, np.ones((size, size), dtype=np.uint8)))
    return depth > np.minimum(reach, THIN * half_width)


def discs(shape: tuple[int, int], centres: Iterable[Point], radius: float) -> Mask:
    """Return a mask (h, w) of the pixels within a radius of any of the centres."""
    y, x = np.ogrid[: shape[0], : shape[1]]
    region = np.zeros(shape, dtype=np.bool_)
    for cx, cy in centres:
        region |= (x - cx) ** 2 + (y - cy) ** 2 <= radius**2
    return region


def _dilated(region: Mask) -> Mask:
    reach = OUTLINE_REACH * np.sqrt(np.count_nonzero(region))
    beyond = cv2.distanceTransform((~region).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(beyond) <= reach


@dataclass(frozen=True)
class _Trial:
    """A proposed region as a prompt, the mask GrabCut made of it, and how much that stands out."""

    prompt: _Prompt
    mask: Mask
    distinctness: float

    @property
    def area(self) -> float:
        return self.prompt.window.picture_area(self.mask)


def _tried_regions(
    pixels: Bytes, regions: Iterable[Region], points: Sequence[Point], negative: Sequence[Point]
) -> list[_Trial]:
    found: list[_Trial] = []
    for region in regions:
        prompt = _region_prompt(pixels, region, region.box, points, negative)
        mask = _object_mask(prompt, prompt.trimaps[0])
        for _ in range(WIDENINGS):
            if not _cut_short(prompt, mask):
                break
            prompt = _region_prompt(pixels, region, _widened(prompt.box), points, negative)
            mask = _object_mask(prompt, prompt.trimaps[0])
        if mask.any() and not mask.all():
            found.append(_Trial(prompt, mask, _distinctness(prompt, mask)))
    return found


def _is_whole_of(outer: _Trial, part: _Trial) -> bool:
    """Return whether a mask holds another, is much larger (not just by a shadow) and distinct."""
    shared = part.prompt.window.transfer(part.mask, outer.prompt.window)
    held = int(np.count_nonzero(shared & outer.mask)) >= HELD * int(np.count_nonzero(shared))
    larger = outer.area >= MUCH_LARGER * part.area
    return held and larger and outer.distinctness >= RIVAL * part.distinctness


def _cut_short(prompt: _Prompt, mask: Mask) -> bool:
    """Return whether a mask runs along the sure background, which then cut it off."""
    touching = np.asarray(cv2.dilate((prompt.trimaps[0] == cv2.GC_BGD).astype(np.uint8), NEXT_TO))
    return int(np.count_nonzero(mask & (touching > 0))) > CUT_SHORT * np.sqrt(
        np.count_nonzero(mask)
    )


def _widened(box: Box) -> Box:
    x0, y0, x1, y1 = box
    dx, dy = WIDER * (x1 - x0), WIDER * (y1 - y0)
    return x0 - dx, y0 - dy, x1 + dx, y1 + dy


def _region_prompt(
    pixels: Bytes, region: Region, box: Box, points: Sequence[Point], negative: Sequence[Point]
) -> _Prompt:
    """Return a box prompt around a grown region, with the region's inside as sure object."""
    window = gc.window_around(pixels, box)
    on, off = window.to_work(points), window.to_work(negative)
    drawn = window.to_work((box[:2], box[2:])).ravel()
    core = _eroded(region.window.transfer(region.mask, window))
    trimap = _box_trimap(window.shape, drawn)
    trimap[core] = cv2.GC_FGD
    extent = gc.box_region(window.shape, drawn)
    return _Prompt(window, [pin(window.features, trimap, on, off)], extent, core, on, box, "point")


def _distinctness(prompt: _Prompt, mask: Mask) -> float:
    return _prompt_fit(prompt, mask) * gc.colour_separation(prompt.window.features, mask)


def _reproposal_stability(pixels: Bytes, tried: _Trial, proposer: Proposer) -> dict[str, float]:
    """Return the cue `stability`: how far other points well inside lead back to the mask.

    It is the mean over these points of the greatest overlap of a proposed region with the mask.
    """
    window, mask = tried.prompt.window, tried.mask
    overlaps: list[float] = []
    for point in _far_inside(mask, tried.prompt.positive):
        ((x, y),) = window.to_picture_points(point[None])
        regions = proposer(pixels, [(float(x), float(y))], PROPOSALS)
        shared = [gc.iou(mask, region.window.transfer(region.mask, window)) for region in regions]
        overlaps.append(max(shared, default=0.0))
    return {"stability": float(np.mean(overlaps)) if overlaps else 0.0}


def _far_inside(mask: Mask, points: Points) -> Points:
    """Return points (n, 2) well inside the mask, each the farthest from all before it."""
    depth = gc.distance_inside(mask)
    inside = np.argwhere(depth >= DEPTH * depth.max())[:, ::-1].astype(np.float64)
    chosen = list(points)
    for _ in range(REPROPOSALS):
        gaps = np.min([np.linalg.norm(inside - point, axis=1) for point in chosen], axis=0)
        chosen.append(inside[gaps.argmax()])
    return np.array(chosen[len(points) :])


def _bounding_box(points: Sequence[Point]) -> Box:
    (x0, y0), (x1, y1) = np.min(points, axis=0), np.max(points, axis=0)
    return float(x0), float(y0), float(x1), float(y1)
