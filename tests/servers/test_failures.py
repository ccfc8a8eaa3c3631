"""What a person reads when a server that others wrote refuses: one sentence, with its own words."""

from typing import Any

import pytest
from formup.agent.messages import User
from formup.agent.model import Request
from formup.agent.providers.endpoint import endpoint
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.prices import UNKNOWN
from formup.agent.providers.remote import RemoteModel
from formup.agent.providers.transport import Transport
from formup.tools.builtin import TOOLS
from formup.tools.errors import ModelError

ASKED = Request("You place robots.", (User(text="Surround the red thing"),), TOOLS)
WITH_KEYS = ["litellm-openai", "litellm-anthropic", "litellm-gemini"]


def failure(asked: Any, model: RemoteModel, request: Request = ASKED) -> str:
    with pytest.raises(ModelError) as raised:
        asked.ask(model, request)
    sentence = str(raised.value)
    assert sentence.startswith(f"The model at {asked.url} answered ")
    assert "\n" not in sentence
    return sentence


def test_an_unknown_model(asked: Any, streamed: bool) -> None:
    sentence = failure(asked, asked.model("nobody", streamed=streamed))
    assert "answered 400 (" in sentence
    assert "nobody" in sentence


def test_a_request_without_messages(asked: Any, streamed: bool) -> None:
    sentence = failure(asked, asked.model(streamed=streamed), Request("", (), ()))
    assert "answered 500 (" in sentence
    assert sentence.endswith("(tried 2 times): try again later.")


@pytest.mark.parametrize("asked", WITH_KEYS, indirect=True)
def test_a_wrong_key(asked: Any, streamed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = asked.server.key[::-1].replace("-ks", "")
    monkeypatch.setenv(asked.place.key_in, f"sk-{wrong}")
    # It looks other keys up in a database, which is not there.
    sentence = failure(asked, asked.model(streamed=streamed))
    assert "answered 400 (No connected db)" in sentence
    assert wrong not in sentence


class Talkative(OpenAIChat):
    def body(self, request: Any, *, stream: bool) -> bytes:
        return super().body(request, stream=stream)[:-1] + b',"nonsense":1}'


@pytest.mark.parametrize("asked", ["transformers-openai"], indirect=True)
def test_a_field_that_the_server_does_not_know(asked: Any) -> None:
    transport = Transport(endpoint(asked.url), f"{asked.url}/chat/completions", {})
    model = RemoteModel("openai:scripted", Talkative("scripted", UNKNOWN), transport)
    sentence = failure(asked, model)
    assert "answered 422 (Unexpected fields in the request: {'nonsense'})" in sentence
