"""OpenAI Chat Completions, and the servers that speak it: vLLM, Ollama, llama.cpp, LM Studio, ...

Only fields that every such server knows are sent, and never a null, as some servers refuse these.
"""

from functools import lru_cache
from typing import Annotated, Any

from annotated_types import MinLen
from pydantic import BaseModel, ConfigDict

from ...tools.tool import Tool
from ..messages import Reply, Result, Usage, User
from ..model import Request
from .calls import CallIds, read
from .chat_stream import ChatAssembly, goes_back, joined_text
from .failures import AskError, cut_off, refused
from .prices import Price
from .wire import (
    MessageCache,
    Wire,
    count,
    data_url,
    described,
    dumped,
    safe_name,
    usage_of,
    validated,
)

_BRIDGE = b'{"role":"assistant","content":"OK."}'
"""Goes between a tool's message and a user's, which strict servers reject in direct succession."""
_BESIDE_CALLS = {"reasoning", "reasoning_content"}
"""Plain-text thoughts are wanted back only with calls; some servers refuse them elsewhere."""


class _Open(BaseModel):
    model_config = ConfigDict(extra="allow")

    @property
    def more(self) -> dict[str, Any]:
        """The fields that the API does not define, without nulls."""
        return {k: v for k, v in (self.model_extra or {}).items() if v is not None}


class _Function(_Open):
    name: str | None = None
    arguments: Any = None


class _Call(_Open):
    id: str | int | None = None
    index: Any = None
    type: Any = None
    function: _Function = _Function()


class _Message(_Open):
    content: str | list[dict[str, Any]] | None = None
    refusal: str | None = None
    tool_calls: list[_Call] | None = None

    @property
    def text(self) -> str:
        return joined_text(self.content or "")


class _Choice(BaseModel):
    message: _Message
    finish_reason: str | None = None


class _Completion(BaseModel):
    choices: Annotated[list[_Choice], MinLen(1)]
    usage: Any = None


class OpenAIChat(Wire):
    """The wire format of OpenAI's Chat Completions API."""

    assembly = ChatAssembly

    def __init__(self, model: str, price: Price, owner: str = "") -> None:
        self._model, self.price = dumped(model), price
        self._ids = CallIds(owner or f"openai:{model}")
        self._returned: set[str] = set()
        self._refused: set[str] = set()
        self._messages = MessageCache(self._rendered)

    def path(self, *, stream: bool) -> str:
        """Return what follows the base URL."""
        return "/chat/completions"

    def body(self, request: Request, *, stream: bool) -> bytes:
        """Return a request as JSON."""
        written = [_system_message(request.system)] if request.system else []
        written += self._conversation(request)
        parts = [b'{"model":', self._model, b',"messages":[', b",".join(written), b"]"]
        if request.tools:
            parts += [b',"tools":', _functions(request.tools)]
        if stream:
            parts.append(b',"stream":true,"stream_options":{"include_usage":true}')
        return b"".join([*parts, b"}"])

    def reply(self, body: Any, request: Request) -> Reply:
        """Return the reply that a complete body holds."""
        completion = validated(body, _Completion, "chat completion")
        choices = completion.choices
        # Some gateways put the words and the calls of one reply into separate choices.
        spoken = next((c for c in choices if c.message.text.strip()), choices[0])
        choice = next((c for c in choices if c.message.tool_calls), spoken)
        message = choice.message
        if message.refusal:
            raise refused(message.refusal)
        _check_finish_reason(choice.finish_reason)
        written = [
            (None if c.id is None else str(c.id), c.function.name or "", c.function.arguments)
            for c in message.tool_calls or ()
        ]
        text, calls = read(spoken.message.text, written, request)
        kept = _fields_to_return(message, bool(calls))
        return Reply(
            text=text,
            calls=calls,
            usage=openai_usage(completion.usage, self.price, "prompt", "completion"),
            opaque=self._ids.opaque(calls, (kept,) if kept else ()),
        )

    def gives_up(self, refusal: str) -> bool:
        """Stop sending back the reply fields that a refusal names; return whether it names any."""
        named = {name for name in self._returned if name in refusal} - self._refused
        self._refused |= named
        if named:
            self._messages = MessageCache(self._rendered)
        return bool(named)

    def _conversation(self, request: Request) -> list[bytes]:
        """Return messages as strict servers take them: successive user messages become one."""
        written: list[bytes] = []
        said: list[tuple[bytes, bytes]] = []
        after_tool = False
        for message in request.messages:
            text, shown = self._messages(message)
            if isinstance(message, Reply):
                written += _users_turn(said, after_tool)
                said = []
            if not isinstance(message, User):
                written.append(text)
                after_tool = isinstance(message, Result)
            if shown:
                said.append((text if isinstance(message, User) else b"", shown))
        return written + _users_turn(said, after_tool)

    def _rendered(self, message: User | Reply | Result) -> tuple[bytes, bytes]:
        """Return a message, and what of it goes into the next user message as parts.

        Results hold only text in this API, so their images go into a user message. Of a user's
        own message the first value is its content where that is text alone, else empty.
        """
        if isinstance(message, User):
            parts = [_text_part(message.text), *map(_image_part, message.images)]
            return b"" if message.images else dumped(message.text), b",".join(parts)
        if isinstance(message, Reply):
            return self._assistant_message(message), b""
        id = self._ids(message.call_id)
        result = {"role": "tool", "tool_call_id": id, "content": message.text}
        if not message.images:
            return dumped(result), b""
        caption = _text_part(f"What {safe_name(message.name)} shows ({id}):")
        return dumped(result), b",".join([caption, *map(_image_part, message.images)])

    def _assistant_message(self, reply: Reply) -> bytes:
        """Return a reply as JSON, with what came beside its text and calls."""
        items = self._ids.items(reply)
        kept = {k: v for k, v in (items[0] if items else {}).items() if k not in self._refused}
        signs: list[dict[str, Any]] = [*kept.pop("tool_calls", ()), *({} for _ in reply.calls)]
        message: dict[str, Any] = {"role": "assistant", "content": reply.text} | kept
        self._returned.update(kept.keys() - {"content"})
        calls: list[dict[str, Any]] = []
        for call, sign in zip(reply.calls, signs, strict=False):
            more = {k: v for k, v in sign.items() if k not in self._refused}
            function = {"name": safe_name(call.name), "arguments": dumped(call.arguments).decode()}
            function |= more.pop("function", {})
            self._returned.update(more)
            calls.append(
                {"id": self._ids(call.id), "type": "function", "function": function} | more
            )
        return dumped(message | ({"tool_calls": calls} if calls else {}))


