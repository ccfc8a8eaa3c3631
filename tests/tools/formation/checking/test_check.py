"""Certified means it: against demands written out anew, scenes turned about, and tricks."""

import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group, with_defaults
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import make_plan
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point

WIDTH, HEIGHT = 640.0, 480.0
RING = np.array([(-60, -70), (10, -70), (10, 30), (90, 30), (90, 80), (-60, 80)], dtype=float)
MIDDLE = np.array([300.0, 240.0])
RELATIONS = ["around", "cage", "corners", "left", "top", "inside", "centre"]


def square(x0: float, y0: float, x1: float, y1: float) -> Outline:
    return make_outline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def whole(site: Site, radius: float = 0.0, **group: object) -> Contract:
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=radius)
    return with_defaults(contract, site.outlines, site.room)


def grouped(relation: str, n: int) -> Group:
    if relation in ("left", "right", "top", "bottom"):
        return Group.model_validate(
            {"relation": "along", "side": relation, "targets": ["t1"], "robots": n}
        )
    return Group.model_validate({"relation": relation, "targets": ["t1"], "robots": n})


def edge_distance(outline: Outline, point: Point) -> float:
    """To the exterior's edges one by one, without shapely's polygon distance."""
    ring = [(float(x), float(y)) for x, y in outline.polygon.exterior.coords]
    return min(LineString(pair).distance(point) for pair in pairwise(ring))


def covered(outline: Outline, x: float, y: float) -> bool:
    """Whether a point is in the exterior ring, by crossing number."""
    ring = [(float(a), float(b)) for a, b in outline.polygon.exterior.coords]
    hits = 0
    for (xa, ya), (xb, yb) in pairwise(ring):
        if (ya > y) != (yb > y) and x < xa + (y - ya) / (yb - ya) * (xb - xa):
            hits += 1
    return hits % 2 == 1


def broken(points: FloatArray, contract: Contract, site: Site) -> bool:
    """Whether a plain demand of a one-group contract does not hold, in its plainest words."""
    group, r, slack = contract.groups[0], contract.robot_radius, 0.01
    outline = site.outlines["t1"]
    for x, y in points:
        if not (r - slack <= x <= site.width - 1 - r + slack):
            return True
        if not (r - slack <= y <= site.height - 1 - r + slack):
            return True
        away, within = edge_distance(outline, Point(x, y)), covered(outline, x, y)
        if group.clearance is None:
            continue
        least, greatest = group.clearance
        if within != (group.relation == "inside") or away - r < least - slack:
            return True
        if group.relation != "corners" and away - r > greatest + slack:
            return True
    floor = max(2 * r, group.min_spacing or 0.0)
    return any(math.dist(a, b) < floor - slack for a, b in combinations(points, 2))


@given(
    st.sampled_from(RELATIONS), st.integers(3, 14), st.sampled_from([0.0, 3.0, 8.0]),
    st.floats(0, 6.3), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.5, 3.0, 12.0]),
)  # fmt: skip
@settings(derandomize=True, deadline=None, max_examples=40)
def test_nothing_is_certified_that_plain_arithmetic_refuses(
    relation: str, n: int, radius: float, angle: float, seed: int, noise: float
) -> None:
    c, s = math.cos(angle), math.sin(angle)
    site = Site(
        {"t1": make_outline(RING @ np.array([[c, s], [-s, c]]) + (300, 240))}, WIDTH, HEIGHT
    )
    try:
        plan = make_plan(Contract(groups=(grouped(relation, n),), robot_radius=radius), site, "s")
    except ToolError:
        assume(False)
        raise
    points = plan.formation.points + np.random.default_rng(seed).normal(0, 1, (n, 2)) * noise
    if certify(points, plan.formation.contract, site).certified:
        assert not broken(points, plan.formation.contract, site)
    elif noise == 0:
        assert not plan.verdict.certified


def mapped(points: FloatArray, which: str) -> FloatArray:
    """Pixel coordinates after turning or mirroring the picture."""
    x, y = points[:, 0], points[:, 1]
    ways = {
        "mirror": (WIDTH - 1 - x, y),
        "flip": (x, HEIGHT - 1 - y),
        "quarter": (HEIGHT - 1 - y, x),
        "half": (WIDTH - 1 - x, HEIGHT - 1 - y),
    }
    return np.stack(ways[which], axis=1)


