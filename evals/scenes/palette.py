"""Colours a person names without hesitation, and how far apart two colours look."""

import colorsys
import math

from numpy.random import Generator

RGB = tuple[float, float, float]
"""Red, green, blue, 0 to 255."""

VISIBLE = 22.0
"""Least difference from the ground at which a person sees a thing at a glance, CIELAB units."""

NAMED: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "red": ((-6, 5), (0.78, 0.95), (0.68, 0.88)),
    "orange": ((25, 31), (0.88, 1.0), (0.93, 1.0)),
    "yellow": ((51, 56), (0.75, 0.95), (0.9, 1.0)),
    "green": ((112, 140), (0.55, 0.85), (0.42, 0.66)),
    "blue": ((214, 228), (0.65, 0.9), (0.55, 0.88)),
    "purple": ((275, 286), (0.5, 0.75), (0.45, 0.65)),
    "pink": ((332, 344), (0.32, 0.48), (0.96, 1.0)),
    "brown": ((20, 27), (0.58, 0.7), (0.36, 0.46)),
    "black": ((0, 360), (0.0, 0.15), (0.07, 0.13)),
    "grey": ((0, 360), (0.0, 0.04), (0.46, 0.58)),
    "white": ((0, 360), (0.0, 0.03), (0.94, 1.0)),
}
"""Hue in degrees, saturation and value: ranges well inside each name."""


def shade(random: Generator, name: str) -> RGB:
    """Return a random colour of that name."""
    hue, saturation, value = (random.uniform(low, high) for low, high in NAMED[name])
    red, green, blue = colorsys.hsv_to_rgb(hue / 360 % 1, saturation, value)
    return 255 * red, 255 * green, 255 * blue


def lit(colour: RGB, factor: float) -> RGB:
    """Return the colour under more (factor > 1) or less light; more light whitens dark colours."""
    lift = 30 * max(factor - 1, 0)
    red, green, blue = (min(max(channel * factor + lift, 0), 255) for channel in colour)
    return red, green, blue


def difference(a: RGB, b: RGB) -> float:
    """Return the distance in CIELAB (CIE 1976): 2 is just visible, 100 is black against white."""
    return math.dist(_lab(a), _lab(b))


def _lab(colour: RGB) -> tuple[float, float, float]:
    red, green, blue = (_linear(channel / 255) for channel in colour)
    x = _root((0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.9505)
    y = _root(0.2126 * red + 0.7152 * green + 0.0722 * blue)
    z = _root((0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.089)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def _linear(channel: float) -> float:
    return channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4


def _root(value: float) -> float:
    return value ** (1 / 3) if value > 0.008856 else 7.787 * value + 16 / 116
