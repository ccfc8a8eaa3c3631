"""Checks of what a dialogue's turn must and must not have changed, by the names suites use.

A check is given the turn and what a suite wants of it, and yields what is wrong. Lengths are px of
the picture on true outlines, with slack for outlines that were measured: a robot's place is
compared with the truth, not with what the method took for it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ...tools.geometry.cages.cages import cage
from ...tools.geometry.outline import FloatArray
from .dialogue_answers import says
from .dialogue_forms import (
    angle_off,
    box_direction,
    form_problems,
    gaps_around,
    neighbour_distance,
    way_of,
)
from .dialogue_states import UNMOVED, Case, distances_to

Check = Callable[[Case, Any], Iterator[str]]
PX, SHARE = 3.0, 0.15
"""Slack of a length: the larger of so many px and this share of it."""
EVEN = (0.4, 1.6)
"""Gaps of an even ring are within these shares of their mean."""
SIDE = {"left": 180.0, "right": 0.0, "top": -90.0, "bottom": 90.0}
"""Directions in the picture, degrees clockwise from the right."""
ON_SIDE, OFF_SIDE = 60.0, 30.0
"""How far off the middle of a side, degrees, with the thing's box stretched to a square, a robot is
still on it; and within how many it is not off it."""
FACING = 40.0
SCATTER = 2.0
"""How much the standard deviation of distances may grow, px, or by SHARE of the mean."""
MEANS = {"further": (1.08, 1e9), "closer": (0.0, 0.93), "same": (0.93, 1.07)}
"""Bounds of the mean distance over that before."""
SPREADS = {"wider": (1.03, 1e9), "tighter": (0.0, 0.97), "same": (0.95, 1.05)}


def _numbered(wanted: Any, all_of: Sequence[str]) -> list[str]:
    """Return the ids of robots given by number, or of all."""
    return list(all_of) if wanted == "all" else [str(name) for name in wanted]


def robots(case: Case, wanted: int | str) -> Iterator[str]:
    """Check for so many robots, `more`, `fewer` or `any`; those from before keep their ids."""
    count, was = len(case.after.robots), len(case.before.robots)
    right = {"more": count > was, "fewer": count < was, "any": True}
    if not right.get(str(wanted), count == wanted):
        yield f"{count} robots after {was}, not {wanted}"
    elif len(case.remaining) < min(was, count):
        yield f"only {len(case.remaining)} robots kept their ids"


def ids(case: Case, wanted: Sequence[int]) -> Iterator[str]:
    """Check that there are exactly these robots."""
    if {str(name) for name in wanted} != set(case.after.robots):
        yield f"the robots are {', '.join(case.after.robots)}, not {', '.join(map(str, wanted))}"


def leave(case: Case, wanted: Sequence[int]) -> Iterator[str]:
    """Check that these robots are gone, and no others."""
    gone = set(case.before.robots) - set(case.after.robots)
    if gone != {str(name) for name in wanted}:
        yield f"{', '.join(sorted(gone)) or 'nobody'} left, not {', '.join(map(str, wanted))}"


def stay(case: Case, wanted: Any) -> Iterator[str]:
    """Check that robots have not moved: those given, or all that were and still are there."""
    for name in _numbered(wanted, case.remaining):
        if name not in case.after.at:
            yield f"robot {name} is gone"
        elif (far := float(np.linalg.norm(case.moved(name)))) > UNMOVED:
            yield f"robot {name} was to stay and moved by {far:.0f} px"


def move(case: Case, wanted: Sequence[int]) -> Iterator[str]:
    """Check that these robots have moved, and no others."""
    moving = [str(name) for name in wanted]
    yield from stay(case, [name for name in case.remaining if name not in moving])
    for name in moving:
        if name not in case.remaining or float(np.linalg.norm(case.moved(name))) <= UNMOVED:
            yield f"robot {name} was to move"


def at(case: Case, wanted: Mapping[int, Sequence[float]]) -> Iterator[str]:
    """Check that robots are at points (x, y) px."""
    for number, place in wanted.items():
        here = case.after.at.get(str(number))
        if here is None or float(np.linalg.norm(here - np.asarray(place))) > PX + UNMOVED:
            yield f"robot {number} is at {here}, not at {place}"


def shift(case: Case, wanted: Mapping[str, Any]) -> Iterator[str]:
    """Check that robots went `by` [dx, dy], or `towards` a side, degrees or a thing, `least` px."""
    for name in _numbered(wanted.get("robots", "all"), case.remaining):
        if name not in case.remaining:
            yield f"robot {name} is gone"
            continue
        way = case.moved(name)
        far = float(np.linalg.norm(way))
        if "by" in wanted:
            off = float(np.linalg.norm(way - np.asarray(wanted["by"])))
            if off > max(PX, SHARE * float(np.linalg.norm(wanted["by"]))):
                yield f"robot {name} went by {way.round()}, not by {wanted['by']}"
            continue
        towards = way_of(wanted["towards"], case, case.before.at[name])
        if far < wanted.get("least", UNMOVED):
            yield f"robot {name} went only {far:.1f} px"
        elif angle_off(way, towards) > FACING:
            yield f"robot {name} went by {way.round()}, not towards {wanted['towards']}"


def swap(case: Case, wanted: Sequence[int]) -> Iterator[str]:
    """Check that two robots have each other's place, and no others moved."""
    a, b = (str(name) for name in wanted)
    yield from stay(case, [name for name in case.remaining if name not in (a, b)])
    for one, other in ((a, b), (b, a)):
        here, there = case.after.at.get(one), case.before.at.get(other)
        if here is None or there is None or float(np.linalg.norm(here - there)) > UNMOVED:
            yield f"robot {one} is not where {other} was"


