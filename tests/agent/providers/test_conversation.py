"""Whole conversations with real tools over HTTP: four interfaces, streamed and not."""

import asyncio
import json
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.loop import run
from formup.agent.messages import Reply, Result, Usage, User
from formup.agent.model import Request
from formup.agent.outcomes import Answered
from formup.prompts import load_prompt
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.perception.image import picture_from_array

Say = Callable[..., bytes]
PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}


@pytest.fixture(scope="module")
def picture() -> Any:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return picture_from_array(pixels)


def ask(model: Any, *messages: Any, system: str = "", tools: Any = ()) -> Reply:
    async def asking() -> Reply:
        try:
            return await model.reply(Request(system, messages, tools))
        finally:
            await model.aclose()

    return asyncio.run(asking())


def test_from_instruction_to_certified_plan(
    server: Any, dialect: Any, say: Say, streamed: bool, picture: Any
) -> None:
    server.script = [say("I place them.", [("c1", "propose_formation", PLAN)], "calls"), say("ok")]
    agent = Agent(server.model(dialect.name, streamed=streamed))
    report = agent.run(picture, "Surround it with 6 robots").report
    assert (report.status, report.message) == ("planned", "ok")
    assert report.verdict is not None
    assert report.verdict.certified
    assert report.model == f"{dialect.name}:m"
    assert (report.usage.requests, report.usage.tool_calls) == (2, 1)
    assert (report.usage.input_tokens, report.usage.output_tokens) == (200, 40)
    former = load_prompt("former")
    assert report.prompt == former.facts
    assert report.prompts == (report.prompt,)
    assert former.text in str(json.dumps(server.requests[0])).encode().decode("unicode_escape")
    assert server.connections == 1
    assert "".join(server.shown) == ("I place them.ok" if streamed else "")


def test_streamed_or_not_the_reply_is_the_same(server: Any, dialect: Any, http: Any) -> None:
    said: tuple[str, list[tuple[str, str, Any]]]
    said = ("Look: 6 ≠ 7, käse", [("a", "look", {"x": [1, {"y": "ü"}]}), ("b", "look", {})])
    server.script = [http.response(dialect.body(*said)), http.stream(dialect.events(*said))]
    whole = ask(server.model(dialect.name), User(text="go"))
    streamed = ask(server.model(dialect.name, streamed=True), User(text="go"))
    assert whole == streamed
    assert whole.text == said[0]
    assert [(c.id, c.name, c.arguments) for c in whole.calls] == said[1]
    assert whole.usage == Usage(input_tokens=100, cached_tokens=60, output_tokens=20)
    assert "".join(server.shown) == said[0]


def test_a_server_that_does_not_stream_is_read_and_shown(
    server: Any, dialect: Any, http: Any
) -> None:
    server.script = [http.response(dialect.body("all at once"))]
    assert ask(server.model(dialect.name, streamed=True), User(text="go")).text == "all at once"
    assert server.shown == ["all at once"]


def test_a_server_that_refuses_stream_options_is_asked_for_the_whole(
    server: Any, openai: Any, http: Any
) -> None:
    strict = {"detail": "Unexpected keys in the request: {'stream_options'}"}
    server.script = [http.response(strict, 422), *[http.response(openai.body("x"))] * 2]
    model = server.model("openai", streamed=True)
    ask(model, User(text="go"))
    ask(model, User(text="go"))
    assert ["stream" in r for r in server.requests] == [True, False, False]


def nulls(value: Any) -> bool:
    if isinstance(value, dict):
        return any(map(nulls, cast("dict[str, Any]", value).values()))
    return any(map(nulls, cast("list[Any]", value))) if isinstance(value, list) else value is None


def test_no_null_is_ever_sent(server: Any, dialect: Any, say: Say, picture: Any) -> None:
    server.script = [say("", [("c1", "locate_object", {})], "calls"), say("done")]
    Agent(server.model(dialect.name)).run(picture, "Surround it with 6 robots")
    for sent in server.requests:
        assert not nulls(sent[dialect.turns])
        assert "stream" not in sent


def test_ids_that_lack_or_repeat_are_made_up(
    server: Any, dialect: Any, say: Say, picture: Any
) -> None:
    twice: list[tuple[str, str, Any]]
    again: list[tuple[str, str, Any]]
    twice = [("", "locate_object", {}), ("x", "look", {}), ("x", "locate_object", {})]
    again = [("x", "look", {}), ("x", "look", {"region": [0, 0, 60, 60]})]
    server.script = [say("", twice, "calls"), say("", again, "calls"), say("done")]
    model = server.model(dialect.name)

    async def going() -> Any:
        try:
            return await run(model, TOOLS, Context.of(picture), (User(text="go"),))
        finally:
            await model.aclose()

    outcome = asyncio.run(going())
    assert isinstance(outcome, Answered)
    ids = [c.id for m in outcome.messages if isinstance(m, Reply) for c in m.calls]
    answered = [m.call_id for m in outcome.messages if isinstance(m, Result)]
    assert ids == answered
    assert len(set(ids)) == 5
    assert "x" in ids


