"""Measures the time and memory of a piece of work, and fits how they grow with its size.

All benchmarks measure and fit here, so that their figures mean the same.
"""

import time
import tracemalloc
from collections.abc import Callable, Iterable, Sequence

import numpy as np

Work = Callable[[], object]


def show(rows: Iterable[str]) -> None:
    """Print rows as they are measured."""
    for row in rows:
        print(row, flush=True)  # noqa: T201


def heading(what: str, last: str = "") -> str:
    """Return the heading of a table of rows made by `beside`."""
    return f"{what:32} {'formup':>10} {'bare':>10} {'ratio':>7}  {last}"


def beside(name: str, ours: float, bare: float, last: str = "") -> str:
    """Return a row: milliseconds beside those of the bare library calls, and the ratio."""
    return f"{name:32} {ours:10.2f} {bare:10.2f} {ours / bare:7.1f}  {last}"


def best(work: Work, repeats: int) -> float:
    """Return the least CPU milliseconds over the repeats, after a warm-up."""
    work()
    times: list[float] = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        times.append(1000 * (time.process_time() - began))
    return max(min(times), 1e-3)


def peak(work: Work) -> float:
    """Return the peak memory of a second run, MiB, without that of GEOS and k-d trees."""
    work()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / 2**20
    finally:
        tracemalloc.stop()


def growth(
    name: str, of: str, sizes: Sequence[float], values: Sequence[float], unit: str = "ms"
) -> str:
    """Return a line with what was measured, and the power of the size that it grows with."""
    measured = ", ".join(f"{value:.3g}" for value in values)
    span = f"{sizes[0]:,.0f} to {sizes[-1]:,.0f}"
    power = float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
    return f"{name:28} ~ {of}^{power:<5.2f} {measured} {unit} for {span}"


def times(work: Callable[[int], Work], sizes: Sequence[int], repeats: int) -> list[float]:
    """Return the CPU milliseconds of the work for each size."""
    return [best(work(size), repeats) for size in sizes]
