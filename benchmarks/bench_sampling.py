"""`python -m formup.benchmarks.bench_sampling`: CPU time of placing and checking many robots.

It is shown beside the bare library calls that are needed at least, on the same data, and as growth
with the numbers of robots and of vertices.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from ..tools.formation.checking.check import certify
from ..tools.formation.contract import Contract, Group, with_defaults
from ..tools.formation.placement.place import Site, place
from ..tools.geometry.curves import Curve, ring
from ..tools.geometry.interior import BRISK_STEPS, FEW, LLOYD_STEPS, inside
from ..tools.geometry.lloyd import cells_of, grid
from ..tools.geometry.outline import FloatArray, Outline, make_outline, nearest_segments
from ..tools.geometry.rings import equal_chords
from ..tools.geometry.sampling import along_curve, nearest
from .growth import Work, beside, best, growth, heading, peak, show, times

REPEATS = 3
SIZE = 12_000.0
MANY, VERTICES = 10_000, 1000
FINE = 1_000_000
"""Number of cells that the energy is summed over."""
HEXAGON = 5 / (18 * 3**0.5)
"""Energy of a hexagonal lattice, divided by area squared over the number of robots (Fejes Toth)."""


def rows() -> Iterator[str]:
    """Yield the tables."""
    outline = bumpy(VERTICES)
    yield f"CPU milliseconds, best of {REPEATS}; an outline of {VERTICES} vertices"
    yield from _placing(outline)
    yield from _checking(outline)
    yield f"\n{'growth':28} fitted"
    yield from _growth()


def bumpy(vertices: int) -> Outline:
    """Return a smooth closed outline with bays."""
    t = np.arange(vertices) / vertices * 2 * np.pi
    radius = SIZE / 3 * (1 + 0.25 * np.sin(3 * t) + 0.1 * np.sin(7 * t + 1))
    return make_outline(np.stack([np.cos(t), np.sin(t)], axis=1) * radius[:, None] + SIZE / 2)


def energy_ratio(outline: Outline, points: FloatArray) -> float:
    """Return the energy of robots' Voronoi cells in a region, relative to a hexagonal lattice's."""
    cells = grid(outline.polygon, float(np.sqrt(outline.area / FINE)))
    mean = float((nearest(points, cells, 1)[0] ** 2).mean())
    return mean * outline.area / (HEXAGON * outline.area**2 / len(points))


def _placing(outline: Outline) -> Iterator[str]:
    plain = make_outline(shapely.get_coordinates(outline.filled.simplify(SIZE / 200)))
    loop = ring(outline, 100, 200)
    few = len(plain.polygon.exterior.coords) - 1
    cases: list[tuple[str, Work, Work]] = [
        (f"around, 8, {few} vertices", _eight(plain), _bare_ring(plain, 8)),
        ("around, 8", _eight(outline), _bare_ring(outline, 8)),
        ("8 on the ring alone", lambda: along_curve(loop, 8), _bare_places(loop, 8)),
        (f"{MANY} on the ring alone", lambda: along_curve(loop, MANY), _bare_places(loop, MANY)),
        ("100 at equal chords", lambda: equal_chords(loop, 100), _bare_places(loop, 100)),
    ]
    yield heading("placing")
    for name, work, bare in cases:
        yield beside(name, best(work, REPEATS), best(bare, REPEATS))
    for n in (6, 50, 100, 1000, MANY):
        ratio = energy_ratio(outline, inside(outline, n, 10, SIZE, 0.0))
        ours = best(_inside(outline, n), REPEATS)
        theirs = best(_bare_lloyd(outline, n), REPEATS)
        yield beside(f"inside, {n}", ours, theirs, f"energy {ratio:.3f}")


def _bare_ring(outline: Outline, n: int) -> Work:
    """Buffer the region and place robots on its edge, without bridging bays or choosing a phase."""

    def work() -> object:
        line = outline.filled.buffer(100).exterior
        return shapely.line_interpolate_point(line, np.arange(n) * line.length / n)

    return work


def _bare_places(loop: Curve, n: int) -> Work:
    line = shapely.LineString(loop.lines[0])
    return lambda: shapely.line_interpolate_point(line, np.arange(n) * line.length / n)


def _bare_lloyd(outline: Outline, n: int) -> Work:
    """Run as many plain steps of Lloyd's iteration as one start gets, from random places."""
    cells = cells_of(outline.polygon, n)
    first = np.random.default_rng(0).choice(cells, n, replace=False)

    def work() -> object:
        points = first
        for _ in range(LLOYD_STEPS if n <= FEW else BRISK_STEPS):
            index = cKDTree(points).query(cells)[1]
            size = np.maximum(np.bincount(index, minlength=n), 1)
            sums = [np.bincount(index, weights=x, minlength=n) for x in cells.T]
            points = np.stack(sums, axis=1) / size[:, None]
        return points

    return work


