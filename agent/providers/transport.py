"""HTTP to a model's server: one client, bounded retries, server-sent events, complete replies.

Whether streamed or not, the result is one complete reply; fragments are only for display.
"""

import asyncio
import random
import ssl
from asyncio import AbstractEventLoop
from collections.abc import AsyncIterator, Awaitable, Callable
from functools import cache
from typing import Any, cast
from urllib.request import getproxies, proxy_bypass
from weakref import WeakKeyDictionary

import httpx
from pydantic_core import from_json

from ...tools.errors import ModelError
from ..messages import Reply
from ..model import Request, ShowText
from .endpoint import Endpoint
from .failures import AskError, of_error_body, of_status, unexpected
from .wire import Assembly, Wire

TRIES = 4
FIRST_PAUSE = 0.5
"""Seconds before the second try; doubled before each further one."""
CONNECT_S = 10.0
SILENCE_S = 300.0
"""Seconds for which a server may send nothing: large models think for minutes."""
MAX_BYTES = 64 * 2**20
_MARK = b"\xef\xbb\xbf"
"""The UTF-8 byte order mark, with which some servers begin their text."""

Sleep = Callable[[float], Awaitable[object]]


class Transport:
    """Sends requests to one URL, retrying where that may help.

    Args:
        endpoint: the server.
        url: the full URL.
        headers: sent with every request, the key among them.
        sleep: waits between tries.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        url: str,
        headers: dict[str, str],
        *,
        sleep: Sleep = asyncio.sleep,
    ) -> None:
        common = {"content-type": "application/json", "user-agent": "formup"}
        self._endpoint, self._url, self._sleep = endpoint, httpx.URL(url), sleep
        self._headers = httpx.Headers(common | headers)
        timeout = httpx.Timeout(SILENCE_S, connect=CONNECT_S, pool=None)
        self._extensions = {"timeout": timeout.as_dict()}
        self._pools: WeakKeyDictionary[AbstractEventLoop, httpx.AsyncHTTPTransport]
        # Connections belong to an event loop, and every Agent.run has its own.
        self._pools = WeakKeyDictionary()

    async def ask(
        self, wire: Wire, request: Request, body: bytes, show: ShowText | None = None
    ) -> Reply:
        """Send a request, whose body the wire has written, until it is answered.

        Raises:
            ModelError: it is not answered; one sentence says who did what, and what to do.
        """
        before: str | None = None
        tries = 0
        while True:
            tries += 1
            try:
                return await self._once(wire, request, body, show)
            except AskError as failure:
                if tries == TRIES or failure.ends(before):
                    raise ModelError(self._sentence(failure, tries)) from None
                before, pause = failure.what, _pause(failure, tries)
            if show is not None:
                show(None)
            await self._sleep(pause)

    async def aclose(self) -> None:
        """Close the connections of the running event loop; a later request makes new ones."""
        pool = self._pools.pop(asyncio.get_running_loop(), None)
        if pool is not None:
            await pool.aclose()

    def _sentence(self, failure: AskError, tries: int) -> str:
        counted = f" (tried {tries} times)" if tries > 1 else ""
        end = "" if failure.advice.endswith("?") else "."
        text = f"The model at {self._endpoint.base_url} {failure.what}{counted}: {failure.advice}"
        return self._endpoint.without_key(text + end)

    def _pool(self) -> httpx.AsyncHTTPTransport:
        """Return connections; a client on top would look for cookies and redirects every turn."""
        loop = asyncio.get_running_loop()
        pool = self._pools.get(loop)
        if pool is None:
            proxy = None if self._endpoint.is_loopback else _proxy(self._url)
            try:
                pool = httpx.AsyncHTTPTransport(verify=_tls(), proxy=proxy)
            except (ValueError, ImportError, httpx.InvalidURL):
                raise _bad_proxy() from None
            self._pools[loop] = pool
        return pool

    async def _once(
        self, wire: Wire, request: Request, body: bytes, show: ShowText | None
    ) -> Reply:
        post = httpx.Request(
            "POST", self._url, headers=self._headers, content=body, extensions=self._extensions
        )
        try:
            response = await self._pool().handle_async_request(post)
            try:
                return await self._read(wire, request, response, show)
            finally:
                await response.aclose()
        except httpx.HTTPError as error:
            raise _network_failure(error) from None

    async def _read(
        self, wire: Wire, request: Request, response: httpx.Response, show: ShowText | None
    ) -> Reply:
        if not response.is_success:
            body = await _whole_body(response)
            advice = self._endpoint.key_advice
            raise of_status(response.status_code, response.headers, body, advice)
        shown = None if show is None else self._endpoint.masking(show)
        data, told = await self._body(response, wire.assembly(), shown)
        reply = wire.reply(data, request)
        if shown is not None:
            shown("" if told else reply.text, last=True)
        return Reply.model_validate(self._endpoint.masked(reply.model_dump()))

    async def _body(
        self, response: httpx.Response, assembly: Assembly, show: ShowText | None
    ) -> tuple[Any, bool]:
        """Return a complete body and whether text was shown; content tells if it is a stream."""
        events, plain, size, streamed, told = Events(), bytearray(), 0, False, False
        try:
            async for chunk in _chunks(response):
                size = _bounded_size(size + len(chunk))
                found = events.feed(chunk)
                streamed = streamed or bool(found)
                plain += b"" if streamed else chunk
                told = self._take(found, assembly, show) or told
            last = events.end()
            told = self._take(last, assembly, show) or told
        except httpx.HTTPError:
            if not assembly.done:
                raise
        else:
            whole = bytes(plain).removeprefix(_MARK).strip()
            typed = response.headers.get("content-type", "").startswith("text/event-stream")
            if not (streamed or last or (typed and whole[:1] not in (b"{", b"["))):
                return self._joined(_parsed_json(whole), assembly), False
        return _ended(assembly), told

    def _joined(self, data: Any, assembly: Assembly) -> Any:
        """Return a complete body; some servers send the events of a stream as one list."""
        listed = isinstance(data, list) and len(cast("list[Any]", data)) > 0
        for event in cast("list[Any]", data if listed else [data]):
            if failure := of_error_body(event, self._endpoint.key_advice):
                raise failure
            if listed:
                assembly.add(event)
        return _ended(assembly) if listed else cast("Any", data)

    def _take(self, events: list[bytes], assembly: Assembly, show: ShowText | None) -> bool:
        """Assemble the data of events and return whether any held text; `{}` is skipped."""
        told = False
        for event in events:
            if event == b"[DONE]":
                assembly.done = True
            elif (data := _parsed_json(event)) != {}:
                if failure := of_error_body(data, self._endpoint.key_advice):
                    raise failure
                text = assembly.add(data)
                told = told or bool(text)
                if text and show is not None:
                    show(text)
        return told


class Events:
    """A parser of server-sent events that takes bytes in chunks of any size."""

    def __init__(self) -> None:
        self._rest: list[bytes] = []
        self._data: list[bytes] = []
        self._half = False  # whether the last chunk ended in CR, which may be half of CR LF

    def feed(self, chunk: bytes) -> list[bytes]:
        """Return the data of the events that this chunk completes, without empty ones."""
        one = chunk[:5] == b"data:" and chunk.find(b"\n\n") == chunk.find(b"\n") == len(chunk) - 2
        if one and b"\r" not in chunk and not (self._rest or self._data):
            self._half = False
            return [data] if (data := chunk[5:].strip()) else []  # the usual case: one whole event
        if self._half:
            chunk = chunk.removeprefix(b"\n")
        self._half = chunk.endswith(b"\r")
        if b"\r" in chunk:
            chunk = chunk.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self._rest.append(chunk)
        if b"\n" not in chunk:
            return []
        *lines, rest = b"".join(self._rest).split(b"\n")
        self._rest = [rest] if rest else []
        events: list[bytes] = []
        for line in lines:
            content = line.removeprefix(_MARK)
            if content.startswith(b"data:"):
                self._data.append(content[5:].strip())
            elif not content and self._data:
                events.append(b"\n".join(self._data))
                self._data = []
        return [event for event in events if event]

    def end(self) -> list[bytes]:
        """Return the data of an event that ended with the connection, unless it was cut off."""
        return [event for event in self.feed(b"\n\n") if event == b"[DONE]" or _is_json(event)]


def _proxy(url: httpx.URL) -> str | None:
    """Return the proxy that the environment names for a URL: HTTPS_PROXY, NO_PROXY and the like."""
    if proxy_bypass(url.host):
        return None
    known = getproxies()
    proxy = known.get(url.scheme) or known.get("all")
    return f"http://{proxy}" if proxy and "://" not in proxy else proxy


@cache
def _tls() -> ssl.SSLContext:
    """Return a TLS context; cached, as reading certificates takes longer than most of a turn."""
    return httpx.create_ssl_context()


def _chunks(response: httpx.Response) -> AsyncIterator[bytes]:
    """Return the body as it comes, without the layers that only a compressed one needs."""
    if "content-encoding" in response.headers:
        return response.aiter_bytes()
    assert isinstance(response.stream, httpx.AsyncByteStream)
    return aiter(response.stream)


async def _whole_body(response: httpx.Response) -> bytes:
    chunks: list[bytes] = []
    size = 0
    async for chunk in _chunks(response):
        size = _bounded_size(size + len(chunk))
        chunks.append(chunk)
    return b"".join(chunks)


def _bounded_size(size: int) -> int:
    """Return the size of an answer so far, bytes.

    Raises:
        AskError: it is longer than any model's answer.
    """
    if size > MAX_BYTES:
        advice = "is the base URL right?"
        raise AskError(f"answered with more than {MAX_BYTES // 2**20} MiB", advice)
    return size


def _is_json(body: bytes) -> bool:
    try:
        return from_json(body) is not None
    except ValueError:
        return False


def _parsed_json(body: bytes) -> Any:
    try:
        return from_json(body)
    except ValueError:
        raise unexpected("something that is not JSON") from None


def _ended(assembly: Assembly) -> Any:
    """Return the complete body of a stream that has ended."""
    if not assembly.done:
        raise _dropped_connection()
    return assembly.whole()


def _dropped_connection() -> AskError:
    return AskError("dropped the connection before its reply was complete", "try again", "later")


def _bad_proxy() -> AskError:
    """Return the error for an unusable proxy, which is not quoted: it may hold a password."""
    advice = "name one such as http://127.0.0.1:3128 (SOCKS needs the package socksio)"
    return AskError("cannot be asked through the proxy that the environment names", advice)


def _network_failure(error: httpx.HTTPError) -> AskError:
    """Return the error for a network failure; it quotes no request, since that holds the key."""
    if isinstance(error, httpx.ConnectTimeout):
        what = f"could not be reached within {CONNECT_S:.0f} s"
        return AskError(what, "is the address right, and the network up?", "unless-same")
    if isinstance(error, httpx.TimeoutException):
        what = f"sent nothing for {SILENCE_S:.0f} s"
        return AskError(what, "use a faster model, or try again later", "unless-same")
    if isinstance(error, httpx.ConnectError):
        what = f"could not be reached ({error})"
        return AskError(what, "is it running, and the address right?", "unless-same")
    if isinstance(error, httpx.NetworkError | httpx.RemoteProtocolError):
        return _dropped_connection()
    return AskError(f"could not be asked ({type(error).__name__})", "is the base URL right?")


def _pause(failure: AskError, tries: int) -> float:
    """Return seconds to the next try: as the server asks, else doubling; with random jitter."""
    if failure.wait is not None:
        return failure.wait * (1 + 0.1 * random.random())
    return FIRST_PAUSE * 2 ** (tries - 1) * (0.5 + 0.5 * random.random())
