"""The trials of cages can fail: what leaks is found to leak, and what they count is counted."""

import numpy as np
import pytest
from formup.benchmarks.cage_trials import Case, search, trials
from formup.tools.geometry.cages.cages import Cage
from formup.tools.geometry.outline import FloatArray
from shapely.geometry import Polygon

SQUARE = Polygon([(-50, -50), (50, -50), (50, 50), (-50, 50)])
LOOSE = Cage("not certified", None, 100.0)


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
    case = Case(SQUARE, ring(n, reach), radius, LOOSE)
    found = search(case, 20, 150, np.random.default_rng(0))
    assert found > 5 if out else found == 0


def test_nothing_gets_out_of_certified_cages_and_much_out_of_leaky_rings() -> None:
    told = trials(caged=3, loose=2, searches=10, steps=60, seed=3)
    assert told.startswith("0 of 30 searches got out of certified cages")
    leaky = told.splitlines()[1]
    assert int(leaky.split()[0]) > 0
    assert leaky.endswith("of 2 rings.")
