"""Drawn scenes: reproducible, exact, and unambiguous by margins measured again here."""

import math
import string
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from formup.evals.experiments.methods import Method
from formup.evals.experiments.trials import TrialRow
from formup.evals.grading.attempts import grade_goals
from formup.evals.scenes.families import FAMILIES
from formup.evals.scenes.paint import draw
from formup.evals.scenes.reference_words import HIDDEN, KINDS
from formup.evals.scenes.stories import CELLS, Story, entry_of, story_of
from formup.evals.scenes.things import Ground, Look
from formup.evals.tasks.suites import load_suite
from formup.evals.tasks.task import Drawing, Goal, Task
from formup.tools.geometry.outline import FloatArray
from PIL import Image
from shapely.geometry import Point, Polygon

trying = import_module("trying")
tried: Callable[..., list[TrialRow]] = trying.tried

SEEDS = range(108)
DRAWN = range(54)
FOLDER = Path(__file__).parents[3] / "evals" / "scenes"
PLAIN = {
    "boundary": "Place {n} robots evenly around it.",
    "cage": "Cage it with {n} robots.",
    "inside": "Spread {n} robots evenly inside it.",
    "corners": "Place {n} robots at its corners.",
    "side": "Line up {n} robots along its {side} side.",
    "center": "Send {n} robots to its centre.",
}


@dataclass(frozen=True)
class Seen:
    """An annotated object, its geometry read anew from the entry."""

    noun: str
    colour: str
    polygon: Polygon
    also: Sequence[str]

    @property
    def area(self) -> float:
        return Polygon(self.polygon.exterior).area

    @property
    def middle(self) -> tuple[float, float]:
        x0, y0, x1, y1 = self.polygon.bounds
        return (x0 + x1) / 2, (y0 + y1) / 2


@dataclass(frozen=True)
class Case:
    """A story with its target, all other things, and those that the noun may mean."""

    story: Story
    target: Seen
    rest: list[Seen]
    group: list[Seen]
    rule: dict[str, Any]
    instruction: str


@cache
def case(seed: int) -> Case:
    story = story_of(seed)
    entry, nouns = entry_of(story), story.target.sort.also
    things = [
        Seen(t.sort.noun, t.colour, Polygon(o["polygon"], o["holes"]), t.sort.also)
        for t, o in zip(story.scene.things, entry["objects"], strict=True)
    ]
    (task,) = entry["tasks"]
    target = things.pop([o["id"] for o in entry["objects"]].index(task["target"]))
    own = story.slots["noun"] == target.noun and story.setup != "hidden"
    group = [t for t in things if not own or t.noun in {target.noun, *nouns}]
    return Case(story, target, things, group, task["success"], task["instruction"])


@pytest.fixture(scope="module")
def tasks() -> list[Task]:
    return list(load_suite("scenes", seeds=f"{DRAWN[0]}-{DRAWN[-1]}").tasks)


def plain(task: Task) -> Task:
    """The same task in words that nothing is to be learnt from."""
    rule = task.goals[0].success
    where, _, side = str(rule["where"]).partition(":")
    words = PLAIN["cage" if rule.get("closed") else where]
    return replace(task, instruction=words.format(n=task.robots, side=side))


def test_every_family_in_every_cell(tasks: list[Task]) -> None:
    pairs = Counter((task.family, task.category, task.setup) for task in tasks)
    assert len(pairs) == len(CELLS) * len(FAMILIES)
    assert set(pairs.values()) == {1}
    assert all(480 <= task.goals[0].size[0] <= 960 for task in tasks)
    assert {task.style for task in tasks} == {"known", "fresh"}


def test_a_seed_is_a_picture() -> None:
    for seed in (3, 14, 28, 44):
        image, entry = Drawing(seed).image(), entry_of(story_of(seed))
        assert image.mode == "RGB"
        assert image.size == (entry["width"], entry["height"])
        assert image.tobytes() == Drawing(seed).image().tobytes()
        assert entry == entry_of(story_of(seed))
    assert Drawing(3).image().tobytes() != Drawing(57).image().tobytes()


