"""What real servers do wrong, one row each: how often they are asked, and what a person reads."""

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.loop import run
from formup.agent.messages import User
from formup.agent.outcomes import Answered, Outcome, Stopped
from formup.agent.providers import transport
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.perception.image import picture_from_array

Say = Callable[..., bytes]
LOOK: tuple[str, str, dict[str, Any]] = ("c1", "locate_object", {})
PICTURE = picture_from_array(np.full((60, 80, 3), 60, np.uint8))


def go(model: Any) -> Outcome:
    async def closing() -> Outcome:
        try:
            return await run(model, TOOLS, Context.of(PICTURE), (User(text="go"),))
        finally:
            await model.aclose()

    return asyncio.run(closing())


def failed(outcome: Outcome, *words: str) -> str:
    """The run stopped for the model's sake, with one sentence that has these words."""
    assert isinstance(outcome, Stopped), outcome
    assert outcome.kind == "model"
    assert "\n" not in outcome.reason
    assert outcome.reason.endswith((".", "?"))
    assert outcome.reason.startswith("The model at http://127.0.0.1:")
    for word in words:
        assert word in outcome.reason
    return outcome.reason


REFUSED_AT_ONCE = [
    (301, "", ("301", "base URL")),
    (400, "content must not be null", ("400", "must not be null", "does not take such a request")),
    (401, "Incorrect API key", ("401", "Incorrect API key", "check the key in")),
    (403, "not in your country", ("403", "check the key in")),
    (404, "no model m", ("404", "model's name", "/v1")),
    (413, "too large", ("413", "too large for it")),
    (422, "extra fields not permitted", ("422", "extra fields", "does not take")),
]


@pytest.mark.parametrize(("status", "text", "words"), REFUSED_AT_ONCE)
def test_a_request_refused_is_not_repeated(
    status: int, text: str, words: tuple[str, ...], server: Any, dialect: Any, http: Any
) -> None:
    server.script = [http.response(dialect.error(text), status)]
    failed(go(server.model(dialect.name)), *words)
    assert len(server.requests) == 1


@pytest.mark.parametrize("status", [500, 502, 504])
def test_the_same_failure_twice_is_final(
    status: int, server: Any, dialect: Any, streamed: bool, http: Any
) -> None:
    server.script = [http.response(dialect.error("the same"), status)] * 2
    words = (str(status), "the same", "tried 2 times", "try again later")
    failed(go(server.model(dialect.name, streamed=streamed)), *words)
    assert len(server.pauses) == 1


def test_failures_that_differ_are_tried_four_times(server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.error(f"number {i}"), 500) for i in range(4)]
    failed(go(server.model(dialect.name)), "number 3", "tried 4 times")
    assert server.pauses == sorted(server.pauses)
    assert 0 < server.pauses[0] <= 0.5 < server.pauses[-1] <= 2


@pytest.mark.parametrize("status", [429, 503, 529])
def test_a_busy_server_is_asked_four_times(
    status: int, server: Any, dialect: Any, http: Any
) -> None:
    server.script = [http.response(dialect.error("busy"), status)] * 4
    failed(go(server.model(dialect.name)), str(status), "busy", "tried 4 times")


def test_retry_after_is_honoured(server: Any, dialect: Any, say: Say, http: Any) -> None:
    past = "Wed, 21 Oct 2015 07:28:00 GMT"
    server.script = [
        http.response(dialect.error("slow down"), 429, retry_after="7"),
        http.response(dialect.error("slow down"), 429, retry_after=past),
        http.response(dialect.error("slow down"), 429, retry_after="soon"),
        say("done"),
    ]
    outcome = go(server.model(dialect.name))
    assert isinstance(outcome, Answered)
    first, second, third = server.pauses
    assert 7 <= first <= 7.7
    assert second == 0
    assert 0 < third <= 2


def test_too_long_a_wait_is_left_to_the_person(server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.error("slow"), 429, retry_after="3600")]
    failed(go(server.model(dialect.name)), "429", "3600 s")
    assert not server.pauses


