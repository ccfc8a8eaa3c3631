"""Anthropic's Messages API, with its marks for prompt caching."""

import io
from functools import lru_cache
from itertools import groupby
from typing import Any

from pydantic import BaseModel

from ...tools.tool import Tool
from ..messages import Reply, Result, Usage, User
from ..model import Request
from .calls import CallIds, give_names, read
from .failures import cut_off, refused
from .prices import Price
from .wire import (
    Assembly,
    MessageCache,
    Wire,
    base64_text,
    count,
    described,
    dumped,
    media_type,
    safe_name,
    usage_of,
    validated,
)

VERSION = "2023-06-01"
MAX_TOKENS = 8_192
"""Most tokens of one reply; the API requires a bound, and this is the lowest of current models."""
CACHED_TURNS = 2
"""User turns with a cache mark: the last one writes the cache for the next request, the one
before it reads what was cached."""
_PLAIN = {"text", "tool_use"}
"""Blocks that can be rebuilt; thoughts, signed or hidden, have to be sent back as they came."""
_MARK = b',"cache_control":{"type":"ephemeral"}}'


_GROWING = {
    "text": "text",
    "partial_json": "input",
    "thinking": "thinking",
    "signature": "signature",
}
"""Fields of deltas, and the fields of blocks that they extend."""


class _Block(BaseModel):
    type: str
    text: str | None = None
    id: str | None = None
    name: str | None = None
    input: Any = None


class _Message(BaseModel):
    content: list[_Block]
    stop_reason: str | None = None
    usage: Any = None


class _Assembly(Assembly):
    events = "messages"

    def __init__(self) -> None:
        self._blocks: dict[int, dict[str, Any]] = {}
        self._grown: dict[tuple[int, str], io.StringIO] = {}
        self._stop: str | None = None
        self._usage: dict[str, Any] = {}

    def whole(self) -> Any:
        # JSON that was streamed as text stays text: it is parsed once the reply is complete.
        for (index, name), text in self._grown.items():
            block, field = self._blocks.setdefault(index, {}), _GROWING[name]
            begun = block.get(field)
            block[field] = (begun if isinstance(begun, str) else "") + text.getvalue()
        self._grown = {}
        content = [block for _, block in sorted(self._blocks.items())]
        return {"content": content, "stop_reason": self._stop, "usage": self._usage}

    def take(self, event: dict[str, Any]) -> str:
        kind, index = event["type"], int(event.get("index") or 0)
        if not isinstance(kind, str):
            raise TypeError
        delta: dict[str, Any] = event.get("delta") or {}
        if kind == "content_block_delta":
            for name in _GROWING.keys() & delta.keys():
                if delta[name]:
                    self._grown.setdefault((index, name), io.StringIO()).write(delta[name])
            return delta.get("text") or ""
        if kind == "content_block_start":
            self._blocks[index] = {} | event["content_block"]
        if kind == "message":  # the whole message in one event
            blocks: list[dict[str, Any]] = event["content"]
            self._blocks, delta = dict(enumerate(blocks)), event
        message: dict[str, Any] = event.get("message") or {}
        for owner in (message, event):
            usage: dict[str, Any] = owner.get("usage") or {}
            self._usage |= {k: v for k, v in usage.items() if v is not None}
        self._stop = delta.get("stop_reason") or self._stop
        self.done = self.done or self._stop is not None or kind == "message_stop"
        return ""


