"""Paths keep off other things wherever there is a way, and reach every goal where there is none."""

from collections.abc import Sequence

import numpy as np
import pytest
import shapely
from formup.tools.formation.site import Other, Site
from formup.tools.geometry.outline import FloatArray
from formup.tools.motion.avoiding import long_ways_round, routes_off
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

ROOM = 0.02 * np.hypot(640, 480)
NOTHING = Polygon()
SEEDS = st.integers(0, 2**32 - 1)


def box(name: str, x0: float, y0: float, x1: float, y1: float, confidence: float = 1.0) -> Other:
    return Other(name, "grey thing", shapely.box(x0, y0, x1, y1), confidence)


def around(
    starts: FloatArray,
    goals: FloatArray,
    things: Sequence[Other],
    radius: float = 0.0,
    solid: BaseGeometry = NOTHING,
) -> list[FloatArray]:
    return routes_off(starts, goals, solid, Site({}, 640, 480, others=tuple(things)), radius)


def ends(*pairs: tuple[float, float]) -> FloatArray:
    return np.array(pairs, dtype=float)


def crossed(path: FloatArray, thing: Other, radius: float = 0.0) -> bool:
    return thing.region.distance(LineString(path)) <= radius


def scattered(rng: np.random.Generator, count: int) -> list[Other]:
    """Round things that leave room between them, at some of the places of a grid."""
    cells = [(x, y) for x in range(110, 600, 105) for y in range(100, 440, 95)]
    chosen: list[int] = rng.permutation(len(cells))[:count].tolist()
    return [
        Other(
            f"c{k}",
            "grey thing",
            shapely.Point(float(cells[i][0]), float(cells[i][1])).buffer(rng.uniform(8, 24)),
            float(rng.choice([0.45, 1.0])),
        )
        for k, i in enumerate(chosen, start=1)
    ]


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.integers(1, 16), st.sampled_from([0.0, 4.0]))
def test_nothing_that_can_be_driven_around_is_driven_over(
    seed: int, count: int, radius: float
) -> None:
    rng = np.random.default_rng(seed)
    things = scattered(rng, count)
    points = rng.uniform((15, 15), (625, 465), (40, 2))
    off = np.asarray(
        shapely.distance(shapely.union_all([t.region for t in things]), shapely.points(points))
    )
    free = points[off > 1.1 * radius + 1][:12]
    starts, goals = free[: len(free) // 2], free[len(free) // 2 : 2 * (len(free) // 2)]
    paths = around(starts, goals, things, radius)
    for start, goal, path in zip(starts, goals, paths, strict=True):
        assert np.array_equal(path[0], start)
        assert np.array_equal(path[-1], goal)
        assert not any(crossed(path, thing, radius) for thing in things)


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_obstacles_are_never_driven_over_for_the_sake_of_other_things(seed: int) -> None:
    rng = np.random.default_rng(seed)
    things, wall = scattered(rng, 14), shapely.box(290, 0, 330, 400)
    starts = rng.uniform((10, 10), (60, 470), (4, 2))
    goals = rng.uniform((560, 10), (620, 470), (4, 2))
    for path in around(starts, goals, things, 2.0, wall):
        assert wall.distance(LineString(path)) > 2


@pytest.mark.parametrize(("confidence", "room"), [(1.0, ROOM), (0.6, ROOM + 0.2 * 0.4 * 150)])
def test_room_is_kept_where_there_is_some_and_more_beside_what_is_vague(
    confidence: float, room: float
) -> None:
    thing = box("c1", 250, 150, 400, 300, confidence=confidence)
    starts, goals = ends((50, 240)), ends((600, 240))
    path = around(starts, goals, [thing])[0]
    assert thing.region.distance(LineString(path)) > 0.9 * room


def test_between_two_things_a_gap_narrower_than_the_room_is_taken_when_there_is_no_other() -> None:
    things = [box("c1", 300, -10, 340, 235), box("c2", 300, 245, 340, 490)]
    starts, goals = ends((50, 100)), ends((600, 100))
    path = around(starts, goals, things)[0]
    assert not any(crossed(path, thing) for thing in things)


def test_a_ring_of_things_is_entered_through_the_least_certain_one() -> None:
    things = [
        box("c1", 200, 100, 440, 130),
        box("c2", 200, 350, 440, 380),
        box("c3", 200, 100, 230, 380),
        box("c4", 410, 100, 440, 380, confidence=0.45),
    ]
    path = around(ends((40, 240)), ends((320, 240)), things, 3.0)[0]
    assert [crossed(path, thing, 3.0) for thing in things] == [False, False, False, True]
    sure = [*things[:3], box("c4", 410, 100, 440, 380)]
    path = around(ends((40, 240)), ends((320, 240)), sure, 3.0)[0]
    assert np.array_equal(path, ends((40, 240), (320, 240))), "the straight way, which is told of"


def test_what_one_robot_stands_on_is_still_in_the_way_of_the_others() -> None:
    thing = box("c1", 280, 200, 360, 280)
    starts, goals = ends((40, 240), (40, 250)), ends((320, 240), (600, 250))
    on, past = around(starts, goals, [thing], 2.0)
    assert crossed(on, thing)
    assert not crossed(past, thing, 2.0)


def left(path: FloatArray, radius: float = 0.0) -> bool:
    """Whether a body on a path comes out of the picture."""
    picture = shapely.box(radius, radius, 639 - radius, 479 - radius)
    return not picture.buffer(1e-6).covers(LineString(path))


@settings(max_examples=60, deadline=None)
@given(st.floats(0.5, 30), st.sampled_from([0.0, 4.0]), st.sampled_from([0.45, 1.0]), SEEDS)
def test_the_picture_is_not_left_for_more_room_where_a_way_within_it_leads_past(
    spare: float, radius: float, confidence: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    gap = 2.2 * radius + spare
    things = [box("c1", 290, gap, 340, 479, confidence), box("c2", 30, 200, 90, 260)]
    starts = rng.uniform((110, 10), (240, 470), (3, 2))
    goals = rng.uniform((400, 10), (620, 470), (3, 2))
    for path in around(starts, goals, things, radius):
        assert not left(path, radius)
        assert not any(crossed(path, thing, radius) for thing in things)


@pytest.mark.parametrize("confidence", [0.45, 1.0])
def test_what_the_picture_cuts_off_is_driven_over_not_around_beyond_it(confidence: float) -> None:
    thing = box("c1", 300, 0, 340, 479, confidence)
    path = around(ends((50, 100)), ends((600, 240)), [thing, box("c2", 150, 60, 260, 300)], 3.0)[0]
    assert not left(path, 3.0)
    assert crossed(path, thing, 3.0)
    assert not crossed(path, box("c2", 150, 60, 260, 300), 3.0), "that is still driven around"


def test_beside_what_is_whole_the_picture_is_left_where_there_is_no_room_within_it() -> None:
    doubtful, sure = (box("c1", 300, 4, 340, 475, confidence) for confidence in (0.45, 1.0))
    path = around(ends((50, 100)), ends((600, 240)), [doubtful], 5.0)[0]
    assert np.array_equal(path, ends((50, 100), (600, 240)))
    path = around(ends((50, 100)), ends((600, 240)), [sure], 5.0)[0]
    assert left(path, 5.0)
    assert not crossed(path, sure, 5.0)
    path = around(ends((50, 100)), ends((600, 240)), [], 5.0, sure.region)[0]
    assert left(path, 5.0)
    assert not crossed(path, sure, 5.0)


def test_a_long_way_round_is_told_with_what_it_goes_round() -> None:
    line, target = box("c1", 300, 10, 306, 440), shapely.box(360, 200, 400, 240)
    site = Site({}, 640, 480, others=(line, box("c2", 20, 20, 60, 60)))
    starts, goals = (
        ends((280, 220), (40, 240), (600, 220)),
        ends((340, 220), (600, 460), (420, 220)),
    )
    ways = dict(zip("123", routes_off(starts, goals, target, site, 3.0), strict=True))
    (met,) = long_ways_round(ways, target, site, 3.0)
    assert (met.how, met.robots, met.thing) == ("round", ("1",), "c1")
    assert met.times == pytest.approx(LineString(ways["1"]).length / 60, abs=0.01)
    assert met.times > 5
    assert f"{met.times:.1f} times as far to get round c1 (grey thing) as over it" in met.sentence
    beside = routes_off(starts, goals, shapely.union(line.region, target), site, 3.0)
    ways = dict(zip("123", beside, strict=True))
    assert long_ways_round(ways, shapely.union(line.region, target), site, 3.0) == ()


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_robots_that_stand_at_a_thing_do_not_drive_over_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    things = scattered(rng, 6)
    off = rng.uniform(1.0, 6.0, len(things))
    rims = [t.region.buffer(o).exterior for t, o in zip(things, off, strict=True)]
    at = shapely.line_interpolate_point(
        np.repeat(np.array(rims), 2), rng.random(12), normalized=True
    )
    starts = shapely.get_coordinates(at)
    for path in around(starts, np.roll(starts, 1, axis=0), things, 3.0):
        over = shapely.union_all([t.region for t in things]).intersection(LineString(path))
        assert over.length == 0


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_leaving_a_thing_never_leads_into_an_obstacle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    things, target = scattered(rng, 8), shapely.Point(320, 240).buffer(60)
    rim = Other("rim", "grey rim", target.buffer(9).boundary.buffer(5), 1.0)
    angles = rng.uniform(0, 2 * np.pi, (2, 6))
    starts = np.stack([320 + 220 * np.cos(angles[0]), 240 + 200 * np.sin(angles[0])], axis=1)
    goals = np.stack([320 + 70 * np.cos(angles[1]), 240 + 70 * np.sin(angles[1])], axis=1)
    for path in around(starts, goals, [*things, rim], 3.0, target):
        assert target.distance(LineString(path)) > 2.9
