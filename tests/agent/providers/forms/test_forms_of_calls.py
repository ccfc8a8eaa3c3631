"""Calls in the forms that models and servers give them, read to what they mean everywhere."""

import json
from typing import Any

import pytest
from formup.agent.messages import Result, User
from formup.agent.model import Request
from formup.agent.providers.anthropic import Anthropic
from formup.agent.providers.calls import arguments_of, calls_in_text, find_tool
from formup.agent.providers.gemini import Gemini
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.openai_responses import OpenAIResponses
from formup.agent.providers.prices import UNKNOWN
from formup.tools.builtin import TOOLS

PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}
TEXT = json.dumps(PLAN)
NESTED = {name: json.dumps(value) for name, value in PLAN.items()}
DEEPER = PLAN | {"targets": [{"id": "t1", "box": "[55, 35, 125, 95]"}]}
GROUP = PLAN["contract"]["groups"][0] | {"clearance": None, "fit": None, "shape": None}
NULLS = {
    "contract": {"groups": [GROUP], "keep_out": None, "robot_radius": None},
    "targets": [PLAN["targets"][0] | {"points": None, "straight": None}],
    "positions": None,
}
ARGUMENTS: dict[str, Any] = {
    "an object": PLAN,
    "text": TEXT,
    "text of text": json.dumps(TEXT),
    "objects as text": NESTED,
    "objects as text in text": json.dumps(NESTED),
    "a list as text, deeper": DEEPER,
    "objects in fences": {name: f"```json\n{text}\n```" for name, text in NESTED.items()},
    "nulls": NULLS,
    "nulls in text": json.dumps(NULLS),
    "a fence": f"```json\n{TEXT}\n```",
    "an empty object first": "{}" + TEXT,
    "twice the same": TEXT + TEXT,
    "a closing tag left": f"{TEXT}\n</tool_call>",
    "special tokens left": f"{TEXT}<|im_end|>",
}


@pytest.mark.parametrize("form", ARGUMENTS)
def test_arguments_of_every_form(
    form: str, server: Any, dialect: Any, forms: Any, http: Any, streamed: bool
) -> None:
    body = dialect.body("", [("a", "propose_formation", ARGUMENTS[form])], "calls")
    if dialect.name in ("openai", "openai-responses") and not isinstance(ARGUMENTS[form], str):
        body = as_object(dialect.name, body, ARGUMENTS[form])
    events = forms.events(dialect, body)
    server.script = [http.stream(events) if streamed else http.response(body)]
    (call,) = forms.ask(server.model(dialect.name)).calls
    assert (call.name, call.arguments) == ("propose_formation", PLAN)


def as_object(name: str, body: Any, arguments: dict[str, Any]) -> Any:
    """A body of OpenAI's whose arguments are no text."""
    if name == "openai":
        body["choices"][0]["message"]["tool_calls"][0]["function"]["arguments"] = arguments
    else:
        body["output"][0]["arguments"] = arguments
    return body


def test_words_stay_words_and_needed_nulls_stay() -> None:
    look, propose = find_tool("segment", TOOLS), find_tool("propose_formation", TOOLS)
    assert arguments_of({"label": '{"a": 1}', "id": "[1]"}, look) == {
        "label": '{"a": 1}',
        "id": "[1]",
    }
    assert arguments_of({"contract": None, "samples": None}, propose) == {"contract": None}
    assert arguments_of({"contract": "not JSON", "targets": "{"}, propose) == {
        "contract": "not JSON",
        "targets": "{",
    }
    assert arguments_of({"x": None, "y": "[1]"}) == {"x": None, "y": "[1]"}


NAMES = [
    "look",
    "functions.look",
    "functions.look:0",
    "look:3",
    "default_api.look",
    "default_api:look",
    "tools/look",
    "mcp__formup__look",
    "functions_look",
    "look<|channel|>commentary",
    "look()",
    "to=functions.look",
    "look#1",
]


@pytest.mark.parametrize("name", [*NAMES, " look\n", "`look`"])
def test_names_with_what_models_put_around_them(
    name: str, dialect: Any, say: Any, server: Any, forms: Any
) -> None:
    server.script = [say("", [("a", name, {})], "calls")]
    (call,) = forms.ask(server.model(dialect.name)).calls
    assert call.name == "look"


OTHERS = [
    "fly",
    "overlook",
    "look.fly",
    "looks",
    "dont_deploy",
    "deploy.cancel",
    "look2",
    "",
    "look at",
]


@pytest.mark.parametrize("name", OTHERS)
def test_other_names_are_not_a_tools(name: str) -> None:
    assert find_tool(name, TOOLS) is None


