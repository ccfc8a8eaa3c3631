"""Words that tell one thing from all others, decided by wide margins.

Each kind of reference is a rule on (thing, the others of its group, the whole view): it returns
the words that fill its template if it applies beyond doubt, else None. Those without words
return whether they apply.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from .layout import nearest_gap
from .things import Thing

AREA_RATIO = 1.45
"""Least ratio of the areas of the largest thing and the next."""
GENERAL = ("thing", "object", "item", "piece")
Slots = dict[str, str]


@dataclass(frozen=True)
class View:
    """All things of a picture, and its width and height, px."""

    things: Sequence[Thing]
    size: tuple[int, int]

    @property
    def margin(self) -> float:
        """How much further along than another a thing must lie to count as such, px."""
        return max(42.0, 0.062 * self.size[0])


Rule = Callable[[Thing, list[Thing], View], Slots | bool | None]


def reference_slots(kind: str, thing: Thing, group: Sequence[Thing], view: View) -> Slots | None:
    """Return what fills the template of a kind for a thing of a group; None if it is unclear."""
    found = _RULES[kind](thing, [t for t in group if t is not thing], view)
    if found is None or isinstance(found, dict):
        return found
    return {} if found else None


def _by_colour(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    clear = all(t.sort.by_colour and t.colour != thing.colour for t in others)
    return {"colour": thing.colour} if thing.sort.by_colour and clear else None


def _by_shape(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    if not thing.sort.is_shape or any(goes_by(t, thing) for t in view.things if t is not thing):
        return None
    return {"shape": thing.sort.noun}


def goes_by(other: Thing, thing: Thing) -> bool:
    """Return whether someone might call the other thing by this one's noun."""
    return other.sort.noun in (thing.sort.noun, *thing.sort.also)