SIDE_AFTER = {
    "mirror": {"left": "right", "top": "top"},
    "flip": {"left": "left", "top": "bottom"},
    "quarter": {"left": "top", "top": "right"},
    "half": {"left": "right", "top": "bottom"},
}


@pytest.mark.parametrize("which", SIDE_AFTER)
@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize("n", [3, 6])
def test_turning_or_mirroring_the_whole_scene_changes_no_verdict(
    which: str, relation: str, n: int
) -> None:
    here = Site({"t1": make_outline(RING + MIDDLE)}, WIDTH, HEIGHT)
    room = (HEIGHT, WIDTH) if which == "quarter" else (WIDTH, HEIGHT)
    there = Site({"t1": make_outline(mapped(RING + MIDDLE, which))}, *room)
    plan = make_plan(Contract(groups=(grouped(relation, n),), robot_radius=3), here, "s")
    after = SIDE_AFTER[which].get(relation, relation)
    contract = Contract(groups=(grouped(after, n),), robot_radius=3)
    turned = make_plan(contract, there, "s", mapped(plan.formation.points, which))
    assert plan.verdict.certified
    assert turned.verdict.certified, turned.verdict.findings
    wrong = plan.formation.points + np.where(np.arange(n)[:, None] == 1, (70, -45), 0)
    first = certify(wrong, plan.formation.contract, here)
    second = certify(mapped(wrong, which), turned.formation.contract, there)
    assert first.certified == second.certified
    assert sorted(f.kind for f in first.findings) == sorted(f.kind for f in second.findings)


@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize(("size", "shift"), [(1, (64, 12)), (2, (0, 0)), (3.5, (-20.25, 40.5))])
def test_moving_or_enlarging_the_whole_scene_changes_no_verdict(
    relation: str, size: float, shift: tuple[float, float]
) -> None:
    def moved(points: FloatArray) -> FloatArray:
        return points * size + shift

    here = Site({"t1": make_outline(RING + MIDDLE)}, WIDTH, HEIGHT)
    # The picture's border has nothing to do with it where it is far away.
    there = Site({"t1": make_outline(moved(RING + MIDDLE))}, WIDTH * 5, HEIGHT * 5)
    plan = make_plan(Contract(groups=(grouped(relation, 6),), robot_radius=3), here, "s")
    contract = Contract(groups=(grouped(relation, 6),), robot_radius=3 * size)
    other = make_plan(contract, there, "s", moved(plan.formation.points))
    assert plan.verdict.certified
    assert other.verdict.certified, other.verdict.findings
    wrong = plan.formation.points + np.where(np.arange(6)[:, None] == 1, (70, -45), 0)
    first = certify(wrong, plan.formation.contract, here)
    second = certify(moved(wrong), other.formation.contract, there)
    assert first.certified == second.certified
    assert sorted(f.kind for f in first.findings) == sorted(f.kind for f in second.findings)


def test_a_target_that_parts_the_picture_is_not_surrounded_from_one_side() -> None:
    site = Site({"t1": square(180, -20, 220, 320)}, 400, 300)
    left = [(150.0, float(y)) for y in np.linspace(10, 290, 6)]
    for relation in ("around", "cage"):
        found = certify(left, whole(site, relation=relation, targets=("t1",), robots=6), site)
        assert not found.certified


@pytest.mark.parametrize("place", [(252, 150), (148, 150), (200, 95), (260, 102), (140, 120)])
def test_beside_another_side_is_not_along_this_one_however_wide_the_range(
    place: tuple[float, float],
) -> None:
    site = Site({"t1": square(150, 100, 250, 200)}, 800, 800)
    for greatest in (60, 120, 400):
        contract = whole(
            site, relation="along", targets=("t1",), robots=1, side="bottom",
            clearance=(0, greatest),
        )  # fmt: skip
        assert not certify([place], contract, site).certified