LOOK = '{"name": "look", "arguments": {}}'
IN_TEXT: list[tuple[str, str, int]] = [
    (f"[{LOOK}, {LOOK}]", "", 2),
    (f"{LOOK}\n{LOOK}", "", 2),
    (f"<tool_call>\n{LOOK}\n</tool_call>\n<tool_call>\n{LOOK}\n</tool_call>", "", 2),
    (f"I look.\n<tool_call>\n{LOOK}\n</tool_call>", "I look.", 1),
    (f"{LOOK}\n</tool_call>", "", 1),
    (f"hm {{}}\n</think>\n\n{LOOK}", "", 1),
    (f"hm\n</think>\nI look.\n<tool_call>{LOOK}", "I look.", 1),
    (f"[TOOL_CALLS][{LOOK}]", "", 1),
    ('{"type": "function", "function": {"name": "look", "arguments": "{}"}}', "", 1),
    ('{"name": "functions.look", "parameters": {}}', "", 1),
]
NOT_CALLS = [
    f"Write <tool_call>{LOOK}</tool_call> to look.",
    f"<tool_call>{LOOK}</tool_call> is how one looks.",
    f"For example:\n```json\n{LOOK}\n```",
    f'[{LOOK}, {{"name": "fly", "arguments": {{}}}}]',
    f"{LOOK} {{}}",
    "[]",
    "[7]",
    "8",
    '"look"',
    "<tool_call></tool_call>",
    "[" * 3_000,
]


@pytest.mark.parametrize(("text", "said", "number"), IN_TEXT)
def test_calls_that_a_text_is(
    text: str, said: str, number: int, dialect: Any, say: Any, server: Any, forms: Any
) -> None:
    server.script = [say(text)]
    reply = forms.ask(server.model(dialect.name))
    assert reply.text == said
    assert [(c.name, c.arguments) for c in reply.calls] == [("look", {})] * number


@pytest.mark.parametrize("text", NOT_CALLS)
def test_texts_that_only_hold_a_call(
    text: str, dialect: Any, say: Any, server: Any, forms: Any
) -> None:
    assert calls_in_text(text, TOOLS) is None
    server.script = [say(text)]
    reply = forms.ask(server.model(dialect.name))
    assert (reply.text, reply.calls) == (text, ())


def test_thoughts_beside_calls_in_the_text_are_no_calls(
    dialect: Any, server: Any, forms: Any, http: Any, streamed: bool
) -> None:
    body = forms.with_thought(dialect, forms.thoughts[dialect.name][0], LOOK)
    events = forms.events(dialect, body)
    server.script = [http.stream(events) if streamed else http.response(body)]
    server.script.append(http.response(dialect.body("done")))
    reply = forms.ask(server.model(dialect.name))
    result = Result(call_id=reply.calls[0].id, name="look", text="{}")
    forms.ask(server.model(dialect.name), User(text="go"), reply, result)
    calls, results = forms.ids(dialect, server.requests[1])
    assert calls == results == [reply.calls[0].id]


def part(name: str | None, arguments: Any, **more: Any) -> dict[str, Any]:
    """A fragment of a call; index and id where they are given."""
    named = {} if name is None else {"name": name}
    return more | {"function": named | ({} if arguments is None else {"arguments": arguments})}


BOX = '{"box": [1, 2, 3, 4]}'
FRAGMENTS: dict[str, list[dict[str, Any]]] = {
    "one index, new ids": [
        part("look", "{}", index=0, id="a"),
        part("segment", BOX[:9], index=0, id="b"),
        part(None, BOX[9:], index=0),
    ],
    "one index, no ids": [
        part("look", "{}", index=0),
        part("segment", BOX[:9], index=0),
        part(None, BOX[9:], index=0),
    ],
    "no index": [
        part("look", "{}", id="a"),
        part("segment", BOX[:9], id="b"),
        part(None, BOX[9:]),
    ],
    "neither": [part("look", "{}"), part("segment", BOX[:9]), part(None, BOX[9:])],
    "fragments that cross": [
        part("look", "", index=0, id="a"),
        part("segment", BOX[:9], index=0, id="b"),
        part(None, "{}", index=0, id="a"),
        part(None, BOX[9:], index=0, id="b"),
    ],
    "another id with every fragment": [
        part("look", "{}", index=0, id="a"),
        part("segment", BOX[:9], index=1, id="b"),
        part(None, BOX[9:], index=1, id="c"),
    ],
    "names in parts, or again and again": [
        part("lo", "", index=0, id="a"),
        part("ok", None, index=0),
        part(None, "{}", index=0),
        part("segment", BOX[:9], index=1, id="b"),
        part("segment", BOX[9:], index=1, id="b"),
    ],
    "an empty object first": [
        part("look", "{}", index=0, id="a"),
        part("look", "{}", index=0),
        part("segment", "{}", index=1, id="b"),
        part(None, BOX, index=1),
    ],
    "an id that comes later": [
        part("look", "{}", index=0),
        part("segment", "", index=1),
        part(None, BOX, index=1, id="b"),
    ],
    "objects": [part("look", {}, index=0, id="a"), part("segment", json.loads(BOX), index=1)],
}


