"""Success rules with lengths named in an instruction, in the proportions of the usual rules.

Lengths are in pixels, as a picture without a scale allows no others and the tools work in them.
"""

import math
from typing import Any

import shapely
from numpy.random import Generator

from ...scenes.layout import room
from ...scenes.success_rules import slack, success
from ...scenes.things import Thing

LEAST = 5
"""Least distance asked for, px; a smaller one is within the error of an outline."""
FINE_GAP = 8.0
"""Least distance between neighbours when many robots are asked for, px."""


def ring_rule(thing: Thing, arrangement: str, robots: int, d: float, off: float) -> dict[str, Any]:
    """Return the rule of a ring at a named distance d, px; robots may be `off` px off it."""
    rule = success(thing, arrangement, robots, "left")
    loop = thing.outline.filled.buffer(d).exterior.length
    band = [round(max(d - off, 1.0), 1), round(d + off, 1)]
    return rule | {
        "band_px": band,
        "max_gap_px": round(slack(thing, arrangement) * loop / robots, 1),
    }


def inner_rule(thing: Thing, robots: int, d: float, apart: float | None) -> dict[str, Any]:
    """Return the rule of an infill at least d px from the edge and, if given, `apart` px apart."""
    rule = success(thing, "inside", robots, "left")
    cell = inner_cell(thing, robots, d)
    if d:
        rule["min_clearance_px"] = round(max(d - 2.0, 0.6 * d), 1)
        rule["max_uncovered_px"] = round(rule["max_uncovered_px"] + 2 * d, 1)
        rule["min_spacing_px"] = round(0.45 * cell, 1)
    return rule | ({"min_spacing_px": apart} if apart else {})


def inner_cell(thing: Thing, robots: int, d: float) -> float:
    """Return the side, px, of a robot's share of the region at least d px from the edge."""
    return math.sqrt(thing.polygon.buffer(-d).area / robots)


def distance(random: Generator, thing: Thing, size: tuple[int, int]) -> int | None:
    """Choose a distance, px, of a ring about a thing that stays in the picture; None: no room."""
    most = int(min(0.3 * thing.size, room(thing, size) - 4))
    least = max(LEAST, round(0.08 * thing.size))
    return int(random.integers(least, most + 1)) if most >= least else None


def margin(random: Generator, thing: Thing) -> int | None:
    """Choose a distance, px, to keep inside the edge of a thing of one piece; None: too thin."""
    most = int(0.12 * thing.outline.min_width)
    if most < 3:
        return None
    d = int(random.integers(3, most + 1))
    return d if shapely.get_num_geometries(thing.polygon.buffer(-d)) == 1 else None


def many(
    random: Generator, thing: Thing, arrangement: str, bounds: tuple[int, int], wide: float = 0.0
) -> int:
    """Choose a number of robots, within bounds, that the thing has room for, small ones more often.

    `wide` is the least distance between neighbours that robots of a size need, px.
    """
    gap = max(FINE_GAP, wide)
    least, most = bounds
    if arrangement == "inside":
        fits = int(thing.polygon.buffer(-0.05 * thing.size).area / (1.6 * gap) ** 2)
    else:
        fits = int(thing.polygon.convex_hull.buffer(0.1 * thing.size).length / gap)
    if arrangement == "cage":
        least = max(least, 10 if thing.hollow else 6)
    top = max(least, min(most, fits))
    return round(math.exp(random.uniform(math.log(least), math.log(top))))
