"""Nobody drives through a target."""

import numpy as np
import pytest
import shapely
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.place import Site
from formup.tools.geometry.curves import Frame
from formup.tools.geometry.outline import FloatArray, distances, make_outline
from formup.tools.motion.routes import NoRouteError, along, obstacles, routes, way_lengths
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

FRAME = Frame(640, 480, 0)
t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
CUP = Polygon(
    [(200, 150), (230, 150), (230, 300), (400, 300), (400, 150), (430, 150), (430, 330), (200, 330)]
)
SOLIDS: dict[str, BaseGeometry] = {
    "box": shapely.box(250, 180, 400, 300),
    "cup": CUP,
    "disc": Polygon(np.stack([np.cos(t), np.sin(t)], axis=1) * 90 + (320, 240)),
    "needle": Polygon([(100, 238), (540, 240), (100, 242)]),
    "three": shapely.union_all(
        [shapely.box(120, 100, 200, 220), shapely.box(260, 200, 330, 400), CUP.buffer(0.0)]
    ),
}


def free_points(rng: np.random.Generator, solid: BaseGeometry, n: int, away: float) -> FloatArray:
    points = rng.uniform((20, 20), (620, 460), (400, 2))
    off = np.asarray(shapely.distance(solid, shapely.points(points)))
    return points[off > away][:n]


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("radius", [0.0, 3.0, 9.0])
@pytest.mark.parametrize("seed", range(3))
def test_no_route_brings_a_body_onto_a_target(name: str, radius: float, seed: int) -> None:
    solid, rng = SOLIDS[name], np.random.default_rng(seed)
    starts = free_points(rng, solid, 12, radius + 2)
    goals = free_points(rng, solid, 12, radius + 2)
    paths = routes(starts, goals, solid, radius, FRAME)
    assert len(paths) == 12
    for start, goal, path in zip(starts, goals, paths, strict=True):
        assert np.array_equal(path[0], start)
        assert np.array_equal(path[-1], goal)
        assert solid.distance(LineString(path)) > radius
        places = np.concatenate([along([path], np.array([s])) for s in np.linspace(0, 1, 60)])
        assert shapely.distance(solid, shapely.points(places)).min() > radius


def test_into_a_cup_the_way_leads_through_its_mouth_and_is_short() -> None:
    start, goal = np.array([[315.0, 400.0]]), np.array([[315.0, 250.0]])
    path = routes(start, goal, CUP, 5.0, FRAME)[0]
    length = LineString(path).length
    shortest = np.hypot(115, 70) + 180 + 30 + np.hypot(85, 100)  # grazing every corner
    assert CUP.distance(LineString(path)) > 5
    assert path[:, 1].min() < 150
    assert shortest < length < 1.4 * shortest


def test_a_free_way_is_straight_and_staying_is_no_way_at_all() -> None:
    start, goal = np.array([[10.0, 10], [50, 400]]), np.array([[600.0, 12], [50, 400]])
    paths = routes(start, goal, SOLIDS["box"], 2.0, FRAME)
    assert [len(p) for p in paths] == [2, 2]
    assert np.array_equal(along(paths, np.array([0.5, 0.5])), [(305, 11), (50, 400)])
    assert np.array_equal(routes(start, goal, Polygon(), 2.0, FRAME)[0], [start[0], goal[0]])


def test_a_place_that_is_walled_off_is_refused_not_driven_through_the_wall() -> None:
    wall = Polygon(
        shapely.box(200, 100, 440, 380).exterior, [shapely.box(220, 120, 420, 360).exterior]
    )
    with pytest.raises(NoRouteError, match=r"place \(320, 240\)"):
        routes(np.array([[50.0, 50]]), np.array([[320.0, 240]]), wall, 3.0, FRAME)


def test_a_way_round_stays_in_the_picture_where_one_does() -> None:
    solid = shapely.box(250, 60, 400, 470)
    path = routes(np.array([[100.0, 400]]), np.array([[500.0, 400]]), solid, 5.0, FRAME)[0]
    assert path[:, 1].max() <= 479, "below the target there is no room inside the picture"
    assert path[:, 1].min() >= 0


@pytest.mark.parametrize("gap", [11.0, 13.0, 40.0])
def test_a_way_round_squeezes_past_within_the_picture_before_it_leaves_it(gap: float) -> None:
    solid, radius = shapely.box(250, gap, 400, 479), 5.0
    starts, goals = np.array([[60.0, 400]]), np.array([[580.0, 400]])
    (path,) = routes(starts, goals, solid, radius, Frame(640, 480, radius))
    assert radius <= path[:, 1].min() <= path[:, 1].max() <= 479 - radius
    assert solid.distance(LineString(path)) > radius


