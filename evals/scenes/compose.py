"""Composition of scenes in which one thing can be told by a given kind of reference."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.random import Generator

from . import ground as grounds
from .layout import Point, Rows, rows, scatter
from .palette import VISIBLE, difference, lit, shade
from .reference_words import HIDDEN, goes_by
from .things import Family, Ground, Look, Scene, Sort, Thing, make

Choice = tuple[Sort, str]
"""A sort and one of its colours."""


@dataclass(frozen=True)
class Stage:
    """What is chosen before the things: the family, the picture's size and the ground."""

    family: Family
    size: tuple[int, int]
    ground: Ground

    @property
    def area(self) -> tuple[float, float, float, float]:
        """The whole picture, x0, y0, x1, y1."""
        return 0.0, 0.0, self.size[0] - 1.0, self.size[1] - 1.0

    def base(self, share: float) -> float:
        """Return the size, px, of a thing that covers this share of the picture's area."""
        return math.sqrt(share * self.size[0] * self.size[1])

    def visible(self, random: Generator) -> list[Choice]:
        """Return the sorts with those of their colours that stand out from the ground."""
        return [
            (sort, colour)
            for sort in self.family.sorts
            for colour in sort.colours
            if min(difference(shade(random, colour), self.ground.colour) for _ in range(4))
            > VISIBLE
        ]


def stage(random: Generator, family: Family) -> Stage:
    """Choose the size of a picture and its ground."""
    width = int(random.integers(480, 961))
    ratio = float(random.choice([1.0, 4 / 3, 4 / 3, 3 / 2, 16 / 10, 5 / 6]))
    size = width, min(round(width / ratio), 800)
    return Stage(family, size, family.ground(random, size))


def compose(random: Generator, seed: int, where: Stage, kind: str, setup: str) -> Scene | None:
    """Compose a scene on a stage, its target first if that is settled; None if it fails."""
    choices = where.visible(random)
    solid = [choice for choice in choices if not choice[0].encloses]
    if setup == "single":
        things = _single_thing(random, where, solid)
    elif kind in HIDDEN:
        things = _place_odd_one_out(random, where, solid, kind)
    else:
        things = _place_mixed(random, where, choices, kind)
    if not things:
        return None
    ground = where.ground
    if isinstance(things, Rows):
        if where.family.bays and random.random() < 0.85:
            ink = 230.0 if random.random() < 0.7 else 205.0
            lines = grounds.bays(things.cells, things.box, things.turn, (ink, ink, ink * 0.95))
            ground = replace(ground, marks=ground.marks + lines)
        things = things.things
    return Scene(seed, where.family.name, where.size, ground, tuple(things), _look(random, things))


def _look(random: Generator, things: Sequence[Thing]) -> Look:
    size = float(np.median([thing.size for thing in things]))
    way, far = random.uniform(0, 2 * math.pi), size * random.uniform(0.03, 0.11)
    shadow = (
        far * math.cos(way),
        far * math.sin(way),
        random.uniform(0.6, 0.03 * size + 1),
        random.uniform(0.2, 0.5),
    )
    return Look(
        shadow=shadow if random.random() < 0.7 else None,
        light=float(random.uniform(0, 0.16)),
        way=float(random.uniform(0, 360)),
        grain=float(random.uniform(0, 0.22)),
        noise=float(random.choice([0.0, 1.5, 3.0, 5.0])),
        blur=float(random.choice([0.0, 0.0, 0.5, 0.8])),
        jpeg=int(random.choice([0, 0, 60, 80, 92])),
    )


def _pick(random: Generator, choices: Sequence[Choice]) -> Choice | None:
    """Choose one, each noun as likely as another; None if there are none."""
    nouns = sorted({sort.noun for sort, _ in choices})
    if not nouns:
        return None
    noun = nouns[random.integers(len(nouns))]
    same = [c for c in choices if c[0].noun == noun]
    return same[random.integers(len(same))]


