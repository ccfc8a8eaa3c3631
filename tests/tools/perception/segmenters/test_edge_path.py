"""The path of least cost along an outline: closed, exact on clear edges, near what was drawn."""

import itertools

import cv2
import numpy as np
import pytest
from formup.tools.perception.segmenters.edge_path import closed_path, edge_path
from formup.tools.perception.segmenters.grabcut import Bytes, Points, features, polygon_region
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays


def disc_picture(radius: float) -> Bytes:
    pixels = np.full((300, 300, 3), 90, np.uint8)
    cv2.circle(pixels, (150, 150), round(radius), (200, 40, 40), -1, cv2.LINE_AA)
    return features(pixels)


def ring(radius: float, count: int = 24) -> Points:
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return 150 + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def cheapest(cost: np.ndarray, bend: float) -> float:
    """The least cost of a closed path, by trying all of them."""
    rows, columns = cost.shape
    return min(
        sum(cost[i, k] for i, k in enumerate(path))
        + sum(bend * (a - b) ** 2 for a, b in zip(path, path[1:] + path[:1], strict=True))
        for path in itertools.product(range(columns), repeat=rows)
    )


@given(arrays(np.float64, (5, 4), elements=st.floats(0, 1)))
@settings(max_examples=40)
def test_a_path_is_closed_and_as_cheap_as_the_best_through_where_it_was_closed(
    cost: np.ndarray,
) -> None:
    taken = closed_path(cost, 0.3)
    total = float(
        cost[np.arange(5), taken].sum() + 0.3 * (np.diff(np.r_[taken, taken[0]]) ** 2).sum()
    )
    least = cheapest(cost, 0.3)
    assert total >= least - 1e-9
    fixed = cost.copy()
    fixed[2, np.arange(4) != taken[2]] = np.inf
    assert total == pytest.approx(cheapest(fixed, 0.3))


@pytest.mark.parametrize("drawn", [76.0, 80.0, 84.0])
def test_a_line_drawn_beside_a_clear_edge_moves_onto_it(drawn: float) -> None:
    outline = ring(drawn)
    region = polygon_region(outline, (300, 300))
    found = edge_path(disc_picture(80.0), outline, region)
    away = np.linalg.norm(found - 150, axis=1) - 80
    assert np.abs(away).mean() < 1.2


def test_where_there_is_no_edge_the_line_stays_where_it_was_drawn() -> None:
    outline = ring(80.0, 60)
    region = polygon_region(outline, (300, 300))
    plain = np.full((300, 300, 3), 90, np.uint8)
    found = edge_path(plain, outline, region)
    assert np.abs(np.linalg.norm(found - 150, axis=1) - 80).max() < 1.5


def test_an_edge_beyond_the_band_is_not_taken() -> None:
    outline = ring(60.0, 60)
    region = polygon_region(outline, (300, 300))
    found = edge_path(disc_picture(90.0), outline, region)
    assert np.linalg.norm(found - 150, axis=1).max() < 60 + 0.06 * np.sqrt(np.pi) * 60 + 1.5


def test_a_thin_part_is_not_crossed() -> None:
    bar = np.array([(40.0, 146.0), (260.0, 146.0), (260.0, 154.0), (40.0, 154.0)])
    region = polygon_region(bar, (300, 300))
    found = polygon_region(edge_path(disc_picture(5.0), bar, region), (300, 300))
    assert np.count_nonzero(found[:, 60:240]) > 0.4 * np.count_nonzero(region[:, 60:240])
