"""The ground inside a margin: nothing of it is nearer to the edge, and nothing else is left out."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.geometry.interior import ground, inside
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

LEFT_OUT = 1.01
"""What is deeper than this multiple of the margin is ground for certain: of a rough edge GEOS
smooths away what is shallower than a hundredth of the distance."""
AT_A_CORNER = 1.0003
MANY = settings(derandomize=True, deadline=None, max_examples=60)


def depths(outline: Outline, points: FloatArray) -> FloatArray:
    """Distances to the nearest edge in plain arithmetic, 0 outside, (n,), px."""
    rings = [outline.polygon.exterior, *outline.polygon.interiors]
    least = np.full(len(points), np.inf)
    for ring in (shapely.get_coordinates(r) for r in rings):
        for a, b in pairwise(ring):
            share = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-30), 0, 1)
            least = np.minimum(least, np.linalg.norm(a + share[:, None] * (b - a) - points, axis=1))
    return np.where(shapely.contains_xy(outline.polygon, points), least, 0.0)


@st.composite
def rough(draw: st.DrawFn) -> Outline:
    """Stars, bays, stairs of pixels; with a hole or two that may touch the edge."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(3, 60))
    angles = np.sort(rng.uniform(0, 2 * math.pi, count))
    radius = rng.uniform(draw(st.sampled_from([20, 60, 110])), 120, count)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius[:, None] + 200
    if draw(st.booleans()):
        ring = np.repeat(np.round(ring / 4) * 4, 2, axis=0)
        ring[1:-1:2, 1] = ring[2::2, 1]
    holes: list[NDArray[np.float64]] = []
    for _ in range(draw(st.integers(0, 2))):
        turns = np.arange(draw(st.integers(3, 9))) * 2 * math.pi
        round_it = np.stack([np.cos(turns / len(turns)), np.sin(turns / len(turns))], axis=1)
        holes.append(round_it * rng.uniform(3, 25) + rng.uniform(150, 250, 2))
    try:
        return make_outline(ring, tuple(holes))
    except InputError:
        return make_outline([(0, 0), (90, 0), (90, 30), (30, 30), (30, 90), (0, 90)])


@given(rough(), st.floats(0.3, 40), st.one_of(st.just(math.inf), st.floats(1, 30)))
@MANY
def test_nothing_is_nearer_than_the_margin_nor_left_out_needlessly(
    outline: Outline, margin: float, more: float
) -> None:
    found = ground(outline, margin, margin + more)
    edge = shapely.get_coordinates(shapely.segmentize(found.boundary, 0.7))
    if len(edge):
        deep = depths(outline, edge)
        assert deep.min() >= margin * (1 - 1e-7)
        assert deep.max() <= (margin + more) * LEFT_OUT
    x0, y0, x1, y1 = outline.bounds
    probes = np.random.default_rng(0).uniform((x0, y0), (x1, y1), (4000, 2))
    deep = depths(outline, probes)
    wanted = probes[(deep > margin * LEFT_OUT) & (deep < (margin + more) / LEFT_OUT)]
    assert shapely.intersects_xy(found, wanted).all()


@given(rough(), st.integers(1, 40), st.floats(0.3, 30), st.floats(0, 12))
@MANY
def test_robots_inside_keep_the_margin(
    outline: Outline, n: int, margin: float, spacing: float
) -> None:
    points = inside(outline, n, margin, math.inf, spacing)
    assert len(points) <= n
    if len(points):
        assert depths(outline, points).min() >= margin - 1e-4
    if len(points) > 1:
        apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points)) * 1e9
        assert apart.min() >= spacing * (1 - 1e-9)


@pytest.mark.parametrize("margin", [1.0, 20.0, 60.0])
def test_at_a_reflex_corner_the_ground_is_round_not_cut_nor_pointed(margin: float) -> None:
    ell = make_outline([(0, 0), (600, 0), (600, 200), (200, 200), (200, 600), (0, 600)])
    found = ground(ell, margin, math.inf)
    away = np.stack(
        [np.cos(turns := np.linspace(1.01 * math.pi, 1.49 * math.pi, 50)), np.sin(turns)]
    )
    corner = np.array([200.0, 200.0])
    assert not shapely.contains_xy(found, corner + away.T * margin * (1 - 1e-6)).any()
    assert shapely.contains_xy(found, corner + away.T * margin * AT_A_CORNER).all()
