"""Who takes which place: CPU time and cost beside the bare SciPy call, and growth with N.

The bare call is `linear_sum_assignment` of the squared distances of sets with one centre, as
anyone would write it. Where that takes minutes the proven bound of the gap stands for the optimum.
"""

import time
import tracemalloc
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from ..tools.formation.assignment import Objective, assign
from ..tools.geometry.outline import FloatArray

PITCH = 10.0
"""Distance of neighbours in the block robots start from, px."""
BARE_MOST = 5_000
"""Robots for which the bare call is made: ten seconds or so."""
SIZES = (2_500, 5_000, 10_000, 20_000)
MEMORY = (5_000, 10_000)
T = TypeVar("T")
Team = Callable[[int], tuple[FloatArray, FloatArray]]
CASES: tuple[tuple[str, int, Objective], ...] = (
    ("distant", 1_000, "squares"),
    ("distant", 1_000, "makespan"),
    ("overlapping", 1_000, "squares"),
    ("distant", 2_000, "squares"),
    ("overlapping", 2_000, "squares"),
    ("distant", 10_000, "squares"),
    ("overlapping", 10_000, "squares"),
)


def main() -> None:
    """Print the rows."""
    for row in rows():
        print(row, flush=True)  # noqa: T201


def rows() -> Iterator[str]:
    """A table of cases, the growth of time with N, and the memory of the approximation."""
    yield f"{'case':32} {'CPU s':>7} {'bare s':>7} {'method':>12} {'above bare':>11} {'gap':>9}"
    for name, n, objective in CASES:
        yield _case(name, n, objective)
    for name in TEAMS:
        times = [_timed(lambda n=n, name=name: assign(*TEAMS[name](n)))[0] for n in SIZES]
        slope = np.polyfit(np.log(SIZES), np.log(times), 1)[0]
        each = ", ".join(f"{t:.2f} s" for t in times)
        yield f"{name}: {each} for {SIZES[0]:,} to {SIZES[-1]:,} robots, time as N^{slope:.2f}"
    peaks = [_peak(n) for n in MEMORY]
    yield (
        f"memory: {peaks[0] / 2**20:.0f} MiB at {MEMORY[0]:,} robots, {peaks[1] / 2**20:.0f} MiB "
        f"at twice as many ({peaks[1] / peaks[0]:.2f} times as much)"
    )


def distant(n: int) -> tuple[FloatArray, FloatArray]:
    """A square block and a disc of as many random places, twice the block's side away."""
    side = int(np.ceil(n**0.5))
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    angle, share = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, 1, n)
    radius = np.sqrt(share) * PITCH * side / 2
    disc = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius[:, None]
    block = np.asarray(cells[:n] * PITCH, dtype=float)
    return block, disc + PITCH * side * np.array([3.0, 0.5])


def overlapping(n: int) -> tuple[FloatArray, FloatArray]:
    """Random robots and random places all over the same square: nothing is gained by aligning."""
    rng, side = np.random.default_rng(0), PITCH * n**0.5
    return rng.uniform(0, side, (n, 2)), rng.uniform(0, side, (n, 2))


TEAMS: dict[str, Team] = {"distant": distant, "overlapping": overlapping}


def _case(name: str, n: int, objective: Objective) -> str:
    starts, goals = TEAMS[name](n)
    seconds, found = _timed(lambda: assign(starts, goals, objective=objective))
    bare = above = "-"
    if n <= BARE_MOST:
        taken, robots = _timed(lambda: _bare(starts, goals))
        least = float(((goals - starts[robots]) ** 2).sum())
        bare, above = f"{taken:.2f}", f"{max(found.cost / least - 1, 0.0):.4%}"
    title = f"{n:,} {name}, {objective}"
    return f"{title:32} {seconds:7.2f} {bare:>7} {found.method:>12} {above:>11} {found.gap:9.4%}"


def _bare(starts: FloatArray, goals: FloatArray) -> NDArray[np.intp]:
    shift: FloatArray = starts.mean(axis=0) - goals.mean(axis=0)
    robots = linear_sum_assignment(cdist(goals + shift, starts, "sqeuclidean"))[1]
    return np.asarray(robots, dtype=np.intp)


def _timed(work: Callable[[], T]) -> tuple[float, T]:
    began = time.process_time()
    done = work()
    return time.process_time() - began, done


def _peak(n: int) -> int:
    """Greatest memory of the approximation for overlapping sets, bytes; k-d trees not counted."""
    starts, goals = overlapping(n)
    tracemalloc.start()
    assign(starts, goals)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


if __name__ == "__main__":
    main()
