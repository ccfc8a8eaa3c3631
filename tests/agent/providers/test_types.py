"""What is sent and what the tests' server says, held against the providers' own types."""

import json
import warnings
from collections.abc import Iterable
from typing import Any, cast

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Opaque, Reply, Result, User
from formup.agent.model import Request
from formup.agent.providers.anthropic import Anthropic
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.openai_responses import OpenAIResponses
from formup.agent.providers.prices import UNKNOWN
from formup.prompts import load_prompt
from formup.tools.builtin import TOOLS
from formup.tools.perception.image import picture_from_array
from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

WHY = "the provider's package of types is not installed: pip install 'formup[dev]'"
PICTURE = picture_from_array(np.full((60, 80, 3), 60, np.uint8))
PNG = b"\x89PNG\r\n\x1a\n..."
HISTORY = (
    User(text="see", images=(PNG,)),
    Reply(text="I look.", calls=(Call(id="a", name="look", arguments={"candidates": True}),)),
    Result(call_id="a", name="look", text="{}", images=(PNG,)),
    Reply(calls=(Call(id="b", name="measure", arguments={}),)),
    Result(call_id="b", name="measure", text="b: is missing.", error="arguments"),
)
REQUEST = Request(load_prompt("former@v001").text, HISTORY, TOOLS)


@pytest.fixture(scope="module", autouse=True)
def packages() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # theirs, at import
        pytest.importorskip("openai", reason=WHY)
        pytest.importorskip("anthropic", reason=WHY)


def drained(value: Any) -> Any:
    """A validated value with its lazy parts validated too."""
    if isinstance(value, dict):
        return {name: drained(part) for name, part in cast("dict[str, Any]", value).items()}
    if isinstance(value, Iterable) and not isinstance(value, str | bytes):
        return [drained(part) for part in cast("Iterable[Any]", value)]
    return value


def accepted(kind: Any, sent: Any) -> None:
    """Of the type, and without a field that it does not know."""
    adapter: TypeAdapter[Any] = TypeAdapter(kind)  # must outlive the lazy parts
    assert drained(adapter.validate_python(sent)) == sent


@pytest.mark.parametrize("stream", [False, True])
def test_openai_requests(stream: bool) -> None:
    from openai.types.chat import completion_create_params as params

    sent = from_json(OpenAIChat("m", UNKNOWN).body(REQUEST, stream=stream))
    kinds = (params.CompletionCreateParamsNonStreaming, params.CompletionCreateParamsStreaming)
    accepted(kinds[stream], sent)
    sent["messages"][1]["role"] = "pirate"
    with pytest.raises(ValidationError):
        accepted(kinds[stream], sent)


@pytest.mark.parametrize("stream", [False, True])
def test_responses_requests(stream: bool) -> None:
    from openai.types.responses import response_create_params as params

    thought: dict[str, Any]
    thought = {"id": "rs_1", "type": "reasoning", "summary": [], "encrypted_content": "gAAA"}
    call = {"type": "function_call", "call_id": "b", "name": "measure", "arguments": "{}"}
    opaque = Opaque(model="openai-responses:m", items=(thought, call))
    thoughtful = HISTORY[3].model_copy(update={"opaque": opaque})
    request = Request(REQUEST.system, (*HISTORY[:3], thoughtful, *HISTORY[4:]), TOOLS)
    sent = from_json(OpenAIResponses("m", UNKNOWN).body(request, stream=stream))
    kinds = (params.ResponseCreateParamsNonStreaming, params.ResponseCreateParamsStreaming)
    accepted(kinds[stream], sent)
    assert sent["input"][-3:-1] == [thought, call]
    sent["input"][0]["role"] = "pirate"
    with pytest.raises(ValidationError):
        accepted(kinds[stream], sent)


@pytest.mark.parametrize("stream", [False, True])
def test_anthropic_requests(stream: bool) -> None:
    from anthropic.types import message_create_params as params

    sent = from_json(Anthropic("m", UNKNOWN).body(REQUEST, stream=stream))
    kinds = (params.MessageCreateParamsNonStreaming, params.MessageCreateParamsStreaming)
    accepted(kinds[stream], sent)
    marks = str(sent).count("cache_control")
    assert 0 < marks <= 4
    sent["messages"][1]["content"][0]["type"] = "smell"
    with pytest.raises(ValidationError):
        accepted(kinds[stream], sent)


@pytest.mark.parametrize("dialect", ["openai", "openai-responses", "anthropic"], indirect=True)
def test_what_the_tests_server_says_is_what_the_providers_say(dialect: Any) -> None:
    from anthropic.types import Message, RawMessageStreamEvent
    from openai.types.chat import ChatCompletion, ChatCompletionChunk
    from openai.types.responses import Response, ResponseStreamEvent

    said = ("text", [("a", "look", {"x": 1})], "calls")
    whole, event = {
        "openai": (ChatCompletion, TypeAdapter[Any](ChatCompletionChunk)),
        "openai-responses": (Response, TypeAdapter[Any](ResponseStreamEvent)),
        "anthropic": (Message, TypeAdapter[Any](RawMessageStreamEvent)),
    }[dialect.name]
    whole.model_validate(dialect.body(*said))
    for data in dialect.events(*said):
        if data != "[DONE]" and data != {"type": "ping"}:
            event.validate_python(data)


def test_the_default_prompt_its_tools_and_the_picture_are_sent(
    server: Any, dialect: Any, say: Any
) -> None:
    server.script = [say("done")]
    Agent(server.model(dialect.name)).run(PICTURE, "Surround it with 4 robots")
    (sent,) = server.requests
    tools = sent["tools"][0].get("functionDeclarations") or sent["tools"]
    former = load_prompt("former")
    named = [tool.get("function", tool)["name"] for tool in tools]
    assert named == [t.name for t in TOOLS if t.name in former.tools]
    assert sorted(named) == sorted(former.tools)
    assert json.dumps(former.text)[1:-1] in json.dumps(sent)
    assert "/9j/" in str(sent)  # how every JPEG begins in base64
