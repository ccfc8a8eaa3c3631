"""A model on a server: a provider's wire format, an endpoint and the transport put together."""

import asyncio
import os
import re
from collections.abc import Callable
from dataclasses import dataclass

from ...tools.errors import ModelError
from ..messages import Reply
from ..model import Request, ShowText
from .anthropic import Anthropic
from .endpoint import endpoint
from .gemini import Gemini
from .openai_chat import OpenAIChat
from .openai_responses import OpenAIResponses
from .prices import UNKNOWN, Price, price_of
from .transport import Sleep, Transport
from .wire import Wire


@dataclass(frozen=True)
class _Provider:
    """How a provider is reached.

    Attributes:
        elsewhere: environment variable that names another base URL, as in its own packages.
        variables: environment variables that may hold its key.
        billed_as: the name its prices are listed under.
    """

    wire: Callable[[str, Price, str], Wire]
    base_url: str
    elsewhere: str
    variables: tuple[str, ...]
    billed_as: str


_OPENAI = ("https://api.openai.com/v1", "OPENAI_BASE_URL", ("OPENAI_API_KEY",), "openai")
_PROVIDERS = {
    "openai": _Provider(OpenAIChat, *_OPENAI),
    "openai-responses": _Provider(OpenAIResponses, *_OPENAI),
    "anthropic": _Provider(
        Anthropic,
        "https://api.anthropic.com",
        "ANTHROPIC_BASE_URL",
        ("ANTHROPIC_API_KEY",),
        "anthropic",
    ),
    "gemini": _Provider(
        Gemini,
        "https://generativelanguage.googleapis.com",
        "GOOGLE_GEMINI_BASE_URL",
        ("GEMINI_API_KEY", "GOOGLE_API_KEY"),
        "gemini",
    ),
    "ollama": _Provider(OpenAIChat, "http://127.0.0.1:11434/v1", "OLLAMA_BASE_URL", (), "ollama"),
}
VARIABLES = tuple(
    dict.fromkeys(n for p in _PROVIDERS.values() for n in (*p.variables, p.elsewhere))
)
"""All environment variables that are read for providers: keys and base URLs."""

_VERSION_AT_START, _VERSION_AT_END = re.compile(r"\A/v\d\w*"), re.compile(r"/v\d\w*\Z")
"""The version of an API, which people write at the end of a base URL or leave out."""


class RemoteModel:
    """A model on a server.

    Args:
        name: what results are recorded under.
        wire: the server's wire format.
        transport: the connection to it.
        show: called with fragments of text as they arrive; with None nothing is streamed. A None
            fragment voids what was shown of the current reply, which starts over.
    """

    prompt = "former"
    """Id of the prompt it is given by default."""
    sees = True
    """Whether it is given the picture."""

    def __init__(
        self, name: str, wire: Wire, transport: Transport, show: ShowText | None = None
    ) -> None:
        self.name = name
        self._wire, self._transport, self._show = wire, transport, show
        self._streams = show is not None

    async def reply(self, request: Request) -> Reply:
        """Return the server's complete reply.

        Raises:
            ModelError: there is none.
        """
        while True:
            try:
                return await self._ask(request)
            except ModelError as error:
                if not self._gives_up(str(error)):
                    raise

    async def aclose(self) -> None:
        """Close the connections of the running event loop."""
        await self._transport.aclose()

    def _gives_up(self, refusal: str) -> bool:
        """Drop a feature that the refusal names; return False if there is none to drop."""
        if self._streams and "stream_options" in refusal:
            self._streams = False  # streaming without this field would not count usage
            return True
        return self._wire.gives_up(refusal)

    async def _ask(self, request: Request) -> Reply:
        body = self._wire.body(request, stream=self._streams)
        show = _ignore if request.aside and self._show is not None else self._show
        return await self._transport.ask(self._wire, request, body, show)


def _ignore(text: str | None) -> None:
    """Show nothing: a reply to a tool's question is not for display."""


def remote_model(
    provider: str,
    model: str,
    base_url: str | None = None,
    *,
    show: ShowText | None = None,
    sleep: Sleep = asyncio.sleep,
) -> RemoteModel:
    """Return a model of a provider, at its own address or at a compatible server.

    Without a base URL the one that the environment names counts, else the provider's own; for
    `show` see `RemoteModel`.

    Raises:
        InputError: no usable base URL, or no key for it.
    """
    known = _PROVIDERS[provider]
    base_url = base_url or os.environ.get(known.elsewhere)
    # Another server has its own prices.
    price = UNKNOWN if base_url else price_of(known.billed_as, model)
    at = endpoint(base_url or known.base_url, *known.variables)
    wire = known.wire(
        model, price, f"{provider}:{model}" + (f" at {at.base_url}" if base_url else "")
    )
    path = wire.path(stream=show is not None)
    if _VERSION_AT_END.search(at.base_url):
        path = _VERSION_AT_START.sub("", path)
    transport = Transport(at, at.base_url + path, wire.headers(at.key), sleep=sleep)
    return RemoteModel(f"{provider}:{model}", wire, transport, show)
