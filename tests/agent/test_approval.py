"""A person's approval is for one plan: real robots wait for it, and move to no other."""

from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.limits import Limits
from formup.agent.messages import Call, Reply, turn_of
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Cancelled, Paused, Stopped
from formup.agent.policy import Policy
from formup.agent.session import Run, load_run
from formup.agent.store.folder import read_events
from formup.agent.wrappers.doubles import FunctionModel, ScriptedModel
from formup.tools.errors import InputError
from formup.tools.perception.image import Picture


def fewer(propose: Call, id: str) -> Call:
    """Another formation around the same thing."""
    group = {"relation": "around", "targets": ["t1"], "robots": 5}
    return Call(id=id, name=propose.name, arguments={"contract": {"groups": [group]}})


def deploy(id: str, **arguments: Any) -> Call:
    return Call(id=id, name="deploy", arguments=arguments)


def paused(run: Run) -> Paused:
    assert isinstance(run.outcome, Paused), run.report.message
    assert (run.report.status, run.report.exit_code) == ("needs_approval", 3)
    return run.outcome


@pytest.mark.usefixtures("real")
@pytest.mark.parametrize("rules", [(), (("*", "allow"),)])
def test_real_robots_wait_for_approval_of_their_plan(
    rules: Any, red_box: Picture, propose: Call, drives: list[Any], tmp_path: Path
) -> None:
    def agent(*replies: Reply) -> Agent:
        return Agent(ScriptedModel(replies), policy=Policy(rules))

    asked = agent(Reply(calls=(propose, deploy("d")))).run(
        red_box, "Surround it", trace=tmp_path / "trace.jsonl"
    )
    waits = paused(asked)
    assert waits.call == deploy("d")
    assert [waits.plan_id] == list(asked.world.plans)
    assert waits.plan_id == asked.report.plan_id
    assert f"approve plan {waits.plan_id} before" in asked.report.message
    assert drives == []
    assert not [e for e in read_events(tmp_path) if e.kind == "moving"]
    left = load_run(tmp_path)
    assert left.outcome == asked.outcome
    with pytest.raises(InputError, match="yes or no"):
        agent().resume(left)
    assert drives == []
    done = agent(Reply(text="They stand.")).resume(left, approve=True)
    assert done.report.status == "deployed"
    assert list(done.world.arrivals) == [waits.plan_id]
    assert drives


@pytest.mark.usefixtures("real")
def test_a_no_moves_nothing(red_box: Picture, propose: Call, drives: list[Any]) -> None:
    agent = Agent(ScriptedModel([Reply(calls=(propose, deploy("d"))), Reply(text="Not moved.")]))
    done = agent.resume(agent.run(red_box, "Surround it"), approve=False)
    assert isinstance(done.outcome, Answered)
    assert (done.report.status, drives) == ("planned", [])


@pytest.mark.usefixtures("real")
def test_an_approval_is_not_for_the_next_plan(
    red_box: Picture, propose: Call, drives: list[Any]
) -> None:
    def decide(request: Request) -> Reply:
        count = sum(isinstance(m, Reply) for m in turn_of(request.messages))
        if count == 0:
            return Reply(calls=(propose, deploy("d")))
        if count == 1:
            return Reply(calls=(fewer(propose, "p2"), deploy("d2")))
        return Reply(text="done")

    agent = Agent(FunctionModel(decide))
    first = agent.run(red_box, "Surround it")
    one = paused(first).plan_id
    second = agent.resume(first, approve=True)
    other = paused(second)
    assert other.plan_id is not None
    assert other.plan_id != one
    assert second.report.plan_id == other.plan_id
    assert list(second.world.arrivals) == [one]
    driven = len(drives)
    third = agent.resume(second, approve=True)
    assert third.report.status == "deployed"
    assert list(third.world.arrivals) == [one, other.plan_id]
    assert len(drives) > driven


