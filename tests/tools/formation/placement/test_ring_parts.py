"""Circles, sides, openings and exact distances: placed, certified, refused when spoilt."""

import math
from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.editing.edit_kinds import Offset
from formup.tools.formation.editing.edits import edited
from formup.tools.formation.placement.pitch import chain
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.units import contract_in_pixels
from formup.tools.geometry.outline import FloatArray, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

TURN = np.arange(72) / 72 * 2 * math.pi
ROUND = np.stack([np.cos(TURN), np.sin(TURN)], axis=1)
THINGS = {
    "disc": ROUND * 60,
    "bar": np.array([(-80, -20), (80, -20), (80, 20), (-80, 20)]),
    "ell": np.array([(-50, -50), (-10, -50), (-10, 20), (50, 20), (50, 50), (-50, 50)]),
}
OTHER = make_outline([(500, 60), (540, 60), (540, 100), (500, 100)])
MANY = settings(derandomize=True, deadline=None, max_examples=60)


def site_of(name: str, middle: tuple[float, float] = (300, 240)) -> Site:
    return Site({"t1": make_outline(THINGS[name] + np.array(middle)), "t2": OTHER}, 640, 480)


def made(site: Site, body: float = 0.0, **group: Any) -> Plan:
    whole = {"relation": "around", "targets": ["t1"], "robots": 8} | group
    return make_plan(Contract(groups=(Group.model_validate(whole),), robot_radius=body), site, "s")


def kinds(points: FloatArray, plan: Plan, site: Site) -> set[str]:
    return {f.kind for f in certify(points, plan.formation.contract, site).findings}


def steps(plan: Plan, site: Site) -> FloatArray:
    """Distances of neighbours by angle about the target's centre."""
    away = plan.formation.points - np.array(site.outlines["t1"].filled.centroid.coords[0])
    points = away[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    return np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)


def around_centre(plan: Plan, site: Site) -> FloatArray:
    return plan.formation.points - np.array(site.outlines["t1"].filled.centroid.coords[0])


PARTS = ["left", "top", "right", "bottom half", "left half"]
DEMANDS: st.SearchStrategy[dict[str, Any]] = st.one_of(
    st.fixed_dictionaries({"radius": st.floats(20, 260)}),
    st.fixed_dictionaries({"pitch": st.floats(4, 150)}),
    st.fixed_dictionaries(
        {
            "opening": st.sampled_from([0.0, 30.0, 90.0]),
            "opening_towards": st.sampled_from(["left", "bottom", "t2", 200.0]),
        }
    ),
    st.fixed_dictionaries({"sides": st.lists(st.sampled_from(PARTS), min_size=1, unique=True)}),
    st.fixed_dictionaries({"pitch": st.floats(4, 60), "opening_towards": st.floats(-180, 180)}),
)


@given(
    st.sampled_from(sorted(THINGS)),
    st.integers(1, 40),
    st.sampled_from([0.0, 3.0]),
    st.sampled_from([(300.0, 240.0), (90.0, 240.0), (300.0, 420.0)]),
    DEMANDS,
)
@MANY
def test_what_is_placed_is_certified_or_refused_in_words(
    name: str, n: int, radius: float, middle: tuple[float, float], demand: dict[str, Any]
) -> None:
    site = site_of(name, middle)
    try:
        plan = made(site, radius, robots=n, **demand)
    except (ToolError, ValidationError):
        return
    allowed: set[str] = set()
    if "ring_in_picture" in plan.verdict.measures and "opening_towards" in demand:
        allowed |= {"narrow_opening", "gap", "crowded"}  # the border's own gap may be wider
    if demand.get("pitch", 9) < 6 and radius:
        allowed |= {"too_close", "off_pitch"}
    assert {f.kind for f in plan.verdict.findings} <= allowed


@pytest.mark.parametrize("name", THINGS)
def test_a_circle_has_the_radius_named_about_the_centre(name: str) -> None:
    site = site_of(name)
    plan = made(site, radius=90)
    assert plan.verdict.certified
    away = np.linalg.norm(around_centre(plan, site), axis=1)
    np.testing.assert_allclose(away, 90, atol=0.01)
    assert kinds(plan.formation.points + np.array([0.7, 0]), plan, site) == {"off_curve"}
    with pytest.raises(ToolError, match="radius above"):
        made(site, radius=40)