@pytest.mark.parametrize("dialect", ["openai", "openai-responses", "anthropic"], indirect=True)
def test_an_empty_account_is_not_asked_again(server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.error("No money", "insufficient_quota"), 429)]
    failed(go(server.model(dialect.name)), "No money", "billing")


SHAPES: list[tuple[object, str]] = [
    ({"error": "model not found"}, "(model not found)"),
    ({"error": {"message": "bad\r\n\tthing\x1b[31m"}}, "(bad thing [31m)"),
    ({"detail": [{"loc": ["body", "x"], "msg": "extra"}]}, '"extra"'),
    ({"object": "error", "message": "an old server"}, "(an old server)"),
    ({"error": {"message": "x" * 5_000}}, "x..."),
    ({"error": {"message": {"odd": 1}, "code": 7}}, '{"odd": 1}'),
    (["odd"], "answered 400:"),
    ("plain", "(plain)"),
    (b"Bad \xff Request", "(Bad"),
    (b"<html><h1>Nope</h1></html>", "answered 400:"),
    (b"", "answered 400:"),
]


@pytest.mark.parametrize(("body", "words"), SHAPES)
def test_error_bodies_of_all_shapes_are_read(
    body: object, words: str, server: Any, http: Any
) -> None:
    server.script = [http.response(body, 400)]
    reason = failed(go(server.model("openai")), words)
    assert len(reason) < 500


def test_an_error_under_status_200(server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.error("no such model", "not_found_error"))]
    failed(go(server.model(dialect.name)), "error (no such model)", "model's name")
    server.script = [http.response(dialect.error("full", "overloaded_error"))] * 4
    failed(go(server.model(dialect.name)), "error (full)", "tried 4 times")
    server.script = [http.response({"error": {"message": "upstream", "code": 502}})] * 2
    failed(go(server.model(dialect.name)), "error (upstream)", "tried 2 times")
    server.script = [http.response({"error": {"message": "odd", "code": "9" * 5_000}})] * 2
    failed(go(server.model(dialect.name)), "error (odd)", "tried 2 times")


def test_an_error_within_a_stream(server: Any, dialect: Any, http: Any) -> None:
    begun = dialect.events("half of it")[:4]
    server.script = [
        http.stream([*begun, dialect.error("full", "overloaded_error")]),
        http.stream(dialect.events("whole")),
    ]
    outcome = go(server.model(dialect.name, streamed=True))
    assert isinstance(outcome, Answered)
    assert outcome.text == "whole"
    assert None in server.shown


NO_REPLIES: list[object] = [
    b"<html>a login page</html>",
    b'{"half": ',
    {"hello": 1},
    [],
    7,
    None,
    {"choices": []},
    {"choices": [{}]},
    {"choices": [{"message": {"content": 7}}]},
    {"content": "x"},
]


@pytest.mark.parametrize("body", NO_REPLIES)
def test_what_is_no_reply_is_said_to_be_none(
    body: object, server: Any, dialect: Any, http: Any
) -> None:
    server.script = [http.response(body)] * 2
    failed(go(server.model(dialect.name)), "answered with something that is", "base URL")


@pytest.mark.parametrize("event", ["{", "[]", "7", '{"choices": 7, "type": 7}'])
def test_a_stream_of_something_else(event: str, server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.stream([event])] * 2
    failed(go(server.model(dialect.name, streamed=True)), "answered with")


def test_an_empty_reply_is_asked_for_once_more(server: Any, dialect: Any, say: Say) -> None:
    server.script = [say(""), say("there")]
    assert isinstance(go(server.model(dialect.name)), Answered)
    server.script = [say(""), say("  \n")]
    failed(go(server.model(dialect.name)), "an empty reply", "tried 2 times")


def test_a_reply_cut_off_is_not_acted_on(server: Any, dialect: Any, say: Say) -> None:
    server.script = [say("half", [LOOK], stop="cut")]
    outcome = go(server.model(dialect.name))
    failed(outcome, "cut its reply off")
    assert len(outcome.messages) == 1


def test_a_refusal_is_passed_on(server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.refusal())]
    failed(go(server.model(dialect.name)), "refused (I will not)")


