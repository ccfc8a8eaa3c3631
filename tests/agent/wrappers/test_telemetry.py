"""Spans of real runs: one tree, the conventions' names, errors by their kind, no texts."""

import asyncio
import threading
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.limits import Limits
from formup.agent.messages import Call, Reply, Usage
from formup.agent.model import Model, Request
from formup.agent.policy import Policy
from formup.agent.report import Totals
from formup.agent.session import Run
from formup.agent.wrappers.doubles import FunctionModel, ScriptedModel
from formup.agent.wrappers.telemetry import traced_model
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.errors import ModelError, ToolError
from formup.tools.perception.image import picture_from_array
from formup.tools.tool import THREAD, Tool, tool
from opentelemetry.sdk.trace import ReadableSpan, TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from opentelemetry.trace import SpanKind, StatusCode, Tracer

PIXELS = np.full((140, 200, 3), 60, np.uint8)
PIXELS[40:90, 60:120] = (200, 40, 40)
PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}
USAGE = Usage(input_tokens=100, cached_tokens=40, output_tokens=10, cost_usd=0.5)


class Seen:
    """A tracer and what it was given, by name, in the order of the spans' ends."""

    def __init__(self) -> None:
        self._memory = InMemorySpanExporter()
        provider = TracerProvider(shutdown_on_exit=False)
        provider.add_span_processor(SimpleSpanProcessor(self._memory))
        self.tracer: Tracer = provider.get_tracer("tests")

    @property
    def spans(self) -> tuple[ReadableSpan, ...]:
        return self._memory.get_finished_spans()

    def one(self, name: str) -> ReadableSpan:
        (span,) = (span for span in self.spans if span.name == name)
        return span

    def clear(self) -> None:
        self._memory.clear()


@pytest.fixture
def seen() -> Seen:
    return Seen()


def call(name: str, arguments: dict[str, Any] | None = None, id: str = "c") -> Reply:
    return Reply(calls=(Call(id=id, name=name, arguments=arguments or {}),), usage=USAGE)


def run(seen: Seen, model: Model, instruction: str = "Surround it", **more: Any) -> Run:
    agent = Agent(model, tracer=seen.tracer, **more)
    return agent.run(picture_from_array(PIXELS), instruction)


def facts(span: ReadableSpan) -> dict[str, Any]:
    return dict(span.attributes or {})


def error(span: ReadableSpan) -> tuple[StatusCode, Any]:
    """How a span ended; no words may come with it."""
    assert span.status.description is None
    assert not span.events
    return span.status.status_code, facts(span).get("error.type")


NO_ERROR = (StatusCode.UNSET, None)


def test_a_run_is_one_tree_of_spans(seen: Seen) -> None:
    replies = [call("look", id="a"), call("propose_formation", PLAN, "b"), Reply(text="done")]
    assert run(seen, ScriptedModel(replies)).report.status == "planned"
    assert [span.name for span in seen.spans] == [
        "chat scripted",
        "execute_tool look",
        "chat scripted",
        "execute_tool propose_formation",
        "chat scripted",
        "invoke_agent formup",
    ]
    *children, root = seen.spans
    assert root.parent is None
    assert root.context is not None
    for span in children:
        assert span.parent is not None
        assert span.parent.span_id == root.context.span_id
        assert span.parent.trace_id == root.context.trace_id
        chat = span.name.startswith("chat")
        assert span.kind == (SpanKind.CLIENT if chat else SpanKind.INTERNAL)
    assert root.kind == SpanKind.INTERNAL
    assert {error(span) for span in seen.spans} == {NO_ERROR}


@pytest.mark.parametrize(
    ("name", "provider", "model"),
    [
        ("openai:gpt-5", "openai", "gpt-5"),
        ("openai-responses:gpt-5", "openai", "gpt-5"),
        ("anthropic:claude-opus", "anthropic", "claude-opus"),
        ("gemini:gemini-3", "gcp.gemini", "gemini-3"),
        ("ollama:qwen3:8b", "ollama", "qwen3:8b"),
        ("offline", "formup", "offline"),
    ],
)
def test_a_reply_says_of_whom_and_how_much(
    name: str, provider: str, model: str, seen: Seen
) -> None:
    run(seen, ScriptedModel([Reply(text="done", usage=USAGE)], name))
    assert facts(seen.one(f"chat {model}")) == {
        "gen_ai.operation.name": "chat",
        "gen_ai.provider.name": provider,
        "gen_ai.request.model": model,
        "gen_ai.usage.input_tokens": 100,
        "gen_ai.usage.cache_read.input_tokens": 40,
        "gen_ai.usage.output_tokens": 10,
    }
    of_run = facts(seen.one("invoke_agent formup"))
    assert of_run["gen_ai.provider.name"] == provider
    assert of_run["gen_ai.request.model"] == model