def test_a_way_that_leaves_the_picture_is_none_where_it_is_to_be_kept() -> None:
    starts, goals = np.array([[60.0, 400], [60, 300]]), np.array([[580.0, 400], [100, 300]])
    solid, frame = shapely.box(250, 4, 400, 479), Frame(640, 480, 5.0)
    assert routes(starts, goals, solid, 5.0, frame)[0][:, 1].max() > 479
    with pytest.raises(NoRouteError) as refused:
        routes(starts, goals, solid, 5.0, frame, bounded=True)
    assert refused.value.robots.tolist() == [0]


def test_who_goes_where_is_decided_by_ways_within_the_picture() -> None:
    solid, frame = shapely.box(250, 60, 400, 475), Frame(640, 480, 5.0)
    starts, goals = np.array([[200.0, 400]]), np.array([[450.0, 400]])
    (path,) = routes(starts, goals, solid, 5.0, frame)
    length = way_lengths(starts, goals, solid, 5.0, frame)[0, 0]
    assert length == pytest.approx(LineString(path).length, rel=0.05)
    shut = shapely.box(250, 0, 400, 479)
    assert np.isfinite(way_lengths(starts, goals, shut, 5.0, frame)).all()


@pytest.mark.parametrize("clearance", [20.0, 100.0, 150.0])
def test_how_far_off_robots_are_to_stand_does_not_keep_their_ways_off(clearance: float) -> None:
    solid = shapely.box(300, 220, 340, 260)
    starts = np.array([[300.0 - clearance, 240]])
    goals = np.array([[340.0 + clearance, 240]])
    (path,) = routes(starts, goals, solid, 3.0, FRAME)
    assert 3 < solid.distance(LineString(path)) < 3 + 0.02 * np.hypot(640, 480)


@pytest.mark.parametrize("gap", [8.0, 16.0, 30.0])
def test_a_narrow_gap_is_taken_rather_than_a_way_that_is_far_longer(gap: float) -> None:
    walls = shapely.union(shapely.box(310, 60, 330, 230), shapely.box(310, 230 + gap, 330, 420))
    starts, goals = np.array([[260.0, 240]]), np.array([[380.0, 240]])
    (path,) = routes(starts, goals, walls, 3.0, FRAME)
    assert walls.distance(LineString(path)) > 3
    assert LineString(path).length < 150


def test_many_cornered_targets_are_still_driven_around() -> None:
    rng = np.random.default_rng(1)
    angle = np.linspace(0, 2 * np.pi, 700, endpoint=False)
    radius = 110 + 25 * np.sin(9 * angle) + rng.normal(0, 1.5, 700)
    solid = Polygon(np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius[:, None] + (320, 240))
    assert solid.is_valid
    starts = free_points(rng, solid, 10, 8)
    goals = free_points(rng, solid, 10, 8)
    for path in routes(starts, goals, solid, 4.0, FRAME):
        assert solid.distance(LineString(path)) > 4


def test_what_robots_stand_in_is_no_obstacle_and_everything_else_named_is() -> None:
    first = make_outline([(100, 100), (200, 100), (200, 200), (100, 200)])
    second = make_outline([(300, 100), (400, 100), (400, 200), (300, 200)])
    site = Site({"t1": first, "t2": second}, 640, 480)
    inside = Group(relation="inside", targets=("t1",), robots=2)
    around = Group(relation="around", targets=("t2",), robots=2)
    assert obstacles(Contract(groups=(inside,)), site).is_empty
    assert obstacles(Contract(groups=(inside, around)), site).equals(second.polygon)
    kept_out = Contract(groups=(around,), keep_out=("t1",))
    assert obstacles(kept_out, site).area == pytest.approx(20_000)


def test_a_narrow_passage_wide_enough_for_a_body_is_taken() -> None:
    walls = shapely.union(shapely.box(250, 0, 400, 228), shapely.box(250, 252, 400, 479))
    path = routes(np.array([[80.0, 60]]), np.array([[560.0, 60]]), walls, 5.0, FRAME)[0]
    assert walls.distance(LineString(path)) > 5
    assert path[:, 1].min() >= 0
    assert path[:, 1].max() <= 479


