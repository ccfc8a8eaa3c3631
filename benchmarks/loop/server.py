"""A scripted Chat Completions server on loopback with cached answers.

POST /tN[f]/v1/chat/completions answers with N tool turns, then the final text (with f, as a call
of final_answer, which smolagents wants). The turn is the number of tool results in the request.
Streams have an event for every four characters of arguments, each in a chunk of its own.
"""

import asyncio
import json
import re
from functools import cache
from typing import Any

from exchange import FINAL

POINTS = [(round(0.17 * i - 0.6, 3), round(0.9 - 0.21 * i, 3)) for i in range(8)]
USAGE = {"prompt_tokens": 321, "completion_tokens": 120, "total_tokens": 441}
HEAD: dict[str, Any] = {"id": "chatcmpl-bench", "created": 1_760_000_000, "model": "bench-model"}
RESULT = re.compile(
    rb'"role": ?"tool"|": ?"Observation:\\n'
)  # smolagents sends results as user messages
STREAM = re.compile(rb'"stream": ?true')
LENGTH = re.compile(rb"\r\ncontent-length: *(\d+)", re.IGNORECASE)
PATH = re.compile(rb"POST /t(\d+)(f?)/v1/chat/completions ")


def dumps(value: object) -> str:
    """Return compact JSON."""
    return json.dumps(value, separators=(",", ":"))


def call(turn: int, last: bool) -> dict[str, Any]:
    """Return the tool call of a turn; points are named after it, as models seldom repeat."""
    points = [{"label": f"p{i}-{turn}", "x": x, "y": y} for i, (x, y) in enumerate(POINTS)]
    name, arguments = (
        ("final_answer", {"answer": FINAL}) if last else ("check_points", {"points": points})
    )
    function = {"name": name, "arguments": dumps(arguments)}
    return {"id": f"call_{turn:06d}", "type": "function", "function": function}


def whole(turn: int, kind: str) -> bytes:
    """Return an answer in one piece."""
    message: dict[str, Any] = {"role": "assistant", "content": None, "refusal": None}
    if kind == "text":
        message["content"] = FINAL
    else:
        message["tool_calls"] = [call(turn, kind == "final")]
    finish = "stop" if kind == "text" else "tool_calls"
    choice = {"index": 0, "message": message, "logprobs": None, "finish_reason": finish}
    body = dumps(HEAD | {"object": "chat.completion", "choices": [choice], "usage": USAGE}).encode()
    head = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n"
    return head % len(body) + body


def streamed(turn: int, kind: str) -> bytes:
    """Return an answer as server-sent events."""
    deltas: list[dict[str, Any]] = [{"role": "assistant", "content": ""}]
    if kind == "text":
        deltas += [{"content": FINAL[i : i + 4]} for i in range(0, len(FINAL), 4)]
    else:
        made = call(turn, kind == "final")
        name, written = made["function"]["name"], made["function"]["arguments"]
        first = made | {"index": 0, "function": {"name": name, "arguments": ""}}
        pieces = [
            {"index": 0, "function": {"arguments": written[i : i + 4]}}
            for i in range(0, len(written), 4)
        ]
        deltas += [{"tool_calls": [piece]} for piece in [first, *pieces]]
    finish = "stop" if kind == "text" else "tool_calls"
    common: dict[str, Any] = {"index": 0, "logprobs": None}
    choices = [common | {"delta": delta, "finish_reason": None} for delta in deltas]
    last: dict[str, Any] = {"delta": {}, "finish_reason": finish}
    choices.append(common | last)
    chunk = HEAD | {"object": "chat.completion.chunk"}
    events = [dumps(chunk | {"choices": [choice], "usage": None}) for choice in choices]
    end: dict[str, Any] = {"choices": [], "usage": USAGE}
    events += [dumps(chunk | end), "[DONE]"]
    head = (
        b"HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\ntransfer-encoding: chunked\r\n\r\n"
    )
    parts = [f"data: {event}\n\n".encode() for event in events]
    return head + b"".join(b"%x\r\n%s\r\n" % (len(p), p) for p in parts) + b"0\r\n\r\n"


@cache
def answer(stream: bool, turn: int, kind: str) -> bytes:
    """Return an answer, made once and cached."""
    return (streamed if stream else whole)(turn, kind)


class Conversation(asyncio.Protocol):
    """One connection; `counts` covers all of them."""

    counts: dict[str, int] = {"requests": 0, "bad": 0}  # noqa: RUF012

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Accept a client."""
        assert isinstance(transport, asyncio.Transport)
        self._transport, self._buffer = transport, b""

    def data_received(self, data: bytes) -> None:
        """Answer every complete request."""
        self._buffer += data
        while (end := self._buffer.find(b"\r\n\r\n")) >= 0:
            length = LENGTH.search(self._buffer, 0, end + 2)
            size = end + 4 + (int(length[1]) if length else 0)
            if len(self._buffer) < size:
                return
            request, self._buffer = self._buffer[:size], self._buffer[size:]
            self._transport.write(self._reply(request, end))

    def _reply(self, request: bytes, end: int) -> bytes:
        if request.startswith(b"GET /counts"):
            body = dumps(self.counts).encode()
            return b"HTTP/1.1 200 OK\r\ncontent-length: %d\r\n\r\n%s" % (len(body), body)
        path = PATH.match(request)
        if path is None:
            self.counts["bad"] += 1
            return b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n"
        self.counts["requests"] += 1
        turn = len(RESULT.findall(request, end))
        kind = "tool" if turn < int(path[1]) else "final" if path[2] else "text"
        return answer(STREAM.search(request, end) is not None, turn, kind)


async def serve() -> None:
    """Print the port and serve until killed."""
    server = await asyncio.get_running_loop().create_server(
        Conversation, "127.0.0.1", 0, backlog=256
    )
    print(server.sockets[0].getsockname()[1], flush=True)  # noqa: T201
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(serve())