def test_a_tool_says_what_it_is(seen: Seen) -> None:
    run(seen, ScriptedModel([call("look"), Reply(text="done")]))
    (look,) = (tool for tool in TOOLS if tool.name == "look")
    assert facts(seen.one("execute_tool look")) == {
        "gen_ai.operation.name": "execute_tool",
        "gen_ai.tool.name": "look",
        "gen_ai.tool.type": "function",
        "gen_ai.tool.description": look.description,
    }


def test_a_run_says_how_it_ended(seen: Seen) -> None:
    replies = [call("look"), Reply(text="done", usage=USAGE)]
    report = run(seen, ScriptedModel(replies)).report
    assert report.usage == Totals(
        requests=2,
        tool_calls=1,
        input_tokens=200,
        output_tokens=20,
        cost_usd=1.0,
        seconds=report.usage.seconds,
    )
    assert facts(seen.one("invoke_agent formup")) == {
        "gen_ai.operation.name": "invoke_agent",
        "gen_ai.provider.name": "formup",
        "gen_ai.request.model": "scripted",
        "gen_ai.agent.name": "formup",
        "gen_ai.usage.input_tokens": 200,
        "gen_ai.usage.cache_read.input_tokens": 80,
        "gen_ai.usage.output_tokens": 20,
        "formup.status": report.status,
        "formup.requests": 2,
        "formup.tool_calls": 1,
        "formup.cost_usd": 1.0,
    }


def test_a_failing_model_fails_its_span_and_the_run(seen: Seen) -> None:
    assert run(seen, ScriptedModel([])).report.status == "failed"
    assert error(seen.one("chat scripted")) == (StatusCode.ERROR, "ModelError")
    assert error(seen.one("invoke_agent formup")) == (StatusCode.ERROR, "model")
    assert facts(seen.one("invoke_agent formup"))["formup.status"] == "failed"


def test_what_a_tool_cannot_do_fails_its_span_alone(seen: Seen) -> None:
    wrong = call("describe_shape", {"target": "t9"})
    run(seen, ScriptedModel([wrong, Reply(text="sorry")]))
    assert error(seen.one("execute_tool describe_shape")) == (StatusCode.ERROR, "ToolError")
    assert error(seen.one("invoke_agent formup")) == NO_ERROR


def test_a_call_that_runs_no_tool_has_no_span(seen: Seen) -> None:
    replies = [call("fly", id="a"), call("look", {"at": 1}, "b"), call("deploy", id="c")]
    policy = Policy((("deploy", "refuse"),))
    run(seen, ScriptedModel([*replies, Reply(text="sorry")]), policy=policy)
    assert {span.name for span in seen.spans} == {"chat scripted", "invoke_agent formup"}


@tool("read")
def broken(context: Context) -> dict[str, Any]:
    """Break."""
    raise ZeroDivisionError("private words")


@tool("read")
async def endless(context: Context) -> dict[str, Any]:
    """Wait for ever."""
    await asyncio.Event().wait()
    raise AssertionError


def test_a_broken_tool_fails_its_span_and_the_run(seen: Seen) -> None:
    outcome = run(seen, ScriptedModel([call("broken")]), tools=(broken,)).outcome
    assert "private words" in str(outcome)
    assert error(seen.one("execute_tool broken")) == (StatusCode.ERROR, "ZeroDivisionError")
    assert error(seen.one("invoke_agent formup")) == (StatusCode.ERROR, "tool")


def test_a_tool_given_up_ends_its_span(seen: Seen) -> None:
    limits = Limits(tool_seconds=0.05)
    model = ScriptedModel([call("endless"), Reply(text="sorry")])
    run(seen, model, tools=(endless,), limits=limits)
    assert error(seen.one("execute_tool endless")) == (StatusCode.ERROR, "CancelledError")
    assert error(seen.one("invoke_agent formup")) == NO_ERROR


def test_a_limit_ends_a_run_as_an_error_with_the_limit_as_its_type(seen: Seen) -> None:
    run(seen, ScriptedModel([call("look")]), limits=Limits(requests=1))
    assert error(seen.one("invoke_agent formup")) == (StatusCode.ERROR, "limit")
    assert facts(seen.one("invoke_agent formup"))["formup.status"] == "stopped"


