"""Names, keys and base URLs: one sentence for every mistake, and keys in none of them."""

import asyncio
import json
from pathlib import Path
from typing import Any, cast

import formup
import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.model import Request
from formup.agent.providers.endpoint import endpoint
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.prices import UNKNOWN, price_of
from formup.agent.providers.registry import model_named
from formup.agent.providers.remote import remote_model
from formup.agent.providers.wire import MessageCache
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.errors import InputError, ModelError
from formup.tools.perception.image import picture_from_array

KEY = "sk-very-secret-0123456789"
URL = "https://models.example/v1"
PICTURE = picture_from_array(np.full((60, 80, 3), 60, np.uint8))


@pytest.fixture(autouse=True)
def no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY", "GEMINI_API_KEY", "GOOGLE_API_KEY"):
        monkeypatch.delenv(variable, raising=False)
        monkeypatch.delenv(f"{variable}_FILE", raising=False)


@pytest.mark.parametrize("name", ["gpt-9", "openai", "openai:", "gemini: ", "groq:x", ":x", ""])
def test_unknown_names_list_those_there_are(name: str) -> None:
    with pytest.raises(InputError, match=r"offline, openai:NAME, .*gemini:NAME, ollama:NAME"):
        model_named(name)


@pytest.mark.parametrize("provider", ["openai", "anthropic", "gemini"])
def test_a_missing_key_is_one_sentence(provider: str) -> None:
    variable = f"{provider.upper()}_API_KEY"
    with pytest.raises(InputError, match=f"set {variable}, or {variable}_FILE"):
        model_named(f"{provider}:m")


def test_no_key_is_needed_on_this_machine() -> None:
    assert model_named("ollama:llama3.2:3b").name == "ollama:llama3.2:3b"
    for host in ("127.0.0.1:8000", "localhost", "[::1]:1"):
        assert model_named("openai:m", f"http://{host}/v1").name == "openai:m"
    with pytest.raises(InputError, match="No key"):
        model_named("openai:m", "http://localhost.example/v1")


BAD_URLS = [
    *("", "models.example", "ftp://x/v1", "http://", "http://x:99999", "http://[", "http://x y"),
    *("https://x/v1?key=1", "https://x/#a", "http://x\n", "http://ü.example"),
]


@pytest.mark.parametrize("url", BAD_URLS)
def test_a_bad_base_url_is_one_sentence(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    with pytest.raises(InputError, match=r"base URL|more than a path") as caught:
        endpoint(url, "OPENAI_API_KEY")
    assert "\n" not in str(caught.value)


def test_a_base_url_with_a_password_is_not_repeated() -> None:
    with pytest.raises(InputError) as caught:
        endpoint("https://me:hunter2@models.example/v1", "OPENAI_API_KEY")
    assert "hunter2" not in str(caught.value)


def test_a_base_url_goes_with_a_name() -> None:
    with pytest.raises(InputError, match="offline rules"):
        Agent("offline", base_url=URL)
    with pytest.raises(InputError, match="object"):
        Agent(ScriptedModel([]), base_url=URL)


def test_keys_come_from_the_variable_or_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "key").write_text(f"  {KEY}\n")
    monkeypatch.setenv("OPENAI_API_KEY_FILE", str(tmp_path / "key"))
    assert endpoint(URL, "OPENAI_API_KEY").key == KEY
    monkeypatch.setenv("OPENAI_API_KEY", "sk-other")
    assert endpoint(URL, "OPENAI_API_KEY").key == "sk-other"


@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe", b"a b", b"a\nb", "ü".encode()])
def test_a_key_file_that_holds_none(
    content: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "key"
    if content is not None:
        path.write_bytes(content)
    monkeypatch.setenv("OPENAI_API_KEY_FILE", str(path))
    with pytest.raises(InputError, match="OPENAI_API_KEY_FILE names") as caught:
        endpoint(URL, "OPENAI_API_KEY")
    assert "a b" not in str(caught.value)


def test_the_key_of_gemini_has_either_of_two_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "key").write_text("from-a-file")
    names = ("GEMINI_API_KEY", "GOOGLE_API_KEY")
    monkeypatch.setenv("GOOGLE_API_KEY_FILE", str(tmp_path / "key"))
    assert endpoint(URL, *names).key == "from-a-file"
    assert "GOOGLE_API_KEY" in endpoint(URL, *names).key_advice
    monkeypatch.setenv("GOOGLE_API_KEY", "google")
    assert endpoint(URL, *names).key == "google"
    monkeypatch.setenv("GEMINI_API_KEY", KEY)
    assert endpoint(URL, *names).key == KEY


