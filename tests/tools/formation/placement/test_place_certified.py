"""What the placer places is certified, or it says why nothing can be."""

import math

import numpy as np
import pytest
from formup.tools.errors import InputError, ToolError
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group, with_defaults
from formup.tools.formation.placement.place import CapacityError, Site, place
from formup.tools.formation.plan import make_plan
from formup.tools.geometry.outline import Outline, make_outline
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from shapely.geometry import MultiPoint

MANY = settings(
    derandomize=True, deadline=None, max_examples=60, suppress_health_check=[HealthCheck.too_slow]
)
WIDTH, HEIGHT = 640.0, 480.0
SIDES = ("left", "right", "top", "bottom", "long", "short")
BLOCKS = {
    "ell": [(-1, -1), (-0.3, -1), (-0.3, 0.4), (1, 0.4), (1, 1), (-1, 1)],
    "cup": [(-1, -1), (-0.6, -1), (-0.6, 0.5), (0.6, 0.5), (0.6, -1), (1, -1), (1, 1), (-1, 1)],
    "bar": [(-1, -0.1), (1, -0.1), (1, 0.1), (-1, 0.1)],
    "brick": [(-1, -0.6), (1, -0.6), (1, 0.6), (-1, 0.6)],
}


@st.composite
def outlines(draw: st.DrawFn) -> Outline:
    kind = draw(st.sampled_from(["hull", "ragged", "disc", *BLOCKS]))
    if kind in BLOCKS:
        points = np.array(BLOCKS[kind])
    elif kind == "hull":
        seeds = draw(
            st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=4, max_size=9)
        )
        hull = MultiPoint(seeds).convex_hull
        assume(hull.area > 0.1)
        points = np.asarray(hull.boundary.coords)[:-1]
    else:
        count = 90 if kind == "disc" else draw(st.integers(5, 18))
        low = 1.0 if kind == "disc" else 0.35
        radii = np.array(draw(st.lists(st.floats(low, 1), min_size=count, max_size=count)))
        t = np.arange(count) / count * 2 * math.pi
        points = np.stack([np.cos(t), np.sin(t)], axis=1) * radii[:, None]
    turn = draw(st.sampled_from([0.0, 0.3, 1.0, 2.2]))
    c, s = math.cos(turn), math.sin(turn)
    size = draw(st.sampled_from([6.0, 30.0, 60.0, 100.0, 100.0, 260.0]))
    middle = (draw(st.sampled_from([320.0, 200.0, 60.0])), draw(st.sampled_from([240.0, 400.0])))
    try:
        return make_outline(points @ np.array([[c, s], [-s, c]]) * size + middle)
    except InputError:
        assume(False)
        raise


robots = st.one_of(st.integers(1, 8), st.integers(1, 60))
radii = st.sampled_from([0.0, 0.0, 3.0, 9.0])


def check(group: Group, radius: float, site: Site, allowed: frozenset[str] = frozenset()) -> None:
    """The plan is certified but for findings allowed, or the placer refuses in words."""
    contract = Contract(groups=(group,), robot_radius=radius)
    try:
        plan = make_plan(contract, site, "s")
    except CapacityError as error:
        assert 0 <= error.fits < group.robots
        assert str(error.fits) in str(error)
        return
    except ToolError:
        return
    others = [f.sentence for f in plan.verdict.findings if f.kind not in allowed]
    assert others == []
    assert plan.verdict.certified == (not plan.verdict.findings)


@given(outlines(), robots, radii, st.sampled_from(["tight", "normal", "wide"]))
@MANY
def test_around(outline: Outline, n: int, radius: float, fit: str) -> None:
    group = Group.model_validate({"relation": "around", "targets": ["t1"], "robots": n, "fit": fit})
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT))


@given(outlines(), st.integers(3, 60), radii)
@MANY
def test_cage(outline: Outline, n: int, radius: float) -> None:
    """A ring that cannot be closed is shown, not certified, and the opening is named."""
    group = Group(relation="cage", targets=("t1",), robots=n)
    cannot_close = frozenset({"opening", "opening_at_border", "not_enclosed"})
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT), cannot_close)


