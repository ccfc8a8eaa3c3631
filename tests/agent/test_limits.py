"""Limits, policy, repetition and broken tools: every one an outcome that keeps the messages."""

import asyncio
import threading
import time
from typing import Any, cast

import numpy as np
import pytest
from formup.agent.limits import Limits
from formup.agent.loop import run
from formup.agent.messages import Call, History, Reply, Result, Usage, User
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Cancelled, Outcome, Stopped
from formup.agent.wrappers.doubles import FunctionModel, ScriptedModel
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.errors import FleetError, InputError, ToolError
from formup.tools.perception.image import picture_from_array
from formup.tools.tool import Tool, ToolResult, tool
from formup.tools.world import World

START: History = (User(text="go"),)
PICTURE = picture_from_array(np.full((60, 80, 3), 60, np.uint8))


def call(name: str, id: str = "c1", **arguments: Any) -> Reply:
    return Reply(calls=(Call(id=id, name=name, arguments=arguments),))


def go(model: Any, *tools: Tool, messages: History = START, **more: Any) -> Outcome:
    return asyncio.run(run(model, tools or TOOLS, Context.of(PICTURE), messages, **more))


def spending(tokens: int, cost: float) -> FunctionModel:
    """Looks at another number of things each time."""

    def reply(request: Request) -> Reply:
        count = len(request.messages)
        usage = Usage(input_tokens=tokens - 1, output_tokens=1, cost_usd=cost)
        asked = Call(id=f"c{count}", name="report", arguments={"number": count})
        return Reply(calls=(asked,), usage=usage)

    return FunctionModel(reply)


def sampled(context: Context) -> World:
    """The world with something new in it."""
    return context.world.with_sample([(0.0, 0.0)])[0]


@tool("read")
def report(context: Context, number: int) -> ToolResult:
    """Repeat a number.

    Args:
        number: any.
    """
    return ToolResult({"number": number})


@pytest.mark.parametrize(
    ("limits", "requests", "word"),
    [
        (Limits(requests=3), 3, "3 requests"),
        (Limits(tool_calls=2), 2, "2 tool calls"),
        (Limits(tokens=250), 3, "250 tokens was reached: 300"),
        (Limits(cost_usd=0.25), 3, "0.25 USD was reached: 0.3000"),
    ],
)
def test_a_limit_is_an_outcome(limits: Limits, requests: int, word: str) -> None:
    outcome = go(spending(100, 0.1), report, limits=limits)
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "limit"
    assert word in outcome.reason
    assert len(outcome.messages) == 1 + 2 * requests


def test_a_limit_that_is_lifted_lets_the_run_go_on() -> None:
    stopped = go(spending(100, 0.1), report, limits=Limits(requests=2))
    script = ScriptedModel([Reply(text="done")])
    outcome = go(script, report, messages=stopped.messages, limits=Limits(requests=3))
    assert isinstance(outcome, Answered)
    assert outcome.messages[: len(stopped.messages)] == stopped.messages


