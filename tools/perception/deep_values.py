"""Pictures of more than 8 bits as 8 bits, with the contrast a person would expect.

A few dead pixels, or a value that stands for none, must not stretch the range so far that nothing
is left of the rest: they are left out of account, shown black or white, and said.
"""

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

FEW = 0.01
"""Share of dead pixels; a single value that stands for none may take up to half of the picture."""
NOISE = 12
"""Times the usual step between neighbours; what spans less is noise, whatever lies beyond it."""
MARGIN = 32
"""Shades between what is left out of account and the rest."""
SAMPLED = 1_000_000
"""Values among which the range is looked for."""
FULL = 1 << 14
"""Colour that reaches so far uses its 16 bits, and is no less deep a picture stored in them."""


def as_8_bits(image: Image.Image, data: bytes | None) -> tuple[Image.Image, str]:
    """The picture with 8 bits a channel, and a note, which may be empty.

    Values that all lie in 0..255 stay as they are, floats that all lie in 0..1 are multiplied by
    255, colour that uses its 16 bits is divided by 257; else the smallest value becomes black and
    the largest white. NaN and -inf become black, +inf white.

    Args:
        image: decoded.
        data: the file, if it has 16 bits of each colour, of which Pillow drops the lower 8; with
            transparency they stay dropped.
    """
    if image.mode == "F" or image.mode.startswith("I"):
        grey, note = _scaled(np.array(image, dtype=np.float64), "grey", whole=image.mode != "F")
        return Image.fromarray(grey), note
    if data is None or image.mode != "RGB":
        return image, ""
    found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if found is None or found.dtype != np.uint16 or found.ndim != 3 or found.shape[2] < 3:
        return image, ""
    rgb, note = _scaled(found[:, :, 2::-1].astype(np.float32), "colour", whole=True)
    return Image.fromarray(rgb), note


def _scaled(
    values: NDArray[np.floating], what: str, *, whole: bool
) -> tuple[NDArray[np.uint8], str]:
    least, greatest = _range(values, step=1 if whole else 0)
    finite = np.isfinite(values)
    kept = finite & (values >= least) & (values <= greatest)
    low = float(values.min(where=kept, initial=np.inf))
    high = float(values.max(where=kept, initial=-np.inf))
    beyond = int(finite.sum() - kept.sum())
    black, white, notes = 0.0, 255.0, list[str]()
    if not whole and low >= 0 and high <= 1:
        low, high = 0.0, 1.0
    elif low >= 0 and high <= 255:
        low, high = 0.0, 255.0
    elif what == "colour" and high >= FULL:
        low, high = 0.0, 65535.0
    else:
        notes.append(f"{what} values {low:g} to {high:g} stretched from black to white")
        black += MARGIN * (least > -np.inf)
        white -= MARGIN * (greatest < np.inf)
    if beyond:
        notes.append(f"{beyond:,} dead or empty ones left out of account")
    # In place: at 50 megapixels every copy of float64 costs 400 MB.
    values -= low
    values *= (white - black) / (high - low or 1.0)
    values += black + 0.5
    values[~kept & (values < black)] = 0
    values[~kept & (values > white)] = 255
    np.clip(values, 0, 255, out=values)
    np.nan_to_num(values, copy=False, nan=0.0)
    return values.astype(np.uint8), ", ".join(notes)


def _range(values: NDArray[np.floating], step: float) -> tuple[float, float]:
    """The least and the greatest value that count, infinite where all do; of values in steps."""
    rows = values[:: max(1, values.size // SAMPLED)]
    with np.errstate(invalid="ignore"):
        steps = np.abs(np.diff(rows, axis=1))
    seen = steps[np.isfinite(steps)]
    noise = NOISE * max(step, float(np.median(seen)) if seen.size else 0.0)
    ranked = np.sort(rows[np.isfinite(rows)])
    bounds = [np.inf, np.inf]  # of the values, and of the same with the other sign
    for turn in (0, 1, 0, 1):
        last = _last(ranked, noise)
        if last < len(ranked) - 1:
            bounds[turn] = float(ranked[last])
        ranked = -ranked[last::-1]
    return -bounds[1], bounds[0]


def _last(ranked: NDArray[np.floating], noise: float) -> int:
    """The last of (n,) sorted values that is not alone: further on than all before it span."""
    index = np.arange(max(len(ranked) - 1, 0))
    span = ranked[:-1] - ranked[:1]
    alone = (np.diff(ranked) > span) & (span > noise) & (index >= len(ranked) // 2)
    alone &= (len(ranked) - 1 - index <= FEW * len(ranked)) | (ranked[1:] == ranked[-1:])
    return int(np.argmax(alone)) if alone.any() else len(ranked) - 1
