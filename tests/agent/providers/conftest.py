"""A real HTTP server on loopback that says what a test wrote down, in four interfaces' terms."""

import json
import socketserver
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast

import pytest
from formup.agent.providers.remote import RemoteModel, remote_model

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
    turns, spare = "messages", 1
    """The field that holds the conversation; events that may be lost, for all is said by then."""
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
    turns, spare = "messages", 1
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


class Responses:
    """OpenAI's Responses as the provider answers them."""

    name, variable = "openai-responses", "OPENAI_API_KEY"
    turns, spare = "input", 0

    def body(self, text: str = "", calls: Calls = (), stop: str = "done") -> dict[str, Any]:
        output = [self._message(text)] if text else []
        output += [self._call(number, *call) for number, call in enumerate(calls)]
        cut = {"status": "incomplete", "incomplete_details": {"reason": "max_output_tokens"}}
        ends = {"status": "completed", "incomplete_details": None} if stop != "cut" else cut
        return self._frame() | {"output": output, "usage": self.usage()} | ends

    def events(self, text: str = "", calls: Calls = (), stop: str = "done") -> list[object]:
        whole = self.body(text, calls, stop)
        events: list[dict[str, Any]] = [{"type": "response.created", "response": self._frame()}]
        for index, item in enumerate(whole["output"]):
            at = {"output_index": index}
            begun: dict[str, Any] = (
                {"content": []} if item["type"] == "message" else {"arguments": ""}
            )
            started = item | begun | {"status": "in_progress"}
            events.append({"type": "response.output_item.added", "item": started} | at)
            events += [delta | at | {"item_id": item["id"]} for delta in self._deltas(item)]
            events.append({"type": "response.output_item.done", "item": item} | at)
        events.append({"type": f"response.{whole['status']}", "response": whole})
        return [event | {"sequence_number": number} for number, event in enumerate(events)]

    def refusal(self) -> dict[str, Any]:
        body = self.body("x")
        body["output"][0]["content"] = [{"type": "refusal", "refusal": "I will not."}]
        return body

    def error(self, message: str, code: str = "some_error") -> dict[str, Any]:
        return {"error": {"message": message, "type": code, "code": code, "param": None}}

    def usage(self) -> dict[str, Any]:
        given = {"cached_tokens": 60, "cache_write_tokens": 30}
        counts = {"input_tokens": 100, "output_tokens": 20, "total_tokens": 120}
        more = {"input_tokens_details": given, "output_tokens_details": {"reasoning_tokens": 15}}
        return counts | more

    def _message(self, text: str) -> dict[str, Any]:
        content: list[Any] = [{"type": "output_text", "text": text, "annotations": []}]
        head = {"id": "msg_1", "type": "message", "role": "assistant", "status": "completed"}
        return head | {"content": content}

    def _call(self, number: int, id: str, name: str, arguments: Any) -> dict[str, Any]:
        head = {"id": f"fc_{number}", "type": "function_call", "status": "completed"}
        return head | {"call_id": id, "name": name, "arguments": _text(arguments)}

    def _deltas(self, item: dict[str, Any]) -> list[dict[str, Any]]:
        if item["type"] == "function_call":
            kind = "response.function_call_arguments.delta"
            return [{"type": kind, "delta": piece} for piece in _pieces(item["arguments"])]
        text, part = item["content"][0]["text"], item["content"][0] | {"text": ""}
        head: dict[str, Any] = {"logprobs": [], "content_index": 0}
        deltas = [{"delta": text[i : i + 4]} for i in range(0, len(text), 4)]
        begin = head | {"type": "response.content_part.added", "part": part}
        return [begin, *(head | {"type": "response.output_text.delta"} | d for d in deltas)]

    def _frame(self) -> dict[str, Any]:
        empty: dict[str, Any] = {"error": None, "tools": [], "output": [], "status": "in_progress"}
        asked = {"parallel_tool_calls": True, "tool_choice": "auto"}
        return empty | asked | {"id": "r", "object": "response", "created_at": 1, "model": "m"}


class Gemini:
    """Contents as Google generates them."""

    name, variable = "gemini", "GEMINI_API_KEY"
    turns, spare = "contents", 0
    stops = {"done": "STOP", "cut": "MAX_TOKENS", "calls": "STOP"}  # noqa: RUF012
    codes = {  # noqa: RUF012
        "not_found_error": (404, "NOT_FOUND"),
        "overloaded_error": (503, "UNAVAILABLE"),
    }

    def body(self, text: str = "", calls: Calls = (), stop: str = "done") -> dict[str, Any]:
        parts: list[dict[str, Any]] = [{"text": text}] if text else []
        parts += [self._call(*call) for call in calls]
        return self.frame(parts, self.stops[stop])

    def events(self, text: str = "", calls: Calls = (), stop: str = "done") -> list[object]:
        parts: list[dict[str, Any]] = [{"text": text[i : i + 2]} for i in range(0, len(text), 2)]
        parts += [self._call(*call) for call in calls]
        return [*(self.frame([part]) for part in parts), self.frame([], self.stops[stop])]

    def refusal(self) -> dict[str, Any]:
        ended = {"finishReason": "SAFETY", "finishMessage": "I will not.", "index": 0}
        return self.frame([]) | {"candidates": [ended]}

    def error(self, message: str, code: str = "some_error") -> dict[str, Any]:
        number, status = self.codes.get(code, (400, "INVALID_ARGUMENT"))
        return {"error": {"code": number, "message": message, "status": status}}

    def frame(self, parts: list[dict[str, Any]], stop: str | None = None) -> dict[str, Any]:
        counts = {"promptTokenCount": 100, "cachedContentTokenCount": 60, "totalTokenCount": 120}
        written = {"candidatesTokenCount": 5, "thoughtsTokenCount": 15}
        candidate = {"content": {"role": "model", "parts": parts}, "index": 0}
        ended = {"finishReason": stop} if stop else {}
        head = {"candidates": [candidate | ended], "modelVersion": "m", "responseId": "x"}
        return head | {"usageMetadata": counts | written}

    def _call(self, id: str, name: str, arguments: Any) -> dict[str, Any]:
        return {"functionCall": {"name": name, "args": arguments} | ({"id": id} if id else {})}


Dialect = OpenAI | Responses | Anthropic | Gemini
DIALECTS = {kind.name: kind for kind in (OpenAI, Responses, Anthropic, Gemini)}


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
    for variable in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY", "GEMINI_API_KEY", "GOOGLE_API_KEY"):
        monkeypatch.delenv(variable, raising=False)
        monkeypatch.delenv(f"{variable}_FILE", raising=False)
    with Server() as made:
        thread = threading.Thread(target=made.serve_forever, args=(0.01,))
        thread.start()
        yield made
        made.released.set()
        made.shutdown()
        thread.join()


@pytest.fixture(params=list(DIALECTS))
def dialect(request: pytest.FixtureRequest) -> Dialect:
    return DIALECTS[request.param]()


@pytest.fixture
def openai() -> OpenAI:
    return OpenAI()


@pytest.fixture
def anthropic() -> Anthropic:
    return Anthropic()


@pytest.fixture
def responses() -> Responses:
    return Responses()


@pytest.fixture
def gemini() -> Gemini:
    return Gemini()


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
def say(dialect: Dialect, streamed: bool) -> Callable[..., bytes]:
    """A response in the language and manner of the test: say(text, calls, stop)."""

    def made(*said: Any, **more: Any) -> bytes:
        if streamed:
            return stream(dialect.events(*said, **more))
        return response(dialect.body(*said, **more))

    return made