NAMES = ["requests", "tool_calls", "tokens", "cost_usd", "seconds", "tool_seconds", "reply_seconds"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_limits_that_let_nothing_run_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        Limits(**{name: cast("Any", value)})


class Waiting:
    """Answers only when it is let."""

    name = "waiting"

    async def reply(self, request: Request) -> Reply:
        await asyncio.Event().wait()
        raise AssertionError


def test_the_limit_of_time_interrupts_a_model() -> None:
    outcome = go(Waiting(), limits=Limits(seconds=0.05))
    assert isinstance(outcome, Stopped)
    assert (outcome.kind, outcome.messages) == ("limit", START)
    assert "0.05 s" in outcome.reason


def test_a_timeout_of_the_models_own_is_not_the_limits() -> None:
    def late(request: Request) -> Reply:
        raise TimeoutError

    with pytest.raises(TimeoutError):
        go(FunctionModel(late), limits=Limits(seconds=60))


class Hanging:
    """A tool that does not end until it is let."""

    def __init__(self) -> None:
        self.released = threading.Event()

        @tool("commit")
        def hang(context: Context) -> ToolResult:
            """Change something and hang."""
            self.released.wait(60)
            return ToolResult({}, world=sampled(context))

        @tool("commit")
        async def hang_async(context: Context) -> ToolResult:
            """Change something and wait for ever."""
            await asyncio.Event().wait()
            raise AssertionError

        self.tools = (hang, hang_async)


@pytest.fixture
def hanging() -> Any:
    made = Hanging()
    yield made
    made.released.set()
    for thread in threading.enumerate():
        if thread.name == "formup tool":
            thread.join()


@pytest.mark.parametrize("index", [0, 1])
def test_a_tool_that_hangs_is_given_up_and_has_changed_nothing(
    hanging: Hanging, index: int
) -> None:
    tool_ = hanging.tools[index]
    script = ScriptedModel([call(tool_.name), Reply(text="I do without.")])
    outcome = go(script, tool_, limits=Limits(tool_seconds=0.05))
    assert isinstance(outcome, Answered)
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert result.error == "timeout"
    assert "0.05 s" in result.text
    hanging.released.set()
    assert outcome.world == World.of(PICTURE)


def test_ctrl_c_comes_through_while_a_tool_works(hanging: Hanging) -> None:
    async def scenario() -> Outcome:
        script = ScriptedModel([call("hang")])
        task = asyncio.create_task(run(script, hanging.tools, Context.of(PICTURE), START))
        while not any(t.name == "formup tool" for t in threading.enumerate()):
            await asyncio.sleep(0.01)
        task.cancel()
        return await task

    outcome = asyncio.run(scenario())
    assert isinstance(outcome, Cancelled)
    assert len(outcome.messages) == 2


def test_a_tool_that_works_does_not_stop_the_others() -> None:
    """Two conversations in one event loop: each tool waits until the other one runs."""
    both = threading.Barrier(2)

    @tool("read")
    def meet(context: Context) -> ToolResult:
        """Wait for the other one."""
        both.wait(30)
        return ToolResult({})

    async def scenario() -> list[Outcome]:
        one = [
            run(
                ScriptedModel([call("meet"), Reply(text="met")]),
                (meet,),
                Context.of(PICTURE),
                START,
            )
            for _ in range(2)
        ]
        return await asyncio.gather(*one)

    assert all(isinstance(outcome, Answered) for outcome in asyncio.run(scenario()))


@tool("read")
def broken(context: Context) -> ToolResult:
    """Have a mistake."""
    raise KeyError("colour\nof it")


def test_a_broken_tool_is_named_with_its_line() -> None:
    outcome = go(ScriptedModel([call("broken")]), broken)
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "tool"
    assert isinstance(outcome.error, KeyError)
    assert "broken broke (KeyError: 'colour\\nof it') at line" in outcome.reason
    assert "test_limits.py" in outcome.reason
    assert len(outcome.messages) == 2
    assert outcome.world == World.of(PICTURE)


def test_what_a_tool_cannot_do_keeps_what_it_found() -> None:
    @tool("read")
    def doubt(context: Context) -> ToolResult:
        """Find something, but not enough."""
        context.observed(sampled(context))
        raise ToolError("not enough")

    outcome = go(ScriptedModel([call("doubt"), Reply(text="oh")]), doubt)
    assert list(outcome.world.samples) == ["s1"]


def test_errors_of_fleet_and_person_are_theirs() -> None:
    @tool("actuate")
    async def move(context: Context, wrong: str) -> ToolResult:
        """Fail.

        Args:
            wrong: how.
        """
        raise FleetError("no radio") if wrong == "fleet" else InputError("bad starts")

    outcome = go(ScriptedModel([call("move", wrong="fleet")]), move)
    assert isinstance(outcome, Stopped)
    assert (outcome.kind, outcome.reason) == ("fleet", "no radio")
    with pytest.raises(InputError, match="bad starts"):
        go(ScriptedModel([call("move", wrong="person")]), move)


def same(count: int, **arguments: Any) -> list[Reply]:
    return [call("report", id=f"c{i}", **arguments) for i in range(count)]


def test_the_same_call_with_the_same_answer_three_times_stops() -> None:
    outcome = go(ScriptedModel(same(9, number=1)), report)
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "repeat"
    assert len(outcome.messages) == 1 + 2 * 3


def test_other_arguments_or_other_answers_are_no_repetition() -> None:
    mixed = [call("report", id=f"c{i}", number=i % 9) for i in range(18)]
    assert isinstance(go(ScriptedModel([*mixed, Reply(text="x")]), report), Answered)

    @tool("read")
    def clock(context: Context) -> ToolResult:
        """Tell the time."""
        return ToolResult({"seconds": time.perf_counter_ns()})

    ticking = [call("clock", id=f"c{i}") for i in range(9)]
    assert isinstance(go(ScriptedModel([*ticking, Reply(text="x")]), clock), Answered)


def together(*numbers: int) -> Reply:
    """Calls of `report` in one reply."""
    calls = (
        Call(id=f"c{i}", name="report", arguments={"number": n}) for i, n in enumerate(numbers)
    )
    return Reply(calls=tuple(calls))


def test_calls_made_together_repeat_too_but_twice_is_no_circle() -> None:
    twice = together(1, 1, 2, 2)
    assert isinstance(go(ScriptedModel([twice, Reply(text="x")]), report), Answered)
    outcome = go(ScriptedModel([together(1, 1, 1, 1, 1)]), report)
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "repeat"
    assert len(outcome.messages) == 2 + 3


def test_a_person_who_speaks_allows_it_anew() -> None:
    twice = go(ScriptedModel([*same(2, number=1), Reply(text="so")]), report)
    later = tuple(
        Reply(calls=tuple(c.model_copy(update={"id": f"d{c.id}"}) for c in r.calls), text=r.text)
        for r in [*same(2, number=1), Reply(text="so")]
    )
    outcome = go(ScriptedModel(later), report, messages=(*twice.messages, User(text="again")))
    assert isinstance(outcome, Answered)


@pytest.mark.parametrize("answer", [{"wind": object()}, {"wind": float("nan")}, "3 m/s", None])
def test_an_answer_that_is_no_json_is_a_broken_tool(answer: Any) -> None:
    @tool("read")
    def wind(context: Context) -> Any:
        """How it blows."""
        return answer

    outcome = go(ScriptedModel([call("wind")]), wind)
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "tool"
    assert "wind broke" in outcome.reason


def test_data_alone_is_an_answer() -> None:
    @tool("read")
    def wind(context: Context) -> dict[str, Any]:
        """How it blows, m/s."""
        return {"wind": 3}

    outcome = go(ScriptedModel([call("wind"), Reply(text="x")]), wind)
    assert isinstance(outcome.messages[2], Result)
    assert outcome.messages[2].text == '{"wind":3}'


@pytest.mark.parametrize("raised", [StopIteration("x"), SystemExit(3), KeyboardInterrupt()])
def test_what_a_tool_raises_ends_the_run_and_not_the_program(raised: BaseException) -> None:
    @tool("read")
    def leave(context: Context) -> ToolResult:
        """Raise what no tool should."""
        raise raised

    outcome = go(ScriptedModel([call("leave")]), leave)
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "tool"
    assert repr(raised) in outcome.reason
