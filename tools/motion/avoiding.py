"""Paths that also keep off the other things in a picture, as far as there is a way around them.

A robot leaves what it starts or ends beside by the shortest way. What it starts or ends on does not
count. What would wall it off is driven over: what is less certain first, then what the picture cuts
off, whose end nobody sees; the picture is left rather than that other certain things are touched.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from ..formation.encounters import AT_BORDER, Encounter, room_of
from ..formation.site import Other, Site
from ..geometry.outline import FloatArray, distances
from .routes import NOBODY, NoRouteError, routes

BESIDE = 1.1
"""A robot whose centre is no further from a thing than so many radii leaves it before it drives."""
ROOM_SHARES = (1.0, 0.3, 0.0)
"""Shares of the room beside things that are tried in turn: less where there is no other way."""
NEAR_END = 0.5
"""Things grow towards starts and goals by no more than this share of the way."""
DETAIL = 0.1
"""How much things are simplified, as a share of how much they grow."""
LONG, LEAST_LONGER = 2.0, 0.1
"""A way round things that is longer than the way over them by more than this factor, and by more
than this share of the picture's diagonal, is told of, with the largest of them."""

Indices = NDArray[np.intp]


def routes_off(
    starts: FloatArray,
    goals: FloatArray,
    solid: BaseGeometry,
    site: Site,
    radius: float,
    *,
    idle: FloatArray = NOBODY,
    ends: FloatArray | None = None,
) -> list[FloatArray]:
    """Return shortest paths as `routes` does, which also keep off the site's other things.

    Args:
        ends: (k, 2) as of `routes`.

    Raises:
        NoRouteError: a goal is walled off by obstacles and robots that stay.
    """
    paths, frame = dict[int, FloatArray](), site.frame(radius)
    near = np.concatenate([starts, goals]) if ends is None else ends

    def route(robots: Indices, things: Sequence[Other], share: float, bounded: bool) -> Indices:
        """Find paths past things; return the robots that have none."""
        left = _with_room(things, share, site, near, radius)
        around, walled = solid, robots[:0]
        while len(robots):
            pair = starts[robots], goals[robots]
            try:
                ways = routes(*pair, around, radius, frame, idle=idle, ends=near, bounded=bounded)
            except NoRouteError as error:
                if around is solid and not bounded:
                    raise
                walled = np.concatenate([walled, robots[error.robots]])
                robots = np.delete(robots, error.robots)
                continue
            paths.update(zip(robots.tolist(), ways, strict=True))
            lines = np.array([LineString(way) for way in ways], dtype=object)
            cut = (around is not solid) & _too_near(lines, solid, *pair, radius)
            walled, robots, lines = np.concatenate([walled, robots[cut]]), robots[~cut], lines[~cut]
            hit = shapely.distance(left[:, None], lines) <= radius
            robots, met = robots[hit.any(axis=0)], hit.any(axis=1)
            around, left = shapely.union_all([around, *left[met]]), left[~met]
        return walled

    for robots, things in _by_things_stood_on(starts, goals, site.others):
        for tried in _tries(things, site):
            robots = route(robots, *tried) if len(robots) else robots
    return [paths[i] for i in range(len(starts))]


def long_ways_round(
    paths: Mapping[str, FloatArray], solid: BaseGeometry, site: Site, radius: float
) -> tuple[Encounter, ...]:
    """Return the things that robots go a long way round, with who does, and how far.

    Args:
        paths: (k, 2) px, by robot.
        solid: the obstacles' union, which nobody could drive over.
    """
    bent = [name for name, path in paths.items() if _length(path) > LONG * _length(path[[0, -1]])]
    if not bent or not site.others:
        return ()
    starts, goals = np.stack([paths[name][[0, -1]] for name in bent], axis=1)
    try:
        direct = routes(starts, goals, solid, radius, site.frame(radius))
    except NoRouteError:
        return ()
    found: dict[str, dict[str, float]] = {}
    for name, over in zip(bent, direct, strict=True):
        long, short, line = _length(paths[name]), _length(over), LineString(over)
        met = [t for t in site.others if shapely.distance(t.region, line) <= radius]
        if met and long > max(LONG * short, short + LEAST_LONGER * math.hypot(*site.room)):
            widest = max(met, key=lambda thing: thing.region.length)
            found.setdefault(widest.id, {})[name] = long / short
    return tuple(
        Encounter(
            how="round",
            robots=tuple(who),
            thing=thing.id,
            label=thing.label,
            sure=thing.sure,
            times=round(max(who.values()), 2),
        )
        for thing in site.others
        if (who := found.get(thing.id))
    )


def _length(path: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _tries(things: Sequence[Other], site: Site) -> Iterator[tuple[Sequence[Other], float, bool]]:
    """Yield what is tried in turn: things to keep off, a share of room, whether to stay inside."""
    sure = [thing for thing in things if thing.sure]
    for off in (things, sure):
        for share in ROOM_SHARES:
            yield off, share, True
    picture = site.frame(AT_BORDER).box
    whole = [thing for thing in sure if picture.covers(thing.region)]
    yield whole, 0.0, True
    yield whole, 0.0, False
    yield (), 0.0, False


def _too_near(
    lines: NDArray[np.object_],
    solid: BaseGeometry,
    starts: FloatArray,
    goals: FloatArray,
    radius: float,
) -> NDArray[np.bool_]:
    """Return which paths, (n,), come nearer to the obstacles than both a radius and their ends.

    That happens because the short way off a thing is straight, whatever lies there.
    """
    ends = np.minimum(distances(solid, starts), distances(solid, goals))
    return np.asarray(shapely.distance(solid, lines) < 0.98 * np.minimum(ends, radius))


def _with_room(
    things: Sequence[Other], share: float, site: Site, ends: FloatArray, radius: float
) -> NDArray[np.object_]:
    """Return things grown by a share of their room, less where a path ends near but not at them."""

    def grown(thing: Other) -> BaseGeometry:
        off = distances(thing.region, ends)
        spare = float(off[off > BESIDE * radius + 0.1].min(initial=np.inf)) - radius
        reach = min(share * (room_of(site) + thing.blur), NEAR_END * spare)
        slack = DETAIL * reach
        return thing.region.simplify(slack).buffer(reach + slack, quad_segs=2)

    return np.array([grown(thing) for thing in things], dtype=object)


def _by_things_stood_on(
    starts: FloatArray, goals: FloatArray, others: Sequence[Other]
) -> list[tuple[Indices, list[Other]]]:
    """Group robots by the things they can keep off: none that a centre starts or ends on."""
    groups: defaultdict[bytes, list[int]] = defaultdict(list)
    ends = np.concatenate([starts, goals])
    near = [distances(thing.region, ends).reshape(2, -1).min(axis=0) for thing in others]
    on: NDArray[np.bool_] = np.reshape(near, (-1, len(starts))) <= 0
    for robot in range(len(starts)):
        groups[on[:, robot].tobytes()].append(robot)
    return [
        (np.array(same), [t for t, under in zip(others, on[:, same[0]], strict=True) if not under])
        for same in groups.values()
    ]
