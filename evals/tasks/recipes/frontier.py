"""Tasks a vision model alone does not solve: 20 to 100 robots at exact distances, several groups.

The scene of a seed decides what is asked: a ring, an infill, groups or a cage. Distances must
hold to 3 px, about the error of a careful outline.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from ...scenes.reference_words import View, phrase
from ...scenes.stories import Story, entry_of, named, standable, story_of
from ...scenes.things import Thing
from .length_rules import distance, inner_cell, inner_rule, many, margin, ring_rule
from .metric import SPREAD, Named, named_length, robot_size

ROBOTS, SIZED_ROBOTS = (20, 100), (20, 48)
OFF = 3.0
APART, BODIES = 0.5, 2.1
"""Least distance between robots inside: this share of a robot's cell, and so many of its radii."""
SHARED = (8, 30)
"""Robots of one group if there are several."""
TURNS = ("ring", "infill", "groups", "cage")


def frontier(seed: int, scale: float | None = None) -> dict[str, Any]:
    """Return the entry of annotations.json of a seed.

    Args:
        seed: of the scene.
        scale: metres per pixel; with it lengths are named in metres, and the robots' size too.
    """
    story = story_of(seed)
    random = np.random.default_rng([seed, 5])
    entry = entry_of(story)
    ids = {id(t): o["id"] for t, o in zip(story.scene.things, entry["objects"], strict=True)}
    turn, team = turn_of(story), Team(scale, robot_size(seed, scale))
    if turn == "groups":
        parts = _several_groups(random, story, team)
    else:
        what = turn, named(random, story)
        bounds = ROBOTS if scale is None else SIZED_ROBOTS
        size = story.scene.size
        parts = [(story.target, *_goal_and_words(random, story.target, size, what, bounds, team))]
    *first, last = [words for *_, words in parts]
    text = f"{', '.join(first)}, and {last}" if first else last
    goals = [{"target": ids[id(t)], "robots": n, "success": rule} for t, n, rule, _ in parts]
    entry["tasks"][0] |= {
        "instruction": f"{text[:1].upper()}{text[1:]}.{team.words}",
        "robots": sum(n for _, n, _, _ in parts),
        "success": goals[0]["success"],
        "target": goals[0]["target"],
        "goals": goals,
        "style": "default",
    }
    return entry


def turn_of(story: Story) -> str:
    """Return what is asked of a scene: groups if several things are in it, else by its category.

    Cages are never asked for in groups.
    """
    if story.setup == "multi" and story.category != "caging":
        return "groups"
    return {"general": "ring", "infill": "infill", "caging": "cage"}[story.category]


Part = tuple[Thing, int, dict[str, Any], str]


@dataclass(frozen=True)
class Team:
    """The scale in which lengths are named, and the size of the robots."""

    scale: float | None
    across: Named | None

    @property
    def radius(self) -> float:
        """Radius of a robot, px; 0 if the size is not named."""
        return self.across.px / 2 if self.across else 0.0

    @property
    def words(self) -> str:
        """A sentence that names the robots' size; empty if it is not named."""
        return f" The robots are {self.across.words} across." if self.across else ""


def _goal_and_words(
    random: Generator,
    thing: Thing,
    size: tuple[int, int],
    what: tuple[str, str],
    bounds: tuple[int, int],
    team: Team,
) -> tuple[int, dict[str, Any], str]:
    turn, thing_words = what
    wide = SPREAD * team.radius
    if turn == "infill":
        n = many(random, thing, "inside", bounds, wide)
        d = named_length(margin(random, thing) or 0, team.scale)
        deep = d.px + team.radius
        near = max(int(APART * inner_cell(thing, n, deep)), 3, math.ceil(BODIES * team.radius))
        apart = named_length(near, team.scale)
        rule = inner_rule(thing, n, deep, apart.px)
        rule["min_clearance_px"] = max(deep - OFF / 2, 0.5)
        edge = f", at least {d.words} from its edge" if d.px else ""
        text = (
            f"spread {n} robots evenly over {thing_words}{edge}, no two closer than {apart.words}"
        )
        return n, rule, text
    arrangement = "cage" if turn == "cage" else "around"
    n = many(random, thing, arrangement, bounds, wide)
    d = named_length(distance(random, thing, size) or 6, team.scale)
    rule = ring_rule(thing, arrangement, n, d.px + team.radius, OFF)
    if turn == "cage":
        return n, rule, f"cage {thing_words} with {n} robots, exactly {d.words} from it"
    return n, rule, f"place {n} robots evenly around {thing_words}, exactly {d.words} from it"


def _several_groups(random: Generator, story: Story, team: Team) -> list[Part]:
    """Return groups about the target and up to two other things that a phrase tells apart."""
    view = View(story.scene.things, story.scene.size)
    others = [
        (thing, words)
        for thing in story.scene.things
        if thing is not story.target
        and (words := phrase(thing, view))
        and standable(thing, story.scene)
        and thing.outline.min_width >= 24
    ]
    chosen = [(story.target, named(random, story)), *others[:2]]
    turns = ("ring", "infill", "ring") if random.random() < 0.5 else ("infill", "ring", "infill")
    return [
        (thing, *_goal_and_words(random, thing, story.scene.size, (turn, words), SHARED, team))
        for (thing, words), turn in zip(chosen, turns, strict=False)
    ]
