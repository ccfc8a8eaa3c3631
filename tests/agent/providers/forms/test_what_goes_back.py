"""What a provider needs back goes back as it came, to the model it came from and to no other."""

from itertools import pairwise
from typing import Any

import pytest
from formup.agent.messages import HISTORY, Call, Reply, Result, User
from formup.agent.model import Request
from formup.agent.providers.calls import MOST_ID, CallIds
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.prices import UNKNOWN
from formup.tools.errors import ModelError
from pydantic_core import from_json

GO = User(text="go")
CALLS: list[tuple[str, str, dict[str, Any]]] = [("a", "look", {}), ("b", "locate_object", {})]
LONG = "call_" + "x" * 90
COUNTS = {"openai": 4, "anthropic": 3, "openai-responses": 2, "gemini": 2}
KINDS = [(name, number) for name, count in COUNTS.items() for number in range(count)]


def answered(reply: Reply) -> tuple[Any, ...]:
    """A history in which a reply's calls have results, stored and read again."""
    results = [Result(call_id=c.id, name=c.name, text="{}") for c in reply.calls]
    return HISTORY.validate_json(HISTORY.dump_json((GO, reply, *results)))


@pytest.mark.parametrize(("dialect", "number"), KINDS, indirect=["dialect"])
def test_thoughts_come_back_as_they_came(
    dialect: Any,
    number: int,
    dialects: Any,
    server: Any,
    forms: Any,
    http: Any,
    streamed: bool,
) -> None:
    thought = forms.thoughts[dialect.name][number]
    body = forms.with_thought(dialect, thought, "I look.", CALLS, "calls")
    events = http.stream(forms.events(dialect, body))
    server.script = [events if streamed else http.response(body)]
    server.script.append(http.response(dialect.body("done")))
    reply = forms.ask(server.model(dialect.name, streamed=streamed))
    assert [(c.id, c.name, c.arguments) for c in reply.calls] == [
        (c.id, name, arguments) for c, (_, name, arguments) in zip(reply.calls, CALLS, strict=True)
    ]
    assert reply.text == "I look."
    history = answered(reply)
    forms.ask(server.model(dialect.name), *history)
    first, *_ = forms.items(dialect, server.requests[1])
    assert {k: v for k, v in first.items() if k in thought} == thought
    if dialect.name != "openai":
        assert first == thought
    # Another server is another provider, whatever it calls its model.
    other = next(name for name in forms.thoughts if name != dialect.name)
    plain = answered(reply.model_copy(update={"opaque": None}))
    for name, at in ((dialect.name, server.url.replace("127.0.0.1", "localhost")), (other, "")):
        pair = [http.response(dialect.body("x") if at else dialects[name].body("x"))] * 2
        server.script, before = pair, len(server.requests)
        for each in (history, plain):
            forms.ask(server.model(name, url=at), *each)
        assert server.requests[before] == server.requests[before + 1]


def test_a_signature_stays_with_its_call(
    server: Any, openai: Any, forms: Any, http: Any, streamed: bool
) -> None:
    body = openai.body("", [*CALLS, ("c", "look", {})], "calls")
    made = body["choices"][0]["message"]["tool_calls"]
    made[0]["extra_content"] = {"google": {"thought_signature": "c2ln"}}
    made[1]["function"]["thought_signature"] = "bmVk"
    events = forms.events(openai, body)
    last = {"choices": [{"index": 0, "delta": {"tool_calls": [{"extra_content": {"x": 1}}]}}]}
    events.insert(-1, last)  # alone, without index or id: it belongs to the last call
    server.script = [http.stream(events) if streamed else http.response(body)]
    server.script.append(http.response(openai.body("done")))
    forms.ask(server.model("openai"), *answered(forms.ask(server.model("openai"))))
    sent = forms.items(openai, server.requests[1])[0]["tool_calls"]
    assert sent[0]["extra_content"] == {"google": {"thought_signature": "c2ln"}}
    assert "extra_content" not in sent[1]
    assert sent[1]["function"]["thought_signature"] == "bmVk"
    assert sent[2].get("extra_content") == ({"x": 1} if streamed else None)