def _single_thing(
    random: Generator, where: Stage, solid: list[Choice]
) -> list[Thing] | Rows | None:
    picked = _pick(random, solid)
    if picked is None:
        return None
    share = math.exp(random.uniform(math.log(0.012), math.log(0.14)))
    thing = make(random, *picked, where.base(share))
    base, turns = _turns_of_things(random, where, 1)
    return _arranged(random, where, [thing], base, turns, where.family.rows)


def _turns_of_things(random: Generator, where: Stage, count: int) -> tuple[float, list[float]]:
    """Choose a direction of the whole and each thing's turn relative to it, degrees."""
    style = where.family.turns
    if style == "either":
        style = "aligned" if random.random() < 0.5 else "free"
    if style == "free":
        return 0.0, [float(v) for v in random.uniform(0, 360, count)]
    base = float(random.choice([0, 0, 90, random.uniform(0, 180)]))
    return base, [float(v) for v in random.choice([0, 180], count) + random.uniform(-2, 2, count)]


def _arranged(
    random: Generator,
    where: Stage,
    things: list[Thing],
    base: float,
    turns: list[float],
    rate: float,
) -> list[Thing] | Rows | None:
    if random.random() < rate:
        placed = rows(random, where.area, things, base, turns)
        if placed is not None:
            return placed
    return scatter(random, where.area, things, [base + t for t in turns], {})


def _place_odd_one_out(
    random: Generator, where: Stage, solid: list[Choice], kind: str
) -> list[Thing] | Rows | None:
    """Make and place things that are alike, the first one differing in what the kind names."""
    turned = kind == "askew"
    usual = _pick(random, [c for c in solid if c[0].upright or not turned])
    if usual is None:
        return None
    count = int(random.integers(5, 12))
    share = math.exp(random.uniform(math.log(0.006), math.log(0.28 / count)))
    size, odd = where.base(share), usual
    sizes = size * random.uniform(0.98, 1.02, count)
    if kind == "odd_colour":
        here, own = shade(random, usual[1]), [c for c in solid if c[0] is usual[0]]
        odd = _pick(random, [c for c in own if difference(shade(random, c[1]), here) > 38])
    elif kind == "odd_shape":
        odd = _pick(random, [c for c in solid if _unlike(c, usual)])
    elif kind == "odd_size":
        sizes[0] *= (
            random.uniform(1.45, 1.75) if random.random() < 0.6 else 1 / random.uniform(1.45, 1.7)
        )
    if odd is None:
        return None
    form, paint = int(random.integers(2**31)), shade(random, usual[1])
    odd_paint = paint if odd[1] == usual[1] else shade(random, odd[1])
    things = [
        make(
            np.random.default_rng(form),
            *(usual if i else odd),
            float(s),
            lit(paint if i else odd_paint, random.uniform(0.96, 1.02)),
        )
        for i, s in enumerate(sizes)
    ]
    if kind == "alone":
        return _cluster(random, where, things)
    base, turns = _turns_of_things(random, where, count)
    if turned or usual[0].upright:
        turns = [float(v) for v in random.uniform(-2, 2, count)]
    if turned:
        turns[0] = float(random.choice([-1, 1]) * random.uniform(24, 40))
    return _arranged(random, where, things, base, turns, max(where.family.rows, 0.5))


def _unlike(choice: Choice, usual: Choice) -> bool:
    """Return whether it is of the usual one's colour, but of a clearly different form."""
    a, b = make_one(choice), make_one(usual)
    same_look = abs(a.stretch - b.stretch) < 0.5 and abs(a.roundness - b.roundness) < 0.12
    return (
        choice[1] == usual[1]
        and not goes_by(a, b)
        and not goes_by(b, a)
        and not (same_look and abs(a.solidity - b.solidity) < 0.15)
    )


def make_one(choice: Choice) -> Thing:
    """Make a specimen of fixed form, to compare sorts by."""
    return make(np.random.default_rng(0), *choice, 100)