def test_a_circle_that_is_moved_out_is_a_larger_circle() -> None:
    site = site_of("bar")
    found = edited(made(site, radius=100), (Offset(kind="out", px=10),), site, lambda _: "s").plan
    assert found.verdict.certified
    assert found.formation.contract.groups[0].radius == 110
    np.testing.assert_allclose(np.linalg.norm(around_centre(found, site), axis=1), 110, atol=0.01)


@pytest.mark.parametrize("name", THINGS)
@pytest.mark.parametrize(
    ("towards", "way"), [("left", (-1, 0)), ("top", (0, -1)), (90, (0, 1)), ("t2", (4, -3))]
)
def test_an_opening_is_wide_enough_and_where_it_is_to_be(
    name: str, towards: object, way: tuple[float, float]
) -> None:
    site = site_of(name)
    plan = made(site, radius_of := 2.0, robots=9, opening=50, opening_towards=towards)
    assert plan.verdict.certified
    *others, widest = sorted(steps(plan, site))
    assert widest - 2 * radius_of >= 50
    assert widest >= 1.25 * others[len(others) // 2]
    assert float(plan.verdict.measures["opening_px"]) == pytest.approx(
        widest - 2 * radius_of, abs=0.01
    )
    ahead = around_centre(plan, site) @ np.array(way) / np.hypot(*way)
    side = np.abs(around_centre(plan, site) @ np.array([-way[1], way[0]]) / np.hypot(*way))
    assert not ((ahead > 0) & (side < 15)).any()


def test_an_opening_that_the_other_gaps_make_wider_than_asked_is_told_of() -> None:
    site = site_of("disc")
    few, many = (made(site, 3.0, robots=n, opening=30) for n in (6, 40))
    assert any("not 30.0 px: it is at least 1.5 times" in note for note in few.verdict.notes)
    assert not many.verdict.notes
    assert few.verdict.certified and many.verdict.certified


def test_a_ring_without_its_opening_or_with_it_elsewhere_is_refused() -> None:
    site = site_of("disc")
    plan = made(site, opening=60, opening_towards="left")
    even = made(site).formation.points
    assert "narrow_opening" in kinds(even, plan, site)
    turned = made(site, opening=60, opening_towards="right").formation.points
    assert "narrow_opening" in kinds(turned, plan, site)
    bunched, middle = plan.formation.points.copy(), np.array([300, 240])
    order = np.argsort(np.arctan2(*(bunched - middle).T))
    bunched[order[3]] = middle + 77.1 * (step := bunched[order[4]] + 4 - middle) / np.hypot(*step)
    assert kinds(bunched, plan, site) >= {"gap", "crowded"}
    with pytest.raises(ToolError, match="widest"):
        made(site, opening=400)


def test_two_robots_side_by_side_leave_all_the_rest_of_the_ring_open() -> None:
    site = site_of("disc")
    plan = made(site, 3.0, robots=2, pitch=20, opening=90, opening_towards="top")
    assert plan.verdict.certified
    assert float(plan.verdict.measures["opening_px"]) > 120
    near = plan.formation.points[:1] + np.array([[0, 0], [0, 30]])
    assert "narrow_opening" not in kinds(near, plan, site)
    swapped = made(site, 3.0, robots=2, pitch=20, opening=90, opening_towards="bottom")
    assert "narrow_opening" in kinds(swapped.formation.points, plan, site)


def part_names(x: float, y: float, half: FloatArray) -> set[str]:
    """The sides and halves of a ring about (0, 0) that a place is in, with some slack."""
    u, v, slack = x / half[0], y / half[1], 1e-3
    halves = {"left half": -x, "right half": x, "top half": -y, "bottom half": y}
    sides = {"left": -u - abs(v), "right": u - abs(v), "top": -v - abs(u), "bottom": v - abs(u)}
    return {name for name, inside in (halves | sides).items() if inside >= -slack}


@pytest.mark.parametrize("name", THINGS)
@pytest.mark.parametrize(
    "sides", [["top", "right", "bottom"], ["left half"], ["bottom half"], ["left", "right"]]
)
def test_nobody_stands_off_the_sides_named(name: str, sides: list[str]) -> None:
    site = site_of(name)
    x0, y0, x1, y1 = site.outlines["t1"].bounds
    plan = made(site, sides=sides, robots=12)
    assert plan.verdict.certified
    assert plan.verdict.notes == ()
    half = np.array([x1 - x0, y1 - y0]) / 2
    for x, y in plan.formation.points - (x0, y0) - half:
        assert part_names(x, y, half) & set(sides)
    assert "off_sides" in kinds(made(site, robots=12).formation.points, plan, site)


@pytest.mark.parametrize(
    ("name", "n", "pitch"), [("disc", 8, 70), ("bar", 10, 50), ("ell", 12, 40), ("disc", 3, 130)]
)
def test_all_round_neighbours_stand_exactly_so_far_apart(name: str, n: int, pitch: float) -> None:
    site = site_of(name)
    plan = made(site, robots=n, pitch=pitch)
    assert plan.verdict.certified
    np.testing.assert_allclose(steps(plan, site), pitch, rtol=0.01)
    assert plan.formation.contract.groups[0].min_spacing == pytest.approx(pitch, rel=0.02)
    even = made(site, robots=n).formation.points
    assert "off_pitch" in kinds(even, plan, site)


def test_a_pitch_that_does_not_go_round_is_refused_with_what_would() -> None:
    site = site_of("disc")
    with pytest.raises(ToolError, match="about 10 robots") as caught:
        made(site, pitch=40)
    assert caught.value.facts["robots_needed"] == 10
    assert made(site, pitch=40, robots=10).verdict.certified
    with pytest.raises(ToolError, match=r"15\.0 px from it"):
        made(site, pitch=70, clearance=(15, 15))
    with pytest.raises(ToolError, match="out of the picture"):
        made(site, pitch=300)


@pytest.mark.parametrize(
    "group",
    [
        {"relation": "along", "side": "left", "robots": 3},
        {"relation": "shape", "targets": [], "line": (50, 400, 500, 440)},
        {"relation": "shape", "shape": {"kind": "line", "where": "above"}},
        {"relation": "shape", "shape": {"kind": "v", "where": "right"}, "robots": 5},
        {"relation": "shape", "shape": {"kind": "grid", "where": "left"}, "robots": 6},
        {"relation": "around", "sides": ["left half"], "robots": 5},
        {"relation": "around", "opening_towards": "left", "robots": 5},
    ],
)
def test_elsewhere_neighbours_stand_exactly_so_far_apart(group: dict[str, Any]) -> None:
    site = site_of("disc")
    plan = made(site, pitch=30, **group)
    assert plan.verdict.certified
    points = plan.formation.points
    away = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(len(points)) * 1e9
    np.testing.assert_allclose(away.min(axis=1), 30, rtol=0.01)
    wider = points.mean(axis=0) + (points - points.mean(axis=0)) * 1.05
    assert "off_pitch" in kinds(wider, plan, site)


@given(st.integers(1, 60), st.floats(0.5, 40), st.integers(0, 5))
@MANY
def test_a_chain_keeps_its_pitch_on_any_line_or_is_as_long_as_fits(
    n: int, pitch: float, seed: int
) -> None:
    line = np.cumsum(np.random.default_rng(seed).uniform(-10, 30, (12, 2)), axis=0)
    points = chain(line, n, pitch)
    assert 1 <= len(points) <= n
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(chords, pitch, rtol=0.01)


@pytest.mark.parametrize("group", [{}, {"relation": "along", "side": "left"}])
def test_gaps_wider_than_allowed_are_found_with_what_would_do(group: dict[str, Any]) -> None:
    site = site_of("disc")
    first = made(site, robots=4, max_gap=15, **group).verdict.findings[0]
    assert (first.kind, first.limit) == ("opening", 15)
    assert made(site, robots=40, max_gap=15, **group).verdict.certified
    assert first.needed is None or made(site, robots=first.needed, max_gap=15).verdict.certified


@pytest.mark.parametrize(
    "group",
    [
        {"relation": "cage", "radius": 90},
        {"relation": "along", "side": "left", "sides": ["left"]},
        {"relation": "inside", "pitch": 20},
        {"opening": 20, "robots": 1},
        {"opening": 20, "sides": ["left"]},
        {"pitch": 20, "spacing": "free"},
        {"relation": "shape", "targets": [], "pitch": 20},
    ],
)
def test_demands_that_do_not_go_together_are_refused(group: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Group.model_validate({"relation": "around", "targets": ["t1"], "robots": 8} | group)


def test_new_lengths_are_metres_where_the_contract_says_so() -> None:
    group = Group(relation="around", targets=("t1",), robots=8, radius=9, pitch=4, opening=3)
    found = contract_in_pixels(Contract(groups=(group,), unit="m"), 0.1).groups[0]
    assert (found.radius, found.pitch, found.opening) == (90, 40, 30)
