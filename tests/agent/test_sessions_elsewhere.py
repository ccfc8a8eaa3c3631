"""Sessions that went on elsewhere, logs that broke, and what a turn comes to after robots moved."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply, Result
from formup.agent.outcomes import Paused
from formup.agent.session import load_run
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.context import Settings
from formup.tools.errors import InputError, StorageError
from formup.tools.perception.image import Picture
from formup.tools.perception.target_prompt import TargetPrompt

DEPLOY = Call(id="d", name="deploy", arguments={"tell": "There they stand."})
FIX = Settings(robots=6)


def script(*calls: Call) -> Agent:
    return Agent(ScriptedModel([Reply(calls=calls)]))


def test_a_session_that_went_on_elsewhere_is_not_written(
    red_box: Picture, propose: Call, tmp_path: Path
) -> None:
    path = tmp_path / "trace.jsonl"
    asks = Call(id="q", name="ask_user", arguments={"question": "Which?"})
    script(asks).run(red_box, "Surround it", settings=FIX, trace=path)
    here, there = load_run(path), load_run(path)
    done = script(propose, DEPLOY).resume(here, answer="1")
    assert done.report.status == "deployed"
    written = path.read_bytes()
    for late in (there, here):
        with pytest.raises(StorageError, match="has gone on since"):
            script(propose, DEPLOY).resume(late, answer="2")
        with pytest.raises(StorageError, match="has gone on since"):
            script(propose, DEPLOY).say(late, "And now")
    assert path.read_bytes() == written
    assert load_run(path).outcome == done.outcome


def test_a_reason_that_is_no_text_is_refused_before_anything_is_written(
    red_box: Picture, propose: Call, tmp_path: Path
) -> None:
    path = tmp_path / "trace.jsonl"
    asks = Call(id="q", name="ask_user", arguments={"question": "Which?"})
    asked = script(asks).run(red_box, "Surround it", settings=FIX, trace=path)
    written = path.read_bytes()
    with pytest.raises(InputError, match="UTF-8"):
        script(propose).resume(asked, answer="no\udcff")
    assert path.read_bytes() == written


def test_robots_that_are_there_already_are_deployed_in_a_later_turn_too(
    red_box: Picture, propose: Call
) -> None:
    first = script(propose, DEPLOY).run(red_box, "Surround it", settings=FIX)
    again = DEPLOY.model_copy(
        update={"arguments": DEPLOY.arguments | {"plan_id": first.world.current}}
    )
    second = script(again).say(first, "Go there again")
    assert second.report.status == "deployed"
    assert second.report.arrival == first.report.arrival


def test_a_question_after_a_deployment_is_a_question(red_box: Picture, propose: Call) -> None:
    moved = DEPLOY.model_copy(update={"arguments": {}})
    asks = Call(id="q", name="ask_user", arguments={"question": "What next?"})
    run = script(propose, moved, asks).run(red_box, "Surround it", settings=FIX)
    assert isinstance(run.outcome, Paused)
    assert run.report.status == "question"
    assert run.report.arrival is not None
    assert run.report.arrival.arrived


def test_a_turn_that_changes_nothing_is_answered(red_box: Picture, propose: Call) -> None:
    first = script(propose, DEPLOY).run(red_box, "Surround it", settings=FIX)
    second = Agent(ScriptedModel([Reply(text="You are welcome.")])).say(first, "Thanks")
    assert second.report.status == "answered"
    assert second.report.exit_code == 0
    assert second.report.plan_id == first.report.plan_id
    assert second.report.arrival is None


def test_what_a_later_turn_points_at_is_another_thing(red_box: Picture, propose: Call) -> None:
    box = TargetPrompt(box=(55, 35, 125, 95))
    first = script(propose, DEPLOY).run(red_box, "Surround it", settings=FIX)
    looks = Call(id="l", name="locate_object", arguments={})
    second = Agent(ScriptedModel([Reply(calls=(looks,)), Reply(text="Seen.")]))
    run = second.say(first, "And this", pointed=[box])
    assert [p.id for p in run.world.pointed] == ["t2"]
    assert not [m for m in run.outcome.messages if isinstance(m, Result) and m.error]
    assert {t.id for t in run.world.targets} == {"t1", "t2"}


def test_a_fleet_does_not_outlive_the_loop_it_was_opened_in(
    red_box: Picture, propose: Call
) -> None:
    run = script(propose, DEPLOY).run(red_box, "Surround it", settings=FIX)
    assert run.context.services.fleets == {}

    async def stopped() -> Any:
        made = await script(propose).arun(red_box, "Surround it", settings=FIX)
        services = made.context.services
        await services.fleets["simulated"].stop()
        await services.close_fleets()
        go = DEPLOY.model_copy(update={"arguments": {"plan_id": made.world.current}})
        return await script(go).asay(made, "Go")

    held = asyncio.run(stopped())
    assert (held.report.status, held.report.arrival) == ("failed", None)
    assert "stopped" in held.report.message