def _cluster(random: Generator, where: Stage, things: list[Thing]) -> list[Thing] | None:
    """Place all but the first near each other, and the first far away; None if it fails."""
    share, flipped = random.uniform(0.5, 0.62), random.random() < 0.5
    axis = int(where.area[2] < where.area[3])
    long, part, rest = where.area[axis + 2], list(where.area), list(where.area)
    if flipped:
        part[axis], rest[axis + 2] = long - share * long, long - (share + 0.1) * long
    else:
        part[axis + 2], rest[axis] = share * long, (share + 0.1) * long
    base, turns = _turns_of_things(random, where, len(things))
    turns = [base + turn for turn in turns]
    near = rows(random, part, things[1:], base, [t - base for t in turns[1:]])
    many = near.things if near else scatter(random, part, things[1:], turns[1:], {})
    if not many or len(many) < 4:
        return None
    alone = scatter(random, rest, things[:1], turns[:1], {}, taken=many)
    return [*alone, *many] if alone else None


def _place_mixed(
    random: Generator, where: Stage, choices: list[Choice], kind: str
) -> list[Thing] | Rows | None:
    """Make and place things of a few sorts and colours, the first to be told by the kind."""
    count = int(random.integers(4, 13))
    palette = _choices_for(random, [c for c in choices if not c[0].encloses], kind, count)
    if palette is None:
        return None
    share = math.exp(random.uniform(math.log(0.006), math.log(max(0.25 / count, 0.008))))
    spread = 1.35 if kind in ("largest", "smallest", "largest_colour") else 1.15
    sizes = where.base(share) * spread ** random.uniform(-1, 1, count)
    if kind in ("largest", "largest_colour"):
        sizes[0] *= 1.6
    elif kind == "smallest":
        sizes[0] /= 1.5
    things = [
        make(random, *choice, float(s * choice[0].scale))
        for choice, s in zip(palette, sizes, strict=True)
    ]
    base, turns = _turns_of_things(random, where, count)
    turned = [base + turn for turn in turns]
    if kind == "inside":
        return _enclosed(random, where, choices, things, turned)
    if kind in BESIDE and random.random() < 0.8:
        return _on_one_side(random, where, things, turned, *BESIDE[kind])
    anchors = _anchors(random, where, kind)
    if anchors:
        return scatter(random, where.area, things, turned, anchors)
    return _arranged(random, where, things, base, turns, where.family.rows)


def _choices_for(
    random: Generator, solid: list[Choice], kind: str, count: int
) -> list[Choice] | None:
    """Choose what each thing is.

    The first is unique in what the kind names; none can be taken for one that the reference names.
    """
    pool = [_pick(random, solid) for _ in range(int(random.integers(2, 5)))]
    nouns, colours = {c[0].noun for c in pool if c}, {c[1] for c in pool if c}
    mixed = [c for c in solid if c[0].noun in nouns and c[1] in colours]
    first = _pick(random, [c for c in mixed if _can_be_target(c, kind)])
    if first is None:
        return None
    more = [_pick(random, mixed) for _ in range(_NAMED.get(kind, 0))]
    named = [first, *filter(None, more)]
    left = [[c for c in some if _can_stand_beside(c, first, kind)] for some in (mixed, solid)]
    for other in named[1:]:
        left = [[c for c in some if not _confused(c, other)] for some in left]
    rest = left[0] or left[1]
    if not rest or (kind in _NAMED and any(_confused(a, b) for a, b in combinations(named, 2))):
        return None
    return named + [rest[i] for i in random.integers(len(rest), size=count - len(named))]


_NAMED = {"left_of": 1, "right_of": 1, "above": 1, "below": 1, "nearest": 1, "between": 2}
"""How many other things the reference names."""


def _confused(a: Choice, b: Choice) -> bool:
    """Return whether colour and noun fail to tell the two apart."""
    return a[0] is b[0] and (a[1] == b[1] or not a[0].by_colour)