def target(case: Case, wanted: Any) -> Iterator[str]:
    """Check that all robots are about a thing, or so many about each: {t1: 4, t2: 4}."""
    counts = {name: len(robots) for name, robots in case.owners(case.after).items()}
    wish = {wanted: len(case.after.robots)} if isinstance(wanted, str) else wanted
    if counts != wish:
        yield f"robots are about {counts}, not {wish}"


def distance(case: Case, wanted: Any) -> Iterator[str]:
    """Check the distance of robots from the thing they are about.

    The mean: `further`, `closer`, `same`, `times` [low, high] that before, `more` or `less` by px.
    Each robot: exactly `px` or `m`, `least` or `most`. A ring must stay one: distances that were
    equal must not be scattered.
    """
    after, before = case.distances(case.after), case.distances(case.before)
    mean, was = float(after.mean()), float(before.mean()) if len(before) else 0.0
    wish: Mapping[str, Any] = {wanted: 0} if isinstance(wanted, str) else wanted
    for name, value in wish.items():
        if not _distance_is(after, was, name, value, case.scale):
            yield (
                f"{after.min():.0f} to {after.max():.0f} px away, {mean:.1f} in the mean after "
                f"{was:.1f}, not {name} {value or ''}"
            )
    spread = float(before.std()) * max(1.0, mean / max(was, 1e-9)) if len(before) else mean
    if after.std() > spread + max(SCATTER, SHARE * mean):
        yield f"robots are scattered, {after.min():.0f} to {after.max():.0f} px away"


def _distance_is(after: FloatArray, was: float, name: str, value: Any, scale: float | None) -> bool:
    mean = float(after.mean())
    if name in MEANS:
        low, high = MEANS[name]
        return low * was <= mean <= high * was and (name == "same" or abs(mean - was) > UNMOVED)
    if name == "times":
        return value[0] * was <= mean <= value[1] * was
    if name in ("more", "less"):
        change = mean - was if name == "more" else was - mean
        return abs(change - value) <= max(PX, 2 * SHARE * value)
    px = value / (scale or 1.0) if name == "m" else value
    slack = max(PX, SHARE * px)
    near, far = bool((after >= px - slack).all()), bool((after <= px + slack).all())
    return {"least": near, "most": far}.get(name, near and far)


