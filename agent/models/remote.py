"""A model behind a server: a provider's language, an endpoint and the transport put together."""

import asyncio
from dataclasses import dataclass

from ...tools.errors import ModelError
from ..messages import Reply
from ..model import Request
from .anthropic import Anthropic
from .endpoint import endpoint
from .openai_chat import OpenAIChat
from .prices import UNKNOWN, price_of
from .transport import Sleep, Transport
from .wire import Show, Wire


@dataclass(frozen=True)
class _Provider:
    """Where a provider is asked; `variable` holds its key in the environment."""

    wire: type[OpenAIChat] | type[Anthropic]
    base_url: str
    variable: str | None


_PROVIDERS = {
    "openai": _Provider(OpenAIChat, "https://api.openai.com/v1", "OPENAI_API_KEY"),
    "anthropic": _Provider(Anthropic, "https://api.anthropic.com", "ANTHROPIC_API_KEY"),
    "ollama": _Provider(OpenAIChat, "http://127.0.0.1:11434/v1", None),
}


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

    def __init__(
        self, name: str, wire: Wire, transport: Transport, show: Show | None = None
    ) -> None:
        self.name = name
        self._wire, self._transport, self._show = wire, transport, show
        self._streams = show is not None

    async def reply(self, request: Request) -> Reply:
        """The server's reply, complete.

        Raises:
            ModelError: there is none.
        """
        try:
            return await self._ask(request)
        except ModelError as error:
            # Strict servers refuse this field by name; without it usage would not be counted.
            if not self._streams or "stream_options" not in str(error):
                raise
        self._streams = False
        return await self._ask(request)

    async def aclose(self) -> None:
        """Close the connections of the running event loop."""
        await self._transport.aclose()

    async def _ask(self, request: Request) -> Reply:
        body = self._wire.body(request, stream=self._streams)
        return await self._transport.ask(body, self._wire.reading(request), self._show)


def remote_model(
    provider: str,
    model: str,
    base_url: str | None = None,
    *,
    show: Show | None = None,
    sleep: Sleep = asyncio.sleep,
) -> RemoteModel:
    """A model of a provider, at its own address or another that speaks the same.

    Args:
        provider: openai, anthropic or ollama.
        model: as the server calls it.
        base_url: None for the provider's own.
        show: see `RemoteModel`.
        sleep: waits between tries.

    Raises:
        InputError: no usable base URL, or no key for it.
    """
    known = _PROVIDERS[provider]
    # Who runs another server sets other prices.
    wire = known.wire(model, UNKNOWN if base_url else price_of(provider, model))
    at = endpoint(base_url or known.base_url, known.variable)
    path = wire.path.removeprefix("/v1") if at.base_url.endswith("/v1") else wire.path
    transport = Transport(at, at.base_url + path, wire.headers(at.key), sleep=sleep)
    return RemoteModel(f"{provider}:{model}", wire, transport, show)
