"""`python -m formup.evals.bench_sampling`: CPU time of placing and checking many robots.

Beside each time stand the bare library calls that nothing could do without, on the same data, and
how fast the time grows with the number of robots and of vertices.
"""

import itertools
import time
from collections.abc import Callable

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ..tools.formation.check import certify
from ..tools.formation.contract import Contract, Group, with_defaults
from ..tools.formation.place import Site, place
from ..tools.geometry.curves import Curve, ring
from ..tools.geometry.interior import BRISK_STEPS, FEW, LLOYD_STEPS, inside
from ..tools.geometry.lloyd import cells_of, grid
from ..tools.geometry.outline import FloatArray, Outline, make_outline, nearest_segments
from ..tools.geometry.rings import equal_chords
from ..tools.geometry.sampling import along_curve, nearest

REPEATS = 3
SIZE = 12_000.0
MANY, VERTICES = 10_000, 1000
FINE = 1_000_000
"""Cells that the energy is summed over."""
HEXAGON = 5 / (18 * 3**0.5)
"""Energy of a hexagonal lattice, by area squared over the number of robots (Fejes Toth)."""
Work = Callable[[], object]


def main() -> None:
    """Print the tables."""
    outline = bumpy(VERTICES)
    print(f"CPU milliseconds, best of {REPEATS}; an outline of {VERTICES} vertices")  # noqa: T201
    _placing(outline)
    _checking(outline)
    _growth()


def bumpy(vertices: int) -> Outline:
    """A smooth closed outline with bays."""
    t = np.arange(vertices) / vertices * 2 * np.pi
    radius = SIZE / 3 * (1 + 0.25 * np.sin(3 * t) + 0.1 * np.sin(7 * t + 1))
    return make_outline(np.stack([np.cos(t), np.sin(t)], axis=1) * radius[:, None] + SIZE / 2)


def energy_ratio(outline: Outline, points: FloatArray) -> float:
    """Energy of the Voronoi cells of robots in a region, by that of a hexagonal lattice."""
    cells = grid(outline.polygon, float(np.sqrt(outline.area / FINE)))
    mean = float((nearest(points, cells, 1)[0] ** 2).mean())
    return mean * outline.area / (HEXAGON * outline.area**2 / len(points))


def _best(work: Work) -> float:
    work()
    times: list[float] = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(1000 * (time.process_time() - began))
    return min(times)


def _placing(outline: Outline) -> None:
    plain = make_outline(shapely.get_coordinates(outline.filled.simplify(SIZE / 200)))
    loop = ring(outline, 100, 200)
    few = len(plain.polygon.exterior.coords) - 1
    rows: list[tuple[str, Work, Work]] = [
        (
            f"around, 8, {few} vertices",
            lambda: along_curve(ring(plain, 100, 200), 8),
            _bare_ring(plain, 8),
        ),
        ("around, 8", lambda: along_curve(ring(outline, 100, 200), 8), _bare_ring(outline, 8)),
        ("8 on the ring alone", lambda: along_curve(loop, 8), _bare_places(loop, 8)),
        (f"{MANY} on the ring alone", lambda: along_curve(loop, MANY), _bare_places(loop, MANY)),
        ("100 at equal chords", lambda: equal_chords(loop, 100), _bare_places(loop, 100)),
    ]
    print(f"{'placing':28} {'formup':>10} {'bare':>10}")  # noqa: T201
    for name, work, bare in rows:
        print(f"{name:28} {_best(work):10.2f} {_best(bare):10.2f}")  # noqa: T201
    for n in (6, 50, 100, 1000, MANY):
        ratio = energy_ratio(outline, inside(outline, n, 10, SIZE, 0.0))
        ours, theirs = _best(_inside(outline, n)), _best(_bare_lloyd(outline, n))
        print(f"{f'inside, {n}':28} {ours:10.2f} {theirs:10.2f}   energy {ratio:.3f}")  # noqa: T201


def _bare_ring(outline: Outline, n: int) -> Work:
    """The region grown, and places on its edge, without a bay bridged or a phase chosen."""

    def work() -> object:
        line = outline.filled.buffer(100).exterior
        return shapely.line_interpolate_point(line, np.arange(n) * line.length / n)

    return work


def _bare_places(loop: Curve, n: int) -> Work:
    line = shapely.LineString(loop.lines[0])
    return lambda: shapely.line_interpolate_point(line, np.arange(n) * line.length / n)


def _bare_lloyd(outline: Outline, n: int) -> Work:
    """As many plain steps of Lloyd's iteration as one start gets, from random places."""
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


def _inside(outline: Outline, n: int) -> Work:
    """Places robots inside; each time a little deeper, so that nothing is kept from the last."""
    margins = itertools.count(10, 1e-6)
    return lambda: inside(outline, n, next(margins), SIZE, 0.0)


def _checking(outline: Outline) -> None:
    print(f"\ncheck of {MANY:18} {'formup':>10} {'bare':>10} {'ratio':>7}")  # noqa: T201
    site = Site({"t1": outline}, SIZE, SIZE)
    for relation in ("around", "inside"):
        group = Group.model_validate({"relation": relation, "targets": ["t1"], "robots": MANY})
        contract = with_defaults(Contract(groups=(group,)), site.outlines, site.room)
        points = place(contract, site)
        assert certify(points, contract, site).certified
        bare = _bare_around(outline, points) if relation == "around" else _bare_in(outline, points)
        ours, theirs = _best(lambda c=contract, p=points: certify(p, c, site)), _best(bare)
        print(f"{relation:28} {ours:10.1f} {theirs:10.1f} {ours / theirs:7.1f}")  # noqa: T201


def _bare_around(outline: Outline, points: FloatArray) -> Work:
    """Distances to the outline and to the ring, and to the nearest other robot."""
    loop = shapely.LineString(ring(outline, 100, 200).lines[0])

    def work() -> object:
        places = np.asarray(shapely.points(points), dtype=object)
        near = [nearest_segments(line, places) for line in (outline.filled, loop)]
        return near, cKDTree(points).query(points, k=2)

    return work


def _bare_in(outline: Outline, points: FloatArray) -> Work:
    """Distances to the outline and to the nearest other robot, and how far all ground is."""

    def work() -> object:
        places = np.asarray(shapely.points(points), dtype=object)
        near = nearest_segments(outline.polygon, places)
        cells = cells_of(outline.polygon, len(points))
        return near, cKDTree(points).query(points, k=2), cKDTree(points).query(cells)

    return work


def _growth() -> None:
    """Fit time ~ size ** exponent over a decade and a half."""
    outline, counts = bumpy(VERTICES), np.array([300, 1000, 3000, 10_000])
    loop, vertices = ring(outline, 100, 200), np.array([300, 1000, 3000])
    shapes = [bumpy(int(v)) for v in vertices]
    rows = {
        "along, robots": (counts, [_best(lambda n=n: along_curve(loop, int(n))) for n in counts]),
        "inside, robots": (counts, [_best(_inside(outline, int(n))) for n in counts]),
        "around 8, vertices": (
            vertices,
            [_best(lambda o=o: along_curve(ring(o, 100, 200), 8)) for o in shapes],
        ),
    }
    print("\ngrowth: time ~ size to the power of")  # noqa: T201
    for name, (sizes, times) in rows.items():
        power = np.polyfit(np.log(sizes), np.log(times), 1)[0]
        print(f"{name:28} {power:10.2f}")  # noqa: T201


if __name__ == "__main__":
    main()
