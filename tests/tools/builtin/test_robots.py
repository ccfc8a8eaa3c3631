"""Robots of plans: who takes which place, and where a deployment starts and ends."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from formup.tools.builtin.tracks import read_track
from formup.tools.errors import InputError, ToolError
from formup.tools.formation.contract import Contract
from formup.tools.formation.plan import Formation, Plan, make_plan
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.store import StoredWorld, plan_file, read_world
from formup.tools.world import PlanNode, Target, World

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]
Places = dict[str, tuple[float, float]]
PICTURE = picture_from_array(np.full((240, 320, 3), 90, np.uint8))
OUTLINE = make_outline([(120, 90), (200, 90), (200, 150), (120, 150)])
BOX = Target(
    id="t1", label="box", box=OUTLINE.bounds, confidence=1.0, outline=OUTLINE, prompt="outline"
)

MOST = 1_000
"""Robots that are simulated here."""


@pytest.fixture
def work(tool_calls: Begin) -> "ToolCalls":
    """320 x 240 px with a box t1 of 80 x 60 px in its middle."""
    return tool_calls(PICTURE, world=World.of(PICTURE, targets=(BOX,)))


def contract(*groups: tuple[str, int], **more: Any) -> dict[str, Any]:
    made = [{"relation": r, "targets": ["t1"], "robots": n} for r, n in groups]
    return {"groups": made} | more


def propose(work: "ToolCalls", *groups: tuple[str, int], **more: Any) -> Plan:
    data = work.call("propose_formation", contract=contract(*groups, **more)).data
    assert data["certified"], data["findings"]
    plan = work.world.plan().plan
    assert plan.id == data["plan_id"]
    return plan


def standing(world: World) -> Places:
    return {pose.id: (pose.x, pose.y) for pose in world.robots}


def starts_of(work: "ToolCalls", plan: Plan) -> Places:
    """Where the last deployment of a plan began, to a tenth of a pixel."""
    track = work.world.arrivals[plan.id].track
    assert track is not None
    found = read_track(work.context.services.artefacts.get(track))
    return {
        robot: (float(x), float(y))
        for robot, (x, y) in zip(found.ids, found.points[0], strict=True)
    }


def reopened(work: "ToolCalls", folder: Path, begin: Begin) -> "ToolCalls":
    """The same conversation in another process, from a state file."""
    path = folder / "state.json"
    path.write_bytes(StoredWorld(world=work.world).to_bytes())
    return begin(PICTURE, world=read_world(path).world)


@pytest.mark.parametrize(
    "groups",
    [
        [("around", 9)],
        [("corners", 4), ("inside", 5)],
        [("inside", 3), ("around", 7), ("centre", 1)],
        [("around", 1)],
    ],
    ids=str,
)
def test_a_proposed_plan_says_which_robot_takes_which_place(
    work: "ToolCalls", groups: list[tuple[str, int]]
) -> None:
    made = propose(work, *groups).formation
    count = sum(n for _, n in groups)
    assert made.robots == tuple(str(i) for i in range(1, count + 1))
    assert tuple(pose.id for pose in work.world.robots) == made.robots
    assert [len(group) for group in made.members] == [n for _, n in groups]
    assert sorted(i for group in made.members for i in group) == list(range(count))
    stated = Contract.model_validate(contract(*groups))
    placed = make_plan(stated, work.world.site(stated), work.world.version_of(stated)).formation
    assert (placed.robots, placed.members) == ((), ())
    assert made.points.tolist() == placed.points.tolist()
    assert set(made.positions) == set(placed.positions)
    taken = dict(zip(made.robots, made.positions, strict=True))
    for robot, place in zip(made.robot_of_place, made.points.tolist(), strict=True):
        assert taken[robot] == tuple(place)


def test_robots_take_the_places_that_are_near(work: "ToolCalls") -> None:
    plan = propose(work, ("around", 8))
    starts = np.array([standing(work.world)[robot] for robot in plan.formation.robots])
    ways = np.sum((starts - np.array(plan.formation.positions)) ** 2)
    rng = np.random.default_rng(0)
    others = [rng.permutation(np.array(plan.formation.positions)) for _ in range(200)]
    assert all(ways <= np.sum((starts - other) ** 2) + 1e-6 for other in others)


def test_who_takes_which_place_is_part_of_the_plans_id(work: "ToolCalls") -> None:
    plan = propose(work, ("around", 6))
    back = Formation.model_validate_json(plan.formation.model_dump_json())
    assert (back, back.id) == (plan.formation, plan.id)
    ids = list(plan.formation.robots)
    swapped = plan.for_robots(ids[::-1], ids)
    assert set(swapped.formation.positions) == set(plan.formation.positions)
    assert swapped.formation.points.tolist() == plan.formation.points.tolist()
    assert swapped.id != plan.id
    renamed = plan.for_robots([f"r{i}" for i in ids], [f"r{i}" for i in ids])
    assert renamed.id not in (plan.id, swapped.id)


def test_an_arrival_is_in_robot_order_as_the_plan_is(work: "ToolCalls") -> None:
    plan = propose(work, ("inside", 3), ("around", 7))
    assert plan.formation.points.tolist() != [list(p) for p in plan.formation.positions]
    assert work.call("deploy").data["arrived"]
    arrival = work.world.arrivals[plan.id]
    assert arrival.robots == plan.formation.robots
    off = np.linalg.norm(np.array(arrival.observed) - plan.formation.positions, axis=1)
    assert off == pytest.approx(np.array(arrival.residual_px), abs=2e-3)
    assert off.max() <= arrival.tolerance_px
    assert standing(work.world) == {
        robot: pytest.approx(place, abs=1e-3)
        for robot, place in zip(arrival.robots, arrival.observed, strict=True)
    }


@pytest.mark.parametrize("through_a_file", [False, True])
def test_the_next_deployment_starts_where_the_last_one_ended(
    work: "ToolCalls", tool_calls: Begin, tmp_path: Path, through_a_file: bool
) -> None:
    starts = tuple((20.0 + 30 * i, 12.0) for i in range(6))
    work.fix(starts=starts)
    first = propose(work, ("around", 6))
    work.call("deploy")
    assert set(starts_of(work, first).values()) == set(starts)
    ended = standing(work.world)
    if through_a_file:
        work = reopened(work, tmp_path, tool_calls)
        assert work.context.services.fleets == {}
    second = propose(work, ("inside", 6))
    assert standing(work.world) == ended
    assert work.call("deploy").data["arrived"]
    for robot, place in starts_of(work, second).items():
        assert place == pytest.approx(ended[robot], abs=0.051)
    seen = [pose.seen for pose in work.world.robots]
    assert min(seen) > 0


def test_a_plan_file_holds_where_its_robots_ended(
    work: "ToolCalls", tool_calls: Begin, tmp_path: Path
) -> None:
    plan = propose(work, ("around", 6))
    work.call("deploy")
    path = tmp_path / "plan.json"
    path.write_bytes(plan_file(work.world, plan.id, "Ring it", PICTURE))
    again = tool_calls(PICTURE, world=read_world(path).world)
    assert again.call("deploy", plan_id=plan.id).data["already_there"]
    assert standing(again.world) == standing(work.world)
    assert again.moved == []


@pytest.mark.parametrize("through_a_file", [False, True])
def test_robots_that_are_there_already_are_not_moved(
    work: "ToolCalls", tool_calls: Begin, tmp_path: Path, through_a_file: bool
) -> None:
    plan = propose(work, ("around", 6))
    first = work.call("deploy", tell="There.")
    assert "already_there" not in first.data
    assert work.moved == [plan.id]
    if through_a_file:
        work = reopened(work, tmp_path, tool_calls)
    work.moved.clear()
    before = work.world
    again = work.call("deploy", plan_id=plan.id, tell="There.")
    assert again.data == first.data | {"already_there": True}
    assert again.message == first.message
    assert work.world == before
    assert work.moved == []
    assert propose(work, ("around", 6)).id == plan.id, "robots keep the places they stand on"
    assert work.call("deploy").data["already_there"]
    other = propose(work, ("around", 6), robot_radius=2)
    assert "already_there" not in work.call("deploy").data
    assert work.moved == [other.id]
    assert "already_there" not in work.call("deploy", plan_id=plan.id).data, "they have left"
    assert work.moved == [other.id, plan.id]
    assert list(work.world.arrivals) == [other.id, plan.id]


def test_robots_without_a_place_stay_where_they_are(work: "ToolCalls") -> None:
    propose(work, ("around", 8))
    work.call("deploy")
    before = standing(work.world)
    plan = propose(work, ("inside", 3))
    assert len(plan.formation.robots) == 3
    assert set(plan.formation.robots) < set(before)
    assert standing(work.world) == before
    assert work.call("deploy").data["arrived"]
    after = standing(work.world)
    assert list(after) == list(before)
    taken = dict(zip(plan.formation.robots, plan.formation.positions, strict=True))
    for robot, place in after.items():
        if robot in taken:
            assert place == pytest.approx(taken[robot], abs=0.6)
        else:
            assert place == before[robot]
    assert set(work.world.arrivals[plan.id].robots) == set(taken)


def test_more_robots_join_those_that_have_been_driven(work: "ToolCalls") -> None:
    propose(work, ("inside", 3))
    work.call("deploy")
    before = standing(work.world)
    plan = propose(work, ("around", 7))
    now = standing(work.world)
    assert list(now) == [str(i) for i in range(1, 8)]
    assert {robot: now[robot] for robot in before} == before
    assert work.call("deploy").data["arrived"]
    assert set(starts_of(work, plan)) == set(now)


def test_a_plan_from_before_a_deployment_may_find_its_places_taken(work: "ToolCalls") -> None:
    few = propose(work, ("around", 4))
    many = propose(work, ("around", 8))
    work.call("deploy", plan_id=many.id)
    before = work.world
    with pytest.raises(ToolError, match=r"has no place in the plan, .*give it a place too"):
        work.call("deploy", plan_id=few.id)
    assert standing(work.world) == standing(before)
    assert work.world.arrivals == before.arrivals
    again = propose(work, ("around", 4))
    assert again.id != few.id
    assert work.call("deploy").data["arrived"]


def test_more_robots_than_are_simulated_can_be_planned_only(
    work: "ToolCalls", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("formup.tools.fleet.simulated.MAX_ROBOTS", MOST)
    grid = np.stack(np.meshgrid(np.arange(0, 318, 8), np.arange(0, 238, 8)), axis=-1)
    positions = grid.reshape(-1, 2)[: MOST + 1].tolist()
    group = {"relation": "shape", "robots": len(positions)}
    data = work.call("propose_formation", contract={"groups": [group]}, positions=positions).data
    assert data["certified"]
    formation = work.world.plan().plan.formation
    assert (formation.robots, len(formation.positions)) == ((), MOST + 1)
    with pytest.raises(ToolError, match="nothing was moved") as caught:
        work.call("deploy")
    assert caught.value.kind == "too_many_robots"
    assert (work.world.arrivals, work.moved) == ({}, [])


def test_starts_that_cannot_be_are_the_persons_to_mend(work: "ToolCalls") -> None:
    work.fix(starts=((160.0, 120.0), (10.0, 10.0)))
    with pytest.raises(InputError, match=r"starts at \(160, 120\), on the target"):
        propose(work, ("around", 2))
    assert work.world.plans == {}


def test_a_track_file_gives_the_track_back(work: "ToolCalls") -> None:
    plan = propose(work, ("around", 6))
    work.call("deploy")
    name = work.world.arrivals[plan.id].track
    assert name is not None
    data = work.context.services.artefacts.get(name)
    assert set(json.loads(data)) == {"robots", "points"}
    track = read_track(data)
    assert set(track.ids) == set(plan.formation.robots)
    assert track.points.shape[1:] == (6, 2)
    ended = [standing(work.world)[robot] for robot in track.ids]
    assert track.points[-1] == pytest.approx(np.array(ended), abs=0.051)


def test_a_plan_without_robots_numbers_its_places() -> None:
    world = World.of(PICTURE, targets=(BOX,))
    stated = Contract.model_validate(contract(("around", 5)))
    plan = make_plan(stated, world.site(stated), world.version_of(stated))
    assert plan.formation.robot_of_place == ("1", "2", "3", "4", "5")
    assert plan.formation.points.tolist() == [list(p) for p in plan.formation.positions]
    assert world.with_plan(PlanNode(plan=plan)).plan().plan is plan
