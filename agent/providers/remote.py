"""A model behind a server: a provider's language, an endpoint and the transport put together."""

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
    """Where a provider is asked.

    Attributes:
        elsewhere: the environment variable that names another base URL, as in its own packages.
        variables: hold its key in the environment.
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
"""What the environment may hold for them: keys, and base URLs."""

_VERSION_AT_START, _VERSION_AT_END = re.compile(r"\A/v\d\w*"), re.compile(r"/v\d\w*\Z")
"""Of an interface: people write it at the end of a base URL, or leave it out."""


class RemoteModel:
    """Asks a model on a server.

    Args:
        name: what results are recorded under.
        wire: the server's language.
        transport: the way to it.
        show: is given fragments of text as they come; with None nothing is streamed. A None
            fragment voids what was shown of the current reply, which begins anew.
    """

    prompt = "former"
    """The prompt that tells it what it is here for."""
    sees = True
    """Whether it is given the picture."""

    def __init__(
        self, name: str, wire: Wire, transport: Transport, show: ShowText | None = None
    ) -> None:
        self.name = name
        self._wire, self._transport, self._show = wire, transport, show
        self._streams = show is not None

    async def reply(self, request: Request) -> Reply:
        """The server's reply, complete.

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
        """Do without what a server refuses by name; False if it can not be done without."""
        if self._streams and "stream_options" in refusal:
            self._streams = False  # without this field usage would not be counted
            return True
        return self._wire.gives_up(refusal)

    async def _ask(self, request: Request) -> Reply:
        body = self._wire.body(request, stream=self._streams)
        show = _ignore if request.aside and self._show is not None else self._show
        return await self._transport.ask(self._wire, request, body, show)


def _ignore(text: str | None) -> None:
    """Nobody is shown what a tool asks."""


def remote_model(
    provider: str,
    model: str,
    base_url: str | None = None,
    *,
    show: ShowText | None = None,
    sleep: Sleep = asyncio.sleep,
) -> RemoteModel:
    """A model of a provider, at its own address or another that speaks the same.

    Without a base URL the one the environment names counts, else the provider's own; `show` is as
    of `RemoteModel`.

    Raises:
        InputError: no usable base URL, or no key for it.
    """
    known = _PROVIDERS[provider]
    base_url = base_url or os.environ.get(known.elsewhere)
    # Who runs another server sets other prices.
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