def test_inside_the_greatest_depth_is_checked() -> None:
    site = Site({"t1": square(100, 100, 300, 300)}, 400, 400)
    contract = whole(site, relation="inside", targets=("t1",), robots=1, clearance=(5, 10))
    assert certify([(107, 200)], contract, site).certified
    assert not certify([(200, 200)], contract, site).certified


def test_in_a_hole_is_not_inside_nor_around() -> None:
    holed = make_outline(
        [(100, 100), (300, 100), (300, 300), (100, 300)],
        ([(150, 150), (250, 150), (250, 250), (150, 250)],),
    )
    site = Site({"t1": holed}, 400, 400)
    for relation in ("inside", "around"):
        contract = whole(site, relation=relation, targets=("t1",), robots=1, clearance=(1, 60))
        assert not certify([(200, 200)], contract, site).certified


def test_at_corners_a_robot_further_off_than_allowed_is_refused() -> None:
    site = Site({"t1": square(150, 100, 250, 200)}, 400, 300)
    contract = whole(site, relation="corners", targets=("t1",), robots=1, clearance=(1, 2))
    assert certify([(251, 201)], contract, site).certified
    assert not certify([(260, 210)], contract, site).certified


def test_two_robots_at_one_corner_do_not_stand_for_two_corners() -> None:
    site = Site({"t1": square(150, 100, 250, 200)}, 400, 300)
    contract = whole(site, relation="corners", targets=("t1",), robots=2, clearance=(1, 20))
    assert certify([(255, 205), (145, 95)], contract, site).certified
    assert not certify([(255, 205), (260, 203)], contract, site).certified


def test_a_cage_holds_all_of_a_long_target_not_only_its_middle() -> None:
    site = Site({"t1": square(100, 195, 700, 205)}, 800, 400)
    half = [(85.0, 180.0), (85.0, 220.0), (420.0, 180.0), (420.0, 220.0)]
    contract = whole(site, relation="cage", targets=("t1",), robots=4, clearance=(5, 40))
    assert not certify(half, contract, site).certified


def test_a_cage_whose_widest_opening_is_too_wide_is_refused() -> None:
    site = Site({"t1": square(150, 100, 250, 200)}, 400, 300)
    for gap, certified in ((130.0, True), (20.0, False)):
        contract = whole(site, relation="cage", targets=("t1",), robots=8, max_gap=gap)
        assert make_plan(contract, site, "s").verdict.certified is certified


def test_two_groups_in_each_others_way_are_refused() -> None:
    site = Site({"t1": square(150, 100, 250, 200)}, 400, 300)
    group = Group(relation="around", targets=("t1",), robots=4)
    ring = make_plan(Contract(groups=(group,)), site, "s").formation.points
    both = with_defaults(Contract(groups=(group, group)), site.outlines, site.room)
    found = certify(np.concatenate([ring, ring]), both, site)
    assert [f.kind for f in found.findings].count("too_close") == 4


def test_nobody_stands_on_what_is_to_be_kept_out_of_nor_touches_it() -> None:
    site = Site({"t1": square(150, 100, 250, 200), "t2": square(260, 140, 300, 160)}, 400, 300)
    group = Group(relation="shape", robots=1)
    contract = with_defaults(
        Contract(groups=(group,), robot_radius=5, keep_out=("t2",)), site.outlines, site.room
    )
    for x, certified in ((200.0, True), (254.0, True), (256.0, False), (280.0, False)):
        assert certify([(x, 150)], contract, site).certified is certified


@pytest.mark.parametrize("relation", RELATIONS)
def test_certifying_never_fails_whatever_the_positions(relation: str) -> None:
    rng = np.random.default_rng(3)
    for ring in (RING * 0.1 + 2, RING + MIDDLE, RING * 6 + MIDDLE, RING + 900):
        site = Site({"t1": make_outline(ring)}, WIDTH, HEIGHT)
        for n, radius in ((3, 0.0), (5, 300.0)):
            contract = Contract(groups=(grouped(relation, n),), robot_radius=radius)
            full = with_defaults(contract, site.outlines, site.room)
            points = rng.uniform(-50, 700, (n, 2))
            try:
                found = certify(points, full, site)
            except ToolError:
                continue
            assert not found.certified
            assert found.findings


