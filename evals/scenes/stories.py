"""The drawn scene of a seed, with its task and success rule, in the photographs' format.

Each 54 seeds, from a multiple of 54 on, have each of the paper's nine cells (category x setup)
with each family once. Words have a random stream of their own, so that new ones change no pixel.
"""

from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator

from .compose import compose, stage
from .families import FAMILIES
from .layout import GAP, clearance, nearest_gap, room
from .reference_words import GENERAL, HIDDEN, KINDS, Slots, View, goes_by, reference_slots
from .success_rules import arrangements, robots_for, success
from .things import Family, Scene, Thing

CELLS = tuple(product(("general", "infill", "caging"), ("single", "multi", "hidden")))
SHARES = {"single": (0.01, 0.15), "multi": (0.004, 0.08), "hidden": (0.004, 0.08)}
"""Least and largest share of the picture that a target may cover."""
FRESH = 1 / 3
ATTEMPTS = 25
Words = dict[str, dict[str, list[str]]]
"""Templates by purpose, arrangements or referring, and by kind."""
COUNTS = "one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen"
NUMBERS = (*COUNTS.split(), "sixteen", "seventeen", "eighteen", "nineteen", "twenty")


@dataclass(frozen=True)
class Story:
    """A scene, the thing that is meant, and the words that say so."""

    scene: Scene
    category: str
    setup: str
    target: Thing
    kind: str
    slots: Slots


def family_of(seed: int) -> Family:
    """Return the family of a seed's scene."""
    return FAMILIES[(seed // 9 + seed % 9) % 6]


def story_of(seed: int) -> Story:
    """Compose the scene of a seed, without drawing it, and choose what is asked of it."""
    category, setup = CELLS[seed % 9]
    family = family_of(seed)
    random = np.random.default_rng([seed, 0])
    kinds = {"single": ("single", "single", "colour", "shape"), "hidden": HIDDEN, "multi": KINDS}
    while True:
        kind = str(random.choice(kinds[setup]))
        if kind in family.beyond:
            continue
        for _ in range(ATTEMPTS):
            scene = compose(random, seed, stage(random, family), kind, setup)
            if scene is None or (setup != "single" and len(scene.things) < 4):
                continue
            fitting = _fitting(random, scene, kind, category, setup)
            if fitting:
                target, slots = fitting[random.integers(len(fitting))]
                return Story(scene, category, setup, target, kind, slots)


def _fitting(
    random: Generator, scene: Scene, kind: str, category: str, setup: str
) -> list[tuple[Thing, Slots]]:
    """Return the things robots can be sent to that the kind tells apart, with the words for it."""
    view, general = View(scene.things, scene.size), random.random() < 0.5
    low, high = (share * scene.size[0] * scene.size[1] for share in SHARES[setup])
    word = str(random.choice((*GENERAL, "shape") if scene.family == "shapes" else GENERAL))
    found: list[tuple[Thing, Slots]] = []
    for thing in scene.things[: 1 if setup == "hidden" else None]:
        own = [t for t in scene.things if goes_by(t, thing)]
        group = scene.things if general or setup == "hidden" else own
        common = general or len(own) < len(group)
        slots = reference_slots(kind, thing, group, view)
        if slots is None or not low <= thing.area <= high or not standable(thing, scene):
            continue
        if category == "infill" and thing.outline.min_width < 20:
            continue
        noun = word if common else thing.sort.noun
        plural = thing.sort.plural if not common and thing.sort.plural else f"{noun}s"
        found.append((thing, {"noun": noun, "nouns": plural, **slots}))
    return found


def standable(thing: Thing, scene: Scene) -> bool:
    """Return whether robots can stand around a thing: room to the border and to other things."""
    others = [t for t in scene.things if t is not thing]
    free = nearest_gap(thing, others) >= (GAP - 0.02) * thing.size
    return free and not thing.sort.encloses and room(thing, scene.size) >= clearance(thing) + 2


def entry_of(story: Story) -> dict[str, Any]:
    """Return the entry of annotations.json: exact outlines, instruction and success rule."""
    random = np.random.default_rng([story.scene.seed, 2])
    fitting = arrangements(story.target, story.category)
    arrangement = fitting[random.integers(len(fitting))]
    robots = robots_for(random, story.target, arrangement)
    side = str(random.choice(["left", "right", "upper", "lower"]))
    fresh = random.random() < FRESH and len(wordings()) > 1
    instruction = _instruction_of(random, story, arrangement, robots, side, wordings()[int(fresh)])
    name = f"scene_{story.scene.seed:06d}"
    things = {
        id(t): f"{t.sort.noun.replace(' ', '_')}_{i}" for i, t in enumerate(story.scene.things)
    }
    return {
        "image": f"{name}.png",
        "width": story.scene.size[0],
        "height": story.scene.size[1],
        "family": story.scene.family,
        "objects": [_object(things[id(t)], t) for t in story.scene.things],
        "tasks": [
            {
                "id": f"{name}_t1",
                "instruction": instruction,
                "robots": robots,
                "category": story.category,
                "setup": story.setup,
                "target": things[id(story.target)],
                "success": success(story.target, arrangement, robots, side),
                "referring": story.kind,
                "wording": "fresh" if fresh else "known",
            }
        ],
    }


def retasked(story: Story, **changes: Any) -> dict[str, Any]:
    """Return the entry of a story with these parts of its task changed."""
    entry = entry_of(story)
    entry["tasks"][0] |= changes
    return entry


def _object(name: str, thing: Thing) -> dict[str, Any]:
    rings = [
        [[round(float(x), 2), round(float(y), 2)] for x, y in list(ring.coords)[:-1]]
        for ring in (thing.polygon.exterior, *thing.polygon.interiors)
    ]
    colour = f"{thing.colour} " if thing.sort.by_colour else ""
    return {
        "id": name,
        "name": colour + thing.sort.noun,
        "polygon": rings[0],
        "holes": rings[1:],
        "how": "drawn",
        "confidence": "high",
    }


def _instruction_of(
    random: Generator, story: Story, arrangement: str, robots: int, side: str, words: Words
) -> str:
    thing = named(random, story, words)
    templates = words["arrangements"][arrangement]
    count = NUMBERS[robots - 1] if random.random() < 0.4 else str(robots)
    text = templates[random.integers(len(templates))].format(n=count, thing=thing, side=side)
    return text[:1].upper() + text[1:]


def named(random: Generator, story: Story, words: Words | None = None) -> str:
    """Return a phrase that says which thing is meant, by default in the known wordings."""
    kind = story.kind
    if kind in ("odd_colour", "odd_size", "odd_shape") and random.random() < 0.5:
        kind = "odd"
    phrases = (words or wordings()[0])["referring"][kind]
    return phrases[random.integers(len(phrases))].format(**story.slots)


@cache
def wordings() -> list[Words]:
    """Return the known wordings, and the fresh ones if there are any."""
    here = Path(__file__).parent
    paths = [here / "wordings.yaml", here / "fresh.yaml"]
    return [yaml.safe_load(path.read_text(encoding="utf-8")) for path in paths if path.is_file()]
