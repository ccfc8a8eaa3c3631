"""Teams as numbers: where outlines are, what is seen, what is paid."""

import numpy as np
import pytest
import shapely
from formup.evals.rl.teams import (
    CATEGORIES,
    CLEARANCE,
    FAR,
    SEEN,
    STRIDE,
    Category,
    Teams,
    outline_points,
    random_outlines,
)
from numpy.typing import NDArray
from shapely import affinity
from shapely.geometry import Polygon, box

SQUARE = box(100, 40, 140, 80)
DISC = shapely.Point(70, 70).buffer(20)


def standing(category: Category, places: NDArray[np.float64], target: Polygon = SQUARE) -> Teams:
    """A team that stands where it is told."""
    outline, _, _ = outline_points(target)
    teams = Teams(category, len(places), outline[None], np.random.default_rng(0))
    teams.places = places[None].copy()
    teams.move(np.zeros_like(teams.places))
    return teams


def ring(count: int, turn: float = 0.0) -> NDArray[np.float64]:
    """Even about the disc, at the wanted clearance."""
    turns, radius = 2 * np.pi * (np.arange(count) / count + turn), np.pi**-0.5 + CLEARANCE
    return radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def test_an_outline_is_of_area_1_about_the_origin_without_its_holes() -> None:
    holed = Polygon(SQUARE.exterior, [box(110, 50, 120, 60).exterior])
    points, centre, size = outline_points(holed)
    assert (centre.tolist(), size) == ([120, 60], 40)
    assert Polygon(points).area == pytest.approx(1)
    assert Polygon(points).exterior.is_ccw


def test_what_is_seen_first_is_the_way_to_the_outline() -> None:
    random = np.random.default_rng(3)
    outlines = random_outlines(20, random)
    teams = Teams("general", 5, outlines, random)
    for outline, places, seen in zip(outlines, teams.places, teams.seen(), strict=True):
        target = Polygon(outline)
        for place, own in zip(places, seen, strict=True):
            sign = -1 if target.contains(shapely.Point(place)) else 1
            far = target.exterior.distance(shapely.Point(place))
            assert own[2] == pytest.approx(sign * far, abs=1e-5)
            assert np.hypot(*own[:2]) == pytest.approx(far, abs=1e-5)
            out = place / np.linalg.norm(place)
            there = place + own[0] * out + own[1] * np.array([-out[1], out[0]])
            assert target.exterior.distance(shapely.Point(there)) < 1e-5


@pytest.mark.parametrize("category", CATEGORIES)
def test_nothing_depends_on_how_the_scene_lies(category: Category) -> None:
    places = np.random.default_rng(1).uniform(-2, 2, (7, 2))
    target = Polygon([(0, 0), (60, 0), (60, 20), (20, 20), (20, 50), (0, 50)])
    shape, turn = affinity.translate(target, 300, -20), np.radians(70)
    one = standing(category, places, target)
    turned = places @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    other = standing(category, turned, affinity.rotate(affinity.scale(shape, 3, 3), 70))
    assert other.rewards() == pytest.approx(one.rewards(), abs=1e-6)
    assert other.seen() == pytest.approx(one.seen(), abs=1e-4)


def test_a_category_is_paid_for_what_it_asks() -> None:
    even, shifted = ring(8), ring(8, 0.03)
    for places in (even, shifted):
        assert standing("caging", places, DISC).rewards() == pytest.approx(1, abs=0.05)
    crowd = ring(40)[:8]
    assert standing("caging", crowd, DISC).rewards().mean() < 0.75
    for places in (even, ring(24)[:8]):
        assert standing("general", places, DISC).rewards() == pytest.approx(1, abs=0.01)
    spread = np.array([[x, y] for x in (-0.3, 0.0, 0.3) for y in (-0.25, 0.25)])
    assert standing("infill", spread).rewards() == pytest.approx((1 + 0.3 * 6**0.5) / 2)
    assert standing("infill", ring(6)).rewards().max() < 0.75
    for category in CATEGORIES:
        assert standing(category, np.zeros((4, 2))).rewards().max() <= 0


def test_robots_move_away_and_about_and_no_farther_than_a_stride() -> None:
    teams = standing("general", np.array([[1.0, 0.0], [0.0, -2.0]]))
    teams.move(np.array([[[0.5, 9.0], [9.0, 0.0]]]))
    assert teams.places[0] == pytest.approx(
        np.array([[1 + 0.5 * STRIDE, STRIDE], [0, -2 - STRIDE]])
    )
    for _ in range(30):
        teams.move(np.ones((1, 2, 2)))
    assert np.abs(teams.places).max() <= FAR


@pytest.mark.parametrize("count", [1, 2, 5, 30])
def test_teams_are_of_any_size(count: int) -> None:
    random = np.random.default_rng(0)
    for category in CATEGORIES:
        teams = Teams(category, count, random_outlines(3, random), random)
        teams.move(random.uniform(-1, 1, teams.places.shape))
        assert teams.seen().shape == (3, count, SEEN)
        assert np.isfinite(teams.seen()).all()
        assert teams.rewards().shape == (3, count)
        assert teams.rewards().max() <= 1