def spacing(case: Case, wanted: Any) -> Iterator[str]:
    """Check the mean distance to the nearest robot: `wider`, `tighter`, `same`, `times`, `px`."""
    now, was = neighbour_distance(case.after), neighbour_distance(case.before)
    wish: Mapping[str, Any] = {"times": SPREADS[wanted]} if isinstance(wanted, str) else wanted
    for name, value in wish.items():
        low, high = (
            (value[0] * was, value[1] * was)
            if name == "times"
            else (value - max(PX, SHARE * value), value + max(PX, SHARE * value))
        )
        if not low <= now <= high:
            yield f"neighbours are {now:.1f} px apart after {was:.1f}, not {name} {value}"


def even(case: Case, wanted: Any) -> Iterator[str]:
    """Check that robots about each thing are evenly spaced; `open`: except for one wide gap."""
    for thing, points in case.rings():
        arcs = gaps_around(thing, points).arcs
        if wanted == "open":
            arcs = np.sort(arcs)[:-1]
        low, high = (share * float(arcs.mean()) for share in EVEN) if len(arcs) else (0.0, 0.0)
        if len(arcs) and not (low <= arcs.min() and arcs.max() <= high):
            yield f"gaps of {arcs.min():.0f} to {arcs.max():.0f} px about the {thing.name}"


def closed(case: Case, wanted: bool) -> Iterator[str]:
    """Check that the ring about each thing has no gap wider than an even one, or that it has."""
    for thing, points in case.rings():
        gaps = gaps_around(thing, points)
        whole = gaps.winds and float(gaps.arcs.max()) <= EVEN[1] * float(gaps.arcs.mean())
        if whole != wanted:
            yield f"a gap of {gaps.arcs.max():.0f} px, {gaps.arcs.mean():.0f} in the mean"


def opening(case: Case, wanted: Mapping[str, Any]) -> Iterator[str]:
    """Check that the widest gap is `towards` a side, degrees or thing; `least`, `most` px wide."""
    for thing, points in case.rings():
        gaps = gaps_around(thing, points)
        widest = int(gaps.arcs.argmax())
        rest = np.delete(gaps.arcs, widest)
        if len(rest) and gaps.arcs[widest] < 1.3 * rest.max():
            yield f"no gap: the widest is {gaps.arcs[widest]:.0f} px, the next {rest.max():.0f}"
            continue
        centre = np.asarray(thing.outline.centre)
        way = gaps.middles[widest] - centre
        if "towards" in wanted and angle_off(way, way_of(wanted["towards"], case, centre)) > 50:
            yield f"the gap is at {gaps.middles[widest].round()}, not towards {wanted['towards']}"
        width = float(gaps.chords[widest])
        low, high = wanted.get("least", 0.0), wanted.get("most", 1e9)
        if not low - max(PX, SHARE * low) <= width <= high * (1 + SHARE) + PX:
            yield f"the gap is {width:.0f} px wide, {low:.0f} to {high:.0f} wanted"


def gap(case: Case, wanted: str) -> Iterator[str]:
    """Check that the widest gap is `wider` or `narrower` than before."""
    wide = [
        max(
            float(gaps_around(case.things[name], np.array([s.at[r] for r in robots])).chords.max())
            for name, robots in case.owners(s).items()
        )
        for s in (case.before, case.after)
    ]
    if not (wide[1] > 1.05 * wide[0] if wanted == "wider" else wide[1] < 0.95 * wide[0]):
        yield f"the widest gap is {wide[1]:.0f} px after {wide[0]:.0f}, not {wanted}"


def escape_proof(case: Case, wanted: bool) -> Iterator[str]:
    """Check that robots certainly hold the thing they are about, or that they do not."""
    for thing, points in case.rings():
        state = cage(thing.outline.filled, points).state
        if (state == "caged") != wanted:
            yield f"the {thing.name} is {state}"


def side(case: Case, wanted: str) -> Iterator[str]:
    """Check that all are on a side of their thing, or on half of the way round it: `left half`."""
    name, _, half = wanted.partition(" ")
    for thing, points in case.rings():
        off = angle_off(box_direction(thing, points), SIDE[name])
        if (off > (95.0 if half else ON_SIDE)).any():
            yield f"{int((off > ON_SIDE).sum())} robots are not on the {wanted}"