def test_dropped_connections(server: Any, dialect: Any, say: Say, streamed: bool) -> None:
    half = say("hello", [LOOK])[:-9]
    server.script = [b"", half, b"HTTP/1.1 nonsense\r\n\r\n", say("done")]
    outcome = go(server.model(dialect.name, streamed=streamed))
    assert isinstance(outcome, Answered)
    assert outcome.text == "done"
    server.script = [b"", half, b"", half]
    failed(go(server.model(dialect.name)), "dropped the connection", "tried 4 times")


def test_a_connection_dropped_later_loses_no_messages(
    server: Any, dialect: Any, say: Say, streamed: bool, http: Any
) -> None:
    broken = http.stream(dialect.events("a long story"), cut=4)
    server.script = [say("", [LOOK], "calls"), *[broken] * 4]
    outcome = go(server.model(dialect.name, streamed=streamed))
    failed(outcome, "dropped the connection before its reply was complete")
    assert [m.role for m in outcome.messages] == ["user", "assistant", "tool"]
    assert server.shown.count(None) == (3 if streamed else 0)
    server.script = [say("done")]
    again = asyncio.run(resumed(server.model(dialect.name), outcome))
    assert isinstance(again, Answered)


async def resumed(model: Any, outcome: Outcome) -> Outcome:
    try:
        return await run(model, TOOLS, Context.of(PICTURE), outcome.messages)
    finally:
        await model.aclose()


def test_a_reply_complete_before_the_drop_counts(server: Any, http: Any, dialect: Any) -> None:
    events = dialect.events("all there")
    server.script = [http.stream(events, cut=len(events) - dialect.spare)]
    outcome = go(server.model(dialect.name, streamed=True))
    assert isinstance(outcome, Answered)
    assert outcome.text == "all there"


def test_a_stream_that_ends_early_in_good_order_is_no_reply(
    server: Any, http: Any, dialect: Any
) -> None:
    half = dialect.events("half of it", [LOOK])[:5]
    server.script = [http.stream(half)] * 4
    outcome = go(server.model(dialect.name, streamed=True))
    failed(outcome, "dropped the connection before its reply was complete")
    assert len(outcome.messages) == 1


def test_nobody_listens(server: Any, dialect: Any) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}"
    outcome = go(server.model(dialect.name, url=url))
    failed(outcome, "could not be reached", "tried 2 times", "is it running")


def test_a_silent_server(
    server: Any, dialect: Any, streamed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "SILENCE_S", 0.05)
    server.script = [b"silence"] * 2
    failed(go(server.model(dialect.name, streamed=streamed)), "sent nothing", "tried 2 times")


def test_an_endless_answer(server: Any, http: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "MAX_BYTES", 1_000)
    server.script = [http.response(b"x" * 1_001)]
    failed(go(server.model("openai")), "more than")


@pytest.mark.parametrize("written", ['{"box": [1, 2', "[1, 2]", "no", '{"x": NaN}', '"\\ud800"'])
def test_arguments_that_are_not_json_go_back(
    written: str, server: Any, http: Any, openai: Any, streamed: bool
) -> None:
    made = ("", [("c1", "segment", written)], "calls")
    first = http.stream(openai.events(*made)) if streamed else http.response(openai.body(*made))
    server.script = [first, http.response(openai.body("sorry"))]
    outcome = go(server.model("openai", streamed=streamed))
    assert isinstance(outcome, Answered)
    result = server.requests[1]["messages"][-1]
    assert result["role"] == "tool"
    assert "this is not a JSON object" in result["content"]


def test_the_same_nonsense_twice_stops_the_run(server: Any, dialect: Any, say: Say) -> None:
    server.script = [say("", [("a", "fly", {})], "calls"), say("", [("b", "fly", {})], "calls")]
    outcome = go(server.model(dialect.name))
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "repeat"


def test_a_failed_run_is_reported_as_failed(server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.error("no"), 400)]
    report = Agent(server.model(dialect.name)).run(PICTURE, "Surround it with 4 robots").report
    assert (report.status, report.exit_code) == ("failed", 4)
    assert "answered 400 (no)" in report.message
