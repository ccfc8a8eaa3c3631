"""Tasks for escape-proof cages of few robots: fewer than a ring certified by an inscribed disc.

A ring whose gaps are all narrower than the thing's inscribed disc certainly holds it, and takes
no more than counting. With fewer robots, where they have to stand depends on the shape.
"""

import math
from typing import Any

import numpy as np
import shapely

from ...scenes.stories import named, retasked, story_of
from ...scenes.things import Thing
from .length_rules import distance

SHARES = (0.6, 1.0)
"""Robots asked for, as shares of those in such a ring."""
LEAST, MOST = 4, 30
OFF_SHARE, OFF = 0.4, 4.0
"""How far off the distance a robot may stand: this share of it, but at least so many px."""
WORDS = (
    "cage {thing} with {n} robots, about {d} px from it, escape-proof: it must not get out however "
    "it moves and turns",
    "place {n} robots about {d} px from {thing} as an escape-proof cage",
)


def caged(seed: int) -> dict[str, Any]:
    """Return the entry of annotations.json of a seed."""
    story = story_of(seed)
    random = np.random.default_rng([seed, 8])
    thing = story.target
    d = distance(random, thing, story.scene.size) or 6
    n = _few_robots(thing, d, random.uniform(*SHARES))
    words = WORDS[random.integers(len(WORDS))]
    text = words.format(thing=named(random, story), n=n, d=d)
    off = max(OFF, OFF_SHARE * d)
    rule = {"where": "cage", "band_px": [round(max(d - off, 1.0), 1), round(d + off, 1)]}
    return retasked(
        story,
        instruction=f"{text[:1].upper()}{text[1:]}.",
        robots=n,
        category="caging",
        success=rule,
        style="default",
    )


def _few_robots(thing: Thing, d: float, share: float) -> int:
    filled = thing.outline.filled
    disc = shapely.maximum_inscribed_circle(filled).length
    ring = math.floor(filled.buffer(d).length / (2 * disc)) + 1
    return min(max(LEAST, round(share * ring)), MOST)