def without(case: Case, wanted: str) -> Iterator[str]:
    """Check that no robot is on a side of the thing."""
    for thing, points in case.rings():
        off = angle_off(box_direction(thing, points), SIDE[wanted])
        if (off < OFF_SIDE).any():
            yield f"{int((off < OFF_SIDE).sum())} robots are on the {wanted}"


def turned(case: Case, wanted: Sequence[float]) -> Iterator[str]:
    """Check that robots turned about the thing or their middle by [low, high] degrees clockwise."""
    names = case.remaining
    now, was = (np.array([s.at[name] for name in names]) for s in (case.after, case.before))
    angles = list[float]()
    for about in (was.mean(0), *(t.outline.centre for t, _ in case.rings())):
        a, b = now - about, was - about
        turn = np.arctan2(a[:, 1], a[:, 0]) - np.arctan2(b[:, 1], b[:, 0])
        angles.append(float(np.degrees(np.angle(np.exp(1j * turn).mean()))))
    low, high = wanted
    if not any(low <= angle <= high or low <= angle + 360 <= high for angle in angles):
        yield f"turned by {angles[-1]:.0f} degrees clockwise, not by {low} to {high}"


def mirrored(case: Case, wanted: str) -> Iterator[str]:
    """Check that the form is the mirror image of the one before, `left-right` or `top-bottom`."""
    was, now = case.before.positions, case.after.positions
    flip = np.array([-1.0, 1.0] if wanted == "left-right" else [1.0, -1.0])
    image, here = (was - was.mean(0)) * flip, now - now.mean(0)
    far = np.linalg.norm(image[:, None] - here[None], axis=2)
    reach = max(PX, 0.06 * float(np.ptp(was, axis=0).max()))
    if was.shape != now.shape or far.min(axis=1).max() > reach:
        yield f"no mirror image: a robot is {far.min(axis=1).max():.0f} px off"


def size(case: Case, wanted: Sequence[float]) -> Iterator[str]:
    """Check that the formation is [low, high] times as large as before."""
    now, was = (
        float(np.sqrt(((s.positions - s.positions.mean(0)) ** 2).sum(1).mean()))
        for s in (case.after, case.before)
    )
    if not wanted[0] <= now / max(was, 1e-9) <= wanted[1]:
        yield f"{now / max(was, 1e-9):.2f} times as large, not {wanted[0]} to {wanted[1]}"


def form(case: Case, wanted: str) -> Iterator[str]:
    """Check the form: inside, around, corners, centre of each thing; between two; line, circle."""
    return form_problems(case, wanted)


def heading(case: Case, wanted: Any) -> Iterator[str]:
    """Check that robots look `towards` their thing, `away`, to another, or so many degrees.

    None: they must have no headings.
    """
    looks = case.after.headings
    if not looks or any(value is None for value in looks):
        if wanted is not None:
            yield "robots have no headings"
        return
    if wanted is None:
        yield "robots still have headings"
        return
    for name, value in zip(case.after.robots, looks, strict=True):
        here = case.after.at[name]
        own = next(t for t, of in case.owners(case.after).items() if name in of)
        way = way_of(own if wanted in ("towards", "away") else wanted, case, here)
        sight = np.array([np.cos(np.radians(value or 0.0)), np.sin(np.radians(value or 0.0))])
        if angle_off(sight if wanted != "away" else -sight, way) > FACING:
            yield f"robot {name} looks {value:.0f} degrees, not {wanted}"


def kept_off(case: Case, wanted: str) -> Iterator[str]:
    """Check that a thing is kept clear: it is named as kept off, and no robot stands on it."""
    thing = case.things[wanted]
    if not any(thing.overlap(outline) > 0.4 for outline in case.after.kept_off):
        yield f"the {thing.name} is not kept off"
    if (distances_to(thing, case.after.positions) <= 0).any():
        yield f"a robot is on the {thing.name}"


CHECKS: Mapping[str, Check] = {
    check.__name__: check
    for check in (
        *(robots, ids, leave, stay, move, at, shift, swap, target, distance, spacing, even),
        *(closed, opening, gap, escape_proof, side, without, turned, mirrored, size, form),
        *(heading, kept_off, says),
    )
}
