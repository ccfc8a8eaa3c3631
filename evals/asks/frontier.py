"""What a vision model alone does not solve: 20 to 100 robots at exact distances, several groups.

The turn of a seed says what is asked: a ring, an infill, groups, a cage. Distances hold to 3 px,
about what a careful outline is off.
"""

from typing import Any

import numpy as np
from numpy.random import Generator

from ..scenes.build import Story, entry_of, named, standable, tell
from ..scenes.choose import View, phrase
from ..scenes.things import Thing
from .rules import distance, inner_cell, inner_rule, many, margin, ring_rule

ROBOTS = (20, 100)
OFF = 3.0
APART = 0.5
SHARED = (8, 30)
"""Robots of one group where there are several."""
TURNS = ("ring", "infill", "groups", "cage")


def frontier(seed: int) -> dict[str, Any]:
    """The entry of annotations.json of a seed."""
    story = tell(seed)
    random = np.random.default_rng([seed, 5])
    entry = entry_of(story)
    ids = {id(t): o["id"] for t, o in zip(story.scene.things, entry["objects"], strict=True)}
    turn = turn_of(story)
    if turn == "groups":
        parts = _groups(random, story)
    else:
        parts = [(story.target, *_one(random, story, turn, named(random, story)))]
    said = [words for *_, words in parts]
    text = ", and ".join([", ".join(said[:-1]), said[-1]]) if len(said) > 1 else said[0]
    goals = [{"target": ids[id(t)], "robots": n, "success": rule} for t, n, rule, _ in parts]
    entry["tasks"][0] |= {
        "instruction": f"{text[:1].upper()}{text[1:]}.",
        "robots": sum(n for _, n, _, _ in parts),
        "success": goals[0]["success"],
        "target": goals[0]["target"],
        "goals": goals,
        "style": "default",
    }
    return entry


def turn_of(story: Story) -> str:
    """What is asked of a scene: groups where that has several things, else by its category."""
    if story.setup == "multi" and story.category != "caging":
        return "groups"
    return {"general": "ring", "infill": "infill", "caging": "cage"}[story.category]


Part = tuple[Thing, int, dict[str, Any], str]


def _one(
    random: Generator, story: Story, turn: str, said: str, bounds: tuple[int, int] = ROBOTS
) -> tuple[int, dict[str, Any], str]:
    """Robots, rule and words for a thing that is called so."""
    return _placed(random, story.target, story.scene.size, (turn, said), bounds)


def _placed(
    random: Generator,
    thing: Thing,
    size: tuple[int, int],
    what: tuple[str, str],
    bounds: tuple[int, int],
) -> tuple[int, dict[str, Any], str]:
    turn, said = what
    if turn == "infill":
        n = many(random, thing, "inside", bounds)
        d = margin(random, thing) or 0
        apart = max(int(APART * inner_cell(thing, n, d)), 3)
        rule = inner_rule(thing, n, d, apart)
        rule["min_clearance_px"] = max(d - OFF / 2, 0.5)
        edge = f", at least {d} px from its edge" if d else ""
        return n, rule, f"spread {n} robots evenly over {said}{edge}, no two closer than {apart} px"
    arrangement = "cage" if turn == "cage" else "around"
    n = many(random, thing, arrangement, bounds)
    d = distance(random, thing, size) or 6
    rule = ring_rule(thing, arrangement, n, d, OFF)
    if turn == "cage":
        return n, rule, f"cage {said} with {n} robots, exactly {d} px from it"
    return n, rule, f"place {n} robots evenly around {said}, exactly {d} px from it"


def _groups(random: Generator, story: Story) -> list[Part]:
    """The target and up to two more things that a phrase tells, each with robots of its own."""
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
        (thing, *_placed(random, thing, story.scene.size, (turn, words), SHARED))
        for (thing, words), turn in zip(chosen, turns, strict=False)
    ]
