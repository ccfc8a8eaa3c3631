"""Reads masks stored as pixels: images whose values number the things, and COCO's run lengths.

Sizes are compared with the picture's before anything is decoded, so that a hostile file costs
nothing.
"""

import io
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .shapes import Shape, Size, check_size, fields, items, refusal

VOID = 255
"""The value with which palette images mark borders between things (Pascal VOC)."""
SOFT_LEVELS, SOFT_SHARE = 16, 0.3
"""More grey levels than this, on less than this share of the thing, are its smooth edge."""
MOST_RUNS = 4 << 20
"""The most characters of a mask's run lengths, more than a 50-megapixel picture has edge pixels."""


def label_image(data: bytes, size: Size) -> list[Shape]:
    """Read the things of a PNG: every value except 0 is one.

    Raises:
        InputError: it has another size, is damaged, or is a colour picture.
    """
    check_size(tuple(int.from_bytes(data[i : i + 4]) for i in (16, 20)), size)  # from the header
    try:
        with Image.open(io.BytesIO(data), formats=("PNG",)) as opened:
            opened.load()
            values = _values(opened)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        raise refusal("it is no PNG that can be decoded", "export it again") from None
    found = np.flatnonzero(np.bincount(values.ravel(), minlength=2)[1:]) + 1
    if opened.mode == "P" and len(found) > 1:
        found = found[found != VOID]
    if opened.mode in ("L", "LA", "RGB", "RGBA") and _is_soft(values, len(found)):
        values, found = (values > 127).astype(np.uint8), np.ones(1, dtype=int)
    names = [f"value {v}" for v in found] if len(found) > 1 else [""]
    return [Shape(n, partial(np.equal, values, v)) for n, v in zip(names, found, strict=False)]


def _values(image: Image.Image) -> NDArray[np.integer]:
    """Return the image's values (H, W), 0 where there is nothing."""
    if image.mode == "1":
        return np.asarray(image).astype(np.uint8)
    if image.mode in ("L", "P", "I;16", "I"):
        return np.asarray(image).astype(np.int64 if image.mode == "I" else np.uint16)
    if "A" in image.getbands() and image.getchannel("A").getextrema()[0] == 0:
        return np.asarray(image.getchannel("A"))  # a cut-out with a transparent background
    channels = [np.asarray(c) for c in image.convert("RGB").split()]
    if any((c != channels[0]).any() for c in channels[1:]):
        raise refusal("it is a colour picture, no mask", "save it as grey or palette values")
    return channels[0]


def _is_soft(values: NDArray[np.integer], levels: int) -> bool:
    """Return whether the grey values are just the smooth edge of one white thing."""
    between = int(np.count_nonzero((values > 0) & (values < VOID)))
    return levels > SOFT_LEVELS and between < SOFT_SHARE * int(np.count_nonzero(values))


def run_lengths(found: Any, size: Size) -> NDArray[np.bool_]:
    """Decode the mask (H, W) from COCO's run lengths, compressed or not: column-major, 0 first.

    Raises:
        InputError: the size is missing or another one, or the runs do not fill it.
    """
    given = items(fields(found).get("size"))
    if len(given) != 2:
        raise refusal("its run lengths have no size", "give [height, width]")
    check_size((given[1], given[0]), size)
    counts = fields(found).get("counts")
    runs = _decompressed(counts) if isinstance(counts, str) else items(counts)
    whole = all(type(run) is int and run >= 0 for run in runs)
    if not whole or sum(cast("list[int]", runs)) != size[0] * size[1]:
        raise refusal(
            f"its run lengths do not fill {size[0]} x {size[1]} px", "export the mask again"
        )
    flat = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    return np.ascontiguousarray(flat.reshape(size).T)


def _decompressed(text: str) -> list[int]:
    """Decode COCO's compressed run lengths.

    Each character holds 5 bits, lowest first; each run is stored less the run two before it.
    """
    runs: list[int] = []
    value = shift = 0
    for character in text.encode() if len(text) <= MOST_RUNS else b"\0":
        bits = character - 48
        if not 0 <= bits < 64 or shift > 35:
            raise refusal("its compressed run lengths cannot be read", "export the mask again")
        value |= (bits & 31) << shift
        shift += 5
        if not bits & 32:
            value -= (bits & 16) << (shift - 4) if bits & 16 else 0
            runs.append(value + (runs[-2] if len(runs) > 2 else 0))
            value = shift = 0
    return runs
