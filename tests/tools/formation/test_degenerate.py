"""Slivers, touching holes, very many vertices, specks: refused in words or certified rightly."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError, ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.cages.cages import cage
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from hypothesis import given, settings
from hypothesis import strategies as st

WIDTH, HEIGHT = 640, 480
RELATIONS = ("around", "cage", "corners", "left", "long", "inside", "centre")
SLACK = 0.012


def polar(radius: FloatArray) -> FloatArray:
    turns = np.arange(len(radius)) / len(radius) * 2 * math.pi
    return np.stack([np.cos(turns), np.sin(turns)], axis=1) * radius[:, None] + (320, 240)


def comb() -> FloatArray:
    teeth = np.repeat(np.arange(60) * 4.0 + 200, 2)
    return np.concatenate(
        [np.stack([teeth, np.tile([200.0, 290, 290, 200], 30)], axis=1), [(440, 300), (200, 300)]]
    )


BOX = [(200, 160), (440, 160), (440, 320), (200, 320)]
DEGENERATE: dict[str, Outline] = {
    "sliver": make_outline([(100, 200), (540, 200), (540, 200.02), (100, 200.02)]),
    "slanted sliver": make_outline([(100, 100), (500, 400), (500, 400.2)]),
    "needle and ball": make_outline(
        [*polar(np.full(40, 30.0)).tolist(), (350, 239.99), (630, 240), (350, 240.01)]
    ),
    "touching holes": make_outline(
        BOX,
        (
            [(250, 160), (300, 200), (250, 240), (220, 200)],
            [(300, 200), (350, 160.5), (400, 200), (350, 240)],
            [(400, 200), (440, 240), (400, 319.999), (380, 260)],
        ),
    ),
    "hole as large as the thing": make_outline(
        BOX, ([(200.1, 160.1), (439.9, 160.1), (439.9, 319.9), (200.1, 319.9)],)
    ),
    "many vertices": make_outline(
        polar(90 + 20 * np.random.default_rng(0).standard_normal(100_000).cumsum() / 700)
    ),
    "comb": make_outline(comb()),
    "speck": make_outline([(300, 200), (303, 200), (303, 201.5), (300, 201.5)]),
    "needles": make_outline(polar(np.tile([120.0, 4.0], 30))),
    "at the border": make_outline([(-30, 100), (2, 100), (2, 101), (-30, 140)]),
}


def edge_distances(outline: Outline, points: FloatArray, holes: bool) -> FloatArray:
    """To the nearest edge in plain arithmetic, negative outside, (n,), px."""
    found = [outline.polygon.exterior, *(outline.polygon.interiors if holes else ())]
    least, within = np.full(len(points), np.inf), np.zeros(len(points), dtype=bool)
    x, y = points.T
    for ring in (shapely.get_coordinates(r) for r in found):
        for a, b in pairwise(ring):
            share = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
            least = np.minimum(least, np.linalg.norm(a + share[:, None] * (b - a) - points, axis=1))
            if a[1] != b[1]:
                crosses = (a[1] > y) != (b[1] > y)
                within ^= crosses & (x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
    return np.where(within, least, -least)


def contract(relation: str, n: int, radius: float) -> Contract:
    group: dict[str, object] = {"relation": relation, "targets": ["t1"], "robots": n}
    if relation in ("left", "long"):
        group |= {"relation": "along", "side": relation}
    if relation == "escape-proof":
        group |= {"relation": "cage", "closure": relation}
    return Contract(groups=(Group.model_validate(group),), robot_radius=radius)


def hold_plainly(plan: Plan, outline: Outline) -> None:
    """Bounds, spacing and clearance of a certified plan, by other code than certified it."""
    (group,), radius = plan.formation.contract.groups, plan.formation.contract.robot_radius
    points = plan.formation.points
    assert (points >= radius - SLACK).all()
    assert (points <= np.array([WIDTH - 1, HEIGHT - 1]) - radius + SLACK).all()
    if len(points) > 1:
        apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points)) * 1e9
        assert apart.min() >= max(2 * radius, 2.0) - SLACK
    if group.clearance is None:
        return
    deep = edge_distances(outline, points, holes=group.relation == "inside")
    away = (deep if group.relation == "inside" else -deep) - radius
    least, greatest = group.clearance
    assert away.min() >= least - SLACK
    if group.relation in ("around", "cage", "inside"):
        assert away.max() <= greatest * 1.002 + SLACK


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize(
    ("relation", "n", "radius"),
    [("escape-proof", 25, 2.0), *((r, *n) for r in RELATIONS for n in ((3, 0.0), (17, 4.0)))],
)
def test_what_is_hardly_a_shape_is_refused_or_rightly_certified(
    name: str, relation: str, n: int, radius: float
) -> None:
    outline = DEGENERATE[name]
    try:
        plan = make_plan(contract(relation, n, radius), Site({"t1": outline}, WIDTH, HEIGHT), "s")
    except (ToolError, InputError) as error:
        assert str(error).endswith(".")
        return
    if plan.verdict.certified:
        hold_plainly(plan, outline)


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize("n", [3, 5, 12])
def test_a_cage_of_what_is_hardly_a_shape_lets_no_point_of_it_through_a_wide_gap(
    name: str, n: int
) -> None:
    """Three robots to one side cage nothing; whatever is caged has a gap narrower than itself."""
    outline = DEGENERATE[name]
    x0, y0, x1, y1 = outline.bounds
    aside = np.stack([np.full(n, x1 + 9.0), np.linspace(y0, y1, n)], axis=1)
    assert cage(outline.filled, aside, 1.0, levels=2).state != "caged"
    reach = math.hypot(x1 - x0, y1 - y0) / 2 + 10
    turns = np.arange(n) / n * 2 * math.pi
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1) * reach
    middle = np.array([x0 + x1, y0 + y1]) / 2
    found = cage(outline.filled, middle + ring, 1.0, levels=2)
    if found.state == "caged":
        gap = float(np.linalg.norm(ring[0] - ring[1])) - 2
        assert gap < math.hypot(x1 - x0, y1 - y0)


@pytest.mark.parametrize("pixels", [[(0, 0), (2, 0), (2, 1)], [(5, 5), (6, 5), (5, 6)]])
def test_three_pixels_are_no_outline(pixels: list[tuple[int, int]]) -> None:
    with pytest.raises(InputError, match="4 or more are needed"):
        make_outline(pixels)


@given(
    st.sampled_from(RELATIONS), st.integers(3, 20), st.sampled_from([0.0, 2.0, 9.0]),
    st.integers(0, 2**32 - 1), st.sampled_from([3, 5, 9, 40]), st.floats(0.001, 1),
)  # fmt: skip
@settings(derandomize=True, deadline=None, max_examples=40)
def test_random_points_joined_up_are_refused_or_rightly_certified(
    relation: str, n: int, radius: float, seed: int, corners: int, flat: float
) -> None:
    """Rings that cross themselves, flattened to slivers, with a hole thrown in."""
    rng = np.random.default_rng(seed)
    low, high = (60, 240 - 180 * flat), (580, 240 + 180 * flat)
    ring, hole = rng.uniform(low, high, (corners, 2)), rng.uniform(low, high, (5, 2))
    try:
        outline = make_outline(ring, (hole,))
        plan = make_plan(contract(relation, n, radius), Site({"t1": outline}, WIDTH, HEIGHT), "s")
    except (ToolError, InputError) as error:
        assert str(error).endswith(".")
        return
    if plan.verdict.certified:
        hold_plainly(plan, outline)
