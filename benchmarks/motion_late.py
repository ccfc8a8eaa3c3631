"""Robots that follow a motion in its order of passage, late at random, some stopping for good."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..tools.geometry.outline import FloatArray
from ..tools.motion.following import EXACT, Following
from ..tools.motion.motion import Motion, arc_lengths
from .motion_scenes import RADIUS

STEP = 4 * RADIUS
"""Longest way of a robot in a step, px."""


@dataclass(frozen=True)
class Late:
    """How a drive ended, as numbers of robots.

    Attributes:
        stopped: robots that stopped for good.
        arrived: others that arrived.
        named: others that wait, directly or through others, for one that stopped.
        unnamed: others that did not arrive for no known reason.
        least: least distance of two robots at any time, as a fraction of what is demanded.
    """

    robots: int
    stopped: int
    arrived: int
    named: int
    unnamed: int
    least: float


def late(motion: Motion, demanded: float, random: np.random.Generator, stops: float) -> Late:
    """Step robots along their paths until none can move on.

    Args:
        demanded: distance that they must keep, px.
        stops: fraction of robots that stop for good somewhere on their way.
    """
    following, n = Following(motion), len(motion.paths)
    lengths = following.lengths
    stop = np.where(random.random(n) < stops, random.random(n) * lengths, np.inf)
    share, progress, least = random.uniform(0.1, 1.0, n), np.zeros(n), np.inf
    # One sorted table of all vertices: arc length along the path, offset by all paths before it.
    before = np.concatenate([[0.0], np.cumsum(lengths + 1.0)])
    paths = zip(motion.paths.values(), before[:-1], strict=True)
    vertices = np.concatenate([arc_lengths(path) + base for path, base in paths])
    points = following.at(progress)
    while True:
        limits = np.minimum(following.limits(progress), stop)
        if (limits - progress <= EXACT).all():
            break
        after = np.searchsorted(vertices, before[:-1] + progress + EXACT, side="right")
        vertex = vertices[np.minimum(after, len(vertices) - 1)] - before[:-1]
        straight = np.where(vertex <= lengths, vertex, lengths)
        on = progress + STEP * share * random.random(n)
        progress = np.maximum(np.minimum(np.minimum(on, limits), straight), progress)
        moved = following.at(progress)
        least = min(least, closest(points, moved, demanded + 2 * STEP))
        points = moved
    waits = following.waits_for(progress)
    stopped = {following.ids[i] for i in np.flatnonzero(progress >= stop - EXACT)}
    gone = {following.ids[i] for i in np.flatnonzero(progress >= lengths - EXACT)} - stopped
    others = {*following.ids} - stopped - gone
    named = sum(_waits(robot, waits, stopped) for robot in others)
    count = len(stopped), len(gone), named, len(others) - named
    return Late(n, *count, least / demanded)


def _waits(robot: str, waits: dict[str, str], stopped: set[str]) -> bool:
    """Return whether a robot waits, directly or through others, for one that stopped."""
    for _ in range(len(waits)):
        robot = waits.get(robot, robot)
    return robot in stopped


def closest(begin: FloatArray, end: FloatArray, reach: float) -> float:
    """Return the least distance of two robots while all drive straight from `begin` to `end`.

    Args:
        begin: positions, (n, 2) px; `end` likewise.
        reach: pairs farther apart than this at first are left out, px; at least what they drive.
    """
    pairs = cKDTree(begin).query_pairs(reach, output_type="ndarray")
    one, other = pairs.T
    apart, drift = begin[one] - begin[other], (end - begin)[one] - (end - begin)[other]
    square = np.einsum("ij,ij->i", drift, drift)
    towards = -np.einsum("ij,ij->i", apart, drift)
    share = np.divide(towards, square, out=np.zeros_like(square), where=square > 0)
    near = apart + np.clip(share, 0.0, 1.0)[:, None] * drift
    return float(np.linalg.norm(near, axis=1).min(initial=np.inf))
