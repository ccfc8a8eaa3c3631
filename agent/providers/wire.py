"""What all adapters share: their protocols, a cache of rendered messages, token counts."""

import base64
import json
import re
import weakref
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Generic, Protocol, TypeVar, cast

from pydantic import BaseModel, ValidationError

from ...tools.tool import Tool
from ..messages import Reply, Result, Usage, User
from ..model import Request
from .failures import unexpected
from .prices import Price

T = TypeVar("T")
Body = TypeVar("Body", bound=BaseModel)
MOST_TOKENS = 10**12
"""No request uses so many tokens; a server that reports them is not believed."""
_JPEG = b"\xff\xd8"


class Assembly(Protocol):
    """Assembles the events of a stream into what would have come unstreamed."""

    events: ClassVar[str]
    """What the events are part of, for error messages."""
    done: bool = False
    """Whether the reply is complete, whatever happens to the connection afterwards."""

    def add(self, event: Any) -> str:
        """Add an event and return the text it brings, for display.

        Raises:
            AskError: it is not one of this provider's events.
        """
        # Not validated: a reply has hundreds of events. The body they make up is validated.
        try:
            return self.take(event)
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError):
            raise unexpected(f"a stream of something else than {self.events}") from None

    def take(self, event: Any) -> str:
        """Do what `add` does, with any built-in error for an event that is not this provider's."""
        ...

    def whole(self) -> Any:
        """Return the complete body."""
        ...


class Wire(Protocol):
    """One provider's wire format, made from the server's name for a model and its token prices.

    It does no I/O. A third argument, the owner, says whose replies it may send back as they came.
    """

    assembly: type[Assembly]
    """Assembles the events of one stream."""

    def path(self, *, stream: bool) -> str:
        """Return what follows the base URL, with the version of the API if it has one."""
        ...

    def headers(self, key: str | None) -> dict[str, str]:
        """Return the headers that the provider wants: the key, where there is one."""
        return {"authorization": f"Bearer {key}"} if key else {}

    def body(self, request: Request, *, stream: bool) -> bytes:
        """Return a request as JSON."""
        ...

    def reply(self, body: Any, request: Request) -> Reply:
        """Return the reply that a complete body holds.

        Raises:
            AskError: it holds no reply that may be acted on.
        """
        ...

    def gives_up(self, refusal: str) -> bool:
        """Drop what a server refused in these words; return False if there is nothing to drop."""
        return False


class MessageCache(Generic[T]):
    """A cache of rendered messages, each forgotten together with its message.

    Histories are tuples of frozen messages that grow at their end, so the next request finds all
    but the last two here.
    """

    def __init__(self, render: Callable[[User | Reply | Result], T]) -> None:
        self._render = render
        self._known: dict[int, tuple[weakref.ref[User | Reply | Result], T]] = {}

    def __call__(self, message: User | Reply | Result) -> T:
        """Return the message as rendered, rendering it if it is new."""
        key = id(message)
        known = self._known.get(key)
        if known is None:
            forget = weakref.ref(message, lambda _: self._known.pop(key, None))
            known = self._known[key] = (forget, self._render(message))
        return known[1]


_ENCODER = json.JSONEncoder(separators=(",", ":"))


def dumped(value: object) -> bytes:
    """Return compact JSON, in ASCII so that no text can fail."""
    return _ENCODER.encode(value).encode()


def described(tools: Iterable[Tool], schema: str) -> list[dict[str, Any]]:
    """Return tools as providers list them; `schema` is this one's name for the parameters'."""
    return [{"name": t.name, "description": t.description, schema: t.offered} for t in tools]


def validated(body: Any, form: type[Body], noun: str) -> Body:
    """Return a complete body in the form that the API promises.

    Raises:
        AskError: the body is no `noun`.
    """
    try:
        return form.model_validate(body)
    except ValidationError:
        raise unexpected(f"something that is no {noun}") from None


def media_type(image: bytes) -> str:
    """Return the media type of a PNG or JPEG file."""
    return "image/jpeg" if image.startswith(_JPEG) else "image/png"


def base64_text(image: bytes) -> str:
    """Return a file as base64 text."""
    return base64.b64encode(image).decode()


def data_url(image: bytes) -> str:
    """Return a PNG or JPEG file as a data URL."""
    return f"data:{media_type(image)};base64,{base64_text(image)}"


def safe_name(name: str) -> str:
    """Return a name that no server refuses; models make up others."""
    return re.sub(r"[^a-zA-Z0-9_-]", "_", name)[:64] or "unnamed"


def count(usage: object, *path: str) -> int:
    """Return the token count at a path in a usage object; 0 where it is missing or implausible."""
    value = usage
    for name in path:
        value = cast("dict[str, Any]", value).get(name) if isinstance(value, dict) else None
    return value if isinstance(value, int) and 0 < value < MOST_TOKENS else 0


def usage_of(price: Price, *, fresh: int, cached: int, written: int = 0, output: int) -> Usage:
    """Return tokens and cost; input is fresh, read from a cache (cached) or written to one."""
    return Usage(
        input_tokens=fresh + cached + written,
        cached_tokens=cached,
        output_tokens=output,
        cost_usd=price.cost(fresh=fresh, cached=cached, written=written, output=output),
    )