def test_one_model_serves_one_run_after_another(
    server: Any, dialect: Any, say: Say, picture: Any
) -> None:
    agent = Agent(server.model(dialect.name))
    server.script = [say("one"), say("two")]
    for word in ("one", "two"):
        assert agent.run(picture, "Surround it with 6 robots").report.message == word


def test_many_conversations_at_once_do_not_mix(server: Any, openai: Any, http: Any) -> None:
    server.script = [http.response(openai.body("x"))] * 16
    model = server.model("openai")

    async def talking(number: int) -> None:
        history: tuple[Any, ...] = (User(text=f"I am {number}"),)
        for _ in range(2):
            reply = await model.reply(Request("", history, ()))
            history = (*history, reply, User(text=f"still {number}"))

    async def all_of_them() -> None:
        await asyncio.gather(*(talking(i) for i in range(8)))
        await model.aclose()

    asyncio.run(all_of_them())
    for sent in server.requests:
        numbers = {m["content"][-1] for m in sent["messages"] if m["role"] == "user"}
        assert len(numbers) == 1


WRITTEN: list[tuple[str, dict[str, Any] | None]] = [
    ('{"name": "look", "arguments": {"candidates": true}}', {"candidates": True}),
    ('```json\n{"name": "look", "parameters": {}}\n```', {}),
    ('<tool_call>\n{"name": "look", "arguments": {}}\n</tool_call>', {}),
    ('<think>\nhm {}\n</think>\n{"type": "function", "name": "look", "arguments": {}}', {}),
    ('I call {"name": "look", "arguments": {}}', None),
    ('{"name": "fly", "arguments": {}}', None),
    ('{"name": "look", "arguments": "now"}', None),
    ('{"name": "look", "arguments": {}, "why": "so"}', None),
    ('[{"name": "look", "arguments": {}}]', {}),
    ('{"name": ["look"], "arguments": {}}', None),
    ("```json\n{}\n```", None),
]


@pytest.mark.parametrize(("text", "arguments"), WRITTEN)
def test_a_call_left_in_the_text(
    text: str, arguments: dict[str, Any] | None, server: Any, openai: Any, http: Any
) -> None:
    server.script = [http.response(openai.body(text))]
    reply = ask(server.model("openai"), User(text="go"), tools=TOOLS)
    if arguments is None:
        assert (reply.text, reply.calls) == (text, ())
    else:
        assert reply.text == ""
        assert [(c.name, c.arguments) for c in reply.calls] == [("look", arguments)]


def test_streams_that_differ_from_the_rule(server: Any, openai: Any, http: Any) -> None:
    def chunk(**delta: Any) -> dict[str, Any]:
        return {"choices": [{"delta": delta, "finish_reason": None}]}

    def part(id: str | None, name: str | None, arguments: Any, **more: Any) -> dict[str, Any]:
        return {"id": id, "function": {"name": name, "arguments": arguments}} | more

    events = [
        chunk(content=[{"type": "text", "text": "He"}, {"type": "text", "text": "llo"}]),
        chunk(tool_calls=[part("a", "look", '{"x"', index=0)]),
        chunk(tool_calls=[part("a", "look", ": 1}", index=0)]),
        chunk(tool_calls=[part("b", "look", '{"x": 2}', index=0)]),
        chunk(tool_calls=[part("c", "look", {"x": 3})]),
        {"choices": [{"index": 1, "delta": {"content": "another answer"}}]},
        {"choices": None, "usage": {"prompt_tokens": None, "completion_tokens": -3}},
        "[DONE]",
    ]
    server.script = [http.stream(events)]
    reply = ask(server.model("openai", streamed=True), User(text="go"))
    assert reply.text == "Hello"
    assert [(c.id, c.arguments) for c in reply.calls] == [
        ("a", {"x": 1}),
        ("b", {"x": 2}),
        ("c", {"x": 3}),
    ]
    assert reply.usage == Usage()


def test_messages_are_written_once(
    server: Any, openai: Any, http: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from formup.agent.providers import openai_chat

    written: list[str | dict[str, Any]] = []
    dumped = openai_chat.dumped

    def counting(value: Any) -> bytes:
        written.append(value)
        return dumped(value)

    model = server.model("openai")
    monkeypatch.setattr(openai_chat, "dumped", counting)
    server.script = [http.response(openai.body(f"reply {i}")) for i in range(6)]

    async def talking() -> None:
        history: tuple[Any, ...] = (User(text="begin"),)
        for i in range(6):
            reply = await model.reply(Request("system", history, TOOLS))
            history = (*history, reply, User(text=f"go on {i}"))
        await model.aclose()

    asyncio.run(talking())
    roles = [v.get("role") for v in written if isinstance(v, dict)]
    said = [v for v in written if isinstance(v, str)]
    assert said == ["begin", *(f"go on {i}" for i in range(5))]
    assert roles.count("assistant") == 5
    assert roles.count("system") == 1