def _fields_to_return(message: _Message, calling: bool) -> dict[str, Any]:
    """Return what came beside text and calls and must be sent back, as fields of the message."""
    kept = {name: value for name, value in message.more.items() if goes_back(name)}
    if not calling:
        return {name: value for name, value in kept.items() if name not in _BESIDE_CALLS}
    signs = [
        call.more | ({"function": call.function.more} if call.function.more else {})
        for call in message.tool_calls or ()
    ]
    if any(signs):
        kept["tool_calls"] = signs
    content = message.content or ""
    thinks = (
        "</think" in content if isinstance(content, str) else any("text" not in p for p in content)
    )
    # If the calls came in the text, the content is rebuilt instead.
    return kept | ({"content": content} if thinks and message.tool_calls else {})


def _check_finish_reason(reason: str | None) -> None:
    if reason == "length":
        raise cut_off()
    if reason == "content_filter":
        raise refused("its provider's filter of contents")
    if reason == "error":
        raise AskError("broke its reply off with an error", "try again later", "later")


def openai_usage(usage: Any, price: Price, read: str, wrote: str) -> Usage:
    """Return tokens and cost; `read` and `wrote` are the API's names for input and output."""
    given, details = count(usage, f"{read}_tokens"), f"{read}_tokens_details"
    cached = min(given, count(usage, details, "cached_tokens"))
    written = count(usage, details, "cache_write_tokens") if price.written else 0
    written = min(given - cached, written)
    fresh, output = given - cached - written, count(usage, f"{wrote}_tokens")
    return usage_of(price, fresh=fresh, cached=cached, written=written, output=output)


def _users_turn(said: list[tuple[bytes, bytes]], after_tool: bool) -> list[bytes]:
    """Return one message of all parts, with a bridge before it if needed; text alone stays text."""
    if not said:
        return []
    (content, parts), alone = said[0], len(said) == 1
    if not (alone and content):
        content = b"[%b]" % (parts if alone else b",".join(shown for _, shown in said))
    turn = b'{"role":"user","content":%b}' % content
    return [_BRIDGE, turn] if after_tool else [turn]


def _text_part(text: str) -> bytes:
    return dumped({"type": "text", "text": text})


def _image_part(image: bytes) -> bytes:
    return dumped({"type": "image_url", "image_url": {"url": data_url(image)}})


@lru_cache(maxsize=16)
def _system_message(text: str) -> bytes:
    return dumped({"role": "system", "content": text})


@lru_cache(maxsize=16)
def _functions(tools: tuple[Tool, ...]) -> bytes:
    functions = described(tools, "parameters")
    return dumped([{"type": "function", "function": function} for function in functions])
