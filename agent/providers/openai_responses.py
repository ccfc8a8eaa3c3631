"""OpenAI's Responses API, used without any state on the server.

Nothing is stored there, so a model's thoughts are sent back to it encrypted, with its calls.
"""

import io
from functools import lru_cache
from typing import Any

from pydantic import BaseModel

from ...tools.tool import Tool
from ..messages import Reply, Result, User
from ..model import Request
from .calls import CallIds, give_names, read
from .failures import AskError, cut_off, of_error_body, refused
from .openai_chat import openai_usage
from .prices import Price
from .wire import (
    Assembly,
    MessageCache,
    Wire,
    data_url,
    described,
    dumped,
    safe_name,
    validated,
)

_ENDS = {"response.completed", "response.incomplete", "response.failed"}
_KEY_ADVICE = "check the key"


class _Part(BaseModel):
    type: str = ""
    text: str | None = None
    refusal: str | None = None


class _Item(BaseModel):
    type: str
    content: list[_Part] | None = None
    phase: str | None = None
    encrypted_content: str | None = None
    call_id: str | None = None
    name: str | None = None
    arguments: Any = None


class _Details(BaseModel):
    reason: str | None = None


class _Response(BaseModel):
    output: list[_Item]
    status: str | None = None
    incomplete_details: _Details | None = None
    usage: Any = None


class _Assembly(Assembly):
    events = "responses"

    def __init__(self) -> None:
        self._items: dict[Any, dict[str, Any]] = {}
        self._written: dict[Any, io.StringIO] = {}
        self._response: dict[str, Any] = {}

    def whole(self) -> Any:
        # Some servers end with a response that repeats nothing of what they streamed.
        items = [self._item(place) for place in self._items]
        return self._response | {"output": self._response.get("output") or items}

    def take(self, event: dict[str, Any]) -> str:
        if event.get("object") == "response":  # the whole response in one event
            event = {"type": "response.completed", "response": event}
        kind, place = event["type"], event.get("output_index", len(self._items))
        hash(place)
        if kind in ("response.output_text.delta", "response.function_call_arguments.delta"):
            self._written.setdefault(place, io.StringIO()).write(event["delta"])
            return event["delta"] if "text" in kind else ""
        if kind in ("response.output_item.added", "response.output_item.done"):
            self._items[place] = {} | event["item"]
        elif kind in _ENDS:
            self._response, self.done = {} | event["response"], True
        elif kind == "error" and (failure := of_error_body({"error": event}, _KEY_ADVICE)):
            raise failure
        elif not isinstance(kind, str):
            raise TypeError
        return ""

    def _item(self, place: Any) -> dict[str, Any]:
        """Return an item as it was completed, or else assembled from its fragments."""
        item = self._items[place]
        written = self._written[place].getvalue() if place in self._written else ""
        if item.get("type") == "function_call":
            return item | {"arguments": item.get("arguments") or written}
        text = [{"type": "output_text", "text": written}] if written else []
        return item | ({"content": item.get("content") or text} if text else {})