IDS = [(f"{LONG}-one", f"{LONG}-two"), ("functions.look:0", "functions.locate_object:1")]


@pytest.mark.parametrize("ids", IDS, ids=["long", "odd"])
def test_ids_come_back_whatever_they_look_like(
    ids: tuple[str, str],
    server: Any,
    dialect: Any,
    dialects: Any,
    forms: Any,
    http: Any,
    say: Any,
) -> None:
    made = [(id, name, arguments) for id, (_, name, arguments) in zip(ids, CALLS, strict=True)]
    server.script = [say("", made, "calls"), http.response(dialect.body("done"))]
    history = answered(forms.ask(server.model(dialect.name)))
    forms.ask(server.model(dialect.name), *history)
    assert forms.ids(dialect, server.requests[1]) == ([*ids], [*ids])
    # Another model, which might refuse such ids, gets plain ones.
    wire = OpenAIChat("other", UNKNOWN)
    sent = from_json(wire.body(Request("", history, ()), stream=False))
    calls, results = forms.ids(dialects["openai"], sent)
    assert calls == results
    assert len(set(calls)) == 2
    assert all(len(id) <= MOST_ID and id.isascii() for id in calls)


def test_plain_thoughts_are_sent_beside_calls_alone(forms: Any, openai: Any) -> None:
    wire, request = OpenAIChat("m", UNKNOWN), Request("", (GO,), ())
    signed = {"reasoning": "hm", "reasoning_details": [{"type": "reasoning.text", "text": "hm"}]}
    reply = wire.reply(forms.with_thought(openai, signed, "Done."), request)
    assert reply.opaque is not None
    assert reply.opaque.items == ({"reasoning_details": signed["reasoning_details"]},)
    plain = wire.reply(forms.with_thought(openai, {"reasoning_content": "hm"}, "Done."), request)
    assert plain.opaque is None


@pytest.mark.parametrize(
    "content",
    [
        "<think>hm</think>\nI look.",
        [
            {"type": "thinking", "thinking": [{"type": "text", "text": "hm"}]},
            {"type": "text", "text": "I look."},
        ],
    ],
)
def test_thoughts_within_the_content_come_back_in_it(
    content: Any, server: Any, openai: Any, forms: Any, http: Any, streamed: bool
) -> None:
    body = openai.body("x", CALLS, "calls")
    body["choices"][0]["message"]["content"] = content
    events = http.stream(forms.events(openai, body))
    server.script = [events if streamed else http.response(body)]
    server.script.append(http.response(openai.body("done")))
    reply = forms.ask(server.model("openai"))
    assert reply.text == "I look."
    forms.ask(server.model("openai"), *answered(reply))
    assert forms.items(openai, server.requests[1])[0]["content"] == content


def test_fields_that_a_server_refuses_by_name_are_left_out(
    server: Any, openai: Any, forms: Any, http: Any
) -> None:
    thought = {"reasoning_content": "hm", "thinking_blocks": [{"type": "thinking"}]}
    body = forms.with_thought(openai, thought, "", CALLS, "calls")
    for call in body["choices"][0]["message"]["tool_calls"]:
        call["extra_content"] = {"x": 1}
    refusals = [f"property '{name}' is unsupported" for name in (*thought, "extra_content")]
    server.script = [http.response(body)]
    server.script += [http.response(openai.error(refusal), 400) for refusal in refusals]
    server.script += [http.response(openai.body("done"))] * 2
    model = server.model("openai")
    history = answered(forms.ask(model))
    forms.ask(model, *history)
    forms.ask(model, *history)
    sent = [forms.items(openai, request)[0] for request in server.requests[1:]]
    left = [[k for k in thought if k in m] for m in sent]
    assert left == [[*thought], ["thinking_blocks"], [], [], []]
    assert ["extra_content" in m["tool_calls"][0] for m in sent] == [True] * 3 + [False] * 2


