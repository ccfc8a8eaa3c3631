"""Bodies and streams in the forms that servers and proxies give them; keys within them."""

import json
from collections.abc import Callable
from typing import Any

import pytest
from formup.agent.providers.endpoint import MOST_KEY, Endpoint, endpoint
from formup.tools.errors import InputError, ModelError

SSE, JSON = "text/event-stream", "application/json"
KEY = "sk-very-secret-0123456789"
LOOK: list[tuple[str, str, dict[str, Any]]] = [("a", "look", {"region": [0, 0, 9, 9]})]


def lines(events: list[Any], end: str = "\n") -> str:
    """Events as a stream's text."""
    return "".join(
        f"data: {event if isinstance(event, str) else json.dumps(event)}{end}{end}"
        for event in events
    )


def pretty(body: Any) -> bytes:
    return json.dumps(body, indent=1).encode()


Form = Callable[[list[Any], Any], tuple[bytes, str]]
FORMS: dict[str, Form] = {
    "LF": lambda events, body: (lines(events).encode(), SSE),
    "CR LF": lambda events, body: (lines(events, "\r\n").encode(), SSE),
    "CR": lambda events, body: (lines(events, "\r").encode(), SSE),
    "no last blank line": lambda events, body: (lines(events).rstrip().encode(), SSE),
    "a mark at the beginning": lambda events, body: (b"\xef\xbb\xbf" + lines(events).encode(), SSE),
    "empty data": lambda events, body: (f"data:\n\ndata: \n\n{lines(events)}".encode(), SSE),
    "empty objects": lambda events, body: (f"data: {{}}\n\n{lines(events)}".encode(), SSE),
    "comments": lambda events, body: (f": hi\n\n:\n\n{lines(events)}: ping\n\n".encode(), SSE),
    "names, ids and times": lambda events, body: (
        lines(events).replace("data:", "event: x\nid: 1\nretry: 9\ndata:").encode(),
        SSE,
    ),
    "without spaces": lambda events, body: (lines(events).replace("data: ", "data:").encode(), SSE),
    "a stream typed as JSON": lambda events, body: (lines(events).encode(), JSON),
    "a stream typed as text": lambda events, body: (lines(events).encode(), "text/plain"),
    "JSON typed as a stream": lambda events, body: (json.dumps(body).encode(), SSE),
    "JSON in lines typed as a stream": lambda events, body: (pretty(body), SSE),
    "JSON with a mark": lambda events, body: (b"\xef\xbb\xbf" + pretty(body), JSON),
    "JSON after blanks": lambda events, body: (b"\n \n" + pretty(body), JSON),
    "all in one event": lambda events, body: (lines([body]).encode(), SSE),
    "events as a list": lambda events, body: (
        json.dumps([e for e in events if e != "[DONE]"]).encode(),
        JSON,
    ),
    "the list typed as a stream": lambda events, body: (
        json.dumps([e for e in events if e != "[DONE]"]).encode(),
        SSE,
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_reply_is_read_in_every_form(
    form: str, server: Any, dialect: Any, forms: Any, streamed: bool
) -> None:
    said = ("Look: ü", LOOK, "calls")
    body, kind = FORMS[form](dialect.events(*said), dialect.body(*said))
    server.script = [forms.raw(body, kind)]
    reply = forms.ask(server.model(dialect.name, streamed=streamed))
    assert reply.text == "Look: ü"
    assert [(c.id, c.name, c.arguments) for c in reply.calls] == LOOK
    assert reply.usage.input_tokens == 100
    assert "".join(server.shown) == ("Look: ü" if streamed else "")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_an_event_cut_in_its_midst_is_no_end(
    end: str, server: Any, dialect: Any, forms: Any
) -> None:
    whole = lines(dialect.events("Look", LOOK, "calls")[: -dialect.spare - 1], end).rstrip()
    server.script = [forms.raw(whole[:-9].encode(), SSE)] * 4
    with pytest.raises(ModelError, match="dropped the connection"):
        forms.ask(server.model(dialect.name))


@pytest.mark.parametrize("body", [b"", b": ping\n\n", b"data: {}\n\n", b"data:\n\n"])
def test_a_stream_without_events_is_no_reply(
    body: bytes, server: Any, dialect: Any, forms: Any
) -> None:
    server.script = [forms.raw(body, SSE)] * 4
    with pytest.raises(ModelError, match="dropped the connection"):
        forms.ask(server.model(dialect.name))


def test_a_list_that_ends_early_is_no_reply(server: Any, dialect: Any, forms: Any) -> None:
    events = [e for e in dialect.events("Look", LOOK, "calls") if e != "[DONE]"][:3]
    server.script = [forms.raw(json.dumps(events).encode(), JSON)] * 4
    with pytest.raises(ModelError, match="dropped the connection"):
        forms.ask(server.model(dialect.name))


@pytest.mark.parametrize("kind", [SSE, JSON])
def test_an_error_in_a_list_or_without_its_blank_line(
    kind: str, server: Any, dialect: Any, forms: Any
) -> None:
    error = json.dumps(dialect.error("no such model", "not_found_error"))
    for body in (f"[{error}]", f"data: {error}", error):
        server.script = [forms.raw(body.encode(), kind)]
        with pytest.raises(ModelError, match="no such model"):
            forms.ask(server.model(dialect.name))


def test_a_key_that_comes_back_is_masked(
    server: Any,
    dialect: Any,
    say: Any,
    forms: Any,
    http: Any,
    streamed: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(dialect.variable, KEY)
    calls = [(KEY, f"look_{KEY}", {KEY: [f"a {KEY}"]})]
    server.script = [say(f"Your key is {KEY}, {KEY[:5]} is not.", calls, "calls")]
    reply = forms.ask(server.model(dialect.name, streamed=streamed))
    assert KEY not in repr(reply)
    assert reply.text == f"Your key is [key], {KEY[:5]} is not."
    assert reply.calls[0].arguments == {"[key]": ["a [key]"]}
    assert "".join(server.shown) == (reply.text if streamed else "")
    thought = {
        k: KEY if isinstance(v, str) and k not in ("type", "id") else v
        for k, v in forms.thoughts[dialect.name][0].items()
    }
    server.script = [http.response(forms.with_thought(dialect, thought, "x", LOOK))]
    assert KEY not in repr(forms.ask(server.model(dialect.name)))


def test_words_that_are_no_secret_are_not_masked() -> None:
    assert Endpoint("http://x", "none", "").masked({"text": "none"}) == {"text": "none"}


SECRET = "hunter2"
URLS = [
    f"https://me:{SECRET}@models.example/v1",
    f"HTTPS://me:{SECRET}@models.example/v1",
    f"me:{SECRET}@models.example/v1",
    f"//me:{SECRET}@models.example",
    f"https:/me:{SECRET}@models.example",
    f"https:\\\\me:{SECRET}@models.example",
    f"https:///me:{SECRET}@models.example",
    f"https://me:{SECRET}%40models.example/v1",
    f"https://me:{SECRET}%2540models.example/v1",
    f"https://me:{SECRET}＠models.example/v1",
    f"https://me:{SECRET}﹫models.example/v1",
    f"https://me:{SECRET}@[::1",
    f"ftp://me:{SECRET}@models.example",
    f" https://me:{SECRET}@models.example ",
    f"https://models.example/v1?key={SECRET}",
    f"https://models.example/v1#{SECRET}",
    f"models.example?key={SECRET}",
]


@pytest.mark.parametrize("url", URLS)
def test_what_a_base_url_hides_is_refused_unprinted(url: str) -> None:
    with pytest.raises(InputError, match="The base URL holds") as caught:
        endpoint(url, "OPENAI_API_KEY")
    assert SECRET not in str(caught.value)


def test_a_key_file_is_read_within_bounds(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    path = tmp_path / "key"
    monkeypatch.setenv("OPENAI_API_KEY_FILE", str(path))
    path.write_text("k" * MOST_KEY)
    assert endpoint("https://x/v1", "OPENAI_API_KEY").key == "k" * MOST_KEY
    for more in ("k" * (MOST_KEY + 1), " " * (MOST_KEY + 1) + "k"):
        path.write_text(more)
        with pytest.raises(InputError, match=r"OPENAI_API_KEY_FILE names .*, which"):
            endpoint("https://x/v1", "OPENAI_API_KEY")
    monkeypatch.setenv("OPENAI_API_KEY_FILE", "/dev/zero")  # never ends
    with pytest.raises(InputError, match="OPENAI_API_KEY"):
        endpoint("https://x/v1", "OPENAI_API_KEY")
