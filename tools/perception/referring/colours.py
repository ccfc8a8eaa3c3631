"""Names pixels by the eleven basic colour terms, with shares where two of them meet.

A pixel is named by the exemplars nearest to it in CIE Lab: a colour between red and orange counts
as partly both. The exemplars, sRGB in hexadecimal digits, are in `colours.json`.
"""

import json
from functools import cache
from importlib.resources import files
from typing import get_args

import cv2
import numpy as np

from ..segmenters.grabcut import Bytes, Floats
from .attributes import ColourName

NAMES: tuple[ColourName, ...] = get_args(ColourName)
# How far, in Lab, an exemplar's name reaches: about the step that people call another shade.
REACH = 6.0
BITS = 5


def colour_shares(rgb: Bytes) -> tuple[tuple[ColourName, float], ...]:
    """Return the colour names of sRGB pixels (n, 3) with their shares, the largest first."""
    levels = (rgb >> (8 - BITS)).astype(np.int64)
    index = (levels[:, 0] << 2 * BITS) | (levels[:, 1] << BITS) | levels[:, 2]
    shares = _name_table()[index].mean(axis=0)
    named = zip(NAMES, shares.tolist(), strict=True)
    return tuple(sorted(named, key=lambda name_share: -name_share[1]))


def lab_of(rgb: Bytes) -> Floats:
    """Convert sRGB pixels (n, 3) to CIE Lab (n, 3); L* is 0 to 100."""
    scaled = rgb.astype(np.float32)[None] / 255
    return np.asarray(cv2.cvtColor(scaled, cv2.COLOR_RGB2LAB), dtype=np.float32)[0]


@cache
def _name_table() -> Floats:
    """Return the share of each name for every coarse RGB colour, (8 ** BITS, names)."""
    step = 2 ** (8 - BITS)
    axis = np.arange(2**BITS) * step + step // 2
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    lab = lab_of(cube.astype(np.uint8))
    weight = np.zeros((len(cube), len(NAMES)), dtype=np.float32)
    nearest = np.full(len(cube), np.inf, dtype=np.float32)
    away: list[Floats] = []
    written = json.loads((files(__package__ or "") / "colours.json").read_text("utf-8"))
    for name in NAMES:
        exemplars = lab_of(np.frombuffer(bytes.fromhex(written[name]), np.uint8).reshape(-1, 3))
        away.append(np.min([np.linalg.norm(lab - e, axis=1) for e in exemplars], axis=0))
        nearest = np.minimum(nearest, away[-1])
    for k, distance in enumerate(away):
        weight[:, k] = np.exp(-(distance - nearest) / REACH)
    return weight / weight.sum(axis=1, keepdims=True)
