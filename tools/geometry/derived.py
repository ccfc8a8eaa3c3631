"""Regions that follow from outlines: several as one, the gap between two, a bay, a part."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from .outline import MIN_AREA, Outline, largest_part, outline_of

Side = Literal["left", "right", "top", "bottom"]
PartName = Literal[
    "left half",
    "right half",
    "top half",
    "bottom half",
    "left end",
    "right end",
    "top end",
    "bottom end",
]
END = 0.25
"""Share of a thing's length that its end takes."""
LONGISH, SLANTED = 1.3, 0.35
"""Least long over short side of what has ends, and cosine of its axis to where an end lies."""
TOWARDS = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "top": (0.0, -1.0), "bottom": (0.0, 1.0)}
TOUCHING = 0.5
"""Outlines this near, px, touch: they are traced to a fraction of a pixel."""
LEAST_BAY, ALIKE = 0.03, 0.7
"""Least share of a thing's hull that is a bay of it, and what share of the largest is as large."""


def grouped(outlines: Sequence[Outline]) -> tuple[Outline, str]:
    """Return several outlines as one, and which: "union" if they touch, else "convex hull"."""
    regions = [o.filled for o in outlines]
    union = shapely.union_all([r.buffer(TOUCHING / 2) for r in regions]).buffer(-TOUCHING / 2)
    if len(shapely.get_parts(union)) == 1:
        return outline_of(union), "union"
    return outline_of(shapely.union_all(regions).convex_hull), "convex hull"


def gap_between(
    one: Outline, other: Outline, things: Sequence[BaseGeometry] = ()
) -> tuple[Outline, float]:
    """Return the free region between two outlines, and its least width, px.

    It is what lies within their common hull and in neither hull of their own; things in it are
    cut out, and of several pieces the largest is returned.

    Args:
        things: other regions that are not free.

    Raises:
        InputError: the two touch or overlap, or nothing is free between them.
    """
    width = one.filled.distance(other.filled)
    if width <= TOUCHING:
        raise InputError("The two touch: there is no gap between them.")
    pair = MultiPolygon([one.filled, other.filled])
    between = pair.convex_hull - pair
    reached = [
        p
        for p in shapely.get_parts(between)
        if all(p.distance(o.filled) <= TOUCHING for o in (one, other))
    ]
    free = shapely.union_all(reached) - shapely.union_all(list(things))
    return _region(free, "Nothing is free between the two."), width


def bay_of(outline: Outline, side: Side | None, things: Sequence[BaseGeometry] = ()) -> Outline:
    """Return a thing's largest bay: what lies within its hull and not in it, without other things.

    Args:
        side: where it opens as seen from the thing's middle; None if one is clearly the largest.

    Raises:
        InputError: it has no bay there, or several as large.
    """
    whole = outline.filled
    bays = [
        p
        for p in shapely.get_parts(whole.convex_hull - whole)
        if p.area >= LEAST_BAY * whole.convex_hull.area
    ]
    if side is not None:
        bays = [b for b in bays if _side_of(b, whole) == side]
    where = "" if side is None else f" on its {side}"
    if not bays:
        raise InputError(f"The thing has no bay{where}: its outline has no deep dent there.")
    bays.sort(key=lambda b: -b.area)
    alike = [b for b in bays if b.area >= ALIKE * bays[0].area]
    if len(alike) > 1:
        sides = ", ".join(sorted({_side_of(b, whole) for b in alike}))
        raise InputError(
            f"The thing has {len(alike)} bays about as large{where} ({sides}); draw the one meant."
        )
    free = bays[0] - shapely.union_all(list(things))
    return _region(free, "Nothing is free in that bay.")


def part_of(outline: Outline, part: PartName) -> Outline:
    """Return a half of a thing as the picture shows it, or an end of its long axis.

    Raises:
        InputError: it is not long, or its long axis runs across that direction.
    """
    side, what = part.split()
    towards = np.array(TOWARDS[side])
    share = 0.5
    if what == "end":
        axis, long, short = outline.long_axis
        along = float(axis @ towards)
        if long < LONGISH * short or abs(along) < SLANTED:
            raise InputError(
                f"The thing has no {part}: it is not clearly long in that direction; name a half."
            )
        towards, share = axis * np.sign(along), END
    reach = shapely.get_coordinates(outline.filled) @ towards
    least = float(reach.max() - share * np.ptp(reach))
    across, far = np.array((-towards[1], towards[0])), 2 * outline.perimeter
    middle = np.array(outline.centre)
    middle = middle + (least - middle @ towards) * towards
    corners = [middle - far * across, middle + far * across]
    corners += [c + far * towards for c in reversed(corners)]
    return _region(outline.polygon & Polygon(corners), f"Nothing lies in the thing's {part}.")


def _side_of(bay: BaseGeometry, whole: Polygon) -> Side:
    """Return the side of the thing's box that a bay is nearest to."""
    x0, y0, x1, y1 = whole.bounds
    left, top, right, bottom = bay.bounds
    away: dict[Side, float] = {
        "left": left - x0,
        "right": x1 - right,
        "top": top - y0,
        "bottom": y1 - bottom,
    }
    return min(away, key=lambda side: away[side])


def _region(free: BaseGeometry, otherwise: str) -> Outline:
    region = largest_part(free)
    if region is None or region.area < MIN_AREA:
        raise InputError(otherwise)
    return outline_of(region)
