"""Removes the shadow that a thing casts from its mask.

A shadow differs from the ground as much as the thing does, so colour models take both. But it is
dark, hardly coloured, lies along one side of the thing, and reaches out of the box around it.
"""

import cv2
import numpy as np

from .grabcut import (
    Bytes,
    Floats,
    Mask,
    Points,
    bounding_box,
    clean,
    colour_separation,
    lightness_and_chroma,
    pieces,
)
from .region_growing import box_iou, filled

# A shadow is darker than the ground and than the thing by this much lightness (CIE L*), and has
# no more chroma than this.
DARKER_THAN_GROUND, DARKER_THAN_THING, CHROMA = 12.0, 20.0, 14.0
# The shadow's share of a mask that holds both.
LEAST_SHARE, MOST_SHARE = 0.06, 0.55
# Least shares of its rim beside the thing and on the outside.
BESIDE, OUTSIDE = 0.35, 0.12
# Without it, the box fits and the colours stand out as well as before, up to this much.
FIT_SLACK, SEPARATION_SLACK = 0.003, 0.02
# Colours need not stand out as clearly if the ground's L* is between those of thing and shadow, and
# this far from each.
ON_EACH_SIDE = 15.0
# What is left without it is one thing: its largest piece holds at least this share.
IN_ONE_PIECE = 0.9
NEXT = np.ones((3, 3), np.uint8)
NEAR = np.ones((5, 5), np.uint8)


def without_cast_shadow(image: Bytes, mask: Mask, box: Points, ground: Mask, keep: Points) -> Mask:
    """Return the mask (h, w) without the part that is most likely a shadow, or unchanged.

    Args:
        image: (h, w, 3), features of the window.
        mask: (h, w), the thing, perhaps with its shadow; not empty.
        box: (4,), drawn around the thing, px of the window.
        ground: (h, w), pixels that are surely not the thing.
        keep: (n, 2), points that are surely on the thing.
    """
    lightness, chroma = lightness_and_chroma(image)
    lit = float(np.median(lightness[ground if ground.any() else ~mask]))
    drawn = (float(box[0]), float(box[1]), float(box[2]), float(box[3]))
    best, best_fit = mask, box_iou(bounding_box(mask), drawn) - FIT_SLACK
    clear = colour_separation(image, mask) - SEPARATION_SLACK
    for shadow in _dark_parts(mask, lightness, lit):
        thing = _thing_beside(mask, shadow, keep)
        if thing is None or float(np.median(chroma[shadow])) > CHROMA:
            continue
        bright, dark = float(np.median(lightness[thing])), float(np.median(lightness[shadow]))
        apart = bright - lit > ON_EACH_SIDE and lit - dark > ON_EACH_SIDE
        clearer = apart or colour_separation(image, thing) >= clear
        fit = box_iou(bounding_box(thing), drawn)
        if bright - dark > DARKER_THAN_THING and clearer and fit >= best_fit:
            best, best_fit = thing, fit
    return best


def _dark_parts(mask: Mask, lightness: Floats, lit: float) -> list[Mask]:
    """Return the larger parts of a mask that are darker than the rest and the ground.

    If there are several, all of them together are another one.
    """
    levels = np.rint(2.55 * lightness[mask]).clip(0, 255).astype(np.uint8)
    split, _ = cv2.threshold(levels[:, None], 0, 255, cv2.THRESH_OTSU)
    dark = mask & (lightness <= min(split / 2.55, lit - DARKER_THAN_GROUND))
    opened = cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_OPEN, NEXT)
    labels, areas = pieces(np.asarray(opened) > 0, 4)
    share = areas[1:] / np.count_nonzero(mask)
    large = 1 + np.flatnonzero((share >= LEAST_SHARE) & (share <= MOST_SHARE))
    parts = [labels == i for i in large]
    return [*parts, np.isin(labels, large)] if len(parts) > 1 else parts


def _thing_beside(mask: Mask, shadow: Mask, keep: Points) -> Mask | None:
    """Return a mask without a dark part; None if the part does not lie as a shadow does.

    A windscreen has the thing all round it or divides it; a shadow lies between the thing and the
    outside.
    """
    without = mask & ~_spread(shadow, NEXT)
    left = clean(without, keep)
    largest = max(pieces(left, 8)[1][1:], default=0)
    if largest < max(1, IN_ONE_PIECE * np.count_nonzero(without)):
        return None
    thing = _spread(left, NEXT) & mask
    rim = shadow & _spread(~shadow, NEXT)
    beside = np.mean(_spread(thing, NEAR)[rim])
    outside = np.mean(_spread(~filled(mask), NEXT)[rim])
    return thing if beside >= BESIDE and outside >= OUTSIDE else None


def _spread(mask: Mask, kernel: Bytes) -> Mask:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel)) > 0
