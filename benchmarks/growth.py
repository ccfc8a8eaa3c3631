"""How long a piece of work takes and how much memory, and how both grow with its size.

All benches measure and fit here, so that their figures mean the same.
"""

import time
import tracemalloc
from collections.abc import Callable, Sequence

import numpy as np

Work = Callable[[], object]


def best(work: Work, repeats: int) -> float:
    """Least CPU milliseconds over the repeats, after one to warm up."""
    work()
    times: list[float] = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        times.append(1000 * (time.process_time() - began))
    return max(min(times), 1e-3)


def peak(work: Work) -> float:
    """Greatest memory of a second run, MiB; what GEOS and k-d trees hold is not counted."""
    work()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / 2**20
    finally:
        tracemalloc.stop()


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """The power of the size that values grow with: the slope of a line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def growth(
    name: str, of: str, sizes: Sequence[float], values: Sequence[float], unit: str = "ms"
) -> str:
    """One line that says what was measured and the power law fitted to it."""
    measured = ", ".join(f"{value:.3g}" for value in values)
    span = f"{sizes[0]:,.0f} to {sizes[-1]:,.0f}"
    power = exponent(sizes, values)
    return f"{name:28} ~ {of}^{power:<5.2f} {measured} {unit} for {span}"


def times(work: Callable[[int], Work], sizes: Sequence[int], repeats: int) -> list[float]:
    """CPU milliseconds of the work that each size makes."""
    return [best(work(size), repeats) for size in sizes]
