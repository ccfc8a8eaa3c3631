"""Leave to follow is for one call: its plan, its area, its speed, its time; once."""

from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply
from formup.agent.outcomes import Paused
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.context import Settings
from formup.tools.perception.image import Picture

MOVING = "fleet: simulated\ntargets: {t1: {path: [[0, 0], [30, 10]], speed: 4}}\n"


def deploy(id: str, **arguments: Any) -> Call:
    return Call(id=id, name="deploy", arguments=arguments)


def agent(*calls: Call) -> Agent:
    return Agent(ScriptedModel([Reply(calls=calls), Reply(text="done")]))


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    path = tmp_path / "moving.yaml"
    path.write_text(MOVING, encoding="utf-8")
    return Settings(fleet=str(path))


@pytest.mark.usefixtures("real")
def test_a_person_is_asked_about_every_bound_and_a_yes_is_for_these_alone(
    red_box: Picture, propose: Call, settings: Settings
) -> None:
    first = deploy("d", follow={"seconds": 2, "speed": 5})
    asked = agent(propose, first).run(red_box, "Surround it with 6 robots", settings=settings)
    assert isinstance(asked.outcome, Paused)
    plan = asked.outcome.plan_id
    assert asked.report.status == "needs_approval"
    assert asked.report.message == (
        f"A person must approve plan {plan} and to follow t1 for 2 s at no more than 5 px/s within "
        "the picture."
    )
    faster = deploy("e", plan_id=plan, follow={"seconds": 9, "speed": 30})
    moved = agent(faster).resume(asked, approve=True)
    assert isinstance(moved.outcome, Paused)
    assert moved.outcome.call == faster
    assert "to follow t1 for 9 s at no more than 30 px/s" in moved.report.message
    came = moved.world.arrivals[str(plan)].follow
    assert came is not None
    assert (came.ended, came.seconds) == ("time", 2.0)


@pytest.mark.usefixtures("real")
def test_a_yes_to_a_plan_is_none_to_following(
    red_box: Picture, propose: Call, settings: Settings
) -> None:
    asked = agent(propose, deploy("d")).run(red_box, "Surround it", settings=settings)
    assert isinstance(asked.outcome, Paused)
    plan = str(asked.outcome.plan_id)
    follow = deploy("e", plan_id=plan, follow={"seconds": 2})
    moved = agent(follow).resume(asked, approve=True)
    assert isinstance(moved.outcome, Paused)
    assert moved.outcome.call == follow
    assert moved.world.arrivals[plan].follow is None
