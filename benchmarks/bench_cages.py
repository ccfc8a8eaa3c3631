"""`python -m formup.benchmarks.bench_cages`: CPU time of the tests that prove a cage.

Beside each are the bare library calls that it needs at least: for the disc test, the inscribed
disc, a triangulation and distances; for the flood, one look-up of every robot in every cell of its
first grid, halved once, and one labelling of the free cells.
"""

import itertools
from collections.abc import Iterator

import numpy as np
import shapely
from scipy.ndimage import label
from shapely.affinity import translate
from shapely.geometry import Polygon

from ..tools.geometry.cages.cages import QUICK, THOROUGH, cage
from ..tools.geometry.cages.configuration import flood
from ..tools.geometry.cages.configuration_grid import first_grid
from ..tools.geometry.cages.rigid import Obstacles, body_of
from ..tools.geometry.curves import ring
from ..tools.geometry.outline import FloatArray, make_outline
from ..tools.geometry.sampling import along_curve
from .growth import Work, beside, best, growth, heading, peak, show, times

REPEATS = 5
SIZE = 100.0
COUNTS = (10, 30, 100, 300, 1000)
FLOODED = (5, 6, 8, 12)
CROWDS = (30, 60, 120, 240)
VERTICES = (60, 300, 1500, 4500)
ELL = ((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3))
TABLE = 192
COPIES = 40
"""Number of bodies, each slightly shifted, so that no call can reuse a cached result."""


def rows() -> Iterator[str]:
    """Yield the tables."""
    region = make_outline(np.asarray(ELL) * SIZE + 300).filled
    yield f"CPU milliseconds, best of {REPEATS}; disc: 60 corners; flood: an L of 6 corners"
    yield heading("test", "state")
    discs: list[float] = []
    for n in COUNTS:
        ours, bare, state = _disc(_coin(60), n)
        discs.append(ours)
        yield beside(f"disc, {n} robots", ours, bare, state)
    for n in FLOODED:
        for levels in (QUICK, THOROUGH):
            yield _flood(region, n, levels)
    yield f"\n{'growth':28} fitted"
    yield growth("disc", "robots", COUNTS, discs)
    yield from _growths(region)


def _growths(region: Polygon) -> Iterator[str]:
    """Yield how one level of the flood and the disc test of ten robots grow."""

    def crowd(n: int) -> Work:
        return _level(region, _around(region, n))

    def disc(vertices: int) -> Work:
        coin = _coin(vertices)
        robots = _around(coin, 10)
        asides = itertools.cycle(np.arange(COPIES) / 8)

        def work() -> object:
            aside = next(asides)
            return cage(translate(coin, aside), robots + np.array([aside, 0.0]), levels=0)

        return work

    def cornered(vertices: int) -> Work:
        return _level(_coin(vertices), _around(_coin(vertices), 10))

    yield growth("flood, a level", "robots", CROWDS, times(crowd, CROWDS, REPEATS))
    yield growth("disc, 10 robots", "vertices", VERTICES, times(disc, VERTICES, REPEATS))
    found = times(cornered, VERTICES, REPEATS)
    yield growth("flood, a level, 10 robots", "vertices", VERTICES, found)
    memory = [peak(crowd(n)) for n in CROWDS]
    yield growth("flood, memory", "robots", CROWDS, memory, "MiB")


def _coin(vertices: int) -> Polygon:
    turns = np.arange(vertices) / vertices * 2 * np.pi
    return make_outline(np.stack([np.cos(turns), np.sin(turns)], axis=1) * SIZE + 300).filled


def _level(region: Polygon, robots: FloatArray) -> Work:
    body, obstacles = body_of(region), Obstacles(robots, 0.0)
    return lambda: flood(body, obstacles, 1, escapes=False)


def _disc(region: Polygon, n: int) -> tuple[float, float, str]:
    """Return milliseconds of the disc test and of the bare calls, and the test's result."""
    robots = _around(region, n)
    moved = [(translate(region, x), robots + np.array([x, 0.0])) for x in np.arange(COPIES) / 8]
    turn, again = itertools.cycle(moved), itertools.cycle(moved)
    inner = max(1000 // n, 1)

    def bare(body: Polygon, points: FloatArray) -> object:
        places = shapely.multipoints(points)
        disc = shapely.maximum_inscribed_circle(body)
        return disc, shapely.delaunay_triangles(places, only_edges=True), body.distance(places)

    ours = best(lambda: [cage(*next(turn), levels=0) for _ in range(inner)], REPEATS) / inner
    theirs = best(lambda: [bare(*next(again)) for _ in range(inner)], REPEATS) / inner
    return ours, theirs, cage(region, robots, levels=0).state


def _flood(region: Polygon, n: int, levels: int) -> str:
    robots = _around(region, n)
    found = cage(region, robots, levels=levels)
    how = f"{found.state}, by the {found.test}" if found.test else found.state
    ours = best(lambda: cage(region, robots, levels=levels), REPEATS)
    bare = best(_bare_flood(region, robots), REPEATS)
    return beside(f"flood, {n} robots, {levels} levels", ours, bare, how)


def _around(region: Polygon, n: int) -> FloatArray:
    return along_curve(ring(make_outline(shapely.get_coordinates(region)), 8.0, 16.0), n)


def _bare_flood(region: Polygon, robots: FloatArray) -> Work:
    body = body_of(region)
    grid = first_grid(body, Obstacles(robots, 0.0))
    turns, rows, columns = 2 * grid.turns, *(2 * side for side in grid.domain.shape)
    ticks = np.linspace(-body.reach, body.reach, TABLE)
    table = shapely.contains_xy(body.polygon, *np.meshgrid(ticks, ticks))
    y, x = np.mgrid[:rows, :columns] * (grid.side / 2) + grid.origin[::-1, None, None]
    scale = (TABLE - 1) / (2 * body.reach)

    def work() -> object:
        free = np.ones((turns, rows, columns), dtype=bool)
        for turned, angle in zip(free, np.arange(turns) * 2 * np.pi / turns, strict=True):
            c, s = np.cos(angle), np.sin(angle)
            for px, py in robots:
                across, down = px - x, py - y
                column = ((c * across + s * down + body.reach) * scale).astype(np.intp)
                row = ((c * down - s * across + body.reach) * scale).astype(np.intp)
                near = (column >= 0) & (column < TABLE) & (row >= 0) & (row < TABLE)
                turned[near] &= ~table[row[near], column[near]]
        return label(free)

    return work


if __name__ == "__main__":
    show(rows())
