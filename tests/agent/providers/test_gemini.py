"""What Gemini does otherwise than the rest: where it is asked, how it ends, what it wants back."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from formup.agent.messages import HISTORY, Call, Reply, Result, User
from formup.agent.model import Request
from formup.agent.providers.gemini import UNSIGNED, Gemini
from formup.agent.providers.prices import UNKNOWN, price_of
from formup.tools.errors import ModelError
from pydantic_core import from_json

Say = Callable[..., bytes]
GO = User(text="go")


def ask(model: Any, *messages: Any) -> Reply:
    async def asking() -> Reply:
        try:
            return await model.reply(Request("", messages, ()))
        finally:
            await model.aclose()

    return asyncio.run(asking())


def sent(model: str, *messages: Any) -> list[dict[str, Any]]:
    """The contents that a model is sent."""
    body = Gemini(model, UNKNOWN).body(Request("", messages, ()), stream=False)
    return from_json(body)["contents"]


PATHS = [
    ("m", "", "/v1beta/models/m:generateContent"),
    ("m", "/v1beta/", "/v1beta/models/m:generateContent"),
    ("m", "/v1", "/v1/models/m:generateContent"),
    ("m", "/google", "/google/v1beta/models/m:generateContent"),
    ("tunedModels/x", "", "/v1beta/tunedModels/x:generateContent"),
    ("a?key=b#c d", "", "/v1beta/models/a%3Fkey%3Db%23c%20d:generateContent"),
]


@pytest.mark.parametrize(("name", "base", "path"), PATHS)
def test_where_it_is_asked(name: str, base: str, path: str, server: Any, say: Say) -> None:
    from formup.agent.providers.remote import remote_model

    url = server.url.removesuffix("/v1") + base
    streamed = path.replace("generateContent", "streamGenerateContent?alt=sse")
    for show, expected in ((None, path), (print, streamed)):
        server.script = [http_reply("x")]
        ask(remote_model("gemini", name, url, show=show), GO)
        assert server.paths[-1] == expected


def http_reply(text: str) -> bytes:
    part = b'{"candidates":[{"content":{"parts":[{"text":"%b"}]}}]}' % text.encode()
    head = b"HTTP/1.1 200 X\r\ncontent-type: application/json\r\ncontent-length: "
    return head + b"%d\r\n\r\n" % len(part) + part


ENDS = [
    ("SAFETY", "refused (SAFETY)", 1),
    ("PROHIBITED_CONTENT", "refused (PROHIBITED_CONTENT)", 1),
    ("RECITATION", "refused (RECITATION)", 1),
    ("BLOCKLIST", "refused (BLOCKLIST)", 1),
    ("MAX_TOKENS", "cut its reply off", 1),
    ("CONTINUATION", "cut its reply off", 1),
    ("MALFORMED_FUNCTION_CALL", "broke its reply off (MALFORMED_FUNCTION_CALL)", 2),
    ("UNEXPECTED_TOOL_CALL", "broke its reply off (UNEXPECTED_TOOL_CALL)", 2),
    ("SOMETHING_NEW", "broke its reply off (SOMETHING_NEW)", 2),
]


@pytest.mark.parametrize(("reason", "words", "times"), ENDS)
def test_ends_that_are_none(
    reason: str, words: str, times: int, server: Any, gemini: Any, http: Any, streamed: bool
) -> None:
    said = gemini.frame([{"text": "half"}], reason)
    server.script = [http.stream([said]) if streamed else http.response(said)] * times
    with pytest.raises(ModelError) as caught:
        ask(server.model("gemini", streamed=streamed), GO)
    assert words in str(caught.value)
    assert len(server.requests) == times


def test_a_malformed_call_is_asked_for_again(server: Any, gemini: Any, http: Any) -> None:
    malformed = {"finishReason": "MALFORMED_FUNCTION_CALL", "index": 0}
    server.script = [
        http.response(gemini.frame([]) | {"candidates": [malformed]}),
        http.response(gemini.body("there")),
    ]
    assert ask(server.model("gemini"), GO).text == "there"


def test_a_blocked_prompt_is_a_refusal(server: Any, gemini: Any, http: Any, streamed: bool) -> None:
    blocked = {"promptFeedback": {"blockReason": "PROHIBITED_CONTENT"}, "usageMetadata": {}}
    server.script = [http.stream([blocked]) if streamed else http.response(blocked)]
    with pytest.raises(ModelError, match=r"refused \(PROHIBITED_CONTENT\)"):
        ask(server.model("gemini", streamed=streamed), GO)


def test_nothing_at_all_is_an_empty_reply(server: Any, gemini: Any, http: Any) -> None:
    server.script = [
        http.response({"usageMetadata": {"promptTokenCount": 7}}),
        http.response(gemini.frame([], "STOP")),
    ]
    with pytest.raises(ModelError, match="an empty reply"):
        ask(server.model("gemini"), GO)


def test_thoughts_are_no_text(server: Any, gemini: Any, http: Any, streamed: bool) -> None:
    parts = [{"text": "Hm, ", "thought": True}, {"text": "Yes"}, {"text": "."}]
    frames = [gemini.frame([part]) for part in parts] + [gemini.frame([], "STOP")]
    whole = gemini.frame(parts, "STOP")
    server.script = [http.stream(frames) if streamed else http.response(whole)]
    reply = ask(server.model("gemini", streamed=streamed), GO)
    assert (reply.text, reply.opaque) == ("Yes.", None)
    assert "".join(server.shown) == ("Yes." if streamed else "")


ODD: list[Any] = [
    {"candidates": 7},
    {"candidates": [7]},
    {"candidates": [{"content": {"parts": [7]}}]},
    {"candidates": [{"content": {"parts": [{"text": 7}]}}]},
    {"candidates": [{"content": {"parts": [{"functionCall": 7}]}, "finishReason": "STOP"}]},
    {"candidates": [{"content": 7}]},
    {"promptFeedback": 7},
    {"candidates": None},
]


@pytest.mark.parametrize("said", ODD)
def test_other_shapes_are_foreign(said: Any, server: Any, http: Any, streamed: bool) -> None:
    server.script = [http.stream([said]) if streamed else http.response(said)] * 2
    with pytest.raises(ModelError, match="answered with") as caught:
        ask(server.model("gemini", streamed=streamed), GO)
    assert "tried 2 times" in str(caught.value)


def test_the_wait_stands_in_the_error(server: Any, gemini: Any, http: Any) -> None:
    info = {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "21.5s"}
    details = [{"@type": "type.googleapis.com/google.rpc.Help"}, info]
    error: dict[str, Any] = gemini.error("slow down")
    error["error"]["details"] = details
    server.script = [
        http.response(error, 429),
        http.response([error], 429),
        http.response(error, 429, retry_after="3"),
        http.response(gemini.body("done")),
    ]
    assert ask(server.model("gemini"), GO).text == "done"
    first, second, third = server.pauses
    assert 21.5 <= first <= 23.7
    assert 21.5 <= second <= 23.7
    assert 3 <= third <= 3.3


@pytest.mark.parametrize("details", [7, [7], [{"retryDelay": 7}], [{"retryDelay": "soon"}], [{}]])
def test_a_wait_that_is_none(details: Any, server: Any, gemini: Any, http: Any) -> None:
    error: dict[str, Any] = gemini.error("busy")
    error["error"]["details"] = details
    server.script = [http.response(error, 503), http.response(gemini.body("done"))]
    assert ask(server.model("gemini"), GO).text == "done"
    assert 0 < server.pauses[0] <= 0.5


def test_an_error_in_a_list_is_read(server: Any, gemini: Any, http: Any) -> None:
    server.script = [http.response([gemini.error("API key not valid.")], 400)]
    with pytest.raises(ModelError, match=r"answered 400 \(API key not valid\)"):
        ask(server.model("gemini", streamed=True), GO)


def test_thoughts_cost_what_output_costs(gemini: Any) -> None:
    price = price_of("gemini", "gemini-2.5-pro")
    wire = Gemini("gemini-2.5-pro", price)
    usage = wire.reply(gemini.body("x"), Request("", (GO,), ())).usage
    assert (usage.input_tokens, usage.cached_tokens, usage.output_tokens) == (100, 60, 20)
    assert usage.cost_usd == pytest.approx((40 * 1.25 + 60 * 0.125 + 20 * 10) / 1e6)


SIGNED: list[dict[str, Any]] = [
    {"text": "I look. "},
    {"text": "Twice.", "thoughtSignature": "c2ln"},
    {"functionCall": {"name": "look", "args": {"x": 1}}, "thoughtSignature": "bmVk"},
    {"functionCall": {"id": "g2", "name": "look", "args": {}}},
]


def test_signed_parts_come_back_as_they_came(
    server: Any, gemini: Any, http: Any, streamed: bool
) -> None:
    frames = [gemini.frame([part]) for part in SIGNED] + [gemini.frame([{"text": ""}], "STOP")]
    whole = gemini.frame([*SIGNED, {"text": ""}], "STOP")
    server.script = [
        http.stream(frames) if streamed else http.response(whole),
        http.response(gemini.body("done")),
    ]
    model = server.model("gemini", streamed=streamed)
    reply = ask(model, GO)
    assert reply.text == "I look. Twice."
    first, second = reply.calls
    assert second.id == "g2"
    results = [Result(call_id=c.id, name=c.name, text="{}") for c in reply.calls]
    # A run that was stored and resumed knows them too.
    stored = HISTORY.validate_json(HISTORY.dump_json((GO, reply, *results)))
    assert stored == (GO, reply, *results)
    ask(model, *stored)
    _, said, answers = server.requests[1]["contents"]
    signed = SIGNED[2] | {"functionCall": SIGNED[2]["functionCall"] | {"id": first.id}}
    assert said["parts"] == [*SIGNED[:2], signed, SIGNED[3], {"text": ""}]
    ids = [part["functionResponse"]["id"] for part in answers["parts"]]
    assert ids == [first.id, "g2"]


def test_without_signatures_nothing_is_kept(gemini: Any) -> None:
    body = gemini.body("x", [("a", "look", {})])
    assert Gemini("m", UNKNOWN).reply(body, Request("", (GO,), ())).opaque is None


def test_calls_of_another_model_are_said_to_be_unsigned(gemini: Any) -> None:
    wire = Gemini("gemini-3-pro", UNKNOWN)
    other = wire.reply(gemini.frame(SIGNED, "STOP"), Request("", (GO,), ()))
    chat = Reply(calls=tuple(Call(id=i, name="look", arguments={}) for i in ("a", "b")))

    def signatures(model: str, reply: Reply) -> list[str | None]:
        (said,) = sent(model, reply)
        return [p.get("thoughtSignature") for p in said["parts"] if "functionCall" in p]

    for model in ("gemini-3.5-flash", "gemini-flash-latest"):
        assert signatures(model, chat) == signatures(model, other) == [UNSIGNED, None]
    for model in ("gemini-2.5-pro", "models/gemini-2.5-pro", "gemma-4-31b-it"):
        assert signatures(model, chat) == signatures(model, other) == [None, None]
    assert signatures("gemini-3-pro", other) == ["bmVk", None]


def test_what_says_nothing_is_left_out() -> None:
    assert sent("m", User(text=" "), Reply(), GO) == [{"role": "user", "parts": [{"text": "go"}]}]