class OpenAIResponses(Wire):
    """The wire format of OpenAI's Responses API."""

    assembly = _Assembly

    def __init__(self, model: str, price: Price, owner: str = "") -> None:
        self._model, self.price = dumped(model), price
        self._ids = CallIds(owner or f"openai-responses:{model}")
        self._keeps_thoughts = True
        self._items = MessageCache(self._written)

    def path(self, *, stream: bool) -> str:
        """Return what follows the base URL."""
        return "/responses"

    def body(self, request: Request, *, stream: bool) -> bytes:
        """Return a request as JSON."""
        parts = [b'{"model":', self._model, b',"store":false']
        if self._keeps_thoughts:
            parts.append(b',"include":["reasoning.encrypted_content"]')
        if request.system:
            parts += [b',"instructions":', dumped(request.system)]
        if request.tools:
            parts += [b',"tools":', _function_tools(request.tools)]
        written = [text for message in request.messages if (text := self._items(message))]
        parts += [b',"input":[', b",".join(written), b"]"]
        if stream:
            parts.append(b',"stream":true')
        return b"".join([*parts, b"}"])

    def reply(self, body: Any, request: Request) -> Reply:
        """Return the reply that a complete body holds."""
        if failure := of_error_body(body, _KEY_ADVICE):
            raise failure
        response = validated(body, _Response, "response")
        _check_status(response)
        messages = [item for item in response.output if item.type == "message"]
        parts = [part for message in messages for part in message.content or ()]
        if refusal := "".join(part.refusal or "" for part in parts):
            raise refused(refusal)
        made = [item for item in response.output if item.type == "function_call"]
        written = [(item.call_id, item.name or "", item.arguments) for item in made]
        text, calls = read("".join(part.text or "" for part in parts), written, request)
        items: tuple[dict[str, Any], ...] = ()
        if len(made) == len(calls) and _needs_original_items(response.output):
            said: list[dict[str, Any]] = body["output"]
            items = tuple({k: v for k, v in item.items() if v is not None} for item in said)
            give_names([i for i in items if i["type"] == "function_call"], calls, "call_id")
        usage = openai_usage(response.usage, self.price, "input", "output")
        return Reply(text=text, calls=calls, usage=usage, opaque=self._ids.opaque(calls, items))

    def gives_up(self, refusal: str) -> bool:
        """Stop asking for encrypted thoughts if refused, as models without thoughts do."""
        if not self._keeps_thoughts or "encrypted" not in refusal.lower():
            return False
        self._keeps_thoughts = False
        self._items = MessageCache(self._written)
        return True

    def _written(self, message: User | Reply | Result) -> bytes:
        """Return the items of a message; none if a reply is empty."""
        if isinstance(message, User):
            return dumped({"role": "user", "content": _input_content(message.text, message.images)})
        if isinstance(message, Result):
            head = {"type": "function_call_output", "call_id": self._ids(message.call_id)}
            return dumped(head | {"output": _input_content(message.text, message.images)})
        items = self._ids.items(message)
        kept = items if self._keeps_thoughts else ()
        return b",".join(map(dumped, kept or self._items_of(message)))

    def _items_of(self, reply: Reply) -> list[dict[str, Any]]:
        """Return the items of a reply that holds nothing but text and calls."""
        text = [{"role": "assistant", "content": reply.text}] if reply.text.strip() else []
        calls = [
            {
                "type": "function_call",
                "call_id": self._ids(call.id),
                "name": safe_name(call.name),
                "arguments": dumped(call.arguments).decode(),
            }
            for call in reply.calls
        ]
        return [*text, *calls]


def _check_status(response: _Response) -> None:
    status = response.status or "completed"
    if status == "incomplete":
        details = response.incomplete_details
        if details and details.reason == "content_filter":
            raise refused("its provider's filter of contents")
        raise cut_off()
    if status != "completed":
        raise AskError(f"broke its reply off ({status})", "try again later", "later")


def _needs_original_items(items: list[_Item]) -> bool:
    """Return whether a reply holds more than text and calls, and can be sent back as it came.

    Thoughts that came without their content cannot be looked up by a server that stores none.
    """
    thoughts = [item for item in items if item.type not in ("message", "function_call")]
    whole = all(item.encrypted_content or item.content for item in thoughts)
    return whole and bool(thoughts or any(item.phase for item in items))


def _input_content(text: str, images: tuple[bytes, ...]) -> str | list[dict[str, str]]:
    if not images:
        return text
    urls = [data_url(image) for image in images]
    shown = [{"type": "input_image", "detail": "auto", "image_url": url} for url in urls]
    return [{"type": "input_text", "text": text}, *shown]


@lru_cache(maxsize=16)
def _function_tools(tools: tuple[Tool, ...]) -> bytes:
    # The schemas have optional parameters, which strict mode does not allow.
    listed = described(tools, "parameters")
    return dumped([{"type": "function"} | tool | {"strict": False} for tool in listed])
