"""Bounds inside one reply, of one reply, and around robots that drive."""

import asyncio
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.calls import SLOTS, answer
from formup.agent.limits import Limits
from formup.agent.loop import Recorder, run
from formup.agent.messages import Call, History, Reply, Result, Usage, User
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Outcome, Stopped
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.builtin import TOOLS
from formup.tools.context import Context, Settings
from formup.tools.perception.image import Picture
from formup.tools.tool import ToolResult, tool
from formup.tools.world import World

START: History = (User(text="go"),)


@tool("read")
def report(context: Context, number: int) -> ToolResult:
    """Repeat a number.

    Args:
        number: any.
    """
    return ToolResult({"number": number})


@tool("read")
async def dawdle(context: Context) -> ToolResult:
    """Take a while."""
    await asyncio.sleep(0.4)
    return ToolResult({})


@tool("actuate")
async def drive(context: Context) -> ToolResult:
    """Drive for a while."""
    await asyncio.sleep(0.4)
    return ToolResult({})


class Waiting:
    """Gives some replies, and then none."""

    name = "waiting"

    def __init__(self, *replies: Reply) -> None:
        self._replies = list(replies)

    async def reply(self, request: Request) -> Reply:
        if self._replies:
            return self._replies.pop(0)
        await asyncio.Event().wait()
        raise AssertionError


class Moves(Recorder):
    """Keeps which plans robots moved to."""

    def __init__(self) -> None:
        self.plans: list[str] = []

    async def moving(self, plan_id: str, world: World) -> None:
        self.plans.append(plan_id)


def go(picture: Picture, model: Any, *tools: Any, **more: Any) -> Outcome:
    return asyncio.run(run(model, (*TOOLS, *tools), Context.of(picture), START, **more))


def call(name: str, id: str = "c1", **arguments: Any) -> Reply:
    return Reply(calls=(Call(id=id, name=name, arguments=arguments),))


def results(outcome: Outcome) -> list[Result]:
    return [m for m in outcome.messages if isinstance(m, Result)]


@pytest.mark.parametrize("most", [1, 60, 999])
def test_a_thousand_calls_in_one_reply_stop_at_the_limit(most: int, red_box: Picture) -> None:
    many = (Call(id=f"c{i}", name="report", arguments={"number": i}) for i in range(1_000))
    model = ScriptedModel([Reply(calls=tuple(many))])
    outcome = go(red_box, model, report, limits=Limits(tool_calls=most))
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "limit"
    assert f"limit of {most} tool call" in outcome.reason
    assert len(results(outcome)) == most


def test_the_limit_counts_over_replies(red_box: Picture) -> None:
    replies = [
        Reply(
            calls=tuple(
                Call(id=f"c{i}", name="report", arguments={"number": i}) for i in range(k, k + 4)
            )
        )
        for k in (0, 4, 8)
    ]
    outcome = go(red_box, ScriptedModel(replies), report, limits=Limits(tool_calls=6))
    assert isinstance(outcome, Stopped)
    assert len(results(outcome)) == 6


def test_two_hundred_deploys_in_one_reply_move_the_fleet_once(
    red_box: Picture, propose: Call, drives: list[Any]
) -> None:
    deploy = [Call(id=f"d{i}", name="deploy", arguments={}) for i in range(200)]
    once = go(red_box, ScriptedModel([Reply(calls=(propose, deploy[0])), Reply(text="x")]))
    assert isinstance(once, Answered)
    moves, driven = Moves(), len(drives)
    plan_id = once.world.current
    assert driven > 0
    for arguments in ({}, {"plan_id": plan_id}):
        drives.clear()
        moves.plans.clear()
        calls = [c.model_copy(update={"arguments": arguments}) for c in deploy]
        model = ScriptedModel([Reply(calls=(propose, *calls))])
        outcome = go(red_box, model, recorder=moves, limits=Limits(tool_calls=None))
        assert isinstance(outcome, Stopped)
        assert outcome.kind == "repeat"
        assert moves.plans == [plan_id]
        assert len(drives) == driven
        first, second = [m.text for m in results(outcome) if m.name == "deploy"][:2]
        assert "already_there" not in first
        assert '"already_there":true' in second
        assert outcome.world.arrivals == once.world.arrivals


