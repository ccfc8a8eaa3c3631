"""OpenAI Chat Completions, and what else speaks it: vLLM, Ollama, llama.cpp, LM Studio, ...

Only fields that every such server knows are sent, and never a null: some refuse either.
"""

import io
import re
from functools import lru_cache
from typing import Annotated, Any, cast

from annotated_types import MinLen
from pydantic import BaseModel
from pydantic_core import from_json

from ...tools.tool import Tool
from ..messages import Reply, Result, Usage, User
from ..model import Request
from .failures import AskError, cut_off, empty, refused
from .prices import Price
from .wire import (
    Assembly,
    MessageCache,
    Wire,
    count,
    data_url,
    described,
    dumped,
    make_calls,
    safe_name,
    usage_of,
    validated,
)

_THOUGHTS = re.compile(r"\A\s*<think>.*?</think>", re.DOTALL)
_FENCES = re.compile(r"\A(?:```(?:json)?\s(.*)```|<tool_call>(.*)</tool_call>)\Z", re.DOTALL)


class _Function(BaseModel):
    name: str | None = None
    arguments: Any = None


class _Call(BaseModel):
    id: str | int | None = None
    function: _Function = _Function()


class _Message(BaseModel):
    content: str | list[dict[str, Any]] | None = None
    refusal: str | None = None
    tool_calls: list[_Call] | None = None

    @property
    def text(self) -> str:
        return _joined_text(self.content or "")


class _Choice(BaseModel):
    message: _Message
    finish_reason: str | None = None


class _Completion(BaseModel):
    choices: Annotated[list[_Choice], MinLen(1)]
    usage: Any = None


class _Assembly(Assembly):
    events = "chat completions"

    def __init__(self) -> None:
        self._text, self._refusal = io.StringIO(), io.StringIO()
        self._calls: list[dict[str, Any]] = []
        self._at: dict[int | None, dict[str, Any]] = {}
        self._finish: str | None = None
        self._usage: Any = None

    def take(self, event: dict[str, Any]) -> str:
        self._usage = event.get("usage") or self._usage
        choices = event.get("choices") or ()
        return "".join([self._choice(c) for c in choices if not c.get("index")])

    def whole(self) -> Any:
        calls = [
            {"id": c["id"], "function": {"name": c["name"], "arguments": "".join(c["arguments"])}}
            for c in self._calls
        ]
        content, refusal = self._text.getvalue(), self._refusal.getvalue()
        message = {"content": content, "refusal": refusal, "tool_calls": calls}
        return {
            "choices": [{"message": message, "finish_reason": self._finish}],
            "usage": self._usage,
        }

    def _choice(self, choice: dict[str, Any]) -> str:
        """Take the fragment of an answer in; the text it brings."""
        if choice.get("finish_reason"):
            self._finish, self.done = choice["finish_reason"], True
        delta: dict[str, Any] = choice.get("delta") or {}
        for part in delta.get("tool_calls") or ():
            self._call(part)
        if delta.get("refusal"):
            self._refusal.write(_joined_text(delta["refusal"]))
        text = _joined_text(delta.get("content") or "")
        self._text.write(text)
        return text

    def _call(self, part: dict[str, Any]) -> None:
        """Take the fragment of a call in."""
        call, id = self._at.get(part.get("index")), part.get("id")
        # Some servers leave the index out, or give every parallel call the same one.
        if call is None or (id and call["id"] and id != call["id"]):
            call = self._at[part.get("index")] = {"id": None, "name": None, "arguments": []}
            self._calls.append(call)
        function: dict[str, Any] = part.get("function") or {}
        call["id"] = call["id"] or id
        call["name"] = call["name"] or function.get("name")
        given = function.get("arguments")
        if given is not None:
            call["arguments"].append(given if isinstance(given, str) else dumped(given).decode())


