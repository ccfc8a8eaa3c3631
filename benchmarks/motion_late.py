"""Robots that follow a motion in its order of passage, late by chance, some stopping for good."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..tools.geometry.outline import FloatArray
from ..tools.motion.following import EXACT, Following
from ..tools.motion.motion import Motion, arc_lengths
from .motion_scenes import RADIUS

STEP = 4 * RADIUS
"""How far robots get in a step if nothing delays them, px."""


@dataclass(frozen=True)
class Late:
    """How a drive ended, in robots: all that stopped for good, and the others.

    Attributes:
        named: did not arrive, and wait for one that waits for one ... that stopped.
        unnamed: did not arrive, and nobody says why.
        least: distance of two robots at any time, as a share of what is demanded.
    """

    robots: int
    stopped: int
    arrived: int
    named: int
    unnamed: int
    least: float


def late(motion: Motion, demanded: float, random: np.random.Generator, stops: float) -> Late:
    """Step robots along their paths until none gets on.

    Args:
        demanded: how far apart they are to stay, px.
        stops: share of robots that stop for good somewhere on their way.
    """
    following, n = Following(motion), len(motion.paths)
    lengths = following.lengths
    stop = np.where(random.random(n) < stops, random.random(n) * lengths, np.inf)
    share, progress, least = random.uniform(0.1, 1.0, n), np.zeros(n), np.inf
    # One table of all vertices: how far along its path each is, after those of the paths before.
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
    """Whether a robot waits for one that stopped, or for one that does so."""
    for _ in range(len(waits)):
        robot = waits.get(robot, robot)
    return robot in stopped


def closest(begin: FloatArray, end: FloatArray, reach: float) -> float:
    """The least distance of two robots that drive straight from (n, 2) to (n, 2) px meanwhile.

    Args:
        reach: pairs that are farther apart at first are left out; at least what they drive.
    """
    pairs = cKDTree(begin).query_pairs(reach, output_type="ndarray")
    one, other = pairs.T
    apart, drift = begin[one] - begin[other], (end - begin)[one] - (end - begin)[other]
    square = np.einsum("ij,ij->i", drift, drift)
    towards = -np.einsum("ij,ij->i", apart, drift)
    share = np.divide(towards, square, out=np.zeros_like(square), where=square > 0)
    near = apart + np.clip(share, 0.0, 1.0)[:, None] * drift
    return float(np.linalg.norm(near, axis=1).min(initial=np.inf))