@pytest.mark.parametrize(
    ("limits", "kind", "word"),
    [
        (Limits(tool_calls=2), "limit", "2 tool calls"),
        (Limits(requests=1), "limit", "1 request"),
        (Limits(), "repeat", "repeated"),
        (Limits(tokens=1), "limit", "1 tokens"),
    ],
)
def test_robots_that_had_arrived_are_reported_whatever_stopped_the_turn(
    limits: Limits, kind: str, word: str, red_box: Picture, propose: Call
) -> None:
    deploy = Call(id="d", name="deploy", arguments={})
    first = Reply(calls=(propose, deploy), usage=Usage(input_tokens=1))
    again = [call("report", f"r{i}", number=1) for i in range(3)]
    model = ScriptedModel([first, *again])
    made = Agent(model, tools=(*TOOLS, report), limits=limits).run(
        red_box, "Surround it", settings=Settings(robots=6)
    )
    assert isinstance(made.outcome, Stopped)
    assert made.outcome.kind == kind
    assert (made.report.status, made.report.exit_code) == ("deployed", 0)
    assert made.report.arrival is not None
    assert made.report.arrival.arrived
    assert made.report.message.startswith("All robots had arrived. ")
    assert word in made.report.message


def test_a_reply_that_takes_too_long_stops_the_turn(red_box: Picture) -> None:
    model = Waiting(call("report", number=1))
    outcome = go(red_box, model, report, limits=Limits(reply_seconds=0.05))
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "model"
    assert "waiting did not finish a reply within 0.05 s" in outcome.reason
    assert "raise the limit reply_seconds" in outcome.reason
    assert len(results(outcome)) == 1


def test_what_the_tools_take_is_not_the_replys(red_box: Picture) -> None:
    model = ScriptedModel([call("dawdle"), Reply(text="done")])
    outcome = go(red_box, model, dawdle, limits=Limits(reply_seconds=0.2))
    assert isinstance(outcome, Answered)


def test_a_timeout_of_the_models_own_is_not_the_replys(red_box: Picture) -> None:
    class Late:
        name = "late"

        async def reply(self, request: Request) -> Reply:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        go(red_box, Late(), limits=Limits(reply_seconds=60))


def test_the_clock_stands_still_while_robots_drive(red_box: Picture) -> None:
    limits = Limits(seconds=0.2)
    driven = go(red_box, ScriptedModel([call("drive"), Reply(text="there")]), drive, limits=limits)
    assert isinstance(driven, Answered)
    other = go(red_box, ScriptedModel([call("dawdle"), Reply(text="x")]), dawdle, limits=limits)
    assert isinstance(other, Stopped)
    assert (other.kind, "0.2 s" in other.reason) == ("limit", True)


def test_the_clock_goes_on_when_they_have_driven(red_box: Picture) -> None:
    outcome = go(red_box, Waiting(call("drive")), drive, limits=Limits(seconds=0.2))
    assert isinstance(outcome, Stopped)
    assert (outcome.kind, "0.2 s" in outcome.reason) == ("limit", True)
    assert len(results(outcome)) == 1


def test_tools_of_many_conversations_wait_for_a_place(red_box: Picture) -> None:
    at_work, most = 0, 0

    @tool("read")
    async def work(context: Context) -> ToolResult:
        """Count who works at the same time."""
        nonlocal at_work, most
        at_work += 1
        most = max(most, at_work)
        await asyncio.sleep(0.1)
        at_work -= 1
        return ToolResult({})

    async def many() -> list[Result]:
        call, context = Call(id="1", name="work", arguments={}), Context.of(red_box)
        calls = (answer((work,), context, call, 0.5) for _ in range(10 * SLOTS))
        return await asyncio.gather(*calls)

    results = asyncio.run(many())
    assert most == SLOTS
    assert not any(result.error for result in results), "waiting is not working: no time runs"