@given(outlines(), st.integers(1, 9), radii)
@MANY
def test_corners(outline: Outline, n: int, radius: float) -> None:
    group = Group(relation="corners", targets=("t1",), robots=n)
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT))


@given(outlines(), robots, radii, st.sampled_from(SIDES))
@MANY
def test_along_a_side(outline: Outline, n: int, radius: float, side: str) -> None:
    group = Group.model_validate(
        {"relation": "along", "targets": ["t1"], "robots": n, "side": side}
    )
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT))


@given(outlines(), robots, radii, st.integers(0, 30), st.booleans())
@MANY
def test_along_edges(outline: Outline, n: int, radius: float, edge: int, two: bool) -> None:
    count = len(outline.edges)
    edges = tuple(sorted({edge % count, (edge + two) % count}))
    group = Group(relation="along", targets=("t1",), robots=n, edges=edges)
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT))


@given(outlines(), robots, radii)
@settings(MANY, max_examples=20)
def test_inside(outline: Outline, n: int, radius: float) -> None:
    group = Group(relation="inside", targets=("t1",), robots=n)
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT))


@given(outlines(), robots, radii)
@MANY
def test_centre(outline: Outline, n: int, radius: float) -> None:
    group = Group(relation="centre", targets=("t1",), robots=n)
    check(group, radius, Site({"t1": outline}, WIDTH, HEIGHT))


@given(outlines(), outlines(), robots, radii, st.sampled_from(["line", "divider"]))
@MANY
def test_between(first: Outline, second: Outline, n: int, radius: float, layout: str) -> None:
    group = Group.model_validate(
        {"relation": "between", "targets": ["t1", "t2"], "robots": n, "layout": layout}
    )
    check(group, radius, Site({"t1": first, "t2": second}, WIDTH, HEIGHT))


STAR = [(329, 198.5), (340.4, 216.2), (305, 238.9), (326.1, 271.7), (311, 281.5), (278.5, 231)]
FOUND: list[tuple[list[tuple[float, float]], dict[str, object], float]] = [
    (STAR, {"relation": "along", "side": "bottom", "robots": 4}, 0.0),
    (
        [(60, -20), (242, -20), (242, 344), (580, 344), (580, 500), (60, 500)],
        {"relation": "around", "robots": 2, "fit": "tight"},
        0.0,
    ),
    (
        [(420, 500), (220, 500), (220, 300), (260, 300), (260, 450), (380, 450), (380, 300)],
        {"relation": "centre", "robots": 4},
        9.0,
    ),
]


@pytest.mark.parametrize(("points", "group", "radius"), FOUND, ids=lambda x: str(x)[:40])
def test_what_long_searches_found(
    points: list[tuple[float, float]], group: dict[str, object], radius: float
) -> None:
    """An overhang, a ring cut in two, a centre at the picture's border."""
    wanted = Group.model_validate(group | {"targets": ("t1",)})
    check(wanted, radius, Site({"t1": make_outline(points)}, WIDTH, HEIGHT))


coordinate = st.floats(-50, 700)


@given(st.tuples(coordinate, coordinate, coordinate, coordinate), robots, radii)
@MANY
def test_a_line(line: tuple[float, float, float, float], n: int, radius: float) -> None:
    check(Group(relation="shape", robots=n, line=line), radius, Site({}, WIDTH, HEIGHT))


BRICK = Site(
    {
        "t1": make_outline(np.array(BLOCKS["brick"]) * 90 + (300, 220)),
        "t2": make_outline(np.array(BLOCKS["brick"]) * 40 + (560, 380)),
    },
    WIDTH,
    HEIGHT,
)
FULL: list[dict[str, object]] = [
    {"relation": "around"},
    {"relation": "cage"},
    {"relation": "along", "side": "top"},
    {"relation": "along", "side": "long"},
    {"relation": "along", "edges": (1,)},
    {"relation": "centre"},
    {"relation": "corners"},
    {"relation": "inside"},
    {"relation": "between", "targets": ("t1", "t2")},
    {"relation": "between", "targets": ("t1", "t2"), "layout": "divider"},
]


