"""What every adapter needs: the protocol of one, messages written once, tokens counted."""

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
"""No request counts so many; a server that says so does not know."""
_JPEG = b"\xff\xd8"


class Assembly(Protocol):
    """Puts the events of a stream together to what would have come unstreamed."""

    events: ClassVar[str]
    """What the events are part of, for messages."""
    done: bool = False
    """Whether the reply is complete, whatever the connection does from here."""

    def add(self, event: Any) -> str:
        """Take an event in; the text it brings, for display.

        Raises:
            AskError: it is none of this provider's.
        """
        # Read by hand: there are hundreds of these a reply. What they make up is validated whole.
        try:
            return self.take(event)
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError):
            raise unexpected(f"a stream of something else than {self.events}") from None

    def take(self, event: Any) -> str:
        """As `add`, with any builtin error for what is not this provider's."""
        ...

    def whole(self) -> Any:
        """The complete body."""
        ...


class Wire(Protocol):
    """One provider's language, made of a model as the server calls it and the price of its tokens.

    It does no I/O. A third argument, the owner, says whose replies it may send back as they came.
    """

    assembly: type[Assembly]
    """Takes the events of one stream in."""

    def path(self, *, stream: bool) -> str:
        """What follows the base URL, with the version of the interface if it has one."""
        ...

    def headers(self, key: str | None) -> dict[str, str]:
        """What it wants beside the body: the key, where there is one."""
        return {"authorization": f"Bearer {key}"} if key else {}

    def body(self, request: Request, *, stream: bool) -> bytes:
        """A request as JSON."""
        ...

    def reply(self, body: Any, request: Request) -> Reply:
        """What a complete body answers to a request.

        Raises:
            AskError: it is no reply that may be acted on.
        """
        ...

    def gives_up(self, refusal: str) -> bool:
        """Do without what a server refused in these words; False if there is no such thing."""
        return False


class MessageCache(Generic[T]):
    """Renders each message once, and forgets it together with the message.

    Histories are tuples of frozen messages that grow at their end, so that the next turn finds
    all but the last two here.
    """

    def __init__(self, render: Callable[[User | Reply | Result], T]) -> None:
        self._render = render
        self._known: dict[int, tuple[weakref.ref[User | Reply | Result], T]] = {}

    def __call__(self, message: User | Reply | Result) -> T:
        """The message as rendered before, or now."""
        key = id(message)
        known = self._known.get(key)
        if known is None:
            forget = weakref.ref(message, lambda _: self._known.pop(key, None))
            known = self._known[key] = (forget, self._render(message))
        return known[1]


_ENCODER = json.JSONEncoder(separators=(",", ":"))


def dumped(value: object) -> bytes:
    """Compact JSON; ASCII, so that no text whatever fails."""
    return _ENCODER.encode(value).encode()


def described(tools: Iterable[Tool], schema: str) -> list[dict[str, Any]]:
    """Tools as providers list them; `schema` is what this one calls that of the parameters."""
    return [{"name": t.name, "description": t.description, schema: t.offered} for t in tools]


def validated(body: Any, form: type[Body], noun: str) -> Body:
    """A complete body in the form that the interface promises.

    Raises:
        AskError: it is no `noun`.
    """
    try:
        return form.model_validate(body)
    except ValidationError:
        raise unexpected(f"something that is no {noun}") from None


def media_type(image: bytes) -> str:
    """Of a PNG or JPEG file."""
    return "image/jpeg" if image.startswith(_JPEG) else "image/png"


def base64_text(image: bytes) -> str:
    """A file as text."""
    return base64.b64encode(image).decode()


def data_url(image: bytes) -> str:
    """A PNG or JPEG file as a URL that holds it."""
    return f"data:{media_type(image)};base64,{base64_text(image)}"


def safe_name(name: str) -> str:
    """A name that no server refuses, for models make up others."""
    return re.sub(r"[^a-zA-Z0-9_-]", "_", name)[:64] or "unnamed"


def count(usage: object, *path: str) -> int:
    """A number of tokens somewhere in a usage object; 0 where servers leave it out."""
    value = usage
    for name in path:
        value = cast("dict[str, Any]", value).get(name) if isinstance(value, dict) else None
    return value if isinstance(value, int) and 0 < value < MOST_TOKENS else 0


def usage_of(price: Price, *, fresh: int, cached: int, written: int = 0, output: int) -> Usage:
    """Tokens and their cost; input is fresh, read from a cache (cached) or written to one."""
    return Usage(
        input_tokens=fresh + cached + written,
        cached_tokens=cached,
        output_tokens=output,
        cost_usd=price.cost(fresh=fresh, cached=cached, written=written, output=output),
    )