def _can_be_target(choice: Choice, kind: str) -> bool:
    if kind == "round":
        return make_one(choice).roundness >= 0.87
    return kind != "long" or make_one(choice).stretch >= 2.2


def _can_stand_beside(choice: Choice, first: Choice, kind: str) -> bool:
    """Return whether such a thing may be in the scene of the target."""
    if kind == "round":
        return make_one(choice).roundish <= 0.72
    if kind == "long":
        return make_one(choice).stretch <= 1.6
    if kind in ("single", "shape"):
        return choice[0] is not first[0]
    if kind == "colour":
        return choice[1] != first[1]
    return kind != "colour_shape" or choice[0] is not first[0] or choice[1] != first[1]


BESIDE = {"left_of": (0, -1), "right_of": (0, 1), "above": (1, -1), "below": (1, 1)}
"""Axis (0 for x, 1 for y) and direction."""


def _on_one_side(
    random: Generator, where: Stage, things: list[Thing], turns: list[float], axis: int, sign: int
) -> list[Thing] | None:
    """Place the first thing on one side of the second, with no other of its sort on that side."""
    along, across = random.uniform(0.3, 0.45), random.uniform(0.3, 0.7)
    spots: list[Point] = []
    for share, off in ((random.uniform(0.1, 0.18), random.uniform(-0.1, 0.1)), (along, 0.0)):
        place = [0.0, 0.0]
        place[axis] = (share if sign < 0 else 1 - share) * where.size[axis]
        place[1 - axis] = (across + off) * where.size[1 - axis]
        spots.append((place[0], place[1]))
    pair = scatter(random, where.area, things[:2], turns[:2], {0: spots[0], 1: spots[1]})
    if pair is None:
        return None
    beyond = list(where.area)
    beyond[axis if sign < 0 else axis + 2] = spots[1][axis] - sign * 10
    own = random.random() < 0.5
    free = [i for i in range(2, len(things)) if own and things[i].sort is not things[0].sort]
    others = [i for i in range(2, len(things)) if i not in free]
    for group, area in ((others, beyond), (free, where.area)):
        some = [things[i] for i in group]
        pair += scatter(random, area, some, [turns[i] for i in group], {}, pair) or []
    return pair


def _anchors(random: Generator, where: Stage, kind: str) -> dict[int, Point]:
    """Return places of the first things, by index, if the kind is about a place."""
    w, h = where.size
    if kind == "middle":
        return {0: (w * random.uniform(0.46, 0.54), h * random.uniform(0.46, 0.54))}
    if kind == "corner":
        x, y = random.uniform(0.14, 0.22, 2)
        return {0: (w * abs(int(random.integers(2)) - x), h * abs(int(random.integers(2)) - y))}
    if kind == "between":
        turn, reach = random.uniform(0, math.pi), min(w, h) * random.uniform(0.26, 0.36)
        dx, dy = reach * math.cos(turn), reach * math.sin(turn)
        x, y = w * random.uniform(0.42, 0.58), h * random.uniform(0.42, 0.58)
        return {0: (x, y), 1: (x - dx, y - dy), 2: (x + dx, y + dy)}
    return {}


def _enclosed(
    random: Generator, where: Stage, choices: list[Choice], things: list[Thing], turns: list[float]
) -> list[Thing] | None:
    """Place the first thing within one that encloses it, the others elsewhere; None if it fails."""
    around = _pick(random, [c for c in choices if c[0].encloses])
    if around is None:
        return None
    inner = things[0]
    reach = max(abs(v) for v in inner.polygon.bounds) * 1.42
    outer = make(random, *around, 2.0 * (reach + 0.6 * inner.size + 6))
    placed = scatter(random, where.area, [outer], turns[:1], {})
    if not placed:
        return None
    held = inner.moved(*placed[0].place, turns[0])
    if held.polygon.distance(placed[0].polygon) < 0.52 * inner.size:
        return None
    others = scatter(random, where.area, things[1:], turns[1:], {}, taken=placed)
    return [held, *placed, *(others or [])]