def test_a_line_is_judged_and_noted_by_its_part_in_the_picture() -> None:
    site = Site({}, 200, 140)
    contract = whole(site, relation="shape", robots=4, line=(-3000, 70, 3000, 70))
    on = np.array([(0, 70), (66, 70), (133, 70), (199, 70)], dtype=float)
    found = certify(on, contract, site)
    assert found.certified
    assert found.notes == (
        "Only 3% of the line lies inside the picture; the robots spread over that.",
    )
    off = certify(on + np.array([0, 65]), contract, site)
    assert [f.kind for f in off.findings] == ["off_curve"] * 4
    assert off.findings[0].limit == pytest.approx(0.03 * 199)


def test_between_takes_even_places_at_whole_and_at_half_steps() -> None:
    site = Site({"t1": square(20, 60, 60, 100), "t2": square(260, 60, 300, 100)}, 320, 160)
    contract = whole(site, relation="between", targets=("t1", "t2"), robots=4)
    for shares, certified in (
        ((0.2, 0.4, 0.6, 0.8), True),
        ((0.125, 0.375, 0.625, 0.875), True),
        ((0.02, 0.1, 0.18, 0.26), False),
    ):
        points = [(60 + 200 * share, 80.0) for share in shares]
        assert certify(points, contract, site).certified is certified


def test_a_ring_of_a_cage_that_lets_the_thing_through_sideways_says_so() -> None:
    site = Site({"t1": square(100, 95, 300, 105)}, 400, 200)
    for n, noted in ((8, True), (60, False)):
        contract = Contract(groups=(Group(relation="cage", targets=("t1",), robots=n),))
        notes = make_plan(contract, site, "s").verdict.notes
        assert any("wider than t1" in note for note in notes) is noted


def test_robots_keep_a_distance_from_what_is_kept_free() -> None:
    outlines = {"t1": square(100, 100, 160, 160), "t2": square(240, 100, 280, 160)}
    site = Site(outlines, WIDTH, HEIGHT)
    ring = Group(relation="around", targets=("t1",), robots=8, clearance=(20, 80))
    for far, certified in ((10.0, True), (60.0, False)):
        kept = Contract(groups=(ring,), robot_radius=4, keep_out=("t2",), keep_out_clearance=far)
        contract = with_defaults(kept, site.outlines, site.room)
        points = np.array([(x, y) for x in (65, 130, 195) for y in (65, 130, 195)])
        points = np.delete(points, 4, axis=0).astype(float)
        found = certify(points, contract, site).findings
        near = [f for f in found if f.kind == "keep_out_near"]
        assert (not near) is certified
        if near:
            assert near[0].sentence.endswith(
                "which is to be kept free; 60.0 px or more are needed."
            )
            assert near[0].robot == 6
            assert near[0].value == pytest.approx(math.hypot(45, 35) - 4, abs=1)


def test_robots_at_points_are_held_to_them_to_keep_outs_and_to_each_other() -> None:
    site = Site({"t1": square(300, 200, 400, 300)}, WIDTH, HEIGHT)
    around = Group(relation="around", targets=("t1",), robots=4)
    at = Group(relation="at", robots=2, points=((100, 100), (150, 100)))
    contract = with_defaults(
        Contract(groups=(around, at), robot_radius=3), site.outlines, site.room
    )
    plan = make_plan(contract, site, "s")
    assert plan.verdict.certified
    assert plan.formation.points[4:] == pytest.approx(np.array(at.points))
    for moved, kind, robot in (
        ((101, 100), "off_point", 5),
        ((350, 250), "keep_out", 5),
        ((149, 100), "too_close", 5),
        ((1, 100), "out_of_picture", 5),
    ):
        points = plan.formation.points
        points[4] = moved
        found = certify(points, contract, site).findings
        assert any(f.kind == kind and robot in (f.robot, *f.others) for f in found)
    own = at.model_copy(update={"targets": ("t1",), "robots": 1, "points": ((350.0, 250.0),)})
    alone = with_defaults(Contract(groups=(own,)), site.outlines, site.room)
    assert [f.kind for f in certify([(350, 250)], alone, site).findings] == ["on_target"]
