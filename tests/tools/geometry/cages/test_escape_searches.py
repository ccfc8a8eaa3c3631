"""Nothing gets out of what is certified caged, as random searches by other code find.

Bodies of random shapes are moved and turned at random among robots that stand still. One that gets
out refutes a certificate; rings known to leak are searched as well, to show that a search can fail.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
import pytest
import shapely
from formup.tools.geometry.cages.cages import Cage, cage
from formup.tools.geometry.outline import FloatArray, largest_part
from shapely.geometry import MultiPoint, Polygon

CAGES, LOOSE_RINGS = 3, 2
SEARCHES, STEPS = 10, 60
"""For each of them, and moves of each search; more of all find more, and take longer."""
SIZE = 100.0
"""Square root of the area of every body, px."""
BLOCKS: tuple[list[tuple[float, float]], ...] = (
    [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    [(0, 0), (3, 0), (3, 0.8), (0.8, 0.8), (0.8, 2.2), (3, 2.2), (3, 3), (0, 3)],
    [(0, 0), (4, 0), (4, 1), (0, 1)],
    [(0, 0), (3, 0), (3, 1), (2, 1), (2, 3), (1, 3), (1, 1), (0, 1)],
)
RADII = (0.0, 4.0, 10.0)
ADVANCES = 10
"""Conservative advances per move; a move that needs more of them stops where it is, clear."""
RETREAT = 0.8
"""A move cut short ends at this share of what is clear."""
TOUCH = 1e-3
"""Clearance at which a body stops, px."""


@dataclass(frozen=True)
class Case:
    """A body, the robots about it, (n, 2), and what was said of them."""

    body: Polygon
    robots: FloatArray
    radius: float
    verdict: Cage


def cases(seed: int) -> Iterator[Case]:
    """Random bodies in rings of ever fewer robots: the last ring that each test certifies.

    After them a ring that is certified, with one to half of its robots taken away.
    """
    rng = np.random.default_rng(seed)
    while True:
        body, radius = _body(rng), float(rng.choice(RADII))
        last: dict[str, Case] = {}
        caged = np.empty((0, 2))
        for robots in _rings(rng, body, radius):
            case = Case(body, robots, radius, cage(body, robots, radius, escapes=False))
            if case.verdict.test is None:
                break
            last[case.verdict.test], caged = case, robots
        yield from last.values()
        if last:
            left = rng.permutation(len(caged))[: rng.integers(len(caged) // 2, len(caged))]
            yield Case(body, caged[left], radius, cage(body, caged[left], radius))


def search(case: Case, searches: int, steps: int, rng: np.random.Generator) -> int:
    """Bodies that got out, of so many moved independently.

    Each has a heading for a while and turns at random; it goes as far as it can on each move.
    """
    ring = shapely.get_coordinates(case.body.exterior)
    pivot = ring[:-1].mean(axis=0)
    edges = np.stack([ring[:-1] - pivot, ring[1:] - pivot], axis=1)
    reach = float(np.linalg.norm(edges, axis=2).max())
    middle = case.robots.mean(axis=0)
    away = np.linalg.norm(case.robots - middle, axis=1).max() + reach + case.radius
    poses = np.tile([*pivot, 0.0], (searches, 1))
    heading = rng.uniform(0, 2 * math.pi, searches)
    out = np.zeros(searches, dtype=bool)
    for _ in range(steps):
        anew = rng.random(searches) < 0.05
        heading[anew] = rng.uniform(0, 2 * math.pi, int(anew.sum()))
        way = heading + rng.normal(0, 1.0, searches)
        length = reach * 10 ** rng.uniform(-2, -0.3, searches)
        turn = rng.normal(0, 1, searches) * length / reach
        move = np.stack([length * np.cos(way), length * np.sin(way), turn], axis=1)
        here = np.flatnonzero(~out)
        poses[here] = _advanced(poses[here], move[here], case, edges)
        out |= np.linalg.norm(poses[:, :2] - middle, axis=1) > away
        if out.all():
            break
    return int(out.sum())


def _advanced(poses: FloatArray, move: FloatArray, case: Case, edges: FloatArray) -> FloatArray:
    """Where the bodies get to on straight moves, stopping before they touch a robot."""
    done = np.zeros(len(poses))
    gone = np.linalg.norm(move[:, :2], axis=1)
    for _ in range(ADVANCES):
        now = poses + done[:, None] * move
        seen = case.robots[None] - now[:, None, :2]
        far = np.linalg.norm(seen, axis=2)
        cos, sin = np.cos(now[:, 2:]), np.sin(now[:, 2:])
        x = cos * seen[..., 0] + sin * seen[..., 1]
        y = cos * seen[..., 1] - sin * seen[..., 0]
        gap = _signed(x, y, edges) - case.radius - TOUCH
        # The farthest a robot may be from the pivot during the move bounds its speed.
        speed = gone[:, None] + (far + gone[:, None]) * np.abs(move[:, 2:])
        step = (np.maximum(gap, 0) / speed).min(axis=1)
        done = np.minimum(done + 0.95 * step, 1.0)
    # What stops at a contact keeps off it, or it could not move on.
    return poses + np.where(done < 1, RETREAT * done, 1.0)[:, None] * move


def _signed(x: FloatArray, y: FloatArray, edges: FloatArray) -> FloatArray:
    """Signed distance of points to a polygon, negative inside, by its edges one at a time."""
    squared = np.full(x.shape, np.inf)
    inside = np.zeros(x.shape, dtype=bool)
    for (ax, ay), (bx, by) in edges:
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
        squared = np.minimum(squared, (x - ax - along * dx) ** 2 + (y - ay - along * dy) ** 2)
        if ay != by:
            crosses = (ay > y) != (by > y)
            inside ^= crosses & (x < ax + (y - ay) / (by - ay) * dx)
    return np.where(inside, -1.0, 1.0) * np.sqrt(squared)


def _body(rng: np.random.Generator) -> Polygon:
    kind = rng.integers(3)
    if kind == 0:
        points = np.array(BLOCKS[rng.integers(len(BLOCKS))]) * rng.uniform(0.6, 1.6, 2)
    elif kind == 1:
        hull = MultiPoint(rng.uniform(-1, 1, (int(rng.integers(3, 10)), 2))).convex_hull
        points = shapely.get_coordinates(hull)
    else:
        count = int(rng.integers(5, 14))
        angle = (np.arange(count) + rng.uniform(0, 0.8, count)) / count * 2 * math.pi
        reach = rng.uniform(0.3, 1, count)
        points = np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=1)
    region = largest_part(shapely.make_valid(Polygon(points)))
    if region is None or region.area < 0.15:
        return _body(rng)
    turn = rng.uniform(0, 2 * math.pi)
    c, s = math.cos(turn), math.sin(turn)
    ring = shapely.get_coordinates(region.exterior) @ np.array([[c, s], [-s, c]])
    return Polygon(ring * SIZE / math.sqrt(region.area) + 300)


def _rings(rng: np.random.Generator, body: Polygon, radius: float) -> Iterator[FloatArray]:
    """Rings of fewer and fewer robots at one distance, each a little off an even one."""
    offset = radius + SIZE * rng.uniform(0.03, 0.2)
    line = shapely.LineString(shapely.get_coordinates(body.buffer(offset * 1.01).exterior))
    phase = rng.uniform()
    for n in range(20, 2, -1):
        stations = (np.arange(n) + phase + rng.uniform(-0.15, 0.15, n)) / n % 1
        points = shapely.line_interpolate_point(line, stations, normalized=True)
        yield shapely.get_coordinates(points)


SQUARE = Polygon([(-50, -50), (50, -50), (50, 50), (-50, 50)])
UNKNOWN = Cage("not certified", None, 100.0)


def ring(n: int, reach: float) -> FloatArray:
    t = (np.arange(n) + 0.5) / n * 2 * np.pi
    return np.stack([np.cos(t), np.sin(t)], axis=1) * reach


@pytest.mark.parametrize(
    ("n", "reach", "radius", "out"),
    [
        (3, 100.0, 0.0, True),
        (4, 120.0, 10.0, True),
        (12, 75.0, 0.0, False),
        (5, 127.0, 40.0, False),
    ],
)
def test_a_search_gets_out_where_there_is_a_way(
    n: int, reach: float, radius: float, out: bool
) -> None:
    case = Case(SQUARE, ring(n, reach), radius, UNKNOWN)
    found = search(case, 20, 150, np.random.default_rng(0))
    assert found > 5 if out else found == 0


def test_nothing_gets_out_of_certified_cages_and_much_out_of_leaky_rings() -> None:
    rng, wanted = np.random.default_rng(3), {"caged": CAGES, "escape": LOOSE_RINGS}
    got_out: Counter[str] = Counter()
    for case in islice(cases(3), 100 * (CAGES + LOOSE_RINGS)):
        state = case.verdict.state
        if wanted.get(state):
            wanted[state] -= 1
            got_out[state] += search(case, SEARCHES, STEPS, rng)
    assert not any(wanted.values())
    assert got_out["caged"] == 0
    assert got_out["escape"] > 0