class Anthropic(Wire):
    """The wire format of Anthropic's Messages API."""

    assembly = _Assembly

    def __init__(self, model: str, price: Price, owner: str = "") -> None:
        self._model, self.price = dumped(model), price
        self._ids = CallIds(owner or f"anthropic:{model}")
        self._blocks = MessageCache(self._role_and_blocks)

    def path(self, *, stream: bool) -> str:
        """Return what follows the base URL."""
        return "/v1/messages"

    def headers(self, key: str | None) -> dict[str, str]:
        """Return the version of the API, and the key where there is one."""
        return {"anthropic-version": VERSION} | ({"x-api-key": key} if key else {})

    def body(self, request: Request, *, stream: bool) -> bytes:
        """Return a request as JSON."""
        parts = [b'{"model":', self._model, b',"max_tokens":%d' % MAX_TOKENS]
        if request.system:
            parts += [b',"system":[', _cache_marked(_text_block(request.system)), b"]"]
        if request.tools:
            # Tools come before the system prompt in the cache, so that its mark covers both.
            parts += [b',"tools":[', _tool_list(request.tools, not request.system), b"]"]
        parts += [b',"messages":[', self._turns(request), b"]"]
        if stream:
            parts.append(b',"stream":true')
        return b"".join([*parts, b"}"])

    def reply(self, body: Any, request: Request) -> Reply:
        """Return the reply that a complete body holds."""
        message = validated(body, _Message, "message")
        text = "".join(b.text or "" for b in message.content if b.type == "text")
        if message.stop_reason == "refusal":
            raise refused(text.strip())
        if message.stop_reason == "max_tokens":
            raise cut_off(MAX_TOKENS)
        if message.stop_reason == "model_context_window_exceeded":
            raise cut_off()
        written = [(b.id, b.name or "", b.input) for b in message.content if b.type == "tool_use"]
        text, calls = read(text, written, request)
        items: tuple[dict[str, Any], ...] = ()
        if len(written) == len(calls) and any(b.type not in _PLAIN for b in message.content):
            blocks: list[dict[str, Any]] = body["content"]
            give_names([b for b in blocks if b["type"] == "tool_use"], calls, "id", "input")
            items = tuple(b for b in blocks if b["type"] != "text" or (b.get("text") or "").strip())
        usage = _anthropic_usage(message.usage, self.price)
        return Reply(text=text, calls=calls, usage=usage, opaque=self._ids.opaque(calls, items))

    def _turns(self, request: Request) -> bytes:
        """Return messages by turns: results and what a person says share one turn."""
        said = [turn for message in request.messages if (turn := self._blocks(message))[1]]
        by_role = groupby(said, key=lambda turn: turn[0])
        turns = [(role, [blocks for _, blocks in turn]) for role, turn in by_role]
        for _, blocks in [turn for turn in turns if turn[0] == b"user"][-CACHED_TURNS:]:
            blocks[-1] = _cache_marked(blocks[-1])
        return b",".join(
            [b'{"role":"%b","content":[%b]}' % (role, b",".join(blocks)) for role, blocks in turns]
        )

    def _role_and_blocks(self, message: User | Reply | Result) -> tuple[bytes, bytes]:
        """Return a message's role and blocks, none if it is empty: empty blocks are refused."""
        if isinstance(message, Reply):
            blocks = self._ids.items(message) or self._blocks_of(message)
            return b"assistant", b",".join(map(dumped, blocks))
        spoken = [_text_block(message.text)] if message.text.strip() else []
        shown = [_image_block(image) for image in message.images]
        if isinstance(message, User):
            return b"user", b",".join([*shown, *spoken])
        head = {"type": "tool_result", "tool_use_id": self._ids(message.call_id)}
        head |= {"is_error": True} if message.error else {}
        content = b",".join([*spoken, *shown])
        return b"user", dumped(head)[:-1] + b',"content":[' + content + b"]}"

    def _blocks_of(self, reply: Reply) -> list[dict[str, Any]]:
        """Return the blocks of a reply that holds nothing but text and calls."""
        text = [{"type": "text", "text": reply.text}] if reply.text.strip() else []
        calls = [
            {
                "type": "tool_use",
                "id": self._ids(call.id),
                "name": safe_name(call.name),
                "input": call.arguments,
            }
            for call in reply.calls
        ]
        return [*text, *calls]


def _anthropic_usage(usage: Any, price: Price) -> Usage:
    return usage_of(
        price,
        fresh=count(usage, "input_tokens"),
        cached=count(usage, "cache_read_input_tokens"),
        written=count(usage, "cache_creation_input_tokens"),
        output=count(usage, "output_tokens"),
    )


def _text_block(text: str) -> bytes:
    return dumped({"type": "text", "text": text})


def _image_block(image: bytes) -> bytes:
    source = {"type": "base64", "media_type": media_type(image), "data": base64_text(image)}
    return dumped({"type": "image", "source": source})


def _cache_marked(blocks: bytes) -> bytes:
    """Return blocks with a cache mark in the last one."""
    return blocks[:-1] + _MARK


@lru_cache(maxsize=16)
def _tool_list(tools: tuple[Tool, ...], marked: bool) -> bytes:
    written = b",".join(map(dumped, described(tools, "input_schema")))
    return _cache_marked(written) if marked else written
