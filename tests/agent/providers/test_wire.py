"""A history with everything in it, as it goes over each provider's wire, to the letter."""

import base64
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from formup.agent.messages import Call, History, Reply, Result, User
from formup.agent.model import Request
from formup.agent.providers.anthropic import Anthropic
from formup.agent.providers.calls import CallIds, arguments_of
from formup.agent.providers.gemini import Gemini
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.openai_responses import OpenAIResponses
from formup.agent.providers.prices import UNKNOWN, Price
from formup.agent.providers.transport import Events
from formup.agent.providers.wire import Wire, safe_name
from formup.tools.builtin import TOOLS
from hypothesis import given
from hypothesis import strategies as st
from pydantic_core import from_json

ODD_ID = CallIds("another")("b c")
"""What an id becomes that servers may refuse and that no model of theirs made."""
PNG, JPEG = b"\x89PNG\r\n\x1a\n...", b"\xff\xd8\xff..."
PNG_TEXT, JPEG_TEXT = (base64.b64encode(image).decode() for image in (PNG, JPEG))
HISTORY: History = (
    User(text="see", images=(JPEG,)),
    Reply(text=" "),
    User(text="well?"),
    Reply(
        calls=(
            Call(id="a", name="look", arguments={}),
            Call(id="b c", name="functions.x", arguments={"k": "ü"}),
        )
    ),
    Result(call_id="a", name="look", text="{}", images=(PNG,)),
    Result(call_id="b c", name="functions.x", text="no", error="unknown_tool"),
    Reply(text="Hm."),
    User(text="go on"),
)


def text(words: str) -> dict[str, Any]:
    return {"type": "text", "text": words}


def url(kind: str, data: str) -> dict[str, Any]:
    return {"type": "image_url", "image_url": {"url": f"data:image/{kind};base64,{data}"}}


def image(kind: str, data: str) -> dict[str, Any]:
    source = {"type": "base64", "media_type": f"image/{kind}", "data": data}
    return {"type": "image", "source": source}


def test_openai() -> None:
    sent = from_json(OpenAIChat("m", UNKNOWN).body(Request("Be brief.", HISTORY, ()), stream=False))
    functions = [
        {"name": "look", "arguments": "{}"},
        {"name": "functions_x", "arguments": '{"k":"\\u00fc"}'},
    ]
    calls = [
        {"id": id, "type": "function", "function": function}
        for id, function in zip(("a", ODD_ID), functions, strict=True)
    ]
    shown = [text("What look shows (a):"), url("png", PNG_TEXT)]
    assert sent == {
        "model": "m",
        "messages": [
            {"role": "system", "content": "Be brief."},
            {"role": "user", "content": [text("see"), url("jpeg", JPEG_TEXT)]},
            {"role": "assistant", "content": " "},
            {"role": "user", "content": "well?"},
            {"role": "assistant", "content": "", "tool_calls": calls},
            {"role": "tool", "tool_call_id": "a", "content": "{}"},
            {"role": "tool", "tool_call_id": ODD_ID, "content": "no"},
            {"role": "assistant", "content": "OK."},
            {"role": "user", "content": shown},
            {"role": "assistant", "content": "Hm."},
            {"role": "user", "content": "go on"},
        ],
    }


def test_anthropic() -> None:
    request = Request("Be brief.", HISTORY, TOOLS[:2])
    sent = from_json(Anthropic("m", UNKNOWN).body(request, stream=False))
    mark = {"cache_control": {"type": "ephemeral"}}
    uses: list[dict[str, Any]] = [
        {"type": "tool_use", "id": "a", "name": "look", "input": {}},
        {"type": "tool_use", "id": ODD_ID, "name": "functions_x", "input": {"k": "ü"}},
    ]
    failed = {"tool_use_id": ODD_ID, "is_error": True, "content": [text("no")]}
    shown = [text("{}"), image("png", PNG_TEXT)]
    results = [
        {"type": "tool_result", "tool_use_id": "a", "content": shown},
        {"type": "tool_result"} | failed | mark,
    ]
    assert [tool["name"] for tool in sent.pop("tools")] == [tool.name for tool in TOOLS[:2]]
    assert sent == {
        "model": "m",
        "max_tokens": 8192,
        "system": [text("Be brief.") | mark],
        "messages": [
            {"role": "user", "content": [image("jpeg", JPEG_TEXT), text("see"), text("well?")]},
            {"role": "assistant", "content": uses},
            {"role": "user", "content": results},
            {"role": "assistant", "content": [text("Hm.")]},
            {"role": "user", "content": [text("go on") | mark]},
        ],
    }


