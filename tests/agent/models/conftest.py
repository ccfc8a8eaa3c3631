"""A real HTTP server on loopback that says what a test wrote down, in two providers' languages."""

import json
import socketserver
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast

import pytest
from formup.agent.models.remote import RemoteModel, remote_model

Calls = Sequence[tuple[str, str, dict[str, Any] | str]]
"""Id, name, and arguments: an object, or text as a model wrote it."""


def response(data: object, status: int = 200, **headers: str) -> bytes:
    """An HTTP response; names of headers with _ for -."""
    body = data if isinstance(data, bytes) else json.dumps(data).encode()
    kind = "application/json" if not body.startswith(b"<") else "text/html"
    lines = [f"HTTP/1.1 {status} X", f"content-length: {len(body)}", f"content-type: {kind}"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


def stream(events: Sequence[Any], *, cut: int | None = None) -> bytes:
    """Server-sent events in chunks; broken off after `cut` events, or ended as it should be."""
    head = b"HTTP/1.1 200 X\r\ncontent-type: text/event-stream; charset=utf-8\r\n"
    texts = [e if isinstance(e, str) else json.dumps(e) for e in events][:cut]
    kinds = [
        None if not isinstance(e, dict) else cast("dict[str, Any]", e).get("type") for e in events
    ]
    lines = [
        f"event: {kind}\r\ndata: {text}\r\n\r\n" if kind else f": comment\ndata: {text}\n\n"
        for kind, text in zip(kinds, texts, strict=False)
    ]
    chunks = [f"{len(line.encode()):x}\r\n{line}\r\n".encode() for line in lines]
    end = [] if cut is not None else [b"0\r\n\r\n"]
    return head + b"transfer-encoding: chunked\r\n\r\n" + b"".join([*chunks, *end])


class OpenAI:
    """Chat Completions as the provider answers them."""

    name, variable = "openai", "OPENAI_API_KEY"
    stops = {"done": "stop", "cut": "length", "calls": "tool_calls"}  # noqa: RUF012

    def body(self, text: str = "", calls: Calls = (), stop: str = "done") -> dict[str, Any]:
        made = [
            {"id": i, "type": "function", "function": {"name": n, "arguments": _text(a)}}
            for i, n, a in calls
        ]
        message: dict[str, Any] = {"role": "assistant", "content": text or None}
        message |= {"tool_calls": made} if made else {}
        choice = {"index": 0, "message": message, "finish_reason": self.stops[stop]}
        return self._frame("chat.completion", [choice]) | {"usage": self.usage()}

    def events(self, text: str = "", calls: Calls = (), stop: str = "done") -> list[object]:
        deltas: list[dict[str, Any]] = [{"role": "assistant", "content": ""}]
        deltas += [{"content": text[i : i + 4]} for i in range(0, len(text), 4)]
        for index, (id, name, arguments) in enumerate(calls):
            head = {"index": index, "id": id, "type": "function"}
            deltas.append({"tool_calls": [head | {"function": {"name": name, "arguments": ""}}]})
            for piece in _pieces(_text(arguments)):
                more = {"index": index, "function": {"arguments": piece}}
                deltas.append({"tool_calls": [more]})
        ends = [None] * len(deltas) + [self.stops[stop]]
        choices = [
            {"index": 0, "delta": d, "finish_reason": e}
            for d, e in zip([*deltas, {}], ends, strict=True)
        ]
        chunks = [self._frame("chat.completion.chunk", [c]) for c in choices]
        last = self._frame("chat.completion.chunk", []) | {"usage": self.usage()}
        return [*chunks, last, "[DONE]"]

    def refusal(self) -> dict[str, Any]:
        body = self.body("x")
        body["choices"][0]["message"] = {"content": None, "refusal": "I will not."}
        return body

    def error(self, message: str, code: str = "some_error") -> dict[str, Any]:
        return {"error": {"message": message, "type": code, "code": code, "param": None}}

    def usage(self) -> dict[str, Any]:
        details = {"cached_tokens": 60}
        counts = {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120}
        return counts | {"prompt_tokens_details": details}

    def _frame(self, kind: str, choices: list[dict[str, Any]]) -> dict[str, Any]:
        return {"id": "x", "object": kind, "created": 1, "model": "m", "choices": choices}


class Anthropic:
    """Messages as the provider answers them."""

    name, variable = "anthropic", "ANTHROPIC_API_KEY"
    stops = {"done": "end_turn", "cut": "max_tokens", "calls": "tool_use"}  # noqa: RUF012

    def body(self, text: str = "", calls: Calls = (), stop: str = "done") -> dict[str, Any]:
        blocks: list[dict[str, Any]] = [{"type": "text", "text": text}] if text else []
        blocks += [{"type": "tool_use", "id": i, "name": n, "input": a} for i, n, a in calls]
        return self._frame() | {
            "content": blocks,
            "stop_reason": self.stops[stop],
            "usage": self.usage(),
        }

    def events(self, text: str = "", calls: Calls = (), stop: str = "done") -> list[object]:
        start = self._frame() | {"usage": self.usage() | {"output_tokens": 1}}
        events: list[object] = [{"type": "message_start", "message": start}, {"type": "ping"}]
        blocks: list[tuple[dict[str, Any], list[dict[str, Any]]]] = []
        if text:
            pieces = [text[i : i + 4] for i in range(0, len(text), 4)]
            deltas = [{"type": "text_delta", "text": piece} for piece in pieces]
            blocks.append(({"type": "text", "text": ""}, deltas))
        for id, name, arguments in calls:
            pieces = _pieces(_text(arguments))
            deltas = [{"type": "input_json_delta", "partial_json": p} for p in pieces]
            blocks.append(({"type": "tool_use", "id": id, "name": name, "input": {}}, deltas))
        for index, (block, deltas) in enumerate(blocks):
            at = {"index": index}
            events.append({"type": "content_block_start", "content_block": block} | at)
            events += [{"type": "content_block_delta", "delta": d} | at for d in deltas]
            events.append({"type": "content_block_stop"} | at)
        end = {"stop_reason": self.stops[stop], "stop_sequence": None}
        events.append({"type": "message_delta", "delta": end, "usage": {"output_tokens": 20}})
        return [*events, {"type": "message_stop"}]

    def refusal(self) -> dict[str, Any]:
        return self.body("I will not.") | {"stop_reason": "refusal"}

    def error(self, message: str, code: str = "some_error") -> dict[str, Any]:
        return {"type": "error", "error": {"type": code, "message": message}}

    def usage(self) -> dict[str, Any]:
        return {
            "input_tokens": 30,
            "cache_read_input_tokens": 60,
            "cache_creation_input_tokens": 10,
            "output_tokens": 20,
        }

    def _frame(self) -> dict[str, Any]:
        empty: dict[str, Any] = {"content": [], "stop_reason": None, "stop_sequence": None}
        return {"id": "x", "type": "message", "role": "assistant", "model": "m"} | empty


class Server(socketserver.ThreadingTCPServer):
    """Answers each request with the next step of the script; b"" drops the connection."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.script: list[bytes] = []
        self.requests: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self.paths: list[str] = []
        self.connections = 0
        self.pauses: list[float] = []
        self.shown: list[str | None] = []
        self.released = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/v1"

    def model(self, provider: str, *, streamed: bool = False, url: str = "") -> RemoteModel:
        """A model that asks this server and waits for nothing."""

        async def sleep(seconds: float) -> None:
            self.pauses.append(seconds)

        show = self.shown.append if streamed else None
        return remote_model(provider, "m", url or self.url, show=show, sleep=sleep)


class Handler(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        server = self.server
        assert isinstance(server, Server)
        server.connections += 1
        while first := self.rfile.readline():
            headers: dict[str, str] = {}
            while line := self.rfile.readline().strip():
                name, _, value = line.decode().partition(":")
                headers[name.lower()] = value.strip()
            body = self.rfile.read(int(headers["content-length"]))
            server.paths.append(first.decode().split()[1])
            server.headers.append(headers)
            server.requests.append(json.loads(body))
            step = server.script.pop(0)
            if step == b"silence":
                server.released.wait(10)
                return
            self.wfile.write(step)
            if not _ends(step):
                return


def _ends(step: bytes) -> bool:
    """Whether a response says itself where it ends, so that the connection may go on."""
    if b"chunked" in step:
        return step.endswith(b"0\r\n\r\n")
    head, _, body = step.partition(b"\r\n\r\n")
    return f"content-length: {len(body)}".encode() in head


def _text(arguments: dict[str, Any] | str) -> str:
    return arguments if isinstance(arguments, str) else json.dumps(arguments)


def _pieces(text: str) -> list[str]:
    return [text[i : i + 7] for i in range(0, len(text), 7)]


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    for variable in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(variable, raising=False)
        monkeypatch.delenv(f"{variable}_FILE", raising=False)
    with Server() as made:
        thread = threading.Thread(target=made.serve_forever, args=(0.01,))
        thread.start()
        yield made
        made.released.set()
        made.shutdown()
        thread.join()


@pytest.fixture(params=[OpenAI, Anthropic], ids=["openai", "anthropic"])
def dialect(request: pytest.FixtureRequest) -> OpenAI | Anthropic:
    return request.param()


@pytest.fixture
def openai() -> OpenAI:
    return OpenAI()


@pytest.fixture
def anthropic() -> Anthropic:
    return Anthropic()


@pytest.fixture(params=[False, True], ids=["whole", "streamed"])
def streamed(request: pytest.FixtureRequest) -> bool:
    return request.param


@pytest.fixture
def http() -> Any:
    """How responses are written: http.response(...), http.stream(...)."""

    class Http:
        response: Callable[..., bytes] = staticmethod(response)
        stream: Callable[..., bytes] = staticmethod(stream)

    return Http


@pytest.fixture
def say(dialect: OpenAI | Anthropic, streamed: bool) -> Callable[..., bytes]:
    """A response in the language and manner of the test: say(text, calls, stop)."""

    def made(*said: Any, **more: Any) -> bytes:
        if streamed:
            return stream(dialect.events(*said, **more))
        return response(dialect.body(*said, **more))

    return made
