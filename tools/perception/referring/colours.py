"""Names pixels by the eleven basic colour terms, shared out where two of them meet.

A pixel is named by the exemplars nearest to it in CIE Lab: a colour between red and orange counts
as partly both.
"""

from functools import cache

import cv2
import numpy as np

from ..segmenters.grabcut import Bytes, Floats
from .attributes import ColourName

EXEMPLARS: dict[ColourName, str] = {
    "red": "ff0000 e01b24 c8102e b22222 8b0000 a52030 e84545 701010 c04048",
    "orange": "ff8c00 ff7518 f28500 e8762b ffa500 cc6a1f ff9a45 e06000 ff4500",
    "yellow": "ffff00 ffd700 f5d033 ffe135 e6c200 fff380 f0e060 d0b830 e8d890",
    "green": "00ff00 008000 228b22 2e8b57 90ee90 556b2f 6b8e23 3cb371 004d00 9acd32 4f7a4a 00a86b "
    "5c7050 a0c890 30503a",
    "blue": "0000ff 1e90ff 4169e1 00008b 87ceeb 4682b4 add8e6 000050 5f9ea0 00bfff 00b5c8 27408b "
    "2840c8 1c39bb 3a5fcd 191970 6080b0 306090 008b9a 3a5060",
    "purple": "800080 9932cc 6a0dad 4b0082 8a2be2 9370db ba55d3 5d3a7a b19cd9 7b5090",
    "pink": "ffc0cb ff69b4 ff1493 f4a6c0 e8829c ffb6c1 db7093 ff00ff d85aa0",
    "brown": "8b4513 a0522d 654321 7b3f00 5c4033 964b00 9c6b4a b08050 c4a484 4a2c14 a67b5b d2b48c "
    "8a7050 6a5540",
    "black": "000000 111111 1c1c1c 1a1a22 221c18 101810 282828",
    "grey": "808080 696969 a9a9a9 4a4a4a 5a5a60 909590 b4b4b4 c0c0c4 353535 707880 9a958c 68665f "
    "b5b0a8",
    "white": "ffffff f8f8f8 f0f0f0 e8e8e8 faf5ea eef2f8 f5f0e6 e2e2e6",
}
NAMES = tuple(EXEMPLARS)
# How far, in Lab, an exemplar's name reaches: about the step people call another shade.
REACH = 6.0
BITS = 5


def colour_shares(rgb: Bytes) -> tuple[tuple[ColourName, float], ...]:
    """Colour names of pixels (n, 3) with their shares, the largest first."""
    levels = (rgb >> (8 - BITS)).astype(np.int64)
    index = (levels[:, 0] << 2 * BITS) | (levels[:, 1] << BITS) | levels[:, 2]
    shares = _name_table()[index].mean(axis=0)
    named = zip(NAMES, shares.tolist(), strict=True)
    return tuple(sorted(named, key=lambda name_share: -name_share[1]))


def lab_of(rgb: Bytes) -> Floats:
    """CIE Lab (n, 3) of sRGB pixels (n, 3); L* 0 to 100."""
    scaled = rgb.astype(np.float32)[None] / 255
    return np.asarray(cv2.cvtColor(scaled, cv2.COLOR_RGB2LAB), dtype=np.float32)[0]


@cache
def _name_table() -> Floats:
    """The share of each name (8 ** BITS, names) for every coarse RGB colour."""
    step = 2 ** (8 - BITS)
    axis = np.arange(2**BITS) * step + step // 2
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    lab = lab_of(cube.astype(np.uint8))
    weight = np.zeros((len(cube), len(NAMES)), dtype=np.float32)
    nearest = np.full(len(cube), np.inf, dtype=np.float32)
    away: list[Floats] = []
    for name in NAMES:
        exemplars = lab_of(np.frombuffer(bytes.fromhex(EXEMPLARS[name]), np.uint8).reshape(-1, 3))
        away.append(np.min([np.linalg.norm(lab - e, axis=1) for e in exemplars], axis=0))
        nearest = np.minimum(nearest, away[-1])
    for k, distance in enumerate(away):
        weight[:, k] = np.exp(-(distance - nearest) / REACH)
    return weight / weight.sum(axis=1, keepdims=True)