def test_the_planner_succeeds_with_true_outlines(tasks: list[Task], tmp_path: Path) -> None:
    for task in tasks:  # what is in the picture does not matter
        assert isinstance(task.picture, Drawing)
        Image.new("RGB", task.goals[0].size).save(tmp_path / task.picture.name)
    rows = tried(
        [plain(task) for task in tasks], Method("rules", "offline", mode="truth"), tmp_path
    )
    assert [(row.task, row.feedback) for row in rows if not row.sr] == []


def test_corners_and_bands_lie_where_robots_fit() -> None:
    for c in map(case, SEEDS):
        if c.rule["where"] == "corners":
            corners = shapely.points(np.asarray(c.rule["points"], dtype=float))
            off = shapely.distance(c.target.polygon.exterior, corners)
            assert float(off.max()) < c.rule["tolerance_px"]
        if c.rule["where"] == "boundary":
            low, high = c.rule["band_px"]
            assert low < max(6.0, 0.16 * math.sqrt(c.target.area)) < high


def dumb(name: str, goal: Goal) -> FloatArray:
    """Policies that understand nothing."""
    n, (width, height) = goal.robots, goal.size
    random = np.random.default_rng(0)
    x0, y0, x1, y1 = goal.target.outline.bounds
    turns = 2 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return {
        "picture": random.uniform((0, 0), (width - 1, height - 1), (n, 2)),
        "box": random.uniform((x0, y0), (x1, y1), (n, 2)),
        "tiny circle": np.asarray(goal.target.outline.centre) + circle * 2,
    }[name]


@pytest.mark.parametrize("name", ["picture", "box", "tiny circle"])
def test_positions_that_understand_nothing_fail(name: str, tasks: list[Task]) -> None:
    aimed = [task for task in tasks if task.goals[0].success["where"] != "center"]
    passed = [t.id for t in aimed if grade_goals(t.goals, dumb(name, t.goals[0])).sr]
    assert passed == []


def test_a_ring_around_another_thing_fails(tasks: list[Task]) -> None:
    for seed, task in zip(DRAWN, tasks, strict=True):
        goal = task.goals[0]
        for other in case(seed).rest:
            shares = np.arange(goal.robots) / goal.robots
            ring = other.polygon.exterior.buffer(6).exterior
            points = shapely.line_interpolate_point(ring, shares, normalized=True)
            assert not grade_goals([goal], shapely.get_coordinates(points)).sr


def test_things_are_whole_apart_and_of_fitting_size() -> None:
    for c in map(case, SEEDS):
        width, height = c.story.scene.size
        size = math.sqrt(c.target.area)
        inner = shapely.box(4, 4, width - 5, height - 5)
        ring = c.target.polygon.buffer(max(6.0, 0.16 * size))
        assert shapely.box(0, 0, width - 1, height - 1).contains(ring)
        assert all(t.polygon.is_valid and inner.contains(t.polygon) for t in (c.target, *c.rest))
        assert all(c.target.polygon.distance(t.polygon) >= 0.49 * size for t in c.rest)
        for i, thing in enumerate(c.rest):
            assert all(thing.polygon.distance(t.polygon) > 3 for t in c.rest[:i])
        single = c.story.setup == "single"
        assert 0.004 <= c.target.area / (width * height) <= (0.15 if single else 0.08)
        assert len(c.rest) == 0 if single else 3 <= len(c.rest) <= 13


@pytest.mark.parametrize("seed", range(0, 54, 2))
def test_outlines_are_those_of_the_drawn_pixels(seed: int) -> None:
    """Drawn on two grounds, a pixel is a thing's where it hides more than half of either."""
    scene, bare = case(seed).story.scene, Look(None, 0, 0, 0, 0, 0, 0)
    dark, pale = (
        np.asarray(draw(replace(scene, ground=Ground("flat", colour), look=bare)), dtype=float)
        for colour in ((0, 0, 0), (255, 255, 255))
    )
    drawn = (pale - dark).mean(axis=2) < 127.5
    x, y = np.meshgrid(np.arange(scene.size[0]), np.arange(scene.size[1]))
    region = shapely.union_all([t.polygon for t in (case(seed).target, *case(seed).rest)])
    truth = shapely.contains_xy(region, x, y)
    assert (drawn & truth).sum() / (drawn | truth).sum() >= 0.98


