"""A scale, a point or a box that a person gives in words, where a front end has no other way.

Only a whole message in one of a few forms counts; anything else is left to the model.
"""

import re

from ..tools.perception.target_prompt import TargetPrompt

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001} | dict.fromkeys(("metres", "meters", "metre"), 1.0)
NUMBER = r"(\d{1,6}(?:\.\d{1,6})?)"
LENGTH = rf"{NUMBER} ?({'|'.join(sorted(METRES, key=len, reverse=True))})"
SIDE = re.compile(
    rf"(?:the )?(?:picture|image|photo|scene) is {LENGTH} (wide|across|high|tall)", re.I
)
PIXEL = re.compile(
    rf"(?:1|one|a) (?:px|pixel) (?:is|=) {LENGTH}|{LENGTH} (?:per|a) (?:px|pixel)", re.I
)
PLACE = rf"\(?{NUMBER}, ?{NUMBER}\)?"
POINT = re.compile(rf"(?:the )?(?:thing|one) at {PLACE}", re.I)
BOX = re.compile(rf"(?:the )?(?:thing|one) (?:between|in) {PLACE} (?:and|to) {PLACE}", re.I)
GIVEN = "1 px is {:.4g} mm, so the picture is {:.4g} m wide and {:.4g} m high."
AGAIN = " Plans made before are void; say again what to do."


def scale_said(words: str, size: tuple[int, int]) -> float | None:
    """Return the metres per pixel that words give a picture of a size, or None."""
    said = words.strip(" .!")
    if (side := SIDE.fullmatch(said)) is not None:
        number, unit, which = side.groups()
        pixels = size[0] if which.lower() in ("wide", "across") else size[1]
    elif (pixel := PIXEL.fullmatch(said)) is not None:
        number, unit = filter(None, pixel.groups())
        pixels = 1
    else:
        return None
    return float(number) * METRES[unit.lower()] / pixels or None


def scale_told(scale: float, size: tuple[int, int]) -> str:
    """Return how a scale is told back to the person."""
    return GIVEN.format(scale * 1_000, scale * size[0], scale * size[1])


def place_said(words: str) -> TargetPrompt | None:
    """Return what "the thing at 320, 240" or "between 300, 200 and 340, 280" points at, or None."""
    said = words.strip(" .!")
    if (point := POINT.fullmatch(said)) is not None:
        x, y = map(float, point.groups())
        return TargetPrompt(points=((x, y),))
    if (box := BOX.fullmatch(said)) is not None:
        x0, y0, x1, y1 = map(float, box.groups())
        return TargetPrompt(box=(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)))
    return None
