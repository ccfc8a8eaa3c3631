"""Classifies shapes by their overlap with templates, at any size and turn.

A mask and each template are sampled on the same polar grid around their centroids, scaled to
equal area; the overlap at every turn is then one circular correlation.
"""

from collections.abc import Iterator
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ...geometry.outline import FloatArray
from .attributes import ShapeName

TURNS, RINGS = 96, 28
# Radius of the grid over the square root of the area: beyond the tips of slender stars and long
# rectangles.
REACH = 1.7
# With overlaps worse than this, a shape has no name.
IRREGULAR = 0.82
# Sizes of holes in rings and frames: wider steps would leave thin ones between two unnamed.
HOLES = (0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85)

Spectrum = NDArray[np.complex64]


class Template(NamedTuple):
    """A template on the polar grid: its Fourier transform along the turns, and weighted area."""

    name: ShapeName
    spectrum: Spectrum
    area: float


def shape_fits(polygon: Polygon) -> tuple[tuple[ShapeName, float], ...]:
    """Return the overlap (intersection over union) of a polygon with each shape class, best first.

    "irregular" is given the overlap that most blobs reach.
    """
    grid, area = _polar_grid(polygon)
    spectrum = np.fft.rfft(grid, axis=0)
    best: dict[ShapeName, float] = {"irregular": IRREGULAR}
    for template in _templates():
        shared = np.fft.irfft((spectrum * np.conj(template.spectrum)).sum(axis=1), TURNS).max()
        overlap = min(float(shared / (area + template.area - shared)), 1.0)  # rounding may exceed 1
        best[template.name] = max(best.get(template.name, 0.0), overlap)
    return tuple(sorted(best.items(), key=lambda item: -item[1]))


def _polar_grid(shape: BaseGeometry) -> tuple[FloatArray, float]:
    """Sample a shape on the polar grid (turns, rings), and return that and its weighted area.

    Each cell is weighted by the square root of its share of the area.
    """
    centre = shape.centroid
    radius = (np.arange(RINGS) + 0.5) * REACH * np.sqrt(shape.area) / RINGS
    angle = 2 * np.pi * np.arange(TURNS) / TURNS
    x = centre.x + np.cos(angle)[:, None] * radius
    y = centre.y + np.sin(angle)[:, None] * radius
    shapely.prepare(shape)
    weight = np.sqrt(radius / radius.sum())  # so that the product of two grids is weighted by area
    grid = np.asarray(shapely.contains_xy(shape, x, y), dtype=np.float64) * weight
    return grid, float((grid**2).sum())


@cache
def _templates() -> tuple[Template, ...]:
    found: list[Template] = []
    for name, shape in _drawn_shapes():
        grid, area = _polar_grid(shape)
        found.append(Template(name, np.fft.rfft(grid, axis=0).astype(np.complex64), area))
    return tuple(found)


def _drawn_shapes() -> Iterator[tuple[ShapeName, BaseGeometry]]:
    """Yield every class in the forms it comes in."""
    yield from _round_shapes()
    yield from _polygons()
    yield from _concave_shapes()


def _round_shapes() -> Iterator[tuple[ShapeName, BaseGeometry]]:
    disc = Polygon(_regular(64))
    yield "circle", disc
    for long in (1.35, 1.7, 2.2, 3.0):
        yield "oval", _stretched(disc, long)
    for hole in HOLES:
        yield "ring", disc.difference(Polygon(hole * _regular(64)))
    for shift in (0.4, 0.5, 0.6, 0.7):
        yield "crescent", disc.difference(Polygon(_regular(64) + np.array([shift, 0.0])))
    for stretch in (1.0, 1.2):
        yield "heart", _stretched(Polygon(_heart()), stretch)


def _polygons() -> Iterator[tuple[ShapeName, BaseGeometry]]:
    yield "square", shapely.box(0, 0, 1, 1)
    for long in (1.3, 1.6, 2.0, 2.6, 3.5, 5.0):
        yield "rectangle", shapely.box(0, 0, long, 1)
    for height in (0.7, 1.0, 1.4, 2.0):
        yield "triangle", Polygon([(0, 0), (1.15, 0), (0.575, height)])
    yield "triangle", Polygon([(0, 0), (1, 0), (0, 1)])
    yield "pentagon", Polygon(_regular(5))
    yield "hexagon", Polygon(_regular(6))
    for hole in HOLES:
        square, inner = shapely.box(-1, -1, 1, 1), shapely.box(-hole, -hole, hole, hole)
        for long in (1.0, 1.1, 1.2, 1.3, 1.4):
            yield "frame", _stretched(square.difference(inner), long)


def _concave_shapes() -> Iterator[tuple[ShapeName, BaseGeometry]]:
    for points in (4, 5, 6, 8):
        for inner in (0.38, 0.5) if points == 4 else (0.38, 0.5, 0.62):  # 0.62 looks square
            yield "star", Polygon(_star(points, inner))
    for arm in (0.25, 0.33, 0.42):
        yield "cross", shapely.box(-arm, -1, arm, 1).union(shapely.box(-1, -arm, 1, arm))
    for arm, long in product((0.13, 0.2, 0.26, 0.33), (1.0, 1.25, 1.5)):
        foot = shapely.box(0, 0, long, 2 * arm).union(shapely.box(0, 0, 2 * arm, 1))
        yield "L", foot
        yield "L", _flipped(foot)
    for arm, deep in ((0.25, 1.0), (0.33, 1.0), (0.25, 1.4)):
        bay = shapely.box(arm, arm, deep + 1, 1 - arm)
        yield "C", shapely.box(0, 0, deep, 1).difference(bay)
        yield (
            "T",
            shapely.box(0, 0, 1, arm).union(shapely.box((1 - arm) / 2, 0, (1 + arm) / 2, deep)),
        )
    ring = Polygon(_regular(64)).difference(Polygon(0.55 * _regular(64)))
    for mouth in (0.3, 0.5):
        yield "C", ring.difference(shapely.box(0, -mouth, 2, mouth))
    for head, shaft in product((0.4, 0.6), (0.15, 0.25)):
        yield "arrow", _arrow(head, shaft)


def _regular(count: int) -> FloatArray:
    angle = 2 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _star(points: int, inner: float) -> FloatArray:
    return _regular(2 * points) * np.where(np.arange(2 * points) % 2, inner, 1.0)[:, None]


def _stretched(shape: BaseGeometry, long: float) -> BaseGeometry:
    return shapely.transform(shape, lambda points: points * (long, 1.0))


def _flipped(shape: BaseGeometry) -> BaseGeometry:
    return shapely.transform(shape, lambda points: points * (-1.0, 1.0))


def _heart() -> FloatArray:
    """Return points (64, 2) on a common heart curve: a cubed sine against four cosines."""
    t = 2 * np.pi * np.arange(64) / 64
    x = 16 * np.sin(t) ** 3
    y = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    return np.stack([x, y], axis=1)


def _arrow(head: float, shaft: float) -> Polygon:
    half = [(1.0, 0.0), (1 - 2 * head, 0.6), (1 - 2 * head, shaft), (-1.0, shaft)]
    return Polygon([*half, *((x, -y) for x, y in reversed(half[1:]))])