@pytest.mark.parametrize("seed", range(1, 54, 4))
def test_targets_stand_out_from_the_ground(seed: int) -> None:
    pixels: FloatArray = np.asarray(Drawing(seed).image(), dtype=float)
    target, (width, height) = case(seed).target.polygon, case(seed).story.scene.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    near = target.buffer(0.4 * math.sqrt(target.area)).difference(target.buffer(3))
    ground = pixels[shapely.contains_xy(near, x, y)].mean(axis=0)
    off = np.abs(pixels[shapely.contains_xy(target, x, y)] - ground).max(axis=1)
    assert np.median(off) > 25


def by_name(words: str, things: Sequence[Seen]) -> Seen:
    """The one thing a definite phrase means."""
    (fit,) = [t for t in things if words in (f"the {t.noun}", f"the {t.colour} {t.noun}")]
    return fit


def ahead(axis: int, sign: int, c: Case, a: Seen, b: Seen) -> float:
    """How much further a lies, as a multiple of what makes it clear."""
    return sign * (a.middle[axis] - b.middle[axis]) / max(40.0, 0.06 * c.story.scene.size[0])


def most(axis: int, sign: int) -> Callable[[Case], bool]:
    return lambda c: min(ahead(axis, sign, c, c.target, t) for t in c.group) >= 1


def second(c: Case, sign: int) -> bool:
    steps = sorted(ahead(0, sign, c, c.target, t) for t in c.group)
    return steps[0] <= -1 and steps[1] >= 1


def beside(axis: int, sign: int) -> Callable[[Case], bool]:
    def holds(c: Case) -> bool:
        other = by_name(c.story.slots["other"], c.rest)
        behind = [ahead(axis, sign, c, other, t) for t in c.group if t is not other]
        return ahead(axis, sign, c, c.target, other) >= 1 and min(behind) > 0.25

    return holds


def names(c: Case, thing: Seen) -> set[str]:
    return {thing.noun, *thing.also}


def larger(c: Case, others: Sequence[Seen], sign: int = 1) -> bool:
    return min((c.target.area / t.area) ** sign for t in others) >= 1.4


def nearest(c: Case) -> bool:
    other = by_name(c.story.slots["other"], c.rest)
    gap = c.target.polygon.distance(other.polygon)
    return all(t.polygon.distance(other.polygon) >= 1.5 * gap for t in c.group if t is not other)


def inside(c: Case) -> bool:
    other = by_name(c.story.slots["other"], c.rest)
    hole = Polygon(other.polygon.interiors[0])
    held = [t for t in (c.target, *c.rest) if t is not other and hole.intersects(t.polygon)]
    return held == [c.target] and hole.contains(c.target.polygon)


def between(c: Case) -> bool:
    ends = [by_name(c.story.slots[end], c.rest) for end in "ab"]
    line = shapely.LineString([t.middle for t in ends])
    off = [line.distance(Point(t.middle)) / line.length for t in c.rest if t not in ends]
    return line.distance(Point(c.target.middle)) <= 0.13 * line.length and min([1, *off]) >= 0.1


def close(c: Case, x: float, y: float, reach: float, times: float) -> bool:
    """Near that place of the picture, and nothing else nearly so near."""
    width, height = c.story.scene.size
    near, *off = (math.dist(t.middle, (x * width, y * height)) for t in (c.target, *c.group))
    return near <= reach * math.hypot(width, height) and min(off) >= times * near