@pytest.mark.parametrize("fragments", FRAGMENTS)
def test_fragments_of_calls_in_a_chat(fragments: str, server: Any, forms: Any, http: Any) -> None:
    chunks = [{"choices": [{"delta": {"tool_calls": [f]}}]} for f in FRAGMENTS[fragments]]
    server.script = [http.stream([*chunks, {"choices": [{"finish_reason": "stop"}]}])]
    reply = forms.ask(server.model("openai", streamed=True))
    made = [(c.name, c.arguments) for c in reply.calls]
    assert made == [("look", {}), ("segment", json.loads(BOX))]


def test_alike_calls_without_ids_are_two(server: Any, forms: Any, http: Any) -> None:
    fragments = [part("segment", BOX, index=0), part("segment", BOX, index=0)]
    chunks = [{"choices": [{"delta": {"tool_calls": [f]}}]} for f in fragments]
    server.script = [http.stream([*chunks, "[DONE]"])]
    assert len(forms.ask(server.model("openai")).calls) == 2


@pytest.mark.parametrize("dialect", ["openai", "gemini"], indirect=True)
@pytest.mark.parametrize("first", ["", "I look."])
def test_calls_in_a_later_choice(
    first: str, dialect: Any, server: Any, forms: Any, http: Any, streamed: bool
) -> None:
    field = "choices" if dialect.name == "openai" else "candidates"
    bodies = [dialect.body(first), dialect.body("", [("a", "look", {"region": [0, 0, 9, 9]})])]
    whole = bodies[0] | {field: [b[field][0] | {"index": n} for n, b in enumerate(bodies)]}
    events: list[Any] = []
    for number, body in enumerate(bodies):
        for event in forms.events(dialect, body):
            events.append(event | {field: [event[field][0] | {"index": number}]})
    server.script = [http.stream(events) if streamed else http.response(whole)]
    reply = forms.ask(server.model(dialect.name))
    assert [(c.name, c.arguments) for c in reply.calls] == [("look", {"region": [0, 0, 9, 9]})]


ENDS: list[tuple[str, dict[str, Any]]] = [
    ("arguments in fragments alone", {"added": True, "done": False}),
    ("the item at its beginning and end", {"added": True, "done": True}),
    ("the item at its end alone", {"added": False, "done": True}),
]


@pytest.mark.parametrize(("how", "sent"), ENDS)
def test_responses_whose_end_repeats_nothing(
    how: str, sent: dict[str, Any], server: Any, responses: Any, forms: Any, http: Any
) -> None:
    events = responses.events("I look.", [("a", "segment", json.loads(BOX))], "calls")
    kept = [
        e
        for e in events
        if (sent["added"] or e["type"] != "response.output_item.added")
        and (sent["done"] or e["type"] != "response.output_item.done")
    ]
    kept[-1] = kept[-1] | {"response": kept[-1]["response"] | {"output": []}}
    server.script = [http.stream(kept)]
    reply = forms.ask(server.model("openai-responses"))
    assert reply.text == "I look."
    assert [(c.name, c.arguments) for c in reply.calls] == [("segment", json.loads(BOX))]


def test_an_input_that_comes_with_its_block(
    server: Any, anthropic: Any, forms: Any, http: Any
) -> None:
    block = {"type": "tool_use", "id": "a", "name": "segment", "input": json.loads(BOX)}
    events = forms.events(anthropic, anthropic.body("x"))
    events[1:-1] = [{"type": "content_block_start", "index": 0, "content_block": block}]
    server.script = [http.stream(events)]
    (call,) = forms.ask(server.model("anthropic")).calls
    assert call.arguments == json.loads(BOX)


@pytest.mark.parametrize("wire", [OpenAIChat, OpenAIResponses, Anthropic, Gemini])
def test_without_tools_what_is_written_is_read(wire: Any, dialects: Any) -> None:
    spoken = wire("m", UNKNOWN)
    provider = spoken._ids.owner.partition(":")[0]
    body = dialects[provider].body("", [("a", "functions.look", {"x": None})], "calls")
    (call,) = spoken.reply(body, Request("", (User(text="go"),), ())).calls
    assert (call.name, call.arguments) == ("functions.look", {"x": None})
