"""Placement of things in the picture: scattered or in rows.

Things keep half the larger one's size from each other, and room for a ring from the border.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.random import Generator
from shapely.geometry import Polygon

from ...tools.formation.contract import CLEARANCE_SHARE, MIN_CLEARANCE
from .things import Thing

GAP = 0.52
"""Least gap between two things, as a share of the larger one's size."""
TRIES = 60
Point = tuple[float, float]


@dataclass(frozen=True)
class Rows:
    """Things placed on a grid: the grid's cells, their width and height, and its turn, degrees."""

    things: list[Thing]
    cells: list[Point]
    box: tuple[float, float]
    turn: float


def clearance(thing: Thing) -> float:
    """Return how far from a thing its robots stand by default, px."""
    return max(MIN_CLEARANCE, CLEARANCE_SHARE * thing.size)


def room(thing: Thing, size: tuple[int, int]) -> float:
    """Return the distance of a thing's bounding box from the nearest border, px."""
    x0, y0, x1, y1 = thing.polygon.bounds
    return min(x0, y0, size[0] - 1 - x1, size[1] - 1 - y1)


def scatter(
    random: Generator,
    area: Sequence[float],
    things: Sequence[Thing],
    turns: Sequence[float],
    anchors: Mapping[int, Point],
    taken: Sequence[Thing] = (),
) -> list[Thing] | None:
    """Place things at random in an area; those that find no place are left out.

    Args:
        area: x0, y0, x1, y1 that holds them with room for a ring.
        things: about the origin.
        turns: degrees, one per thing.
        anchors: fixed places of some by index; None is returned if one of these is not free.
        taken: things that are placed already.
    """
    placed: dict[int, Thing] = {}
    order = sorted(range(len(things)), key=lambda i: (i not in anchors, -things[i].size))
    for i in order:
        turned = things[i].moved(0, 0, turns[i])
        low, high = _free_span(turned, area)
        if i in anchors:
            spots = np.asarray([anchors[i]])
        elif (low < high).all():
            spots = random.uniform(low, high, (TRIES, 2))
        else:
            continue
        for x, y in spots:
            inside = low[0] <= x <= high[0] and low[1] <= y <= high[1]
            if inside and _free(turned, x, y, [*taken, *placed.values()]):
                placed[i] = things[i].moved(float(x), float(y), turns[i])
                break
        else:
            if i in anchors:
                return None
    return [placed[i] for i in sorted(placed)]


def _free_span(thing: Thing, area: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    x0, y0, x1, y1 = thing.polygon.bounds
    off = clearance(thing) + 3
    low = np.array([area[0] - x0 + off, area[1] - y0 + off])
    return low, np.array([area[2] - x1 - off, area[3] - y1 - off])


def _free(thing: Thing, x: float, y: float, others: Sequence[Thing]) -> bool:
    reach = float(shapely.minimum_bounding_radius(thing.polygon))
    close: list[tuple[Thing, float]] = []
    for other in others:
        gap = GAP * max(thing.size, other.size)
        apart = math.dist((x, y), other.place)
        if apart < gap:
            return False
        if apart < gap + 2 * (reach + float(shapely.minimum_bounding_radius(other.polygon))):
            close.append((other, gap))
    here = Polygon(thing.moved(x, y, 0).polygon.exterior)
    return all(here.distance(Polygon(other.polygon.exterior)) >= gap for other, gap in close)


def rows(
    random: Generator,
    area: Sequence[float],
    things: Sequence[Thing],
    turn: float,
    turns: Sequence[float],
) -> Rows | None:
    """Place things on cells of a grid turned by `turn`; None if the area is too small.

    Args:
        turns: degrees of each thing relative to the grid.
    """
    gap = GAP * max(thing.size for thing in things) + 2
    spans = np.array(
        [thing.moved(0, 0, t).polygon.bounds for thing, t in zip(things, turns, strict=True)]
    )
    half = np.abs(spans).max(axis=0)
    wide = 2 * max(half[0], half[2]) + gap * random.uniform(1, 1.5)
    high = 2 * max(half[1], half[3]) + gap * random.uniform(1, 1.25)
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    steps = np.arange(-12, 13)
    column, row = np.meshgrid(steps, steps)
    grid = np.stack([column.ravel() * wide, row.ravel() * high], axis=1)
    grid += random.uniform(-0.5, 0.5, 2) * (wide, high)
    middle = np.array([area[0] + area[2], area[1] + area[3]]) / 2
    cells = grid @ np.array([[c, s], [-s, c]]) + middle
    off = max(clearance(thing) for thing in things) + 3
    bounds = np.array(
        [t.moved(0, 0, turn + a).polygon.bounds for t, a in zip(things, turns, strict=True)]
    )
    low = np.asarray(area[:2]) + off - bounds[:, :2].min(axis=0)
    high_corner = np.asarray(area[2:]) - off - bounds[:, 2:].max(axis=0)
    good = cells[((cells >= low) & (cells <= high_corner)).all(axis=1)]
    if len(good) < len(things):
        return None
    spots = good[random.permutation(len(good))[: len(things)]]
    placed = [
        thing.moved(float(x), float(y), turn + t)
        for thing, t, (x, y) in zip(things, turns, spots, strict=True)
    ]
    return Rows(placed, [(float(x), float(y)) for x, y in good], (wide, high), turn)


def nearest_gap(thing: Thing, others: Sequence[Thing]) -> float:
    """Return the distance to the nearest other thing's outline, px; infinite if there is none."""
    return min((thing.polygon.distance(other.polygon) for other in others), default=math.inf)
