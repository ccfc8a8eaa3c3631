"""What the drawings of things share: regions of one colour, darker edges, plain shapes."""

import math
from collections.abc import Callable

from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from .palette import RGB, lit
from .things import Part

Draw = Callable[[Generator, RGB], list[Part]]
GLASS: RGB = (38, 46, 58)


def plain(shape: Callable[[Generator], Polygon], edge: float = 0.35) -> Draw:
    """One colour, with a darker edge at the rate `edge` and a highlight at times."""

    def parts(random: Generator, colour: RGB) -> list[Part]:
        outline = shape(random)
        if random.random() >= edge:
            return [Part(outline, colour)]
        return edged(outline, colour, random.uniform(0.02, 0.05), random.uniform(0.5, 0.75))

    return parts


def edged(outline: Polygon, colour: RGB, width: float, dark: float) -> list[Part]:
    """A darker edge, `width` of the size wide, around the colour."""
    inner = outline.buffer(-width * math.sqrt(outline.area))
    return [Part(outline, lit(colour, dark)), Part(inner, colour)]


def shrunk(outline: BaseGeometry, share: float) -> BaseGeometry:
    """Scaled about its middle."""
    return affinity.scale(outline, share, share)
