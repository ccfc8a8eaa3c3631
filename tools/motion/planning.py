"""Plans how robots get from where they are to where they are to stand without touching.

It finds shortest ways, an order in which they can be driven, and the times that this order allows.
Frame: image pixels.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from ..errors import FleetError
from ..formation.site import Site
from ..geometry.outline import FloatArray
from ..geometry.sampling import min_spacing
from .avoiding import routes_off
from .cells import Cells, conflicts, cut
from .checking import MotionVerdict, check_motion
from .motion import Indices, Motion
from .order import Matched, match, ordered, rematched, rerouted, stepped_aside
from .routes import NOBODY, union, way_lengths
from .schedule import Near, NoTimeError, Schedule, passages, schedule

EXACT = 1 - 1e-9
"""Factor on distances that are to be kept, for rounding."""
CROWD, COARSEST = 100, 1.8
"""With more robots than this, paths are cut less finely, into cells of at most so many radii."""
ROOMY, MOST_ROOM = 0.5, 8.0
"""Where they can, robots stay apart by this share of how far starts and goals are from each other,
but at most by so many radii."""
ALONG = 1e-9
"""Times and places that differ by less are the same."""


class NoOrderError(FleetError):
    """Robots would have to go before each other, so that none of them can go first.

    Attributes:
        ids: of the robots.
    """

    def __init__(self, ids: Sequence[str]) -> None:
        named = ", ".join(ids[:12]) + (", ..." if len(ids) > 12 else "")
        super().__init__(
            f"Robots {named} stand in each other's way: none of them can go first if each is to "
            "have its own place."
        )
        self.ids = tuple(ids)


@dataclass(frozen=True)
class Team:
    """What moves: robots of one kind.

    Attributes:
        ids: of the robots, in the order of `starts`.
        starts: (n, 2) where they stand, px.
        radius: of their bodies, px.
        speed: greatest speed, px/s.
        error: how far they may be off their paths, px; allowed for if starts and goals leave room.
        idle: where robots stand that do not move, px, by id.
    """

    ids: tuple[str, ...]
    starts: FloatArray
    radius: float
    speed: float
    error: float = 0.0
    idle: Mapping[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])


@dataclass(frozen=True)
class Ground:
    """Where they move: obstacles by name, which no robot touches, and things that they avoid."""

    obstacles: Mapping[str, BaseGeometry]
    site: Site

    @cached_property
    def solid(self) -> BaseGeometry:
        """All obstacles as one."""
        return union(self.obstacles)


def plan_motion(
    team: Team, goals: FloatArray, ground: Ground, *, interchangeable: bool
) -> tuple[Motion, tuple[str, ...], MotionVerdict]:
    """Plan paths, times and an order of passage onto all goals.

    Args:
        goals: (n, 2) px, that of each robot in the team's order.
        interchangeable: whether robots may take each other's goals.

    Returns:
        The motion, the robot that takes each goal, and the certificate of the motion.

    Raises:
        NoRouteError: no path leads to a goal.
        NoOrderError: robots stand in each other's way.
    """
    found, apart = _matched(team, goals, ground, interchangeable)
    ids = tuple(team.ids[int(i)] for i in found.robots)
    if found.cycles:
        shut = found.owners[np.concatenate(found.cycles)]
        raise NoOrderError(list(dict.fromkeys(ids[int(i)] for i in shut)))
    cells, pairs = _cut(found, apart)
    lengths = cells.leave[cells.goals] - cells.enter[cells.starts]
    legs = {goal: len(ids) + k for k, goal in enumerate(found.aside)}
    try:
        near = Near.of(pairs, len(cells.robot))
        times = schedule(cells, near, ordered(found.before, lengths.tolist()), team.speed, legs)
    except NoTimeError as error:
        raise NoOrderError([ids[error.robot]]) from None
    knots = [_knots(cells, times, [*filter(None, [legs.get(i)]), i]) for i in range(len(ids))]
    motion = Motion(
        paths={robot: path for robot, (path, _) in zip(ids, knots, strict=True)},
        times={robot: when for robot, (_, when) in zip(ids, knots, strict=True)},
        passages=passages(cells, pairs, times),
    )
    demanded = separation(team.starts, goals, team.radius)
    verdict = check_motion(motion, team.radius, demanded, ground.obstacles, team.idle)
    return motion, ids, verdict


def separation(starts: FloatArray, goals: FloatArray, radius: float) -> float:
    """Return how far apart robots stay, px: two radii, or as near as they start or end."""
    return min(2 * radius, min_spacing(starts), min_spacing(goals)) * EXACT


def assigned(starts: FloatArray, goals: FloatArray, ground: Ground, radius: float) -> Indices:
    """Return who takes each goal, (m,), for the least sum of squared ways around the obstacles.

    Args:
        starts: (n, 2) with n >= m.
        goals: (m, 2).
    """
    from scipy.optimize import linear_sum_assignment

    frame = ground.site.frame(radius)
    ways = way_lengths(starts, goals, ground.solid, radius, frame)
    reached = np.isfinite(ways)
    ways[~reached] = 10 * float(ways[reached].max(initial=frame.width + frame.height))
    return np.asarray(linear_sum_assignment(ways.T**2)[1], dtype=np.intp)


def _matched(
    team: Team, goals: FloatArray, ground: Ground, interchangeable: bool
) -> tuple[Matched, float]:
    """Match robots to goals and ways, without cycles if there is any way to avoid them.

    Returns:
        The match, and how far apart the robots can stay, px.
    """
    ends, radius = np.concatenate([team.starts, goals]), team.radius + team.error
    standing = np.array([*team.idle.values()]).reshape(-1, 2)

    def ways(starts: FloatArray, ends_of_them: FloatArray, parked: FloatArray) -> list[FloatArray]:
        idle = np.concatenate([standing, parked])
        return routes_off(
            starts, ends_of_them, ground.solid, ground.site, radius, idle=idle, ends=ends
        )

    everyone, straight = np.arange(len(goals)), ways(team.starts, goals, NOBODY)
    nearest = min(min_spacing(team.starts), min_spacing(goals))
    roomy = min(ROOMY * nearest, MOST_ROOM * team.radius)
    found, apart = match(everyone, straight, roomy), roomy
    radii = (radius,) if len(standing) else (radius, team.radius)
    for apart in (roomy, *(separation(team.starts, goals, r) for r in radii)):
        if apart == roomy < 2 * radius * EXACT:
            continue
        found = match(everyone, straight, apart)
        if interchangeable and found.cycles:
            found = rematched(found, team.starts, ways, apart)
        if found.cycles and apart != roomy:
            free = partial(_off, ground=ground, standing=standing, radius=radius, apart=apart)
            found = stepped_aside(rerouted(found, ways, apart), ways, apart, free)
        if not found.cycles:
            break
    return found, apart


def _off(
    spots: FloatArray, ground: Ground, standing: FloatArray, radius: float, apart: float
) -> NDArray[np.bool_]:
    """Return which points, (k, 2), are in the picture and off obstacles, things and idle robots."""
    others = [thing.region for thing in ground.site.others]
    solid = shapely.union_all(np.array([ground.solid, *others], dtype=object))
    idle = shapely.MultiPoint(standing)
    room, points = ground.site.frame(radius).box, shapely.points(spots)
    off = shapely.covers(room, points) & ~shapely.dwithin(solid, points, 1.1 * radius)
    return np.asarray(off & ~shapely.dwithin(idle, points, apart), dtype=bool)


def _cut(found: Matched, apart: float) -> tuple[Cells, Indices]:
    """Return the paths as cells, and the pairs of cells that are too near."""
    coarse = min(max((len(found.robots) / CROWD) ** 0.5, 1.0), COARSEST)
    step = min(coarse / 2, 0.9) * apart
    cells = cut(found.paths, found.owners, step)
    return cells, conflicts(cells, apart, step)


def _knots(cells: Cells, times: Schedule, paths: list[int]) -> tuple[FloatArray, FloatArray]:
    """Return what a robot drives, (k, 2), with a vertex wherever its velocity changes, and when.

    Args:
        paths: indices of its paths, which it drives one after the other.
    """
    mine = np.concatenate([np.r_[cells.of(path)] for path in paths]).astype(np.intp)
    points = np.concatenate([cells.begin[mine], cells.end[mine][-1:]])
    when = np.append(times.enter[mine], times.enter[mine][-1])
    spans, ways = np.diff(when), np.diff(points, axis=0)
    same = (spans > ALONG) | (np.abs(ways).max(axis=1) > ALONG)
    points, when = points[np.append(True, same)], when[np.append(True, same)]
    if len(points) < 2:
        return np.repeat(points, 2, axis=0), np.repeat(when, 2)
    spans, ways = np.diff(when), np.diff(points, axis=0)
    velocity = np.divide(ways, spans[:, None], out=np.zeros_like(ways), where=spans[:, None] > 0)
    turns = np.abs(np.diff(velocity, axis=0)).max(axis=1) > 1e-6 * (1 + np.abs(velocity).max())
    kept = np.concatenate([[True], turns, [True]])
    return points[kept], when[kept]
