"""Success rules for true outlines, in the proportions of the photographs' rules."""

import math
from typing import Any

from numpy.random import Generator

from .layout import clearance
from .things import Thing

SIDES = {"left": "left", "right": "right", "upper": "top", "lower": "bottom"}
"""The words for a side in an instruction, and the rule's word for it."""
PARTING = 11.0
"""Least distance between neighbours when a number of robots is chosen, px."""


def arrangements(thing: Thing, category: str) -> list[str]:
    """Return the arrangements that make sense for a thing, likelier ones repeated."""
    if category == "caging":
        return ["cage"]
    if category == "infill":
        return ["inside"]
    fit = ["around"] * 4
    if thing.sort.corners:
        fit += ["corners"] * 3
    straight = not thing.sort.upright or abs((thing.turn + 45) % 90 - 45) < 12
    if thing.solidity > 0.8 and straight:
        fit += ["side"] * 2
    if thing.solidity > 0.95:
        fit.append("centre")
    return fit


def robots_for(random: Generator, thing: Thing, arrangement: str) -> int:
    """Choose a number of robots that fits the thing."""
    if arrangement == "corners":
        return thing.sort.corners
    if arrangement == "centre":
        return 1
    x0, y0, x1, y1 = thing.polygon.bounds
    loop = thing.polygon.convex_hull.buffer(clearance(thing)).length
    least, most = {
        "around": (4, loop / (1.6 * PARTING)),
        "cage": (6, loop / PARTING),
        "inside": (3, thing.polygon.area / PARTING**2),
        "side": (3, min(x1 - x0, y1 - y0) / PARTING),
    }[arrangement]
    if arrangement == "cage" and thing.hollow:
        least = 10  # fewer would leave the mouth of a C open
    limit = {"around": 16, "cage": 20, "inside": 12, "side": 6}[arrangement]
    return int(random.integers(least, max(least, min(limit, int(most))) + 1))


def success(thing: Thing, arrangement: str, robots: int, side: str) -> dict[str, Any]:
    """Return the success rule of an arrangement; `side` matters for "side" only."""
    size = thing.size
    if arrangement in ("around", "cage"):
        closed = arrangement == "cage"
        low = max((0.03 if closed else 0.04) * size, 2.0)
        high = max((0.4 if closed else 0.5) * size, 16.0)
        loop = thing.outline.filled.buffer((low + high) / 2).exterior.length
        rule = {
            "where": "boundary",
            "side": "outside",
            "band_px": [round(low, 1), round(high, 1)],
            "even": True,
            "max_gap_px": round(slack(thing, arrangement) * loop / robots, 1),
        }
        return rule | ({"closed": True, "min_clearance_px": round(low, 1)} if closed else {})
    if arrangement == "inside":
        cell = math.sqrt(thing.polygon.area / robots)
        return {
            "where": "inside",
            "even": True,
            "min_clearance_px": round(0.03 * math.sqrt(thing.polygon.area), 1),
            "min_spacing_px": round(0.45 * cell, 1),
            "max_uncovered_px": round(1.6 * cell, 1),
        }
    if arrangement == "corners":
        return {
            "where": "corners",
            "side": "outside",
            "points": [[round(x, 1), round(y, 1)] for x, y in _counted_corners(thing)],
            "tolerance_px": round(max(0.216 * size, 10), 1),
            "min_clearance_px": 0,
        }
    if arrangement == "side":
        band = [round(0.03 * size, 1), round(max(0.5 * size, 16.0), 1)]
        return {"where": f"side:{SIDES[side]}", "band_px": band, "min_span_frac": 0.5}
    x, y = thing.outline.centre
    return {
        "where": "center",
        "points": [[round(x, 1), round(y, 1)]],
        "tolerance_px": round(max(0.2 * size, 5), 1),
    }


def slack(thing: Thing, arrangement: str) -> float:
    """Return how many times as wide as an even ring's a gap may be."""
    if arrangement == "around":
        return 2.0
    return 1.8 if thing.hollow else 1.6


def _counted_corners(thing: Thing) -> list[tuple[float, float]]:
    ring = thing.polygon.exterior
    if thing.sort.corners == len(ring.coords) - 1:
        return [(float(x), float(y)) for x, y in list(ring.coords)[:-1]]
    return [(float(x), float(y)) for x, y in thing.outline.bulk_rectangle]