def test_an_exception_out_of_a_run_fails_every_span_it_passes(seen: Seen) -> None:
    def broken_model(request: Request) -> Reply:
        raise ZeroDivisionError("private words")

    with pytest.raises(ZeroDivisionError):
        run(seen, FunctionModel(broken_model))
    assert [error(span) for span in seen.spans] == [(StatusCode.ERROR, "ZeroDivisionError")] * 2


def test_a_resumed_run_counts_what_it_used_itself(seen: Seen) -> None:
    asks = call("ask_user", {"question": "Which one?"})
    agent = Agent(ScriptedModel([asks, Reply(text="done", usage=USAGE)]), tracer=seen.tracer)
    paused = agent.run(picture_from_array(PIXELS), "Surround it")
    first = seen.one("invoke_agent formup")
    assert (error(first), facts(first)["formup.status"]) == (NO_ERROR, "question")
    seen.clear()
    resumed = agent.resume(paused, answer="the red one")
    assert resumed.report.usage.requests == 2
    second = facts(seen.one("invoke_agent formup"))
    for name, value in {"requests": 1, "tool_calls": 0, "cost_usd": 0.5}.items():
        assert second[f"formup.{name}"] == value
    assert second["gen_ai.usage.input_tokens"] == 100


@pytest.mark.parametrize("waits", [False, True], ids=["sync", "async"])
def test_spans_a_tool_starts_are_its_own(waits: bool, seen: Seen) -> None:
    threads: list[str] = []

    def work() -> dict[str, Any]:
        threads.append(threading.current_thread().name)
        with seen.tracer.start_as_current_span("inner"):
            return {"seen": True}

    def plain(context: Context) -> dict[str, Any]:
        """Work."""
        return work()

    async def waiting(context: Context) -> dict[str, Any]:
        """Work."""
        await asyncio.sleep(0)
        return work()

    made: Tool = tool("read")(waiting if waits else plain)
    run(seen, ScriptedModel([call(made.name), Reply(text="done")]), tools=(made,))
    outer, inner = seen.one(f"execute_tool {made.name}"), seen.one("inner")
    assert outer.context is not None
    assert inner.parent is not None
    assert inner.parent.span_id == outer.context.span_id
    assert threads == ["MainThread" if waits else THREAD]


def test_spans_hold_nothing_of_what_was_said(seen: Seen) -> None:
    @tool("read")
    def listen(context: Context, word: str) -> dict[str, Any]:
        """Listen.

        Args:
            word: what was heard.
        """
        if word == "secret-argument":
            return {"heard": "secret-result"}
        raise ToolError(f"secret-refusal of {word}")

    def decide(request: Request) -> Reply:
        word = {1: "secret-argument", 3: "secret-mistake"}.get(len(request.messages))
        if word is None:
            raise ModelError("secret-failure")
        listening = call("listen", {"word": word}, f"secret-id{len(request.messages)}")
        return listening.model_copy(update={"text": "secret-text"})

    model, name = FunctionModel(decide), "secret-instruction"
    done = run(seen, model, name, tools=(listen,), system="secret-system")
    said = str((done.outcome, done.report))
    for secret in ("instruction", "argument", "result", "refusal", "mistake", "failure", "text"):
        assert f"secret-{secret}" in said
    assert len(seen.spans) == 6
    assert not [span.name for span in seen.spans if "secret" in span.to_json()]


class Whole:
    """A model with all a model may have."""

    name, prompt = "openai:gpt-5", "former"
    closed = 0

    async def reply(self, request: Request) -> Reply:
        return Reply(text="done")

    async def aclose(self) -> None:
        self.closed += 1


def test_a_traced_model_is_the_model_in_all_else(seen: Seen) -> None:
    model = Whole()
    agent = Agent(model, tracer=seen.tracer)
    assert agent.prompt is not None
    assert agent.prompt.id == "former"
    done = agent.run(picture_from_array(PIXELS), "Surround it")
    assert (done.report.model, model.closed) == ("openai:gpt-5", 1)
    bare = traced_model(ScriptedModel([]), seen.tracer)
    assert not hasattr(bare, "prompt")
    assert not hasattr(bare, "aclose")


def test_without_a_tracer_nothing_is_wrapped() -> None:
    model = ScriptedModel([])
    agent = Agent(model)
    assert agent.model is model
    assert agent.tools is TOOLS