def test_a_key_that_cannot_be_sent_is_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-täglich")
    with pytest.raises(InputError, match="OPENAI_API_KEY") as caught:
        endpoint(URL, "OPENAI_API_KEY")
    assert "sk-" not in str(caught.value)


def test_the_key_is_sent_and_appears_nowhere_else(
    server: Any, dialect: Any, http: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(dialect.variable, KEY)
    server.script = [http.response(dialect.error(f"Incorrect API key provided: {KEY}"), 401)]
    model, trace = server.model(dialect.name), tmp_path / "trace.jsonl"
    run = Agent(model).run(PICTURE, "Surround it with 4 robots", trace=trace)
    sent = server.headers[0]
    names = ("authorization", "x-api-key", "x-goog-api-key")
    assert [KEY in sent[name] for name in names if name in sent] == [True]
    assert f"check the key in {dialect.variable}" in run.report.message
    texts = [run.report.model_dump_json(), trace.read_text(), json.dumps(server.requests)]
    texts += server.paths
    texts += [
        repr(run.outcome),
        repr(model),
        str(vars(cast("object", model))),
        repr(endpoint(URL, dialect.variable)),
    ]
    assert not [text for text in texts if KEY in text]


def test_errors_carry_no_request_with_them(
    server: Any, openai: Any, http: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    server.script = [b""] * 4

    async def asking() -> None:
        model = server.model("openai")
        try:
            await model.reply(Request("", (formup.User(text="x"),), ()))
        finally:
            await model.aclose()

    with pytest.raises(ModelError) as caught:
        asyncio.run(asking())
    assert caught.value.__cause__ is None
    assert caught.value.__suppress_context__


def test_an_ollama_server_gets_no_key(
    server: Any, openai: Any, http: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    server.script = [http.response(openai.body("hello"))]
    report = Agent(server.model("ollama")).run(PICTURE, "Surround it with 4 robots").report
    assert report.message == "hello"
    assert "authorization" not in server.headers[0]


def test_a_prompt_is_chosen_by_name_or_replaced(server: Any) -> None:
    assert Agent(server.model("openai"), prompt="former@v001").prompt is not None
    own = Agent(server.model("openai"), system="You are mine.")
    assert (own.prompt, own.system) == (None, "You are mine.")
    assert Agent(ScriptedModel([])).prompt is None
    assert Agent().prompt is None
    with pytest.raises(InputError, match="former@v001"):
        Agent(server.model("openai"), prompt="nobody@v001")


def test_prices_by_name_with_and_without_a_date() -> None:
    price = price_of("openai", "gpt-4o-mini")
    assert price_of("openai", "gpt-4o-mini-2024-07-18") == price
    assert price_of("anthropic", "claude-sonnet-4-5-20250929") != UNKNOWN
    assert price_of("ollama", "gpt-4o-mini") == UNKNOWN
    assert price_of("openai", "gpt-4o-mini-tts") == UNKNOWN
    assert price.cost(fresh=1_000_000, cached=0, output=0) == pytest.approx(0.15)
    assert price.cost(fresh=0, cached=2_000_000, output=1_000_000) == pytest.approx(0.75)


def test_another_server_has_no_known_price(
    server: Any, openai: Any, http: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    request = Request("", (formup.User(text="x"),), ())
    body = openai.body("hello")

    async def asking() -> float:
        model = remote_model("openai", "gpt-4o", server.url)
        reply = await model.reply(request)
        await model.aclose()
        return reply.usage.cost_usd

    server.script = [http.response(body)]
    assert asyncio.run(asking()) == 0
    own = OpenAIChat("gpt-4o", price_of("openai", "gpt-4o")).reply(body, request)
    assert own.usage.cost_usd == pytest.approx((40 * 2.5 + 60 * 1.25 + 20 * 10) / 1e6)


def fresh(message: object) -> object:
    return object()


def test_what_is_rendered_goes_with_its_message() -> None:
    once: MessageCache[object] = MessageCache(fresh)
    message = formup.User(text="x")
    assert once(message) is once(message)
    other = formup.User(text="x")
    assert once(other) is not once(message)
    del message, other
    assert not vars(once)["_known"]


def test_the_environment_names_another_server(
    server: Any, dialect: Any, http: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = {"anthropic": "ANTHROPIC_BASE_URL", "gemini": "GOOGLE_GEMINI_BASE_URL"}
    monkeypatch.setenv(names.get(dialect.name, "OPENAI_BASE_URL"), server.url)
    server.script = [http.response(dialect.body("hello"))]
    run = Agent(f"{dialect.name}:m").run(PICTURE, "Surround it with 4 robots")
    assert run.report.message == "hello"
    assert run.report.usage.cost_usd == 0
