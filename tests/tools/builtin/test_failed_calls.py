"""A call that fails, waits or is cancelled changes nothing but what was observed."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from formup.tools.errors import ApprovalError, FleetError, InputError, ToolError
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.formation.plan import Plan
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.world import Target, World

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]
Places = dict[str, tuple[float, float]]
PICTURE = picture_from_array(np.full((240, 320, 3), 90, np.uint8))
OUTLINE = make_outline([(120, 90), (200, 90), (200, 150), (120, 150)])
BOX = Target(
    id="t1", label="box", box=OUTLINE.bounds, confidence=1.0, outline=OUTLINE, prompt="outline"
)


@pytest.fixture
def work(tool_calls: Begin) -> "ToolCalls":
    """320 x 240 px with a box t1 of 80 x 60 px in its middle."""
    return tool_calls(PICTURE, world=World.of(PICTURE, targets=(BOX,)))


def propose(work: "ToolCalls", robots: int) -> Plan:
    """Robots around the box."""
    group = {"relation": "around", "targets": ["t1"], "robots": robots}
    assert work.call("propose_formation", contract={"groups": [group]}).data["certified"]
    return work.world.plan().plan


def standing(world: World) -> Places:
    return {pose.id: (pose.x, pose.y) for pose in world.robots}


class Team(SimulatedFleet):
    """Robots that are real, or fail, or are stopped, on their way."""

    def __init__(self, count: int, *, real: bool = False, does: str = "drive") -> None:
        poses = [Pose(f"r{i}", 20.0 * i, 10.0) for i in range(1, count + 1)]
        super().__init__(poses, speed=100.0)
        self.real, self._does = real, does  # pyright: ignore[reportAttributeAccessIssue]

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        async with aclosing(super().drive(motion)) as moving:
            steps = 0
            async for poses in moving:
                yield poses
                steps += 1
                if steps == 5 and self._does == "stop":
                    await self.stop()
                if steps == 5 and self._does == "fail":
                    raise FleetError("The radio is silent.")
                if steps == 5 and self._does == "hang":
                    await asyncio.Event().wait()


def with_team(work: "ToolCalls", team: Team) -> "ToolCalls":
    """The calls with robots of a fleet called `team`, which is in use already."""
    work.context.services.fleets["team"] = team
    settings = work.context.settings.model_copy(update={"fleet": "team"})
    work.context = replace(work.context, settings=settings)
    return work


def approve(work: "ToolCalls", plan_id: str | None) -> None:
    settings = work.context.settings.model_copy(update={"approved": plan_id})
    work.context = replace(work.context, settings=settings)


def test_real_robots_wait_for_a_person_to_approve_exactly_this_plan(work: "ToolCalls") -> None:
    team = Team(6, real=True)
    plan = propose(with_team(work, team), 4)
    assert set(plan.formation.robots) < {f"r{i}" for i in range(1, 7)}
    before = asyncio.run(team.observe())
    for approved in (None, "p-0123456789"):
        approve(work, approved)
        with pytest.raises(ApprovalError) as caught:
            work.call("deploy")
        assert caught.value.plan_id == plan.id
    assert asyncio.run(team.observe()) == before
    assert (work.moved, work.world.arrivals) == ([], {})
    approve(work, plan.id)
    assert work.call("deploy").data["arrived"]
    assert work.world.arrivals[plan.id].robots == plan.formation.robots


def test_a_real_fleet_that_is_too_small_is_no_plan(work: "ToolCalls") -> None:
    with_team(work, Team(3, real=True))
    with pytest.raises(ToolError, match="has 3 robots; the plan needs 4") as caught:
        propose(work, 4)
    assert caught.value.kind == "too_many_robots"
    assert work.world.plans == {}


@pytest.mark.parametrize(
    ("does", "ended", "words"),
    [("fail", "failed", "The radio is silent"), ("stop", "stopped", "was stopped")],
)
def test_where_robots_stand_is_kept_when_they_fail_on_their_way(
    work: "ToolCalls", does: str, ended: str, words: str
) -> None:
    team = Team(6, real=True, does=does)
    plan = propose(with_team(work, team), 4)
    began = standing(work.world)
    approve(work, plan.id)
    planned = work.world
    with pytest.raises(FleetError, match=words):
        work.call("deploy")
    assert standing(work.world) == {p.id: (p.x, p.y) for p in asyncio.run(team.observe())}
    assert standing(work.world) != began
    (arrival,) = work.world.arrivals.values()
    assert (arrival.ended, arrival.arrived) == (ended, False)
    assert arrival.robots == plan.formation.robots
    only_observed = work.world.having(robots=planned.robots, arrivals={})
    assert only_observed == planned
    assert work.moved == [plan.id]


def test_a_deployment_that_is_cancelled_leaves_where_they_stopped(work: "ToolCalls") -> None:
    team = Team(6, real=True, does="hang")
    plan = propose(with_team(work, team), 4)
    approve(work, plan.id)
    planned = work.world

    async def cancelled() -> None:
        driving = asyncio.create_task(work.acall("deploy"))
        while not work.moved:
            await asyncio.sleep(0)
        for _ in range(50):
            await asyncio.sleep(0)
        driving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await driving

    asyncio.run(cancelled())
    assert standing(work.world) == {p.id: (p.x, p.y) for p in asyncio.run(team.observe())}
    assert standing(work.world) != standing(planned)
    assert work.world.having(robots=planned.robots) == planned


def test_nothing_moves_if_it_cannot_be_written_down_that_it_will(work: "ToolCalls") -> None:
    plan = propose(work, 6)

    async def full(plan_id: str) -> None:
        raise InputError(f"The disk is full: {plan_id}.")

    work.context = replace(work.context, moving=full)
    before = work.world
    with pytest.raises(InputError, match=f"full: {plan.id}"):
        work.call("deploy")
    assert work.world == before


@pytest.mark.parametrize("tool", ["propose_formation", "segment"])
def test_of_a_refused_call_only_what_was_observed_stays(tool_calls: Begin, tool: str) -> None:
    pixels = PICTURE.pixels.copy()
    pixels[90:150, 120:200] = (200, 40, 40)
    work = tool_calls(picture_from_array(pixels))
    thing, nothing = {"id": "t2", "box": [115, 85, 205, 155]}, {"box": [10, 10, 50, 50]}
    before = work.world
    if tool == "propose_formation":
        stated = {"groups": [{"relation": "around", "targets": ["t2"], "robots": 4}]}
        with pytest.raises(ToolError, match="Insufficient") as caught:
            work.call(tool, contract=stated, targets=[thing, nothing])
    else:
        work.call(tool, **thing)
        with pytest.raises(ToolError, match="Insufficient") as caught:
            work.call(tool, **nothing)
    assert caught.value.kind == "low_confidence"
    assert [target.id for target in work.world.targets] == ["t2"]
    assert work.world.having(targets=()) == before
    work.fix(threshold=1.0)
    measured = work.world
    with pytest.raises(ToolError, match="Insufficient"):
        work.call("segment", **(thing | {"id": "t3"}))
    assert work.world.doubted is not None
    assert work.world.doubted.id == "t3"
    assert work.world.having(doubted=None) == measured


def test_tools_that_only_read_leave_the_world_as_it_is(work: "ToolCalls") -> None:
    propose(work, 4)
    before = work.world
    for name, arguments in (
        ("look", {"plan_id": before.current}),
        ("measure", {"a": "t1", "b": [3, 4]}),
        ("describe_shape", {"target": "t1"}),
        ("check_point", {"target": "t1", "points": [[1, 2]]}),
        ("report_impossible", {"reason": "no"}),
    ):
        work.call(name, **arguments)
        assert work.world is before