@pytest.mark.usefixtures("real")
def test_a_run_that_ended_after_its_drive_needs_another_approval_to_drive_on(
    red_box: Picture, propose: Call, drives: list[Any], tmp_path: Path
) -> None:
    def agent(*replies: Reply, requests: int = 20) -> Agent:
        return Agent(ScriptedModel(replies), limits=Limits(requests=requests))

    trace = tmp_path / "trace.jsonl"
    asked = agent(Reply(calls=(propose, deploy("d")))).run(red_box, "Surround it", trace=trace)
    ended = agent(requests=1).resume(load_run(tmp_path), approve=True)
    assert isinstance(ended.outcome, Stopped)
    driven = len(drives)
    assert driven
    again = Reply(calls=(deploy("d2", plan_id=paused(asked).plan_id),))
    assert paused(agent(again).resume(load_run(tmp_path))).call.id == "d2"
    assert len(drives) == driven


@pytest.mark.usefixtures("real")
def test_an_approval_is_not_for_the_next_turn(red_box: Picture, propose: Call) -> None:
    def decide(request: Request) -> Reply:
        count = sum(isinstance(m, Reply) for m in turn_of(request.messages))
        number = len(request.messages)
        if len(request.messages) > 6 and count == 0:
            return Reply(calls=(fewer(propose, f"p{number}"), deploy(f"d{number}")))
        return Reply(text="done") if count else Reply(calls=(propose, deploy("d")))

    agent = Agent(FunctionModel(decide))
    asked = agent.run(red_box, "Surround it")
    moved = agent.resume(asked, approve=True)
    assert moved.report.status == "deployed"
    assert moved.context.settings.approved == paused(asked).plan_id
    back = agent.say(moved, "Once more")
    assert back.context.settings.approved is None


@pytest.mark.parametrize("real_robots", [False, True])
def test_an_approval_moves_its_plan_though_another_is_current(
    real_robots: bool, red_box: Picture, propose: Call, drives: list[Any], request: Any
) -> None:
    """The very same call, `deploy` without an id, once another plan is the current one."""
    if real_robots:
        request.getfixturevalue("real")
    policy = Policy((("deploy", "ask"),))
    model = ScriptedModel([Reply(calls=(propose, deploy("d")))])
    asked = Agent(model, policy=policy).run(red_box, "Surround it")
    old = paused(asked)
    again = ScriptedModel([Reply(calls=(fewer(propose, "p2"),)), Reply(text="x")])
    other = Agent(again).run(red_box, "Surround it", targets=asked.world.targets)
    changed = asked.world.with_plan(other.world.plan())
    assert changed.current != old.plan_id
    moved_on = Run(
        asked.report,
        Paused(old.messages, changed, old.call, old.plan_id),
        asked.context,
        asked.began,
    )
    assert drives == []
    still = Agent(ScriptedModel([Reply(text="x")]), policy=policy).resume(moved_on, approve=True)
    assert list(still.world.arrivals) == [old.plan_id]
    assert drives


@pytest.mark.usefixtures("real")
def test_killed_after_a_yes_only_that_plan_moves(
    red_box: Picture, propose: Call, drives: list[Any], tmp_path: Path
) -> None:
    path = tmp_path / "trace.jsonl"
    model = ScriptedModel([Reply(calls=(propose, deploy("d")))])
    asked = Agent(model).run(red_box, "Surround it", trace=path)
    Agent(ScriptedModel([Reply(text="There.")])).resume(asked, approve=True)
    lines = path.read_bytes().splitlines(keepends=True)
    kinds = [event.kind for event in read_events(path)]
    path.write_bytes(b"".join(lines[: kinds.index("approval") + 1]))
    drives.clear()
    left = load_run(path)
    assert isinstance(left.outcome, Cancelled)
    assert left.context.settings.approved == paused(asked).plan_id
    done = Agent(ScriptedModel([Reply(text="There.")])).resume(left)
    assert done.report.status == "deployed"
    assert list(done.world.arrivals) == [paused(asked).plan_id]
