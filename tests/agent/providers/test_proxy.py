"""Proxies come from the environment, in every form people write them."""

import asyncio
from typing import Any

import pytest
from formup.agent.messages import User
from formup.agent.model import Request
from formup.agent.providers.remote import RemoteModel
from formup.tools.errors import ModelError

ELSEWHERE = "http://models.example/v1"
VARIABLES = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "NO_PROXY", "REQUEST_METHOD")


@pytest.fixture(autouse=True)
def no_proxies(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-0123456789")
    for variable in VARIABLES:
        monkeypatch.delenv(variable, raising=False)
        monkeypatch.delenv(variable.lower(), raising=False)


def said(model: RemoteModel) -> str:
    async def asking() -> str:
        try:
            return (await model.reply(Request("", (User(text="x"),), ()))).text
        finally:
            await model.aclose()

    return asyncio.run(asking())


@pytest.mark.parametrize("variable", ["HTTP_PROXY", "http_proxy", "ALL_PROXY"])
@pytest.mark.parametrize("scheme", ["http://", ""])
def test_a_proxy_is_asked_with_or_without_its_scheme(
    server: Any, openai: Any, http: Any, monkeypatch: Any, variable: str, scheme: str
) -> None:
    monkeypatch.setenv(variable, f"{scheme}127.0.0.1:{server.server_address[1]}")
    server.script = [http.response(openai.body("hello"))]
    assert said(server.model("openai", url=ELSEWHERE)) == "hello"
    assert server.paths == [f"{ELSEWHERE}/chat/completions"]
    assert server.headers[0]["host"] == "models.example"


@pytest.mark.parametrize("proxy", ["ftp://me:hunter2@x", "http://me:hunter2@x:y"])
def test_what_is_no_proxy_is_one_sentence(server: Any, monkeypatch: Any, proxy: str) -> None:
    monkeypatch.setenv("HTTP_PROXY", proxy)
    with pytest.raises(ModelError, match="through the proxy that the environment names") as caught:
        said(server.model("openai", url=ELSEWHERE))
    assert "hunter2" not in str(caught.value)
    assert not server.pauses


def test_no_proxy_is_asked_for_this_machine(
    server: Any, openai: Any, http: Any, monkeypatch: Any
) -> None:
    monkeypatch.setenv("HTTP_PROXY", "ftp://nowhere")
    server.script = [http.response(openai.body("hello"))]
    assert said(server.model("openai")) == "hello"


def test_hosts_named_in_no_proxy_are_asked_directly(
    server: Any, openai: Any, http: Any, monkeypatch: Any
) -> None:
    # An address of this machine that is none of its loopback ones.
    monkeypatch.setenv("HTTP_PROXY", "ftp://nowhere")
    monkeypatch.setenv("NO_PROXY", "0.0.0.0")
    url = server.url.replace("127.0.0.1", "0.0.0.0")
    server.script = [http.response(openai.body("hello"))]
    assert said(server.model("openai", url=url)) == "hello"
    assert server.paths == ["/v1/chat/completions"]
