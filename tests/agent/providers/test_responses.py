"""What OpenAI's Responses do otherwise than Chat Completions: ends, errors, thoughts sent back."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from formup.agent.messages import HISTORY, Call, Reply, Result, User
from formup.agent.model import Request
from formup.agent.providers.anthropic import Anthropic
from formup.agent.providers.gemini import Gemini
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.openai_responses import OpenAIResponses
from formup.agent.providers.prices import UNKNOWN, Price
from formup.agent.providers.wire import Wire
from formup.tools.errors import ModelError

GO = User(text="go")
NAME = "openai-responses"
THOUGHT: dict[str, Any] = {
    "id": "rs_1",
    "type": "reasoning",
    "summary": [],
    "content": None,
    "encrypted_content": "gAAA",
}
KEPT = {name: value for name, value in THOUGHT.items() if value is not None}


def ask(model: Any, *messages: Any) -> Reply:
    async def asking() -> Reply:
        try:
            return await model.reply(Request("", messages, ()))
        finally:
            await model.aclose()

    return asyncio.run(asking())


def fails(model: Any) -> str:
    with pytest.raises(ModelError) as caught:
        ask(model, GO)
    return str(caught.value)


def ended(body: dict[str, Any], http: Any, streamed: bool) -> bytes:
    """A response with nothing but its end, streamed or not."""
    event = {"type": f"response.{body['status']}", "response": body, "sequence_number": 0}
    return http.stream([event]) if streamed else http.response(body)


def test_where_it_is_asked(server: Any, responses: Any, http: Any) -> None:
    server.script = [http.response(responses.body("x"))]
    ask(server.model(NAME), GO)
    assert server.paths == ["/v1/responses"]
    assert server.requests[0]["store"] is False


FAILURES = [
    ("rate_limit_exceeded", 4),
    ("server_error", 2),
    ("invalid_prompt", 1),
]


@pytest.mark.parametrize(("code", "times"), FAILURES)
def test_a_response_that_failed(
    code: str, times: int, server: Any, responses: Any, http: Any, streamed: bool
) -> None:
    failed = responses.body() | {"status": "failed", "error": {"code": code, "message": "No."}}
    server.script = [ended(failed, http, streamed)] * times
    assert "answered with an error (No)" in fails(server.model(NAME, streamed=streamed))
    assert len(server.requests) == times


def test_an_error_event_names_its_error_at_once(server: Any, responses: Any, http: Any) -> None:
    error = {"type": "error", "code": "invalid_prompt", "message": "No.", "param": None}
    server.script = [http.stream([*responses.events("half")[:3], error])]
    assert "answered with an error (No)" in fails(server.model(NAME, streamed=True))
    assert len(server.requests) == 1


def test_other_ends(server: Any, responses: Any, http: Any, streamed: bool) -> None:
    filtered = {"status": "incomplete", "incomplete_details": {"reason": "content_filter"}}
    server.script = [ended(responses.body("x") | filtered, http, streamed)]
    assert "refused (its provider's filter" in fails(server.model(NAME, streamed=streamed))
    failed = responses.body("x") | {"status": "failed"}
    server.script = [ended(failed, http, streamed)] * 4
    assert "broke its reply off (failed)" in fails(server.model(NAME, streamed=streamed))


def test_an_end_that_repeats_nothing(server: Any, responses: Any, http: Any) -> None:
    made: list[tuple[str, str, Any]] = [("a", "look", {"x": 1}), ("b", "look", {})]
    said = ("text", made, "calls")
    *events, last = responses.events(*said)
    last["response"]["output"] = []
    server.script = [http.stream([*events, {"type": "keepalive"}, last])]
    reply = ask(server.model(NAME, streamed=True), GO)
    assert reply.text == "text"
    assert [(c.id, c.arguments) for c in reply.calls] == [("a", {"x": 1}), ("b", {})]


ODD: list[Any] = [
    {"type": ["response"]},
    {"kind": "x"},
    {"type": "response.output_text.delta", "delta": 7},
    {"type": "response.output_text.delta"},
    {"type": "response.output_item.done"},
    {"type": "response.completed", "response": 7},
    {"type": "response.completed", "response": {"output": 7}},
    {"type": "response.completed", "response": {"output": [{"no": "type"}]}},
]


@pytest.mark.parametrize("event", ODD)
def test_other_shapes_are_foreign(event: Any, server: Any, http: Any) -> None:
    server.script = [http.stream([event])] * 2
    assert "answered with" in fails(server.model(NAME, streamed=True))


def test_arguments_that_are_not_json_go_back(
    server: Any, responses: Any, http: Any, streamed: bool
) -> None:
    made = ("", [("c1", "segment", '{"box": [1, 2')], "calls")
    whole, events = responses.body(*made), responses.events(*made)
    server.script = [http.stream(events) if streamed else http.response(whole)]
    (call,) = ask(server.model(NAME, streamed=streamed), GO).calls
    assert call.arguments == {"this is not a JSON object": '{"box": [1, 2'}


def test_writing_to_the_cache_has_a_price_with_some_models(responses: Any) -> None:
    old, new = Price(1, 0.1, 0, 10), Price(1, 0.1, 2, 10)
    for price, cost in ((old, 40 + 6 + 200), (new, 10 + 6 + 60 + 200)):
        reply = OpenAIResponses("m", price).reply(responses.body("x"), Request("", (GO,), ()))
        assert reply.usage.cost_usd == pytest.approx(cost / 1e6)


def with_thought(responses: Any, *said: Any, **more: Any) -> dict[str, Any]:
    body = responses.body(*said, **more)
    body["output"].insert(0, THOUGHT)
    return body


def test_thoughts_come_back_before_their_calls(
    server: Any, responses: Any, http: Any, streamed: bool
) -> None:
    body = with_thought(responses, "I look.", [("a", "look", {}), ("a", "look", {})])
    server.script = [ended(body, http, streamed), http.response(responses.body("done"))]
    model = server.model(NAME, streamed=streamed)
    reply = ask(model, GO)
    results = [Result(call_id=c.id, name=c.name, text="{}") for c in reply.calls]
    # A run that was stored and resumed knows them too.
    stored = HISTORY.validate_json(HISTORY.dump_json((GO, reply, *results)))
    assert stored == (GO, reply, *results)
    ask(model, *stored)
    _, thought, message, *rest = server.requests[1]["input"]
    assert (thought, message) == (KEPT, body["output"][1])
    assert [item["type"] for item in rest] == ["function_call"] * 2 + ["function_call_output"] * 2
    first, second, *answers = [item["call_id"] for item in rest]
    assert first != second
    assert answers == [first, second]


def test_what_holds_no_thought_is_not_kept(responses: Any) -> None:
    wire, request = OpenAIResponses("m", UNKNOWN), Request("", (GO,), ())
    plain = responses.body("x", [("a", "look", {})])
    assert wire.reply(plain, request).opaque is None
    # Without its content a thought is a mere reference to what no server has stored.
    body = with_thought(responses, "x")
    body["output"][0] = THOUGHT | {"encrypted_content": None}
    assert wire.reply(body, request).opaque is None
    body["output"][0] = {"id": "rs", "type": "reasoning", "content": [{"type": "reasoning_text"}]}
    assert wire.reply(body, request).opaque is not None
    plain["output"][0]["phase"] = "commentary"
    assert wire.reply(plain, request).opaque is not None


def test_a_model_that_does_not_think_is_asked_for_no_thoughts(
    server: Any, responses: Any, http: Any
) -> None:
    error = responses.error("Encrypted content is not supported with this model.")
    said = [http.response(responses.body("x"))] * 2
    server.script = [http.response(error, 400), *said]
    model = server.model(NAME)
    ask(model, GO)
    ask(model, GO)
    assert ["include" in sent for sent in server.requests] == [True, False, False]


def test_thoughts_that_a_server_cannot_read_are_left_out(
    server: Any, responses: Any, http: Any
) -> None:
    thoughtful = with_thought(responses, "x", [("a", "look", {})])
    error = responses.error("The encrypted content gAAA... could not be verified.")
    server.script = [
        http.response(thoughtful),
        http.response(error, 400),
        http.response(responses.body("done")),
    ]
    model = server.model(NAME)
    reply = ask(model, GO)
    ask(model, GO, reply, Result(call_id="a", name="look", text="{}"))
    _, refused, plain = (sent["input"] for sent in server.requests)
    assert KEPT in refused
    call = {"type": "function_call", "call_id": "a", "name": "look", "arguments": "{}"}
    assert plain[1:3] == [{"role": "assistant", "content": "x"}, call]


WIRES: list[Callable[[str, Price], Wire]] = [OpenAIChat, OpenAIResponses, Anthropic, Gemini]


@pytest.mark.parametrize("maker", [OpenAIResponses, Gemini])
def test_no_other_model_is_sent_what_is_opaque(
    maker: Callable[[str, Price], Wire], responses: Any, gemini: Any
) -> None:
    call: dict[str, Any] = {"id": "a", "name": "look", "args": {}}
    body = with_thought(responses, "", [("a", "look", {})])
    if maker is Gemini:
        body = gemini.frame([{"functionCall": call, "thoughtSignature": "gAAA"}], "STOP")
    reply = maker("m", UNKNOWN).reply(body, Request("", (GO,), ()))
    bare = Reply(calls=(Call(id="a", name="look", arguments={}),))
    assert reply.model_copy(update={"opaque": None, "usage": bare.usage}) == bare
    for kind in WIRES:
        for name in ("m", "n"):
            other = kind(name, UNKNOWN)
            same = (kind, name) == (maker, "m")
            sent, plain = (
                other.body(Request("", (GO, r), ()), stream=False) for r in (reply, bare)
            )
            assert (sent == plain) is not same
            assert (b"gAAA" in sent) is same