def test_responses() -> None:
    request = Request("Be brief.", HISTORY, ())
    sent = from_json(OpenAIResponses("m", UNKNOWN).body(request, stream=True))
    calls = [
        {"type": "function_call", "call_id": id, "name": name, "arguments": arguments}
        for id, name, arguments in (
            ("a", "look", "{}"),
            (ODD_ID, "functions_x", '{"k":"\\u00fc"}'),
        )
    ]

    def shown(words: str, kind: str, data: str) -> list[dict[str, str]]:
        url = f"data:image/{kind};base64,{data}"
        image = {"type": "input_image", "detail": "auto", "image_url": url}
        return [{"type": "input_text", "text": words}, image]

    output = {"type": "function_call_output"}
    assert sent == {
        "model": "m",
        "store": False,
        "include": ["reasoning.encrypted_content"],
        "instructions": "Be brief.",
        "input": [
            {"role": "user", "content": shown("see", "jpeg", JPEG_TEXT)},
            {"role": "user", "content": "well?"},
            *calls,
            output | {"call_id": "a", "output": shown("{}", "png", PNG_TEXT)},
            output | {"call_id": ODD_ID, "output": "no"},
            {"role": "assistant", "content": "Hm."},
            {"role": "user", "content": "go on"},
        ],
        "stream": True,
    }


def test_gemini() -> None:
    request = Request("Be brief.", HISTORY, TOOLS[:2])
    sent = from_json(Gemini("gemini-2.5-pro", UNKNOWN).body(request, stream=True))

    def part(kind: str, data: str) -> dict[str, Any]:
        return {"inlineData": {"mimeType": f"image/{kind}", "data": data}}

    calls: list[dict[str, Any]] = [
        {"functionCall": {"id": "a", "name": "look", "args": {}}},
        {"functionCall": {"id": "b c", "name": "functions.x", "args": {"k": "ü"}}},
    ]
    answers: list[dict[str, Any]] = [
        {"functionResponse": {"id": "a", "name": "look", "response": {"output": "{}"}}},
        part("png", PNG_TEXT),
        {"functionResponse": {"id": "b c", "name": "functions.x", "response": {"error": "no"}}},
    ]
    declared = [
        {"name": t.name, "description": t.description, "parametersJsonSchema": t.offered}
        for t in TOOLS[:2]
    ]
    assert sent == {
        "systemInstruction": {"parts": [{"text": "Be brief."}]},
        "tools": [{"functionDeclarations": declared}],
        "contents": [
            {"role": "user", "parts": [part("jpeg", JPEG_TEXT), {"text": "see"}]},
            {"role": "user", "parts": [{"text": "well?"}]},
            {"role": "model", "parts": calls},
            {"role": "user", "parts": answers},
            {"role": "model", "parts": [{"text": "Hm."}]},
            {"role": "user", "parts": [{"text": "go on"}]},
        ],
    }


def test_without_a_prompt_the_tools_carry_the_mark() -> None:
    request = Request("", HISTORY, TOOLS)
    sent = from_json(Anthropic("m", UNKNOWN).body(request, stream=False))
    assert "system" not in sent
    assert ["cache_control" in tool for tool in sent["tools"]] == [False] * (len(TOOLS) - 1) + [
        True
    ]


@pytest.mark.parametrize(
    ("kind", "turns"),
    [
        (OpenAIChat, "messages"),
        (OpenAIResponses, "input"),
        (Anthropic, "messages"),
        (Gemini, "contents"),
    ],
)
def test_a_longer_history_begins_like_the_shorter(
    kind: Callable[[str, Price], Wire], turns: str
) -> None:
    """Providers cache by what a request begins with."""
    wire = kind("m", UNKNOWN)
    ends = (4, 6, 8)  # where it is the model's turn
    bodies = [wire.body(Request("s", HISTORY[:end], TOOLS), stream=False) for end in (1, *ends)]
    texts = [b.replace(b',"cache_control":{"type":"ephemeral"}', b"") for b in bodies]
    starts = [
        t[t.index(b'"%b"' % turns.encode()) :].partition(b',"tools"')[0].rstrip(b"]}")
        for t in texts
    ]
    for shorter, longer in pairwise(starts):
        assert longer.startswith(shorter)


@given(st.lists(st.text(alphabet="abü☃ ", min_size=1)), st.integers(1, 7), st.sampled_from("rn"))
def test_events_come_whole_however_they_are_cut(texts: list[str], size: int, kind: str) -> None:
    end = "\r\n" if kind == "r" else "\n"
    lines = [f"event: x{end}data: {t.strip() or 'x'}{end}: comment{end}{end}" for t in texts]
    stream, events = "".join(lines).encode(), Events()
    cut = [stream[i : i + size] for i in range(0, len(stream), size)]
    found = [event.decode() for chunk in cut for event in events.feed(chunk)]
    assert found == [t.strip() or "x" for t in texts]


@given(st.text())
def test_arguments_of_any_text_are_an_object(written: str) -> None:
    assert isinstance(arguments_of(written), dict)


def test_arguments_of_every_form() -> None:
    assert arguments_of('{"a": 1}') == arguments_of({"a": 1}) == {"a": 1}
    assert arguments_of("") == arguments_of(" ") == arguments_of(None) == arguments_of("null") == {}
    for odd in ("[" * 5_000, '{"a": 1} {"b": 2}', "7", '{"a": Infinity}'):
        assert list(arguments_of(odd)) == ["this is not a JSON object"]


@given(st.text())
def test_names_are_safe(name: str) -> None:
    assert 1 <= len(safe_name(name)) <= 64
    assert safe_name(name).isascii()
    assert safe_name(safe_name(name)) == safe_name(name)
