"""Helpers for drawing things: regions of one colour, darker edges, plain shapes."""

import math
from collections.abc import Callable, Sequence

import shapely
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from . import polygons as shapes
from .palette import RGB, lit
from .things import Part

Draw = Callable[[Generator, RGB], list[Part]]
GLASS: RGB = (38, 46, 58)


def plain(shape: Callable[[Generator], Polygon]) -> Draw:
    """Return a drawing of a shape in one colour, with a darker edge at times."""

    def parts(random: Generator, colour: RGB) -> list[Part]:
        outline = shape(random)
        if random.random() >= 0.35:
            return [Part(outline, colour)]
        return edged(outline, colour, random.uniform(0.02, 0.05), random.uniform(0.5, 0.75))

    return parts


def edged(outline: Polygon, colour: RGB, width: float, dark: float) -> list[Part]:
    """Return an outline in a colour with a darker edge, `width` of the size wide."""
    inner = outline.buffer(-width * math.sqrt(outline.area))
    return [Part(outline, lit(colour, dark)), Part(inner, colour)]


def boarded(ratio: float, dark: float, boards: Sequence[Polygon], colour: RGB) -> list[Part]:
    """Return boards on a darker rectangle, 1 high and `ratio` long."""
    return [
        Part(shapes.rectangle(ratio), lit(colour, dark)),
        Part(shapely.union_all(boards), colour),
    ]


def dots_around(
    random: Generator, count: int, far: tuple[float, float], radius: float
) -> list[Polygon]:
    """Return discs at random angles about the origin, between two distances from it."""
    turns, radii = random.uniform(0, 6.3, count), random.uniform(*far, count)
    return [
        shapes.circle(radius, r * math.cos(t), r * math.sin(t))
        for t, r in zip(turns, radii, strict=True)
    ]


def shrunk(outline: BaseGeometry, share: float) -> BaseGeometry:
    """Return the outline scaled about its middle."""
    return affinity.scale(outline, share, share)
