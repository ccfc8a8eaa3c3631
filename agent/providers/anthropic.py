"""Anthropic Messages, with its marks for prompt caching."""

import io
from functools import lru_cache
from itertools import groupby
from typing import Any

from pydantic import BaseModel

from ...tools.tool import Tool
from ..messages import Reply, Result, Usage, User
from ..model import Request
from .failures import cut_off, empty, refused
from .prices import Price
from .wire import (
    Assembly,
    MessageCache,
    Wire,
    base64_text,
    count,
    described,
    dumped,
    make_calls,
    media_type,
    safe_name,
    usage_of,
    validated,
)

VERSION = "2023-06-01"
MAX_TOKENS = 8_192
"""Of one reply; the interface wants a bound, and this is the least of the current models'."""
CACHED_TURNS = 2
"""The last turn's mark writes the cache for the next request, the one before reads it."""
_MARK = b',"cache_control":{"type":"ephemeral"}}'


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
        self._blocks: dict[int, _Block] = {}
        self._texts: dict[int, io.StringIO] = {}
        self._inputs: dict[int, io.StringIO] = {}
        self._stop: str | None = None
        self._usage: dict[str, Any] = {}

    def whole(self) -> Any:
        content: list[dict[str, Any]] = []
        for index, block in sorted(self._blocks.items()):
            streamed, given = self._texts.get(index), self._inputs.get(index)
            text = (block.text or "") + (streamed.getvalue() if streamed else "")
            # What was streamed as text stays text: only a complete reply is read.
            written = block.input if given is None else given.getvalue()
            content.append(block.model_dump() | {"text": text, "input": written})
        return {"content": content, "stop_reason": self._stop, "usage": self._usage}

    def take(self, event: dict[str, Any]) -> str:
        kind, index = event["type"], int(event.get("index") or 0)
        if not isinstance(kind, str):
            raise TypeError
        delta: dict[str, Any] = event.get("delta") or {}
        if kind == "content_block_delta":
            text, written = delta.get("text") or "", delta.get("partial_json") or ""
            self._texts.setdefault(index, io.StringIO()).write(text)
            if written:
                self._inputs.setdefault(index, io.StringIO()).write(written)
            return text
        if kind == "content_block_start":
            self._blocks[index] = _Block.model_validate(event["content_block"])
        message: dict[str, Any] = event.get("message") or {}
        for owner in (message, event):
            usage: dict[str, Any] = owner.get("usage") or {}
            self._usage |= {k: v for k, v in usage.items() if v is not None}
        self._stop = delta.get("stop_reason") or self._stop
        self.done = self.done or self._stop is not None or kind == "message_stop"
        return ""


class Anthropic(Wire):
    """Speaks Messages."""

    assembly = _Assembly

    def __init__(self, model: str, price: Price) -> None:
        self._model, self.price = dumped(model), price
        self._blocks = MessageCache(_role_and_blocks)

    def path(self, *, stream: bool) -> str:
        """What follows the base URL."""
        return "/v1/messages"

    def headers(self, key: str | None) -> dict[str, str]:
        """The version of the interface, and the key where there is one."""
        return {"anthropic-version": VERSION} | ({"x-api-key": key} if key else {})

    def body(self, request: Request, *, stream: bool) -> bytes:
        """A request as JSON."""
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
        """What a complete body answers to a request."""
        message = validated(body, _Message, "message")
        text = "".join(b.text or "" for b in message.content if b.type == "text").strip()
        if message.stop_reason == "refusal":
            raise refused(text)
        if message.stop_reason == "max_tokens":
            raise cut_off(MAX_TOKENS)
        if message.stop_reason == "model_context_window_exceeded":
            raise cut_off()
        written = [(b.id, b.name or "", b.input) for b in message.content if b.type == "tool_use"]
        if not text and not written:
            raise empty()
        calls = make_calls(written, request.messages)
        return Reply(text=text, calls=calls, usage=_anthropic_usage(message.usage, self.price))

    def _turns(self, request: Request) -> bytes:
        """Messages by turns: results and what a person says belong to the same one."""
        said = [turn for message in request.messages if (turn := self._blocks(message))[1]]
        by_role = groupby(said, key=lambda turn: turn[0])
        turns = [(role, [blocks for _, blocks in turn]) for role, turn in by_role]
        for _, blocks in [turn for turn in turns if turn[0] == b"user"][-CACHED_TURNS:]:
            blocks[-1] = _cache_marked(blocks[-1])
        return b",".join(
            [b'{"role":"%b","content":[%b]}' % (role, b",".join(blocks)) for role, blocks in turns]
        )


def _anthropic_usage(usage: Any, price: Price) -> Usage:
    return usage_of(
        price,
        fresh=count(usage, "input_tokens"),
        cached=count(usage, "cache_read_input_tokens"),
        written=count(usage, "cache_creation_input_tokens"),
        output=count(usage, "output_tokens"),
    )


def _role_and_blocks(message: User | Reply | Result) -> tuple[bytes, bytes]:
    """Role and blocks of a message; none where it says nothing, for empty ones are refused."""
    if isinstance(message, Reply):
        uses = [
            dumped(
                {
                    "type": "tool_use",
                    "id": safe_name(call.id),
                    "name": safe_name(call.name),
                    "input": call.arguments,
                }
            )
            for call in message.calls
        ]
        spoken = [_text_block(message.text)] if message.text.strip() else []
        return b"assistant", b",".join([*spoken, *uses])
    spoken = [_text_block(message.text)] if message.text.strip() else []
    shown = [_image_block(image) for image in message.images]
    if isinstance(message, User):
        return b"user", b",".join([*shown, *spoken])
    return b"user", _result_block(message, b",".join([*spoken, *shown]))


def _result_block(result: Result, content: bytes) -> bytes:
    head = {"type": "tool_result", "tool_use_id": safe_name(result.call_id)}
    if result.error:
        head |= {"is_error": True}
    return dumped(head)[:-1] + b',"content":[' + content + b"]}"


def _text_block(text: str) -> bytes:
    return dumped({"type": "text", "text": text})


def _image_block(image: bytes) -> bytes:
    source = {"type": "base64", "media_type": media_type(image), "data": base64_text(image)}
    return dumped({"type": "image", "source": source})


def _cache_marked(blocks: bytes) -> bytes:
    """Blocks with a cache mark in the last of them."""
    return blocks[:-1] + _MARK


@lru_cache(maxsize=16)
def _tool_list(tools: tuple[Tool, ...], marked: bool) -> bytes:
    written = b",".join(map(dumped, described(tools, "input_schema")))
    return _cache_marked(written) if marked else written