def _eight(outline: Outline) -> Work:
    return lambda: along_curve(ring(outline, 100, 200), 8)


def _inside(outline: Outline, n: int) -> Work:
    """Place robots inside, each time slightly deeper, so that no call reuses a cached result."""
    margins = itertools.count(10, 1e-6)
    return lambda: inside(outline, n, next(margins), SIZE, 0.0)


def _checking(outline: Outline) -> Iterator[str]:
    yield "\n" + heading(f"check of {MANY}")
    for relation in ("around", "inside"):
        work, points = _checked(relation, outline, MANY)
        bare = _bare_around(outline, points) if relation == "around" else _bare_in(outline, points)
        yield beside(relation, best(work, REPEATS), best(bare, REPEATS))


def _checked(relation: str, outline: Outline, n: int) -> tuple[Work, FloatArray]:
    """Return the check of places that pass it, and the places, (n, 2) px."""
    site = Site({"t1": outline}, SIZE, SIZE)
    group = Group.model_validate({"relation": relation, "targets": ["t1"], "robots": n})
    contract = with_defaults(Contract(groups=(group,)), site.outlines, site.room)
    points = place(contract, site)
    assert certify(points, contract, site).certified
    return lambda: certify(points, contract, site), points


def _bare_around(outline: Outline, points: FloatArray) -> Work:
    """Compute distances to the outline, to the ring and to the nearest other robot."""
    lines = outline.filled, shapely.LineString(ring(outline, 100, 200).lines[0])
    return lambda: (_near(lines, points), cKDTree(points).query(points, k=2))


def _bare_in(outline: Outline, points: FloatArray) -> Work:
    """Compute distances to the outline and the nearest other robot, and from cells to robots."""

    def work() -> object:
        cells = cells_of(outline.polygon, len(points))
        near = _near((outline.polygon,), points)
        return near, cKDTree(points).query(points, k=2), cKDTree(points).query(cells)

    return work


def _near(lines: Sequence[BaseGeometry], points: FloatArray) -> object:
    places = np.asarray(shapely.points(points), dtype=object)
    return [nearest_segments(line, places) for line in lines]


def _growth() -> Iterator[str]:
    """Yield how time and memory grow with robots, and time with vertices."""
    outline, counts, corners = bumpy(VERTICES), (300, 1000, 3000, MANY), (300, 1000, 3000)
    loop = ring(outline, 100, 200)
    by_robots: dict[str, Callable[[int], Work]] = {
        "along": lambda n: lambda: along_curve(loop, n),
        "inside": lambda n: _inside(outline, n),
        "check of around": lambda n: _checked("around", outline, n)[0],
        "check of inside": lambda n: _checked("inside", outline, n)[0],
    }
    by_vertices: dict[str, Callable[[int], Work]] = {
        "around 8": lambda v: _eight(bumpy(v)),
        "inside 100": lambda v: _inside(bumpy(v), 100),
        "check of 1000 around": lambda v: _checked("around", bumpy(v), 1000)[0],
        "check of 1000 inside": lambda v: _checked("inside", bumpy(v), 1000)[0],
    }
    for name, work in by_robots.items():
        yield growth(name, "robots", counts, times(work, counts, REPEATS))
    for name, work in by_vertices.items():
        yield growth(name, "vertices", corners, times(work, corners, REPEATS))
    for name, work in by_robots.items():
        found = [peak(work(n)) for n in counts]
        yield growth(f"{name}, memory", "robots", counts, found, "MiB")


if __name__ == "__main__":
    show(rows())
