"""What is said to close a ring does close it, and is what an edit takes for it."""

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.formation.checking.surroundings import Ring, ring_of
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.editing.edit_kinds import Count
from formup.tools.formation.editing.edits import edited
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import make_outline
from hypothesis import given, settings
from hypothesis import strategies as st

TURN = np.arange(72) / 72 * 2 * np.pi
THINGS = {
    "disc": np.stack([np.cos(TURN), np.sin(TURN)], axis=1) * 60,
    "bar": np.array([(-90, -15), (90, -15), (90, 15), (-90, 15)]),
    "ell": np.array([(-50, -50), (-10, -50), (-10, 20), (50, 20), (50, 50), (-50, 50)]),
    "cup": np.array([(-60, -50), (-40, -50), (-40, 30), (40, 30), (40, -50), (60, -50), (60, 50),
                     (-60, 50)]),
}  # fmt: skip
MANY = settings(derandomize=True, deadline=None, max_examples=40)


def site_of(name: str, middle: tuple[float, float] = (320, 240)) -> Site:
    return Site({"t1": make_outline(THINGS[name] + np.array(middle))}, 640, 480)


def ring(plan: Plan, site: Site) -> Ring:
    (group,) = plan.formation.contract.groups
    found = ring_of(plan.formation.points, group, site, plan.formation.contract.robot_radius)
    assert found is not None
    return found


@given(
    st.sampled_from(sorted(THINGS)),
    st.integers(3, 12),
    st.sampled_from([0.0, 4.0]),
    st.floats(4, 70),
    st.sampled_from(["around", "cage"]),
)
@MANY
def test_as_many_as_are_said_to_close_a_ring_do(
    name: str, n: int, radius: float, clearance: float, relation: str
) -> None:
    site = site_of(name)
    group = {"relation": relation, "targets": ["t1"], "robots": n, "clearance": [clearance] * 2}
    contract = Contract(groups=(Group.model_validate(group),), robot_radius=radius)
    plan = make_plan(contract, site, "s")
    if not plan.verdict.certified:
        return
    found = edited(plan, (Count(robots="needed"),), site, lambda _: "s").plan
    assert found.verdict.certified
    assert len(found.formation.positions) == ring(plan, site).robots_to_close
    after = ring(found, site)
    assert after.closed
    assert after.widest_opening_px < after.min_width_px
    assert after.robots_to_close == len(found.formation.positions)


def test_no_number_is_said_where_the_picture_cuts_the_ring() -> None:
    site = site_of("disc", (70, 240))
    group = Group(relation="around", targets=("t1",), robots=5, clearance=(40, 40))
    plan = make_plan(Contract(groups=(group,)), site, "s")
    assert ring(plan, site).robots_to_close is None
    with pytest.raises(ToolError, match="border cuts the ring"):
        edited(plan, (Count(robots="needed"),), site, lambda _: "s")


def test_a_gap_that_is_named_takes_more_robots_than_the_thing_does() -> None:
    site = site_of("disc")
    group = Group(relation="around", targets=("t1",), robots=5, clearance=(20, 20))
    plain, narrow = group, group.model_copy(update={"max_gap": 15.0})
    needed = [
        ring_of(make_plan(Contract(groups=(g,)), site, "s").formation.points, g, site, 0.0)
        for g in (plain, narrow)
    ]
    counts = [r.robots_to_close for r in needed if r is not None and r.robots_to_close]
    assert counts[1] == pytest.approx(2 * np.pi * 80 / 15, abs=1)
    assert counts[0] < counts[1]
