"""Names of lengths in an instruction, in px or by a scale in metres, and the size of robots.

Metres are rounded to two digits first and the rule is made of those, so that words and rule agree.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ...scenes.layout import room
from ...scenes.things import Thing
from .length_rules import inner_cell

RADII = (5, 11)
"""Radii of robots whose size is named, px, the upper end excluded; all exceed `OFF`."""
SPREAD = 2.6
"""Least distance between robots' centres, in radii, if their size is named."""
OFF = 4.0
"""How far off its distance a robot whose size is named may stand, px; less than any radius."""


@dataclass(frozen=True)
class Named:
    """A length, px, and the words for it."""

    px: float
    words: str


def named_length(px: float, scale: float | None) -> Named:
    """Return a length of about `px` as an instruction names it.

    Args:
        px: a whole number if there is no scale.
        scale: metres per pixel, or None.
    """
    if scale is None:
        return Named(px, f"{px} px")
    metres = float(f"{px * scale:.2g}")
    if metres >= 1 or (metres >= 0.1 and int(px) % 2):
        words = f"{metres:g} m"
    elif metres >= 0.01:
        words = f"{100 * metres:g} cm"
    else:
        words = f"{1000 * metres:g} mm"
    return Named(round(metres / scale, 2), words)


def robot_size(seed: int, scale: float | None) -> Named | None:
    """Return the diameter of a seed's robots; None for a picture without a scale."""
    if scale is None:
        return None
    radius = int(np.random.default_rng([seed, 7]).integers(*RADII))
    return named_length(2 * radius, scale)


def fits(
    thing: Thing, size: tuple[int, int], rule: dict[str, Any], robots: int, across: float
) -> bool:
    """Return whether robots `across` px wide have room where a rule puts their centres."""
    if rule["where"] == "inside":
        deep = rule["min_clearance_px"] + across / 2
        inner = thing.polygon.buffer(-deep)
        whole = shapely.get_num_geometries(inner) == 1 and not inner.is_empty
        return whole and inner_cell(thing, robots, deep) >= SPREAD * across / 2
    far = rule["band_px"][1]
    loop = thing.outline.filled.buffer(sum(rule["band_px"]) / 2).exterior.length
    return far + across / 2 + 2 <= room(thing, size) and loop >= robots * SPREAD * across / 2
