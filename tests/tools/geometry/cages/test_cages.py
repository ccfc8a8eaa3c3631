"""Caged means caged: known answers, what must not matter, and searches that must not get out."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
import shapely
from formup.tools.geometry.cages.cage_places import Demand, fewest_cage
from formup.tools.geometry.cages.cages import MOST_FLOODED, QUICK, Cage, cage, widest_link
from formup.tools.geometry.cages.configuration import flood
from formup.tools.geometry.cages.rigid import Obstacles, body_of, clear_moves
from formup.tools.geometry.curves import Frame, ring
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, MultiPoint, Polygon

FEW = settings(
    derandomize=True, deadline=None, max_examples=10, phases=[Phase.explicit, Phase.generate]
)
"""Not shrunk: one example takes up to a second."""
STAR = [(r * math.cos(t), r * math.sin(t)) for t, r in zip(
    np.arange(10) * math.pi / 5, [1.0, 0.4] * 5, strict=True)]  # fmt: skip
DISC = [(math.cos(t), math.sin(t)) for t in np.linspace(0, 2 * math.pi, 200, endpoint=False)]
SHAPES: dict[str, Sequence[tuple[float, float]]] = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "rectangle": [(0, 0), (4, 0), (4, 2), (0, 2)],
    "triangle": [(0, 0), (5, 0), (2.5, 4.33)],
    "circle": DISC,
    "ell": [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    "star": STAR,
    "cee": [(0, 0), (3, 0), (3, 0.8), (0.8, 0.8), (0.8, 2.2), (3, 2.2), (3, 3), (0, 3)],
}
CUP = [(-50, -60), (-40, -60), (-40, 50), (40, 50), (40, -60), (50, -60), (50, 60), (-50, 60)]


def outline(name: str, size: float = 100.0) -> Outline:
    points = np.array(SHAPES[name], dtype=float)
    return make_outline(points * size / math.sqrt(Polygon(points).area) + 300)


def spread(thing: Outline, offset: float, n: int, phase: float) -> FloatArray:
    line = LineString(ring(thing, offset, offset).lines[0])
    at = (np.arange(n) + phase) / n % 1
    return shapely.get_coordinates(shapely.line_interpolate_point(line, at, normalized=True))


def turned(thing: Polygon, pose: FloatArray, start: FloatArray) -> Polygon:
    x, y, angle = (float(v) for v in pose)
    about = (float(start[0]), float(start[1]))
    moved = rotate(thing, angle, origin=about, use_radians=True)
    return translate(moved, x - about[0], y - about[1])


def gets_out(thing: Polygon, found: Cage, robots: FloatArray, radius: float) -> bool:
    """The path, followed in small steps with shapely alone."""
    assert found.path is not None
    start, points = found.path[0], shapely.points(robots)
    assert np.allclose(start[2], 0)
    for a, b in pairwise(found.path):
        for share in np.linspace(0, 1, 120):
            body = turned(thing, a + share * (b - a), start)
            if shapely.distance(body, points).min() <= radius:
                return False
    last = turned(thing, found.path[-1], start).convex_hull
    return not last.intersects(MultiPoint(robots).convex_hull)


# Even rings at 0.05 of the size, best of four starts, robots that are points.
@pytest.mark.parametrize(
    ("name", "disc"),
    [("square", 4), ("rectangle", 7), ("triangle", 3), ("circle", 3), ("ell", 11), ("star", 5)],
)
def test_the_fewest_in_an_even_ring_that_the_disc_certifies(name: str, disc: int) -> None:
    thing = outline(name)
    for n, certified in ((disc, True), (disc - 1, False)):
        found = [cage(thing.filled, spread(thing, 5, n, phase / 4), levels=0) for phase in range(4)]
        assert any(c.state == "caged" for c in found) == certified
        assert all(c.test == "disc" for c in found if c.state == "caged")


@pytest.mark.parametrize(
    ("name", "n", "phase"),
    [("rectangle", 6, 0.25), ("ell", 3, 0.5), ("star", 4, 0.0), ("cee", 5, 0.25)],
)
def test_the_configuration_space_certifies_with_fewer(name: str, n: int, phase: float) -> None:
    thing = outline(name)
    found = cage(thing.filled, spread(thing, 5, n, phase))
    assert (found.state, found.test) == ("caged", "configuration space")
    assert found.widest_gap is None or found.widest_gap > found.inscribed_diameter


@pytest.mark.parametrize("radius", [0.0, 6.0])
@pytest.mark.parametrize(
    ("name", "n"), [("square", 3), ("rectangle", 4), ("ell", 3), ("cee", 4), ("circle", 2)]
)
def test_an_escape_is_a_path_that_touches_nobody(name: str, n: int, radius: float) -> None:
    thing = outline(name)
    robots = spread(thing, 5 + radius, n, 0.0)
    found = cage(thing.filled, robots, radius)
    assert found.state == "escape"
    assert gets_out(thing.filled, found, robots, radius)


def test_gaps_below_the_least_width_do_not_cage_a_cup() -> None:
    """Its thin walls pass between robots one after the other, though its hull is wide."""
    cup = make_outline(np.array(CUP, dtype=float) + 300)
    robots = np.array([(-20.0, -20.0), (20.0, -20.0), (0.0, 20.0)]) + 300
    widest = max(math.dist(a, b) for a in robots for b in robots)
    assert widest < cup.min_width
    found = cage(cup.filled, robots)
    assert found.state == "escape"
    assert gets_out(cup.filled, found, robots, 0.0)
    assert found.widest_gap is None, "they stand in its mouth, not about it"


def test_a_disc_in_a_ring_of_points_escapes_exactly_where_a_gap_lets_it_through() -> None:
    disc = Polygon(np.array(DISC) * 50)
    for n in (3, 4, 7):
        t = np.arange(n) / n * 2 * math.pi
        for gap, state in ((95.0, "caged"), (110.0, "escape")):
            reach = max(gap / 2 / math.sin(math.pi / n), 50.5)
            if reach == 50.5:
                continue  # the robots would stand in it
            robots = np.stack([np.cos(t), np.sin(t)], axis=1) * reach
            assert cage(disc, robots, levels=3).state == state


def test_a_robot_that_touches_the_object_certifies_nothing() -> None:
    thing = outline("square")
    robots = np.concatenate([spread(thing, 5, 8, 0.0), [thing.centre]])
    assert cage(thing.filled, robots).state == "not certified"
    assert cage(thing.filled, robots[:-1], 5.5).state == "not certified"
    assert cage(thing.filled, robots[:-1], 4.5).state == "caged"


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_robots_to_stand_about_a_thing_cage_no_square(count: int) -> None:
    robots = np.array([(280.0, 340.0), (420.0, 350.0)])[:count].reshape(-1, 2)
    found = cage(outline("square").filled, robots)
    assert found.state == ("escape" if count else "not certified")
    assert found.widest_gap is None


def test_very_many_robots_are_judged_by_the_disc_alone() -> None:
    thing = outline("ell")
    around = spread(thing, 5, MOST_FLOODED + 1, 0.0)
    assert cage(thing.filled, around).test == "disc"
    half = around[around[:, 0] < 400]
    far = np.array([(900.0 + i, 900.0) for i in range(len(around) - len(half))])
    assert cage(thing.filled, np.concatenate([half, far])).state == "not certified"


@given(
    st.sampled_from(["rectangle", "ell", "star", "cee"]), st.integers(3, 9), st.floats(0, 1),
    st.sampled_from([0.0, 5.0]), st.floats(0, 6.3), st.floats(0.2, 5), st.booleans(),
    st.randoms(use_true_random=False),
)  # fmt: skip
@FEW
def test_how_the_scene_lies_and_who_stands_where_does_not_turn_a_proof_round(
    name: str, n: int, phase: float, radius: float, angle: float, scale: float, mirror: bool,
    random: object,
) -> None:  # fmt: skip
    """Grids lie otherwise on a turned scene, so a proof may be missed, never contradicted."""
    thing = outline(name)
    robots = spread(thing, 5 + radius, n, phase)
    c, s = math.cos(angle) * scale, math.sin(angle) * scale
    turn = np.array([[c, s], [-s, c]]) * (1, -1 if mirror else 1)
    order = list(range(n))
    getattr(random, "shuffle")(order)  # noqa: B009
    ring_there = shapely.get_coordinates(thing.filled) @ turn + (50, -70)
    there = cage(Polygon(ring_there), (robots @ turn + (50, -70))[order], radius * scale, levels=3)
    here = cage(thing.filled, robots, radius, levels=3)
    assert {here.state, there.state} != {"caged", "escape"}
    assert there.inscribed_diameter == pytest.approx(here.inscribed_diameter * scale, rel=5e-3)
    if name in ("ell", "star"):  # the others have several greatest discs
        assert (here.test == "disc") == (there.test == "disc")
        gap = None if here.widest_gap is None else here.widest_gap * scale
        assert there.widest_gap == (gap if gap is None else pytest.approx(gap, rel=1e-6))
    if n > 2:
        assert cage(thing.filled, robots[order], radius, levels=QUICK).state == (
            cage(thing.filled, robots, radius, levels=QUICK).state
        )


@example("ell", 5, 0.8386943197717307, 0.99)  # its grid ends where its domain does
@given(
    st.sampled_from(["rectangle", "ell", "cee"]), st.integers(4, 7), st.floats(0, 1),
    st.floats(0, 1),
)  # fmt: skip
@FEW
def test_a_robot_more_lets_nobody_out(name: str, n: int, phase: float, where: float) -> None:
    thing = outline(name)
    robots = spread(thing, 5, n, phase)
    before = cage(thing.filled, robots, levels=3)
    more = np.concatenate([robots, spread(thing, 8, 1, where)])
    after = cage(thing.filled, more, levels=3)
    if before.state == "caged":
        assert after.state != "escape"
        body = body_of(thing.filled)
        seen = flood(body, Obstacles(robots, 0.0), 3).enclosed
        assert not seen or flood(body, Obstacles(more, 0.0), 3).path is None
    if after.state == "escape":
        assert after.path is not None
        moves = clear_moves(
            body_of(thing.filled), Obstacles(robots, 0.0), after.path[:-1], after.path[1:]
        )
        assert moves.all(), "the way out past more robots is one past fewer"


def test_a_move_is_clear_only_if_nothing_is_met_on_the_way() -> None:
    body = body_of(Polygon([(0, 0), (20, 0), (20, 2), (0, 2)]))
    start = body.start
    past, half = start + np.array([100, 0, 0]), start + np.array([0, 0, math.pi])
    for spot, straight, about in (
        ((60.0, 1.0), False, True),
        ((60.0, 2.5), True, True),
        ((60.0, 1.99), False, True),
        ((10.0, 9.0), True, False),
        ((10.0, 12.0), True, True),
    ):
        for radius, slack in ((0.0, 0.0), (0.2, 0.2)):
            obstacles = Obstacles(np.array([spot]) + np.array([0, slack]), radius)
            moves = clear_moves(body, obstacles, np.stack([start] * 2), np.stack([past, half]))
            assert moves.tolist() == [straight, about]


def test_the_ring_is_found_whatever_else_stands_about() -> None:
    rng = np.random.default_rng(5)
    t = np.arange(12) / 12 * 2 * math.pi
    circle = np.stack([np.cos(t), np.sin(t)], axis=1) * 60
    others = rng.uniform(-400, 400, (30, 2))
    others = others[np.linalg.norm(others, axis=1) > 80]
    points = np.concatenate([others, circle])[rng.permutation(len(others) + 12)]
    between = widest_link(points, np.zeros(2))
    assert between is not None
    i, j = between
    assert math.dist(points[i], points[j]) == pytest.approx(2 * 60 * math.sin(math.pi / 12))
    assert widest_link(points, np.array([2000.0, 0.0])) is None
    assert widest_link(circle[:6], np.zeros(2)) is None


def test_walls_close_what_robots_leave_open() -> None:
    box = make_outline([(10, 100), (110, 100), (110, 160), (10, 160)]).filled
    robots = np.array([(30.0, 90.0), (80.0, 90.0), (120.0, 115.0), (120.0, 145.0), (30.0, 170.0),
                       (80.0, 170.0)])  # fmt: skip
    assert cage(box, robots).state == "escape"
    wall = shapely.box(0, 0, 600, 400).boundary
    found = cage(box, robots, walls=wall)
    assert (found.state, found.test) == ("caged", "configuration space")
    away = cage(box, robots[:2], walls=wall)
    assert away.state == "escape"
    assert away.path is not None
    for a, b in pairwise(away.path):
        for share in np.linspace(0, 1, 30):
            assert not turned(box, a + share * (b - a), away.path[0]).intersects(wall)


@pytest.mark.parametrize(("name", "most"), [("square", 4), ("ell", 4)])
def test_few_robots_are_found_that_cage_and_keep_to_their_range(name: str, most: int) -> None:
    thing = outline(name)
    demand = Demand(thing, (2.5, 10.0), 3.0, Frame(800, 800, 3.0), 6.0)
    points = fewest_cage(demand)
    assert points is not None
    assert len(points) <= most
    assert cage(thing.filled, points, 3.0).state == "caged"
    away = shapely.distance(thing.filled, shapely.points(points)) - 3.0
    assert away.min() >= 2.5 - 0.005
    assert away.max() <= 10.0


def test_where_robots_have_no_room_no_cage_is_promised() -> None:
    thing = outline("square")
    assert fewest_cage(Demand(thing, (2.0, 8.0), 1.0, Frame(340, 800, 1.0), 2.0)) is None
    assert fewest_cage(Demand(thing, (60.0, 70.0), 0.0, Frame(800, 800), 150.0)) is None
