"""Mends outlines that cross themselves if it is clear what was meant.

People overshoot when they close an outline, or give two vertices in the wrong order; such a
crossing says nothing about the object.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import Polygon

from .outline import largest_part

WHOLE = 0.9
"""Share of the enclosed area that one part must hold to stand for the whole."""
MOST_VERTICES, MOST_CROSSINGS = 2_000, 50
"""An outline with more is a scribble, and finding all its parts would take too long."""
MOST_SWAPPED = 60
"""Most vertices for which swapping two of them is tried."""
AS_SHORT, ALIKE = 1.1, 0.8
"""Every other order at most AS_SHORT times as long as the shortest must overlap with it by at least
ALIKE (intersection over union)."""


def mended(vertices: Sequence[tuple[float, float]]) -> tuple[Polygon, str] | None:
    """Return a self-crossing outline as one that does not, and a text that says what was done.

    None if it could mean several things.
    """
    if len(vertices) > MOST_VERTICES or _crossings(vertices) > MOST_CROSSINGS:
        return None
    orders = _swapped(vertices) if len(vertices) <= MOST_SWAPPED else []
    near = [p for p in orders if p.length <= AS_SHORT * orders[0].length]
    if near and all(_shared_area(near[0], other) >= ALIKE for other in near):
        return near[0], "it crossed itself, and two vertices changed places"
    faces = shapely.polygonize([shapely.node(Polygon(vertices).exterior)])
    whole = largest_part(faces)
    if whole is not None and whole.area >= WHOLE * faces.area:
        return Polygon(whole.exterior), "it crossed itself, and a small loop was left out"
    return None


def _crossings(vertices: Sequence[tuple[float, float]]) -> int:
    """Return how often its sides meet, other than where one follows the other."""
    ring = np.asarray(vertices, dtype=float)
    sides = np.asarray(shapely.linestrings(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)))
    pairs = shapely.STRtree(sides).query(sides, predicate="intersects")
    return (pairs.shape[1] - 3 * len(ring)) // 2


def _swapped(vertices: Sequence[tuple[float, float]]) -> list[Polygon]:
    """Return the outlines without crossings that swapping two vertices gives, shortest first."""
    pairs = np.array(list(combinations(range(len(vertices)), 2)))
    order = np.tile(np.arange(len(vertices)), (len(pairs), 1))
    np.put_along_axis(order, pairs, pairs[:, ::-1], axis=1)
    made = [Polygon(ring) for ring in np.asarray(vertices)[order]]
    return sorted((p for p in made if p.is_valid), key=lambda p: p.length)


def _shared_area(one: Polygon, other: Polygon) -> float:
    return float(one.intersection(other).area / one.union(other).area)