class OpenAIChat(Wire):
    """Speaks Chat Completions."""

    assembly = _Assembly

    def __init__(self, model: str, price: Price) -> None:
        self._model, self.price = dumped(model), price
        self._messages = MessageCache(_rendered)

    def path(self, *, stream: bool) -> str:
        """What follows the base URL."""
        return "/chat/completions"

    def body(self, request: Request, *, stream: bool) -> bytes:
        """A request as JSON."""
        written = [_system_message(request.system)] if request.system else []
        pictures: list[bytes] = []
        for message in request.messages:
            if pictures and not isinstance(message, Result):
                written += pictures
                pictures = []
            text, picture = self._messages(message)
            written.append(text)
            if picture:
                pictures.append(picture)
        parts = [b'{"model":', self._model, b',"messages":[', b",".join(written + pictures), b"]"]
        if request.tools:
            parts += [b',"tools":', _functions(request.tools)]
        if stream:
            parts.append(b',"stream":true,"stream_options":{"include_usage":true}')
        return b"".join([*parts, b"}"])

    def reply(self, body: Any, request: Request) -> Reply:
        """What a complete body answers to a request."""
        completion = validated(body, _Completion, "chat completion")
        choice = completion.choices[0]
        message = choice.message
        if message.refusal:
            raise refused(message.refusal)
        _check_finish_reason(choice.finish_reason)
        text = _THOUGHTS.sub("", message.text).strip()
        written = [
            (None if c.id is None else str(c.id), c.function.name or "", c.function.arguments)
            for c in message.tool_calls or ()
        ]
        if not written and (call := call_in_text(text, request.tools)):
            text, written = "", [(None, *call)]
        if not text and not written:
            raise empty()
        calls = make_calls(written, request.messages)
        usage = openai_usage(completion.usage, self.price, "prompt", "completion")
        return Reply(text=text, calls=calls, usage=usage)


def _joined_text(content: str | list[dict[str, Any]]) -> str:
    """Text; some servers answer in parts, as one may ask."""
    if isinstance(content, str):
        return content
    return "".join([str(part.get("text") or "") for part in content])


def call_in_text(text: str, tools: tuple[Tool, ...]) -> tuple[str, dict[str, Any]] | None:
    """The call that a text is and nothing else: name and arguments, or None.

    Servers that do not know a model's format leave its calls in the text. One is taken as a call
    only if the whole text, a code fence or tool_call tags aside, is one JSON object of `name` and
    `arguments` (or `parameters`) and the name is a tool's; anything more may be meant as words.
    """
    fenced = _FENCES.match(text)
    try:
        data: Any = from_json((fenced[1] or fenced[2]) if fenced else text, allow_inf_nan=False)
    except ValueError:
        return None
    if not isinstance(data, dict):
        return None
    fields = dict(cast("dict[str, Any]", data))
    if fields.get("type") == "function":
        del fields["type"]
    name, arguments = fields.get("name"), fields.get("arguments", fields.get("parameters"))
    known = any(tool.name == name for tool in tools)
    if len(fields) != 2 or not known or not isinstance(arguments, dict):
        return None
    return str(name), cast("dict[str, Any]", arguments)


def _check_finish_reason(reason: str | None) -> None:
    if reason == "length":
        raise cut_off()
    if reason == "content_filter":
        raise refused("its provider's filter of contents")
    if reason == "error":
        raise AskError("broke its reply off with an error", "try again later", "later")


def openai_usage(usage: Any, price: Price, read: str, wrote: str) -> Usage:
    """Tokens and their cost; `read` and `wrote` are what the interface calls input and output."""
    given, details = count(usage, f"{read}_tokens"), f"{read}_tokens_details"
    cached = min(given, count(usage, details, "cached_tokens"))
    written = count(usage, details, "cache_write_tokens") if price.written else 0
    written = min(given - cached, written)
    fresh, output = given - cached - written, count(usage, f"{wrote}_tokens")
    return usage_of(price, fresh=fresh, cached=cached, written=written, output=output)


def _rendered(message: User | Reply | Result) -> tuple[bytes, bytes | None]:
    """A message, and the one that must follow the last result to show its images."""
    if isinstance(message, User):
        return _user_message(message.text, message.images), None
    if isinstance(message, Reply):
        return _assistant_message(message), None
    result = {"role": "tool", "tool_call_id": safe_name(message.call_id), "content": message.text}
    caption = f"What {safe_name(message.name)} shows ({safe_name(message.call_id)}):"
    # Results of tools hold text only in this interface.
    return dumped(result), _user_message(caption, message.images) if message.images else None


def _user_message(text: str, images: tuple[bytes, ...]) -> bytes:
    if not images:
        return dumped({"role": "user", "content": text})
    shown = [{"type": "image_url", "image_url": {"url": data_url(image)}} for image in images]
    return dumped({"role": "user", "content": [{"type": "text", "text": text}, *shown]})


def _assistant_message(reply: Reply) -> bytes:
    message: dict[str, Any] = {"role": "assistant", "content": reply.text}
    if reply.calls:
        message["tool_calls"] = [
            {
                "id": safe_name(call.id),
                "type": "function",
                "function": {
                    "name": safe_name(call.name),
                    "arguments": dumped(call.arguments).decode(),
                },
            }
            for call in reply.calls
        ]
    return dumped(message)


@lru_cache(maxsize=16)
def _system_message(text: str) -> bytes:
    return dumped({"role": "system", "content": text})


@lru_cache(maxsize=16)
def _functions(tools: tuple[Tool, ...]) -> bytes:
    functions = described(tools, "parameters")
    return dumped([{"type": "function", "function": function} for function in functions])