def test_a_server_that_wants_what_is_lost_is_not_asked_for_ever(
    server: Any, openai: Any, forms: Any, http: Any
) -> None:
    body = forms.with_thought(openai, {"reasoning_content": "hm"}, "", CALLS, "calls")
    server.script = [
        http.response(body),
        *[http.response(openai.error("no reasoning_content"), 400)] * 2,
    ]
    model = server.model("openai")
    history = answered(forms.ask(model))
    with pytest.raises(ModelError, match="answered 400"):
        forms.ask(model, *history)


DETAILS: dict[str, tuple[list[dict[str, Any]], list[dict[str, Any]]]] = {
    "by index": (
        [
            {"type": "reasoning.text", "text": "Two ", "index": 0},
            {"type": "reasoning.encrypted", "data": "aa", "index": 1},
            {"type": "reasoning.text", "text": "rings.", "index": 0, "signature": None},
            {"type": "reasoning.text", "signature": "c2ln", "index": 0},
        ],
        [
            {"type": "reasoning.text", "text": "Two rings.", "index": 0, "signature": "c2ln"},
            {"type": "reasoning.encrypted", "data": "aa", "index": 1},
        ],
    ),
    "in a row": (
        [
            {"type": "reasoning.text", "text": "Two "},
            {"type": "reasoning.text", "text": "rings."},
            {"type": "reasoning.text", "signature": "c2ln"},
            {"type": "reasoning.text", "text": "Go."},
            {"type": "reasoning.encrypted", "data": "aa"},
            {"type": "reasoning.encrypted", "data": "bb"},
        ],
        [
            {"type": "reasoning.text", "text": "Two rings.", "signature": "c2ln"},
            {"type": "reasoning.text", "text": "Go."},
            {"type": "reasoning.encrypted", "data": "aa"},
            {"type": "reasoning.encrypted", "data": "bb"},
        ],
    ),
}


@pytest.mark.parametrize("kind", DETAILS)
def test_fragments_of_signed_thoughts_are_joined(
    kind: str, server: Any, openai: Any, forms: Any, http: Any
) -> None:
    fragments, whole = DETAILS[kind]
    events = [{"choices": [{"index": 0, "delta": {"reasoning_details": [f]}}]} for f in fragments]
    calls = forms.events(openai, openai.body("", CALLS, "calls"))
    server.script = [http.stream([*events, *calls]), http.response(openai.body("done"))]
    forms.ask(server.model("openai"), *answered(forms.ask(server.model("openai"))))
    assert forms.items(openai, server.requests[1])[0]["reasoning_details"] == whole


PNG = b"\x89PNG\r\n\x1a\n..."


def test_roles_are_in_the_order_that_strict_servers_take() -> None:
    look = Reply(calls=(Call(id="a", name="look", arguments={}),))
    seen = Result(call_id="a", name="look", text="{}", images=(PNG,))
    told = Result(call_id="a", name="look", text="{}", message="Done.")
    wire = OpenAIChat("m", UNKNOWN)
    for history in (
        (GO, look, seen),
        (GO, look, seen, GO),
        (GO, look, told, GO),
        (GO, GO, look, seen, look.model_copy(), told, GO, User(text="x", images=(PNG,))),
    ):
        sent = from_json(wire.body(Request("s", history, ()), stream=False))
        roles = [m["role"] for m in sent["messages"]]
        follows = {("tool", "user"), ("user", "user"), ("user", "tool")}
        assert not follows & set(pairwise(roles))
        assert roles[-1] in ("user", "tool")
        said = str(sent)
        assert said.count("'image_url': {") == sum(
            len(m.images) for m in history if not isinstance(m, Reply)
        )


def test_ids_of_others_stay_apart() -> None:
    ids = CallIds("me")
    given = ["b c", "b_c", "b.c", "x" * 41, "x" * 42, "ü"]
    assert len({ids(id) for id in given}) == len(given)
    assert ids("b_c") == "b_c"
