"""Assignment of robots to places: CPU time and cost beside bare SciPy, and growth with N.

The bare call is `linear_sum_assignment` on squared distances, the sets' centres aligned, as anyone
would write it. Where that would take minutes, the proven bound of the gap stands in for it.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from ..tools.geometry.assignment import assign
from ..tools.geometry.outline import FloatArray
from .growth import best, growth, peak, show

PITCH = 10.0
"""Distance between neighbours in the block that robots start from, px."""
BARE_MOST = 5_000
"""Most robots for which the bare call is made; it takes ten seconds or so."""
SIZES = (2_500, 5_000, 10_000, 20_000)
REPEATS = 1
Team = Callable[[int], tuple[FloatArray, FloatArray]]
CASES = (
    ("distant", 1_000),
    ("block to ring", 2_000),
    ("block to far ring", 2_000),
    ("overlapping", 1_000),
    ("distant", 2_000),
    ("overlapping", 2_000),
    ("distant", 10_000),
    ("overlapping", 10_000),
)


def rows() -> Iterator[str]:
    """Yield a table of cases, then how time and memory grow with N."""
    yield f"{'case':38} {'CPU s':>7} {'bare s':>7} {'method':>12} {'above bare':>11} {'gap':>9}"
    for name, n in CASES:
        yield _case(name, n)
    yield f"\n{'growth':28} fitted"
    for name in ("distant", "overlapping"):
        times = [best(_assigned(name, n), REPEATS) for n in SIZES]
        yield growth(name, "robots", SIZES, times)
    for name in ("distant", "overlapping"):
        yield growth(
            f"{name}, memory", "robots", SIZES, [peak(_assigned(name, n)) for n in SIZES], "MiB"
        )


def distant(n: int) -> tuple[FloatArray, FloatArray]:
    """Return a square block of robots, and a disc of random places, 1.5 of the block's sides away.

    Both are (n, 2), px.
    """
    side = int(np.ceil(n**0.5))
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    angle, share = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, 1, n)
    radius = np.sqrt(share) * PITCH * side / 2
    disc = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius[:, None]
    block = np.asarray(cells[:n] * PITCH, dtype=float)
    return block, disc + PITCH * side * np.array([3.0, 0.5])


def overlapping(n: int) -> tuple[FloatArray, FloatArray]:
    """Return random robots and places in one square, (n, 2) px, where aligning gains nothing."""
    rng, side = np.random.default_rng(0), PITCH * n**0.5
    return rng.uniform(0, side, (n, 2)), rng.uniform(0, side, (n, 2))


def block_to_ring(n: int, away: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return a square block and a ring about it, (n, 2) px, moved `away` times the block's side."""
    block, _ = distant(n)
    side = PITCH * np.ceil(n**0.5)
    angle = np.arange(n) / n * 2 * np.pi
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * side
    return block, ring + block.mean(axis=0) + side * away * np.array([1.0, 0.15])


TEAMS: dict[str, Team] = {
    "distant": distant,
    "overlapping": overlapping,
    "block to ring": block_to_ring,
    "block to far ring": lambda n: block_to_ring(n, 5.0),
}


def _assigned(name: str, n: int) -> Callable[[], object]:
    starts, goals = TEAMS[name](n)
    return lambda: assign(starts, goals)


def _case(name: str, n: int) -> str:
    starts, goals = TEAMS[name](n)
    found = assign(starts, goals)
    seconds = best(lambda: assign(starts, goals), REPEATS) / 1000
    bare = above = "-"
    if n <= BARE_MOST:
        taken = best(lambda: _bare(starts, goals), REPEATS) / 1000
        least = float(((goals - starts[_bare(starts, goals)]) ** 2).sum())
        bare, above = f"{taken:.2f}", f"{max(found.cost / least - 1, 0.0):.4%}"
    title = f"{n:,} {name}"
    return f"{title:38} {seconds:7.2f} {bare:>7} {found.method:>12} {above:>11} {found.gap:9.4%}"


def _bare(starts: FloatArray, goals: FloatArray) -> NDArray[np.intp]:
    shift: FloatArray = starts.mean(axis=0) - goals.mean(axis=0)
    robots = linear_sum_assignment(cdist(goals + shift, starts, "sqeuclidean"))[1]
    return np.asarray(robots, dtype=np.intp)


if __name__ == "__main__":
    show(rows())
