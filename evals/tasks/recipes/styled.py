"""The procedural tasks of formation-dev: 3 to 64 robots, five wording styles, named lengths."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator

from ...scenes.stories import Story, named, retasked, story_of
from ...scenes.success_rules import arrangements, robots_for, success
from .length_rules import distance, inner_cell, inner_rule, many, margin, ring_rule
from .metric import OFF as SIZED_OFF
from .metric import fits, named_length, robot_size

STYLES = ("default", "simple", "strategy", "narrative", "structured")
ROBOTS = (3, 64)
NAMED = 0.5
"""How often a length is named in a picture without a scale, if there is room for one."""
OFF_SHARE, OFF = 0.25, 4.0
"""How far off a named distance a robot may stand: this share of it, but at least so many px."""
APART = 0.5
"""The named distance between robots, as a share of a robot's cell."""
Length = tuple[str, str]


def styled(seed: int, scale: float | None = None) -> dict[str, Any]:
    """Return the entry of annotations.json of a seed: its scene, with a task of its own.

    Args:
        seed: of the scene.
        scale: metres per pixel; with it lengths are named in metres, and the robots' size too if
            there is room for it.
    """
    story = story_of(seed)
    random = np.random.default_rng([seed, 4])
    fitting = [a for a in arrangements(story.target, story.category) if a != "centre"]
    arrangement = fitting[random.integers(len(fitting))]
    side = str(random.choice(["left", "right", "upper", "lower"]))
    robots = _robots_for(random, story, arrangement)
    rule, lengths = _rule(random, story, (arrangement, side), robots, scale)
    if scale is not None:
        rule, lengths = _sized(seed, story, rule, robots, lengths, scale)
    style = STYLES[seed % len(STYLES)]
    text = _instruction(random, story, style, (arrangement, side), robots, lengths)
    return retasked(story, instruction=text, robots=robots, success=rule, style=style)


def _robots_for(random: Generator, story: Story, arrangement: str) -> int:
    if arrangement in ("around", "cage", "inside"):
        return many(random, story.target, arrangement, ROBOTS)
    return robots_for(random, story.target, arrangement)


def _rule(
    random: Generator, story: Story, what: tuple[str, str], robots: int, scale: float | None
) -> tuple[dict[str, Any], list[Length]]:
    """Return the rule, and the length that the words name, if any: its kind and its words."""
    arrangement, side = what
    thing, plain = story.target, success(story.target, arrangement, robots, side)
    if random.random() >= NAMED and scale is None:
        return plain, []
    if arrangement in ("around", "cage"):
        d = distance(random, thing, story.scene.size)
        if d is not None:
            named = named_length(d, scale)
            off = max(OFF, OFF_SHARE * d)
            return ring_rule(thing, arrangement, robots, named.px, off), [("exact", named.words)]
    if arrangement == "inside":
        if random.random() < 0.5:
            d = margin(random, thing)
            if d is not None:
                named = named_length(d, scale)
                return inner_rule(thing, robots, named.px, None), [("edge", named.words)]
        apart = int(APART * inner_cell(thing, robots, 0))
        if apart >= 4:
            named = named_length(apart, scale)
            return inner_rule(thing, robots, 0, named.px), [("apart", named.words)]
    return plain, []


def _sized(
    seed: int,
    story: Story,
    rule: dict[str, Any],
    robots: int,
    lengths: list[Length],
    scale: float,
) -> tuple[dict[str, Any], list[Length]]:
    """Return rule and lengths for robots of a named size if a distance is named, else as given.

    Distances are to robots' edges, so that their centres stand half their size further off.
    """
    size, thing = robot_size(seed, scale), story.target
    kinds = [kind for kind, _ in lengths]
    if size is None or not {"exact", "edge"} & set(kinds):
        return rule, lengths
    if not fits(thing, story.scene.size, rule, robots, size.px):
        return rule, lengths
    if "exact" in kinds:
        d = sum(rule["band_px"]) / 2 + size.px / 2
        made = ring_rule(thing, "cage" if rule.get("closed") else "around", robots, d, SIZED_OFF)
    else:
        made = inner_rule(thing, robots, rule["min_clearance_px"] + size.px / 2, None)
    return made, [*lengths, ("size", size.words)]


def _instruction(
    random: Generator,
    story: Story,
    style: str,
    what: tuple[str, str],
    robots: int,
    lengths: list[Length],
) -> str:
    arrangement, side = what
    templates = _style_templates()[style][arrangement]
    template = templates[random.integers(len(templates))]
    text = template.format(n=robots, thing=named(random, story), side=side)
    for kind, words in lengths:
        text += " " + _style_templates()[style]["lengths"][kind].format(d=words)
    return text[:1].upper() + text[1:]


@cache
def _style_templates() -> dict[str, Any]:
    path = Path(__file__).parent / "styles.yaml"
    return yaml.safe_load(path.read_text(encoding="utf-8"))
