"""Instructions that must not be carried out: asking or refusing is right, and moving is wrong."""

import math
from typing import Any

import numpy as np
from numpy.random import Generator

from ...scenes.stories import Story, named, retasked, story_of
from ...scenes.things import Thing

ABSENT = ("giraffe", "piano", "lighthouse", "bicycle", "umbrella stand", "telescope", "elephant")
DENSEST = 2 / math.sqrt(3)
"""Most robots, at least s apart, per s x s of a plane (hexagonal packing of discs)."""
ASK, REFUSE = "question", "impossible"
KINDS = ("absent", "ambiguous", "few", "crowded", "vague", "uncounted")


def unmet(seed: int) -> dict[str, Any]:
    """Return the entry of annotations.json of a seed; successive seeds differ in what is wrong."""
    story = story_of(seed)
    random = np.random.default_rng([seed, 6])
    kind = KINDS[seed % len(KINDS)]
    if kind == "ambiguous" and _one_of_several(story) is None:
        kind = "absent"
    words, robots, expects = _words_and_robots(random, story, kind)
    return retasked(
        story,
        instruction=f"{words[:1].upper()}{words[1:]}.",
        robots=robots,
        expects=list(expects),
        goals=[],
        style=kind,
    )


def _words_and_robots(
    random: Generator, story: Story, kind: str
) -> tuple[str, int | None, tuple[str, ...]]:
    """Return the words, the number of robots if one is given, and the statuses that are right."""
    n, thing = int(random.integers(4, 13)), named(random, story)
    if kind == "absent":
        missing = ABSENT[random.integers(len(ABSENT))]
        return f"surround the {missing} with {n} robots", n, (ASK, REFUSE)
    if kind == "ambiguous":
        alike = _one_of_several(story)
        assert alike is not None
        return f"surround the {alike.sort.noun} with {n} robots", n, (ASK,)
    if kind == "few":
        return f"cage {thing} with 2 robots so that nothing gets out", 2, (ASK, REFUSE)
    if kind == "crowded":
        apart = max(12, round(story.target.size / 3))
        many = math.ceil(3 * DENSEST * story.target.area / apart**2) + 8
        text = f"fill {thing} with {many} robots, no two closer than {apart} px"
        return text, many, (ASK, REFUSE)
    if kind == "vague":
        return f"do something useful with {n} robots", n, (ASK,)
    return f"surround {thing} with robots", None, (ASK,)


def _one_of_several(story: Story) -> Thing | None:
    """Return a thing that shares its noun with another, or None."""
    nouns = [thing.sort.noun for thing in story.scene.things]
    return next((t for t in story.scene.things if nouns.count(t.sort.noun) > 1), None)
