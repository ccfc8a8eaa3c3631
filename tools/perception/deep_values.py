"""Reduces pictures of more than 8 bits to 8, with the contrast a person would expect.

A few dead pixels, or a no-data value, must not stretch the range so far that nothing is left of
the rest: they are ignored in choosing the range, shown black or white, and mentioned in the note.
"""

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

FEW = 0.01
"""Greatest share of dead pixels; a single no-data value may fill up to half of the picture."""
NOISE = 12
"""A span below this many median steps between neighbours is noise, whatever lies beyond it."""
MARGIN = 32
"""Shades of grey between ignored values and the rest."""
SAMPLED = 1_000_000
"""Number of values sampled to find the range."""
FULL = 1 << 14
"""Colour that reaches this value uses all 16 bits; below, a shallower picture is stored in them."""


def as_8_bits(image: Image.Image, data: bytes | None) -> tuple[Image.Image, str]:
    """Return the picture with 8 bits per channel, and a note, which may be empty.

    Values that all lie in 0..255 stay as they are, floats that all lie in 0..1 are multiplied by
    255, and colour that uses its 16 bits is divided by 257; otherwise the smallest value becomes
    black and the largest white. NaN and -inf become black, +inf white.

    Args:
        image: the decoded picture.
        data: the file's content if it has 16 bits per colour, of which Pillow drops the lower 8;
            pictures with transparency are left with Pillow's 8 bits.
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
    """Return the least and greatest values that count; infinite where nothing is ignored.

    `step` is the least step between different values, 0 if they are continuous.
    """
    rows = values[:: max(1, values.size // SAMPLED)]
    with np.errstate(invalid="ignore"):
        steps = np.abs(np.diff(rows, axis=1))
    seen = steps[np.isfinite(steps)]
    noise = NOISE * max(step, float(np.median(seen)) if seen.size else 0.0)
    ranked = np.sort(rows[np.isfinite(rows)])
    bounds = [np.inf, np.inf]  # upper bounds of the values, and of the negated values
    for turn in (0, 1, 0, 1):
        last = _last_inlier(ranked, noise)
        if last < len(ranked) - 1:
            bounds[turn] = float(ranked[last])
        ranked = -ranked[last::-1]
    return -bounds[1], bounds[0]


def _last_inlier(ranked: NDArray[np.floating], noise: float) -> int:
    """Return the index of the last of sorted values (n,) before any outliers.

    Outliers are few, or all equal, in the upper half, and the gap up to them is wider than the
    span of all values below it, which exceeds `noise`.
    """
    index = np.arange(max(len(ranked) - 1, 0))
    span = ranked[:-1] - ranked[:1]
    alone = (np.diff(ranked) > span) & (span > noise) & (index >= len(ranked) // 2)
    alone &= (len(ranked) - 1 - index <= FEW * len(ranked)) | (ranked[1:] == ranked[-1:])
    return int(np.argmax(alone)) if alone.any() else len(ranked) - 1
