"""OpenAI Responses, used without any state on the server.

Nothing is stored there, so that what a model thought comes back to it encrypted, with its calls.
"""

from functools import lru_cache
from typing import Any

from pydantic import BaseModel

from ...tools.tool import Tool
from ..messages import Call, Opaque, Reply, Result, User
from ..model import Request
from .failures import AskError, cut_off, empty, of_error_body, refused
from .openai_chat import openai_usage
from .prices import Price
from .wire import (
    Assembly,
    MessageCache,
    Wire,
    data_url,
    described,
    dumped,
    make_calls,
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
        self._items: list[Any] = []
        self._response: dict[str, Any] = {}

    def whole(self) -> Any:
        # Some servers end with a response that repeats nothing of what they streamed.
        return self._response | {"output": self._response.get("output") or self._items}

    def take(self, event: dict[str, Any]) -> str:
        kind = event["type"]
        if kind == "response.output_text.delta":
            return "".join([event["delta"]])
        if kind == "response.output_item.done":
            self._items.append(event["item"])
        elif kind in _ENDS:
            self._response, self.done = {} | event["response"], True
        elif kind == "error" and (failure := of_error_body({"error": event}, _KEY_ADVICE)):
            raise failure
        elif not isinstance(kind, str):
            raise TypeError
        return ""


class OpenAIResponses(Wire):
    """Speaks Responses."""

    assembly = _Assembly

    def __init__(self, model: str, price: Price) -> None:
        self._model, self._name, self.price = dumped(model), f"openai-responses:{model}", price
        self._keeps_thoughts = True
        self._items = MessageCache(self._written)

    def path(self, *, stream: bool) -> str:
        """What follows the base URL."""
        return "/responses"

    def body(self, request: Request, *, stream: bool) -> bytes:
        """A request as JSON."""
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
        """What a complete body answers to a request."""
        if failure := of_error_body(body, _KEY_ADVICE):
            raise failure
        response = validated(body, _Response, "response")
        _check_status(response)
        messages = [item for item in response.output if item.type == "message"]
        parts = [part for message in messages for part in message.content or ()]
        if refusal := "".join(part.refusal or "" for part in parts):
            raise refused(refusal)
        text = "".join(part.text or "" for part in parts).strip()
        made = [item for item in response.output if item.type == "function_call"]
        if not text and not made:
            raise empty()
        written = [(item.call_id, item.name or "", item.arguments) for item in made]
        calls = make_calls(written, request.messages)
        opaque = None
        if _must_be_kept(response.output):
            opaque = Opaque(model=self._name, items=_with_ids(body["output"], calls))
        usage = openai_usage(response.usage, self.price, "input", "output")
        return Reply(text=text, calls=calls, usage=usage, opaque=opaque)

    def gives_up(self, refusal: str) -> bool:
        """Do without encrypted thoughts: models that do not think refuse to be asked for them."""
        if not self._keeps_thoughts or "encrypted" not in refusal.lower():
            return False
        self._keeps_thoughts = False
        self._items = MessageCache(self._written)
        return True

    def _written(self, message: User | Reply | Result) -> bytes:
        """The items of a message, none where it says nothing."""
        if isinstance(message, User):
            return dumped({"role": "user", "content": _input_content(message.text, message.images)})
        if isinstance(message, Result):
            head = {"type": "function_call_output", "call_id": safe_name(message.call_id)}
            return dumped(head | {"output": _input_content(message.text, message.images)})
        opaque = message.opaque if self._keeps_thoughts else None
        own = opaque is not None and opaque.model == self._name
        items = opaque.items if opaque and own else _items_of(message)
        return b",".join(map(dumped, items))


def _check_status(response: _Response) -> None:
    status = response.status or "completed"
    if status == "incomplete":
        details = response.incomplete_details
        if details and details.reason == "content_filter":
            raise refused("its provider's filter of contents")
        raise cut_off()
    if status != "completed":
        raise AskError(f"broke its reply off ({status})", "try again later", "later")


def _must_be_kept(items: list[_Item]) -> bool:
    """Whether a reply holds more than text and calls, and all that it takes to send it back.

    Thoughts that came without their content cannot be looked up by a server that stores none.
    """
    thoughts = [item for item in items if item.type not in ("message", "function_call")]
    whole = all(item.encrypted_content or item.content for item in thoughts)
    return whole and bool(thoughts or any(item.phase for item in items))


def _with_ids(items: list[dict[str, Any]], calls: tuple[Call, ...]) -> tuple[dict[str, Any], ...]:
    """Items whose calls have the ids that their results will name."""
    ids = iter(calls)
    kept: list[dict[str, Any]] = []
    for item in items:
        call = {"call_id": safe_name(next(ids).id)} if item["type"] == "function_call" else {}
        kept.append({name: value for name, value in item.items() if value is not None} | call)
    return tuple(kept)


def _items_of(reply: Reply) -> tuple[dict[str, Any], ...]:
    """A reply of which text and calls are all there is."""
    text = [{"role": "assistant", "content": reply.text}] if reply.text.strip() else []
    calls = [
        {
            "type": "function_call",
            "call_id": safe_name(call.id),
            "name": safe_name(call.name),
            "arguments": dumped(call.arguments).decode(),
        }
        for call in reply.calls
    ]
    return (*text, *calls)


def _input_content(text: str, images: tuple[bytes, ...]) -> str | list[dict[str, str]]:
    if not images:
        return text
    urls = [data_url(image) for image in images]
    shown = [{"type": "input_image", "detail": "auto", "image_url": url} for url in urls]
    return [{"type": "input_text", "text": text}, *shown]


@lru_cache(maxsize=16)
def _function_tools(tools: tuple[Tool, ...]) -> bytes:
    # The schemas have optional parameters, which strict mode does not know.
    listed = described(tools, "parameters")
    return dumped([{"type": "function"} | tool | {"strict": False} for tool in listed])
