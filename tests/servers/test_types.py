"""What servers that others wrote answer to formup, held against the providers' own types.

Not Gemini's: google-genai is too large a package to test with.
"""

import importlib
import warnings
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from formup.agent.messages import Call, Reply, Result, User
from formup.agent.model import Request
from formup.agent.providers.anthropic import Anthropic
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.openai_responses import OpenAIResponses
from formup.agent.providers.prices import UNKNOWN
from formup.tools.builtin import TOOLS
from pydantic import TypeAdapter

WHY = "the provider's package of types is not installed: pip install 'formup[dev]'"
CALLED = Reply(calls=(Call(id="c1", name="look", arguments={}),))
PERSON = (User(text="Surround the red thing with 6 robots"),)
TURNS = {"call": PERSON, "sentence": (*PERSON, CALLED, Result(call_id="c1", name="look", text="1"))}
TYPES = {
    "openai": (OpenAIChat, "openai.types.chat", "ChatCompletion", "ChatCompletionChunk"),
    "openai-responses": (
        OpenAIResponses,
        "openai.types.responses",
        "Response",
        "ResponseStreamEvent",
    ),
    "anthropic": (Anthropic, "anthropic.types", "Message", "RawMessageStreamEvent"),
}
PLACES = [
    "transformers-openai",
    "transformers-openai-responses",
    "litellm-openai",
    "litellm-anthropic",
]


def events(text: str) -> Iterator[str]:
    """Data of server-sent events, which these servers write on one line each."""
    for line in text.splitlines():
        if line.startswith("data: ") and line != "data: [DONE]":
            yield line.removeprefix("data: ")


@pytest.mark.parametrize("asked", PLACES, indirect=True)
@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_replies_are_of_the_providers_types(asked: Any, streamed: bool, turn: Any) -> None:
    made, package, whole, event = TYPES[asked.place.provider]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # theirs, at import
        pytest.importorskip(package.partition(".")[0], reason=WHY)
        types: Any = importlib.import_module(package)
    wire = made(asked.name, UNKNOWN)
    response = httpx.post(
        asked.url.removesuffix("/v1") + "/v1" + wire.path(stream=streamed).removeprefix("/v1"),
        content=wire.body(Request("You place robots.", turn, TOOLS), stream=streamed),
        headers={"content-type": "application/json"} | wire.headers(asked.server.key),
        trust_env=False,
        timeout=60,
    )
    assert response.status_code == 200
    if response.headers["content-type"].startswith("text/event-stream"):
        adapter: TypeAdapter[Any] = TypeAdapter(getattr(types, event))
        assert len([adapter.validate_json(data) for data in events(response.text)]) >= 3
        return
    assert not streamed
    getattr(types, whole).model_validate_json(response.content)
