"""A plan's id stands for its positions, its contract and its scene, everywhere and always."""

import subprocess
import sys
from random import Random

import numpy as np
import pytest
from formup.tools.errors import FormupError
from formup.tools.formation.checking.check import certify
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import DECIMALS, Formation, Plan, make_plan, scene_version
from formup.tools.geometry.outline import make_outline
from hypothesis import given, settings
from hypothesis import strategies as st

SITE = Site({"t1": make_outline([(100, 100), (223, 110), (210, 220), (95, 190)])}, 400, 300)
AROUND = Contract(groups=(Group(relation="around", targets=("t1",), robots=7),), robot_radius=2)
BUILD = """
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.placement.place import Site
from formup.tools.formation.plan import make_plan
from formup.tools.geometry.outline import make_outline
site = Site({"t1": make_outline([(100, 100), (223, 110), (210, 220), (95, 190)])}, 400, 300)
group = Group(relation="around", targets=("t1",), robots=7)
print(make_plan(Contract(groups=(group,), robot_radius=2), site, "s-1").id)
"""


def test_the_id_is_the_same_in_another_process() -> None:
    ids = {
        subprocess.run(
            [sys.executable, "-c", BUILD], env={"PYTHONHASHSEED": seed}, text=True,
            capture_output=True, check=True,
        ).stdout.strip()
        for seed in ("1", "2")
    }  # fmt: skip
    assert ids == {make_plan(AROUND, SITE, "s-1").id}


def test_any_change_of_what_is_approved_changes_the_id() -> None:
    plan = make_plan(AROUND, SITE, "s-1")
    points = plan.formation.points
    moved, swapped = points.copy(), points[::-1]
    moved[3, 1] += 10.0**-DECIMALS
    group = AROUND.groups[0]
    others = [
        make_plan(AROUND, SITE, "s-1", moved),
        make_plan(AROUND, SITE, "s-1", swapped),
        make_plan(AROUND, SITE, "s-2", points),
        make_plan(AROUND.model_copy(update={"robot_radius": 2.001}), SITE, "s-1", points),
        make_plan(AROUND.model_copy(update={"keep_out": ("t1",)}), SITE, "s-1", points),
    ]
    for change in (
        {"spacing": "free"},
        {"fit": "wide"},
        {"min_spacing": 5.0},
        {"clearance": (3.0, 40.0)},
    ):
        changed = Contract(groups=(group.model_copy(update=change),), robot_radius=2)
        others.append(make_plan(changed, SITE, "s-1", points))
    ids = [plan.id, *(other.id for other in others)]
    assert len(set(ids)) == len(ids)
    assert make_plan(AROUND, SITE, "s-1", points).id == plan.id


@given(st.lists(st.tuples(st.floats(0, 399), st.floats(0, 299)), min_size=1, max_size=9))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_positions_and_ids_survive_json_bit_for_bit(places: list[tuple[float, float]]) -> None:
    contract = Contract(groups=(Group(relation="shape", robots=len(places)),))
    plan = make_plan(contract, SITE, "s", places)
    again = Plan.model_validate_json(plan.model_dump_json())
    assert again == plan
    assert again.id == plan.id
    assert np.array_equal(again.formation.points, plan.formation.points)
    assert np.abs(plan.formation.points - np.array(places)).max() <= 0.5 * 10.0**-DECIMALS + 1e-9


@pytest.mark.parametrize(
    "group",
    [
        {"relation": "around"},
        {"relation": "cage"},
        {"relation": "corners"},
        {"relation": "along", "side": "long"},
        {"relation": "inside"},
        {"relation": "centre"},
    ],
    ids=str,
)
def test_what_was_certified_is_certified_again_from_its_json(group: dict[str, object]) -> None:
    wanted = Group.model_validate(group | {"targets": ("t1",), "robots": 4})
    plan = make_plan(Contract(groups=(wanted,), robot_radius=2), SITE, "s")
    again = Formation.model_validate_json(plan.formation.model_dump_json())
    assert plan.verdict.certified
    assert certify(again.points, again.contract, SITE) == plan.verdict
    assert make_plan(again.contract, SITE, "s", again.positions).id == plan.id


def test_a_plan_with_positions_that_break_the_contract_says_so() -> None:
    points = make_plan(AROUND, SITE, "s").formation.points
    points[0] = (150, 150)
    plan = make_plan(AROUND, SITE, "s", points)
    assert not plan.verdict.certified
    assert plan.verdict.findings[0].robot == 1


@given(st.lists(st.integers(1, 5), min_size=1, max_size=4), st.integers(0, 3), st.randoms())
@settings(derandomize=True, deadline=None, max_examples=60)
def test_robots_take_all_places_in_the_fleets_order(
    sizes: list[int], idle: int, random: Random
) -> None:
    count = sum(sizes)
    contract = Contract(groups=tuple(Group(relation="shape", robots=n) for n in sizes))
    plan = make_plan(contract, SITE, "s", [(10.0 * i, 7.0 * (i % 5)) for i in range(count)])
    fleet = [f"r{i}" for i in range(count + idle)]
    random.shuffle(fleet)
    taking = random.sample(fleet, count)
    made = plan.for_robots(taking, fleet).formation
    assert list(made.robots) == [robot for robot in fleet if robot in taking]
    assert made.robot_of_place == tuple(taking)
    assert made.points.tolist() == plan.formation.points.tolist()
    assert [len(group) for group in made.members] == sizes
    assert sorted(i for group in made.members for i in group) == list(range(count))
    place_of = dict(zip(taking, plan.formation.positions, strict=True))
    assert made.positions == tuple(place_of[robot] for robot in made.robots)
    assert certify(made.points, made.contract, SITE) == plan.verdict
    again = Formation.model_validate_json(made.model_dump_json())
    assert (again, again.id) == (made, made.id)
    reassigned = plan.for_robots(taking, fleet).for_robots(taking[::-1], fleet)
    assert reassigned.formation.points.tolist() == plan.formation.points.tolist()
    assert (reassigned.id == made.id) == (count == 1)


def test_negative_zero_is_the_same_place_as_zero() -> None:
    contract = Contract(groups=(Group(relation="shape", robots=1),))
    assert make_plan(contract, SITE, "s", [(-0.0, 0.0)]).id == (
        make_plan(contract, SITE, "s", [(0.0, -1e-9)]).id
    )


@pytest.mark.parametrize("shape", [(3,), (2, 7), (7, 3), (14,), (7, 1), (1, 7, 2)])
def test_positions_that_are_no_pairs_are_refused_not_reshaped(shape: tuple[int, ...]) -> None:
    with pytest.raises(FormupError):
        make_plan(AROUND, SITE, "s", np.full(shape, 50.0))


def test_a_scene_version_follows_the_picture_and_every_outline_but_not_their_order() -> None:
    base = scene_version("ab", {"t1": [1, 2], "t2": [3]})
    assert scene_version("ab", {"t2": [3], "t1": [1, 2]}) == base
    assert scene_version("ac", {"t1": [1, 2], "t2": [3]}) != base
    assert scene_version("ab", {"t1": [1, 2], "t2": [4]}) != base
    assert scene_version("ab", {"t1": [1, 2]}) != base
