"""Ways of pointing at a task's thing, which are a variable of an experiment.

truth: the annotated outline is the mask. box: each side off by up to 8 % of the box. outline: at
most 12 vertices, off by up to 4 % of the size (square root of the area). drawn: by hand, at one
look. point: one well inside. words: nothing, except the outlines that a dialogue begins with.
"""

import json
import zlib
from functools import cache
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray
from ...tools.perception.target_prompt import TargetPrompt
from ...tools.world import Target
from ..tasks.annotations import PHOTOS
from ..tasks.task import Task, Thing

Mode = Literal["truth", "outline", "drawn", "box", "point", "words"]
JITTERED: tuple[Mode, ...] = ("outline", "box", "point")
"""Modes in which each trial points a little differently."""
BOX_JITTER, OUTLINE_JITTER, OUTLINE_VERTICES = 0.08, 0.04, 12
MOST_VERTICES = 30
"""Most vertices that an outline may be drawn with."""


class Pointing(NamedTuple):
    """What an agent is given besides the words."""

    pointed: tuple[TargetPrompt, ...] = ()
    targets: tuple[Target, ...] = ()


def mode_named(text: str) -> Mode:
    """Return the mode of this name.

    Raises:
        InputError: there is none; the text lists those there are.
    """
    for mode in get_args(Mode):
        if text == mode:
            return mode
    raise InputError(f"Unknown mode {text!r}. There are: {', '.join(get_args(Mode))}.")


def can_point(task: Task, mode: Mode) -> bool:
    """Return whether a task can be pointed at this way: one pointing settles one thing alone."""
    if task.dialogue is not None:
        return mode in ("truth", "words")
    if mode == "drawn":
        return task.id in _drawings()
    if mode in JITTERED:
        return len(task.things) == 1
    return mode == "words" or bool(task.things)


def pointing(task: Task, mode: Mode, number: int) -> Pointing:
    """Return how a task is pointed at in the trial of a number, which determines the jitter."""
    things = task.things[: task.dialogue.given] if task.dialogue else task.things
    if mode == "words":
        shown = enumerate(things, start=1) if task.dialogue else ()
        return Pointing(pointed=tuple(_drawn_outline(thing, f"t{i}") for i, thing in shown))
    if mode == "drawn":
        return Pointing(pointed=(TargetPrompt.model_validate(_drawings()[task.id]),))
    if mode == "truth":
        return Pointing(targets=tuple(map(_true_target, things, range(len(things)))))
    random = np.random.default_rng([number, zlib.crc32(task.id.encode())])
    (thing,) = task.things
    far = np.array(task.goals[0].size, dtype=float) - 1
    jittered = {"box": _jittered_box, "outline": _jittered_outline, "point": _inner_point}[mode]
    return Pointing(pointed=(jittered(thing, random, far),))


@cache
def _drawings() -> dict[str, dict[str, Any]]:
    """Return the outlines drawn by hand, by task."""
    return json.loads((PHOTOS / "outlines/drawn.json").read_text(encoding="utf-8"))


def _true_target(thing: Thing, index: int) -> Target:
    outline = thing.outline
    return Target(
        id=f"t{index + 1}",
        label=thing.name,
        box=outline.bounds,
        confidence=1.0,
        outline=outline,
        prompt="truth",
    )


def _jittered_box(thing: Thing, random: np.random.Generator, far: FloatArray) -> TargetPrompt:
    box = np.asarray(thing.outline.bounds).reshape(2, 2)
    moved = box + random.uniform(-BOX_JITTER, BOX_JITTER, (2, 2)) * (box[1] - box[0])
    x0, y0, x1, y1 = np.clip(moved, 0, far).ravel()
    return TargetPrompt(box=(float(x0), float(y0), float(x1), float(y1)))


def _drawn_outline(thing: Thing, name: str) -> TargetPrompt:
    """Return the true outline with as many vertices as can be given."""
    vertices = _simplified(thing, MOST_VERTICES)
    return TargetPrompt(id=name, outline=tuple((float(x), float(y)) for x, y in vertices))


def _simplified(thing: Thing, most: int) -> FloatArray:
    """Return an outline's vertices, simplified to at most so many, (n, 2) px."""
    tolerance = 0.5
    ring = LineString([*thing.polygon, thing.polygon[0]])
    vertices = shapely.get_coordinates(ring.simplify(tolerance))[:-1]
    while len(vertices) > most:
        tolerance *= 1.15
        vertices = shapely.get_coordinates(ring.simplify(tolerance))[:-1]
    return vertices


def _jittered_outline(thing: Thing, random: np.random.Generator, far: FloatArray) -> TargetPrompt:
    """Return the true outline simplified to at most 12 vertices, each moved."""
    vertices = _simplified(thing, OUTLINE_VERTICES)
    amount = OUTLINE_JITTER * thing.outline.size
    while True:  # a jitter that crosses itself is no outline a person would draw
        moved = np.clip(vertices + random.uniform(-amount, amount, vertices.shape), 0, far)
        if Polygon(moved).is_valid:
            return TargetPrompt(outline=tuple((float(x), float(y)) for x, y in moved))


def _inner_point(thing: Thing, random: np.random.Generator, far: FloatArray) -> TargetPrompt:
    """Return a random point of the thing, if possible an eighth of its least width off its edge."""
    outline = thing.outline
    inner = outline.polygon.buffer(-outline.min_width / 8)
    region = outline.polygon if inner.is_empty else inner
    x0, y0, x1, y1 = region.bounds
    while True:
        x, y = (float(v) for v in random.uniform((x0, y0), (x1, y1)))
        if shapely.contains_xy(region, x, y):
            return TargetPrompt(points=((x, y),))