SEEDS, RADII = st.integers(0, 2**32 - 1), st.sampled_from([0.0, 3.0, 9.0])


@settings(max_examples=60)
@given(st.sampled_from(sorted(SOLIDS)), RADII, SEEDS)
def test_who_stands_on_a_target_leaves_it_by_the_shortest_way_and_stays_off(
    name: str, radius: float, seed: int
) -> None:
    solid, rng = SOLIDS[name], np.random.default_rng(seed)
    goals = free_points(rng, solid, 6, radius + 2)
    starts = rng.uniform((20, 20), (620, 460), (6, 2))
    x0, y0, x1, y1 = solid.bounds
    starts[:3] = rng.uniform((x0, y0), (x1, y1), (3, 2))
    away = shapely.distance(solid, shapely.points(goals)).min()
    for start, goal, path in zip(
        starts, goals, routes(starts, goals, solid, radius, FRAME), strict=True
    ):
        assert np.array_equal(path[0], start)
        assert np.array_equal(path[-1], goal)
        on = solid.distance(shapely.Point(start)) <= radius
        assert solid.distance(LineString(path[1:] if on else path)) > radius
        if on:
            rim = solid.buffer(away).boundary.intersection(FRAME.box)
            out = shapely.Point(start).distance(rim)
            assert np.linalg.norm(path[1] - start) <= 1.02 * out + 0.1


@settings(max_examples=60)
@given(st.sampled_from(["none", *sorted(SOLIDS)]), RADII, st.integers(1, 40), SEEDS)
@example("needle", 9, 11, 501)
@example("three", 9, 32, 9911743)
def test_idle_robots_are_driven_around(name: str, radius: float, count: int, seed: int) -> None:
    solid, rng = SOLIDS.get(name, Polygon()), np.random.default_rng(seed)
    if name == "none":
        starts, goals, idle = (rng.uniform((20, 20), (620, 460), (n, 2)) for n in (6, 6, count))
    else:
        points = free_points(rng, solid, 400, radius + 2)
        starts, goals, idle = points[:6], points[6:12], points[12 : 12 + count]
        starts[0] = solid.representative_point().coords[0]
    body = max(2 * radius, 2.0)
    clear = np.linalg.norm(idle[:, None] - np.concatenate([starts, goals]), axis=2).min(axis=1)
    paths = routes(starts, goals, solid, radius, FRAME, idle=idle[clear > 1.5 * body])
    alone = routes(starts, goals, solid, radius, FRAME)
    for start, goal, path, other in zip(starts, goals, paths, alone, strict=True):
        assert np.array_equal(path[0], start)
        assert np.array_equal(path[-1], goal)
        nearest, without = (
            distances(LineString(p), idle[clear > 1.5 * body]).min(initial=1e9)
            for p in (path, other)
        )
        assert nearest >= body - 1e-9
        if without > 1.01 * body and not solid.contains(shapely.Point(start)):
            assert path == pytest.approx(other), "nobody is in the way"


def test_a_gap_between_idle_robots_too_narrow_for_a_body_is_not_taken() -> None:
    start, goal = np.array([[100.0, 240]]), np.array([[500.0, 240]])
    wall = np.array([(300.0, y) for y in range(60, 430, 15)])
    path = routes(start, goal, Polygon(), 5.0, FRAME, idle=wall)[0]
    assert shapely.distance(LineString(path), shapely.points(wall)).min() >= 10
    assert LineString(path).length < 2.1 * np.hypot(200, 190)
    wide = routes(start, goal, Polygon(), 5.0, FRAME, idle=wall * (1, 1.5) - (0, 127.5))[0]
    assert LineString(wide).length < 401, "there is room between these"


def test_a_robot_shut_in_by_idle_ones_has_no_way_out() -> None:
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 30 + (320, 240)
    with pytest.raises(NoRouteError, match="the robots that stay to place"):
        routes(np.array([[320.0, 240]]), np.array([[50.0, 50]]), Polygon(), 8.0, FRAME, idle=ring)


def test_a_corner_of_the_obstacle_is_driven_to_without_crossing_it() -> None:
    solid = shapely.box(100, 100, 200, 160)
    goals = np.array([(100, 100), (200, 160)], dtype=float)
    starts = np.array([(300, 260), (10, 10)], dtype=float)
    for path, goal in zip(routes(starts, goals, solid, 0.0, Frame(400, 300)), goals, strict=True):
        np.testing.assert_array_equal(path[-1], goal)
        assert LineString(path).intersection(solid).length < 1e-6