def ratio(thing: Seen) -> float:
    sides = np.diff(shapely.get_coordinates(thing.polygon.minimum_rotated_rectangle), axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    return float(lengths.max() / lengths.min())


def fill(thing: Seen) -> float:
    """Share of the smallest disc around it that it fills, a mug without its handle."""
    bulk = thing.polygon.buffer(-0.17 * math.sqrt(thing.area)).buffer(0.17 * math.sqrt(thing.area))
    region = bulk if thing.noun == "mug" else Polygon(thing.polygon.exterior)
    return region.area / math.pi / float(shapely.minimum_bounding_radius(region)) ** 2


def odd(c: Case, what: str) -> bool:
    """The others agree, and the target is unlike them in that one thing."""
    looks: dict[str, Callable[[Seen], object]] = {
        "colour": lambda t: t.colour,
        "shape": lambda t: t.noun,
        "size": lambda t: round(math.log(t.area / c.rest[0].area) / 0.5),
    }
    unlike = [name for name, look in looks.items() if look(c.target) != look(c.rest[0])]
    return unlike == [what] * bool(what) and all(
        len({look(t) for t in c.rest}) == 1 for look in looks.values()
    )


def askew(c: Case) -> bool:
    turns = [t.turn for t in c.story.scene.things if t is not c.story.target]
    off = [abs((turn - turns[0] + 45) % 90 - 45) for turn in (c.story.target.turn, *turns)]
    return odd(c, "") and off[0] >= 20 and max(off[1:]) <= 6


def alone(c: Case) -> bool:
    things = [c.target, *c.rest]
    own, *gaps = (min(t.polygon.distance(o.polygon) for o in things if o is not t) for t in things)
    return own >= 1.9 * max(gaps)


HOLDS: dict[str, Callable[[Case], bool]] = {
    "single": lambda c: not c.group,
    "colour": lambda c: all(t.colour != c.story.slots["colour"] for t in c.group),
    "shape": lambda c: not any(t.noun in names(c, c.target) for t in c.rest),
    "colour_shape": lambda c: (
        not any(t.noun in names(c, c.target) and t.colour == c.target.colour for t in c.rest)
    ),
    "largest": lambda c: larger(c, c.group),
    "smallest": lambda c: larger(c, c.group, -1),
    "largest_colour": lambda c: larger(c, [t for t in c.group if t.colour == c.target.colour]),
    "leftmost": most(0, -1),
    "rightmost": most(0, 1),
    "topmost": most(1, -1),
    "bottommost": most(1, 1),
    "second_left": lambda c: second(c, -1),
    "second_right": lambda c: second(c, 1),
    "left_of": beside(0, -1),
    "right_of": beside(0, 1),
    "above": beside(1, -1),
    "below": beside(1, 1),
    "nearest": nearest,
    "inside": inside,
    "between": between,
    "corner": lambda c: close(
        c, "right" in c.story.slots["corner"], "lower" in c.story.slots["corner"], 0.35, 1.3
    ),
    "middle": lambda c: close(c, 0.5, 0.5, 0.08, 2),
    "round": lambda c: fill(c.target) > 0.86 and max(map(fill, c.group)) < 0.75,
    "long": lambda c: ratio(c.target) > 2.1 and max(map(ratio, c.group)) < 1.7,
    "odd_colour": lambda c: odd(c, "colour"),
    "odd_size": lambda c: odd(c, "size"),
    "odd_shape": lambda c: odd(c, "shape"),
    "askew": askew,
    "alone": alone,
}


def test_what_is_said_is_true_of_one_thing_alone() -> None:
    assert set(HOLDS) == {*KINDS, *HIDDEN}
    assert [s for s in SEEDS if not HOLDS[case(s).story.kind](case(s))] == []


def test_hidden_targets_are_never_told_by_their_look() -> None:
    hidden = [c.story for c in map(case, SEEDS) if c.story.setup == "hidden"]
    assert {story.kind for story in hidden} == set(HIDDEN)
    assert all(set(story.slots) == {"noun", "nouns"} for story in hidden)


@pytest.mark.parametrize("file", ["wordings.yaml", "fresh.yaml"])
def test_wordings_fill_every_need(file: str) -> None:
    text = (FOLDER / file).read_text(encoding="utf-8")
    words: dict[str, dict[str, list[str]]] = yaml.safe_load(text)
    slots = {"noun", "nouns", "colour", "shape", "other", "a", "b", "corner"}
    assert set(words) == {"arrangements", "referring"}
    assert set(words["arrangements"]) == {"around", "corners", "side", "inside", "cage", "centre"}
    assert set(words["referring"]) == {*KINDS, *HIDDEN, "odd"}
    for allowed, some, least in (
        ({"n", "thing", "side"}, words["arrangements"], 6),
        (slots, words["referring"], 5),
    ):
        for name, templates in some.items():
            assert len(set(templates)) >= least, name
            used = [{f for _, f, _, _ in string.Formatter().parse(t) if f} for t in templates]
            assert all(u <= allowed for u in used), name


def test_instructions_name_a_count_and_leave_no_slot_open() -> None:
    texts = [case(seed).instruction for seed in SEEDS]
    assert not any("{" in text for text in texts)
    assert any(c.isdigit() for text in texts for c in text)
    assert any(" five " in f" {text} " for text in texts)