def _by_both(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    rest = [t for t in view.things if t is not thing]
    same_shape = [t for t in rest if goes_by(t, thing)]
    same_colour = [t for t in rest if t.colour == thing.colour]
    both = any(t.colour == thing.colour for t in same_shape)
    if not thing.sort.is_shape or both or not same_shape or not same_colour:
        return None
    return {"colour": thing.colour, "shape": thing.sort.noun}


def _larger(thing: Thing, others: list[Thing], view: View) -> bool:
    return bool(others) and thing.area >= AREA_RATIO * max(t.area for t in others)


def _smaller(thing: Thing, others: list[Thing], view: View) -> bool:
    return bool(others) and AREA_RATIO * thing.area <= min(t.area for t in others)


def _larger_of_colour(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    same = [t for t in others if t.colour == thing.colour]
    clear = thing.sort.by_colour and all(t.sort.by_colour for t in others)
    return {"colour": thing.colour} if clear and _larger(thing, same, view) else None


def _along_axis(thing: Thing, axis: int, sign: int) -> tuple[float, float]:
    """Return the centre and far edge of a thing along an axis, growing towards `sign`."""
    bounds = thing.polygon.bounds
    edge = bounds[axis + 2] if sign > 0 else bounds[axis]
    return sign * thing.place[axis], sign * edge


def _most(axis: int, sign: int, thing: Thing, others: list[Thing], view: View) -> bool:
    centre, edge = _along_axis(thing, axis, sign)
    rest = [_along_axis(t, axis, sign) for t in others]
    return bool(rest) and all(centre >= c + view.margin and edge >= e + 8 for c, e in rest)


def _second(sign: int, thing: Thing, others: list[Thing], view: View) -> bool:
    first = [t for t in others if _most(0, sign, t, [thing], view)]
    rest = [t for t in others if t not in first]
    return len(first) == 1 and len(rest) > 1 and _most(0, sign, thing, rest, view)


def phrase(thing: Thing, view: View) -> str | None:
    """Return a definite phrase by noun, or colour and noun; None if neither tells the thing."""
    named = [t for t in view.things if t is not thing and goes_by(t, thing)]
    if not named:
        return f"the {thing.sort.noun}"
    if thing.sort.by_colour and all(t.colour != thing.colour for t in named):
        return f"the {thing.colour} {thing.sort.noun}"
    return None


def _beside_another(
    axis: int, sign: int, thing: Thing, others: list[Thing], view: View
) -> Slots | None:
    """Return the slots if it is the only one of its group on that side of another thing."""
    for other in view.things:
        words = phrase(other, view) if other is not thing else None
        rest = [t for t in others if t is not other]
        if words is None or not rest or not _most(axis, sign, thing, [other], view):
            continue
        ahead = _along_axis(other, axis, sign)[0] - 0.4 * view.margin
        across = abs(thing.place[1 - axis] - other.place[1 - axis])
        far = abs(thing.place[axis] - other.place[axis])
        if across <= 0.8 * far and all(_along_axis(t, axis, sign)[0] <= ahead for t in rest):
            return {"other": words}
    return None


def _nearest_to_another(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    for other in view.things:
        words = phrase(other, view) if other is not thing else None
        rest = [t for t in others if t is not other]
        if words is None or not rest:
            continue
        gaps = [thing.polygon.distance(other.polygon), math.dist(thing.place, other.place)]
        next_gaps = [
            min(t.polygon.distance(other.polygon) for t in rest),
            min(math.dist(t.place, other.place) for t in rest),
        ]
        if all(1.6 * a <= b for a, b in zip(gaps, next_gaps, strict=True)):
            return {"other": words}
    return None


def _inside_another(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    for other in view.things:
        words = phrase(other, view) if other.sort.encloses else None
        held = [
            t
            for t in view.things
            if t is not other and other.polygon.convex_hull.contains(t.polygon)
        ]
        if words and held == [thing]:
            return {"other": words}
    return None


def _between_two(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    rest = [t for t in view.things if t is not thing]
    for i, a in enumerate(rest):
        for b in rest[i + 1 :]:
            first, second = phrase(a, view), phrase(b, view)
            if first is None or second is None or first == second:
                continue
            share, off = _station(thing, a, b)
            others_off = [_station(t, a, b) for t in rest if t is not a and t is not b]
            if (
                0.3 <= share <= 0.7
                and off <= 0.12
                and all(o >= 0.4 or not -0.1 <= s <= 1.1 for s, o in others_off)
            ):
                return {"a": first, "b": second}
    return None


def _station(thing: Thing, a: Thing, b: Thing) -> tuple[float, float]:
    """Return how far along and how far off the line from a to b a thing is, over its length."""
    (ax, ay), (bx, by), (x, y) = a.place, b.place, thing.place
    dx, dy = bx - ax, by - ay
    length = max(dx * dx + dy * dy, 1e-9)
    along, across = (x - ax) * dx + (y - ay) * dy, (x - ax) * dy - (y - ay) * dx
    return along / length, abs(across) / length


def _in_corner(thing: Thing, others: list[Thing], view: View) -> Slots | None:
    x, y = (2 * p / s - 1 for p, s in zip(thing.place, view.size, strict=True))
    down, right = math.copysign(1, y), math.copysign(1, x)
    if min(abs(x), abs(y)) < 0.45 or not others:
        return None
    corner = (view.size[0] * (right > 0), view.size[1] * (down > 0))
    for t in others:
        u, v = (2 * p / s - 1 for p, s in zip(t.place, view.size, strict=True))
        near = math.dist(t.place, corner) < 1.4 * math.dist(thing.place, corner)
        if near or (u * right > 0.05 and v * down > 0.05):
            return None
    return {"corner": f"{'lower' if down > 0 else 'upper'} {'right' if right > 0 else 'left'}"}


def _in_middle(thing: Thing, others: list[Thing], view: View) -> bool:
    middle = ((view.size[0] - 1) / 2, (view.size[1] - 1) / 2)
    side = min(view.size)
    near = math.dist(thing.place, middle) <= 0.09 * side
    return near and bool(others) and all(math.dist(t.place, middle) >= 0.27 * side for t in others)


def _round(thing: Thing, others: list[Thing], view: View) -> bool:
    return thing.roundness >= 0.87 and all(t.roundish <= 0.72 for t in others) and bool(others)


def _elongated(thing: Thing, others: list[Thing], view: View) -> bool:
    return thing.stretch >= 2.2 and all(t.stretch <= 1.6 for t in others) and bool(others)


def _askew(thing: Thing, others: list[Thing], view: View) -> bool:
    def off(a: float, b: float) -> float:
        return abs((a - b + 45) % 90 - 45)

    first = others[0].turn
    return all(off(t.turn, first) <= 5 for t in others) and off(thing.turn, first) >= 20


def _stands_alone(thing: Thing, others: list[Thing], view: View) -> bool:
    gaps = [nearest_gap(t, [o for o in others if o is not t]) for t in others]
    return nearest_gap(thing, others) >= 2.0 * max(gaps)


def _differs(of: Callable[[Thing], str], thing: Thing, others: list[Thing], view: View) -> bool:
    return {of(t) for t in others} == {of(others[0])} and of(thing) != of(others[0])


def _odd_size(thing: Thing, others: list[Thing], view: View) -> bool:
    areas = [t.area for t in others]
    agree = max(areas) <= 1.2 * min(areas)
    return agree and (thing.area >= 1.8 * max(areas) or 1.8 * thing.area <= min(areas))


_RULES: dict[str, Rule] = {
    "single": lambda thing, others, view: not others,
    "colour": _by_colour,
    "shape": _by_shape,
    "colour_shape": _by_both,
    "largest": _larger,
    "smallest": _smaller,
    "leftmost": partial(_most, 0, -1),
    "rightmost": partial(_most, 0, 1),
    "topmost": partial(_most, 1, -1),
    "bottommost": partial(_most, 1, 1),
    "second_left": partial(_second, -1),
    "second_right": partial(_second, 1),
    "largest_colour": _larger_of_colour,
    "left_of": partial(_beside_another, 0, -1),
    "right_of": partial(_beside_another, 0, 1),
    "above": partial(_beside_another, 1, -1),
    "below": partial(_beside_another, 1, 1),
    "nearest": _nearest_to_another,
    "inside": _inside_another,
    "between": _between_two,
    "corner": _in_corner,
    "middle": _in_middle,
    "round": _round,
    "long": _elongated,
    "odd_colour": partial(_differs, lambda t: t.colour),
    "odd_size": _odd_size,
    "odd_shape": partial(_differs, lambda t: t.sort.noun),
    "askew": _askew,
    "alone": _stands_alone,
}
HIDDEN = ("odd_colour", "odd_size", "odd_shape", "askew", "alone")
KINDS = tuple(kind for kind in _RULES if kind not in HIDDEN)
