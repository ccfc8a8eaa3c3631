"""A certified placement, broken in every way there is, is never certified again."""

import numpy as np
import pytest
from formup.tools.formation.checking.check import certify
from formup.tools.formation.checking.verdict import Verdict
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import make_plan
from formup.tools.geometry.outline import FloatArray, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st

ELL = make_outline([(150, 120), (230, 120), (230, 240), (360, 240), (360, 320), (150, 320)])
POST = make_outline([(480, 150), (540, 150), (540, 330), (480, 330)])
SITE = Site({"t1": ELL, "t2": POST}, 640, 480)
RADIUS = 4.0


def contract(**group: object) -> Contract:
    return Contract(groups=(Group.model_validate(group),), robot_radius=RADIUS, keep_out=("t2",))


CASES = {
    "around": contract(relation="around", targets=("t1",), robots=10),
    "cage": contract(relation="cage", targets=("t1",), robots=12),
    "corners": contract(relation="corners", targets=("t1",), robots=6),
    "left": contract(relation="along", targets=("t1",), robots=5, side="left"),
    "edges": contract(relation="along", targets=("t1",), robots=4, edges=(0, 1)),
    "inside": contract(relation="inside", targets=("t1",), robots=9),
    "line": contract(relation="between", targets=("t1", "t2"), robots=3),
    "divider": contract(relation="between", targets=("t1", "t2"), robots=4, layout="divider"),
    "centre": contract(relation="centre", targets=("t1",), robots=4),
    "shape": contract(relation="shape", robots=6, line=(40, 60, 600, 60)),
}
PLACES: dict[str, FloatArray] = {
    name: make_plan(case, SITE, "s").formation.points for name, case in CASES.items()
}
FULL = {name: make_plan(case, SITE, "s").formation.contract for name, case in CASES.items()}
OUTSIDE = ("around", "cage", "corners", "left", "edges", "line", "divider")
names = st.sampled_from(sorted(CASES))
MANY = settings(derandomize=True, deadline=None, max_examples=50)


def verdict(name: str, points: FloatArray) -> Verdict:
    return certify(points, FULL[name], SITE)


def blamed(found: Verdict) -> set[int]:
    return {f.robot for f in found.findings if f.robot is not None}


@pytest.mark.parametrize("name", CASES)
def test_what_is_broken_below_is_certified_before(name: str) -> None:
    found = verdict(name, PLACES[name])
    assert found.certified
    assert not found.findings


@pytest.mark.parametrize("where", [(200, 200), (300, 280), (510, 240)])
@pytest.mark.parametrize("name", OUTSIDE)
def test_a_robot_on_a_target_is_blamed(name: str, where: tuple[float, float]) -> None:
    for i in range(len(PLACES[name])):
        points = PLACES[name].copy()
        points[i] = where
        found = verdict(name, points)
        assert not found.certified
        assert i + 1 in blamed(found)


@given(names, st.integers(0, 99), st.sampled_from([(-1, 240), (3, 3), (637, 240), (300, 500)]))
@MANY
def test_a_robot_not_wholly_in_the_picture_is_blamed(
    name: str, robot: int, where: tuple[float, float]
) -> None:
    points = PLACES[name].copy()
    i = robot % len(points)
    points[i] = where
    found = verdict(name, points)
    assert {"out_of_picture"} <= {f.kind for f in found.findings if f.robot == i + 1}


@given(names, st.integers(0, 99), st.integers(1, 98), st.floats(0, 7.9), st.floats(0, 6.3))
@MANY
def test_two_bodies_that_overlap_are_blamed(
    name: str, robot: int, step: int, apart: float, turn: float
) -> None:
    points = PLACES[name].copy()
    count = len(points)
    i = robot % count
    j = (i + 1 + step % (count - 1)) % count
    points[i] = points[j] + apart * np.array([np.cos(turn), np.sin(turn)])
    found = verdict(name, points)
    assert not found.certified
    assert blamed(found) & {i + 1, j + 1}


@pytest.mark.parametrize("name", CASES)
def test_one_robot_too_few_or_too_many_is_counted(name: str) -> None:
    points = PLACES[name]
    for other in (points[1:], points[:0], np.concatenate([points, points[:1] + 40])):
        found = verdict(name, other)
        assert [f.kind for f in found.findings] == ["count"]
        assert not found.certified


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e308, -1e18])
@pytest.mark.parametrize("name", CASES)
def test_a_coordinate_that_is_no_place_is_blamed(name: str, bad: float) -> None:
    points = PLACES[name].copy()
    points[1, 0] = bad
    found = verdict(name, points)
    assert not found.certified
    assert blamed(found) == {2}


@pytest.mark.parametrize("name", ["around", "cage"])
def test_a_robot_moved_far_along_the_ring_leaves_a_gap(name: str) -> None:
    points = PLACES[name].copy()
    for i in range(len(points)):
        moved = points.copy()
        moved[i] = (points[(i + 1) % len(points)] + points[(i + 2) % len(points)]) / 2
        found = verdict(name, moved)
        assert not found.certified


@pytest.mark.parametrize("name", [n for n in CASES if n not in ("inside", "centre", "shape")])
def test_swapped_coordinates_are_not_certified(name: str) -> None:
    assert not verdict(name, PLACES[name][:, ::-1].copy()).certified


def test_a_corner_robot_turned_away_about_the_centre_is_blamed() -> None:
    points = PLACES["corners"]
    middle = np.array([255.0, 220.0])
    for angle in (0.5, 1.0, 2.0):
        c, s = np.cos(angle), np.sin(angle)
        moved = points.copy()
        moved[0] = (points[0] - middle) @ np.array([[c, s], [-s, c]]) + middle
        found = verdict("corners", moved)
        assert not found.certified
        assert 1 in blamed(found)


@pytest.mark.parametrize("name", ["around", "cage", "left", "edges"])
def test_all_robots_pushed_out_past_the_range_are_all_blamed(name: str) -> None:
    middle = np.array(ELL.centre)
    away = PLACES[name] - middle
    points = middle + away * (1 + 90 / np.linalg.norm(away, axis=1, keepdims=True))
    found = verdict(name, points)
    assert not found.certified
    assert len(blamed(found)) == len(points)


@given(names, st.randoms(use_true_random=False))
@MANY
def test_who_stands_where_does_not_matter(name: str, random: object) -> None:
    order = list(range(len(PLACES[name])))
    getattr(random, "shuffle")(order)  # noqa: B009
    found = verdict(name, PLACES[name][order])
    assert found.certified
    assert found.measures == verdict(name, PLACES[name]).measures


@given(names, st.integers(0, 99), st.floats(170, 400), st.floats(0, 6.3))
@settings(MANY, max_examples=150)
def test_a_robot_moved_a_long_way_is_never_still_in_its_place(
    name: str, robot: int, reach: float, turn: float
) -> None:
    """Only `inside` may bear it: any place in the target that stays evenly covered is good."""
    points = PLACES[name].copy()
    i = robot % len(points)
    points[i] += reach * np.array([np.cos(turn), np.sin(turn)])
    if name != "inside":
        assert not verdict(name, points).certified


def test_everybody_on_one_side_is_not_around() -> None:
    for name in ("around", "cage"):
        n = len(PLACES[name])
        row = np.stack([np.full(n, 115.0), np.linspace(110, 330, n)], axis=1)
        assert not verdict(name, row).certified