@pytest.mark.parametrize("group", FULL, ids=str)
@pytest.mark.parametrize("radius", [6.0, 9.0, 11.0])
def test_as_many_as_are_said_to_fit_do_fit_and_one_more_does_not(
    group: dict[str, object], radius: float
) -> None:
    def placed(n: int) -> int:
        wanted = Group.model_validate({"targets": ("t1",), "robots": n} | group)
        contract = Contract(groups=(wanted,), robot_radius=radius)
        return len(place(with_defaults(contract, BRICK.outlines, BRICK.room), BRICK))

    with pytest.raises(CapacityError) as caught:
        placed(500)
    fits = caught.value.fits
    assert fits >= 3
    assert placed(fits) == fits
    for more in range(fits + 1, fits + 9):
        with pytest.raises(CapacityError):
            placed(more)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_between_two_targets_a_line_of_any_number_stands_on_the_way(n: int) -> None:
    second = make_outline([(500, 180), (560, 180), (560, 260), (500, 260)])
    site = Site(dict(BRICK.outlines) | {"t2": second}, WIDTH, HEIGHT)
    group = Group(relation="between", targets=("t1", "t2"), robots=n)
    plan = make_plan(Contract(groups=(group,)), site, "s")
    assert plan.verdict.certified
    assert ((plan.formation.points[:, 0] > 390) & (plan.formation.points[:, 0] < 500)).all()


@pytest.mark.parametrize("radius", [0.0, 2.0, 20.0])
@pytest.mark.parametrize("clearance", [(20.0, 20.0), (5.0, 5.0), (60.0, 60.1)])
def test_a_distance_asked_for_exactly_can_be_met(
    clearance: tuple[float, float], radius: float
) -> None:
    for relation in ({"relation": "around"}, {"relation": "along", "side": "left"}):
        group = Group.model_validate(
            relation | {"targets": ("t1",), "robots": 6, "clearance": clearance}
        )
        check(group, radius, BRICK)


@pytest.mark.parametrize("radius", [100, 200, 300, 1000])
def test_robots_too_big_for_the_picture_are_refused_in_words(radius: float) -> None:
    for group in FULL:
        wanted = Group.model_validate({"targets": ("t1",), "robots": 9} | group)
        contract = Contract(groups=(wanted,), robot_radius=radius)
        with pytest.raises(ToolError):
            make_plan(contract, BRICK, "s")


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0, 2.2])
@pytest.mark.parametrize("radius", [0.0, 4.0])
def test_at_corners_an_exact_distance_takes_away_none(
    block: str, turn: float, radius: float
) -> None:
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array(BLOCKS[block]) @ np.array([[c, s], [-s, c]]) * 90 + (320, 240)
    site = Site({"t1": make_outline(corners)}, WIDTH, HEIGHT)
    for n in range(1, len(corners) + 1):
        group = Group(relation="corners", targets=("t1",), robots=n, clearance=(15, 15))
        plan = make_plan(Contract(groups=(group,), robot_radius=radius), site, "s")
        assert plan.verdict.findings == ()


@pytest.mark.parametrize("radius", [0.0, 4.0])
def test_on_the_corners_exactly(radius: float) -> None:
    outline = make_outline(np.array(BLOCKS["brick"]) * 90 + (320, 240))
    site = Site({"t1": outline}, WIDTH, HEIGHT)
    group = Group(relation="corners", targets=("t1",), robots=4, clearance=(0, 0))
    plan = make_plan(Contract(groups=(group,), robot_radius=radius), site, "s")
    assert plan.verdict.certified
    points = plan.formation.points
    np.testing.assert_allclose(np.sort(points, axis=0), np.sort(outline.corners, axis=0))
    moved = certify(points + np.array([0.6, 0]), plan.formation.contract, site)
    assert {f.kind for f in moved.findings} == {"off_corner"}
    with pytest.raises(ValidationError):
        Group(relation="around", targets=("t1",), robots=4, clearance=(0, 0))
