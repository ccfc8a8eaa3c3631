"""Outlines that cross themselves: mended where it is clear what was meant, else left."""

import itertools

import numpy as np
import pytest
from formup.tools.geometry.mending import mended
from shapely.geometry import Polygon

Ring = list[tuple[float, float]]


def star(seed: int, vertices: int) -> Ring:
    """A rough outline around a thing: vertices in order, not evenly far from the middle."""
    random = np.random.default_rng(seed)
    turns = np.sort(random.uniform(0, 0.7, vertices) + np.arange(vertices)) * 2 * np.pi / vertices
    far = random.uniform(60, 100, vertices)
    return [(200 + f * np.cos(t), 200 + f * np.sin(t)) for f, t in zip(far, turns, strict=True)]


@pytest.mark.parametrize("seed", range(30))
def test_two_vertices_in_the_wrong_order_are_put_right(seed: int) -> None:
    ring = star(seed, 5 + seed % 8)
    true, wrong = Polygon(ring), list(ring)
    k = seed % (len(ring) - 1)
    wrong[k], wrong[k + 1] = wrong[k + 1], wrong[k]
    if Polygon(wrong).is_valid:
        return
    found = mended(wrong)
    if found is None:
        return  # it may have meant something else as well
    region, said = found
    assert region.is_valid
    assert "crossed itself" in said
    assert region.intersection(true).area / region.union(true).area > 0.75


def test_most_of_them_are() -> None:
    right = tried = 0
    for seed in range(60):
        ring = star(seed, 6 + seed % 6)
        ring[1], ring[2] = ring[2], ring[1]
        if not Polygon(ring).is_valid:
            tried, right = tried + 1, right + (mended(ring) is not None)
    assert tried > 30
    assert right > 0.8 * tried


def test_an_end_that_overshoots_the_beginning_is_cut_off() -> None:
    ring = [(10.0, 10.0), (100, 10), (100, 100), (10, 100), (12, 8), (8, 12)]
    found = mended(ring)
    assert found is not None
    assert found[0].area == pytest.approx(90 * 90, rel=0.05)
    assert "loop" in found[1]


def test_corners_named_row_by_row_are_a_rectangle() -> None:
    found = mended([(0, 0), (50, 0), (0, 30), (50, 30)])
    assert found is not None
    assert found[0].equals(Polygon([(0, 0), (50, 0), (50, 30), (0, 30)]))


def test_what_could_mean_anything_is_left() -> None:
    random = np.random.default_rng(1)
    for count in (12, 40, 300, 5_000):
        points = random.uniform(0, 300, (count, 2))
        assert mended([(float(x), float(y)) for x, y in points]) is None
    flower = [(x * 100.0, y * 100.0) for x, y in itertools.product((0, 1, 2), (0, 1, 2))]
    assert mended([flower[i] for i in (0, 8, 2, 6, 1, 7, 3, 5)]) is None
