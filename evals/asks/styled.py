"""The procedural tasks of formation-dev: 3 to 64 robots, five wording styles, named lengths."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator

from ..scenes.build import Story, entry_of, named, tell
from ..scenes.rules import arrangements, robots_for, success
from .rules import distance, inner_cell, inner_rule, many, margin, ring_rule

STYLES = ("default", "simple", "strategy", "narrative", "structured")
ROBOTS = (3, 64)
NAMED = 0.5
"""How often a length is named where there is room for one."""
OFF_SHARE, OFF = 0.25, 4.0
"""How far off a named distance a robot may stand: this share of it, at least so many px."""
APART = 0.5
"""A distance between robots that is named, as a share of a robot's cell."""
Length = tuple[str, int]


def styled(seed: int) -> dict[str, Any]:
    """The entry of annotations.json of a seed: its scene, with a task of its own."""
    story = tell(seed)
    random = np.random.default_rng([seed, 4])
    fitting = [a for a in arrangements(story.target, story.category) if a != "centre"]
    arrangement = fitting[random.integers(len(fitting))]
    side = str(random.choice(["left", "right", "upper", "lower"]))
    robots = _robots(random, story, arrangement)
    rule, length = _rule(random, story, arrangement, robots, side)
    style = STYLES[seed % len(STYLES)]
    entry = entry_of(story)
    task = entry["tasks"][0]
    task |= {
        "instruction": _said(random, story, style, (arrangement, side), robots, length),
        "robots": robots,
        "success": rule,
        "style": style,
    }
    return entry


def _robots(random: Generator, story: Story, arrangement: str) -> int:
    if arrangement in ("around", "cage", "inside"):
        return many(random, story.target, arrangement, ROBOTS)
    return robots_for(random, story.target, arrangement)


def _rule(
    random: Generator, story: Story, arrangement: str, robots: int, side: str
) -> tuple[dict[str, Any], Length | None]:
    """The rule, and the length that the words name: its kind and px."""
    thing, plain = story.target, success(story.target, arrangement, robots, side)
    if random.random() >= NAMED:
        return plain, None
    if arrangement in ("around", "cage"):
        d = distance(random, thing, story.scene.size)
        if d is not None:
            off = max(OFF, OFF_SHARE * d)
            return ring_rule(thing, arrangement, robots, d, off), ("exact", d)
    if arrangement == "inside":
        if random.random() < 0.5:
            d = margin(random, thing)
            if d is not None:
                return inner_rule(thing, robots, d, None), ("edge", d)
        apart = int(APART * inner_cell(thing, robots, 0))
        if apart >= 4:
            return inner_rule(thing, robots, 0, apart), ("apart", apart)
    return plain, None


def _said(
    random: Generator,
    story: Story,
    style: str,
    what: tuple[str, str],
    robots: int,
    length: Length | None,
) -> str:
    arrangement, side = what
    templates = _styles()[style][arrangement]
    template = templates[random.integers(len(templates))]
    text = template.format(n=robots, thing=named(random, story), side=side)
    if length is not None:
        text += " " + _styles()[style]["lengths"][length[0]].format(d=length[1])
    return text[:1].upper() + text[1:]


@cache
def _styles() -> dict[str, Any]:
    path = Path(__file__).parent / "styles.yaml"
    return yaml.safe_load(path.read_text(encoding="utf-8"))
