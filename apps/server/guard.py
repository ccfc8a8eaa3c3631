"""The guard before every route: checks who asks, from where, how much, how often, how slowly."""

import asyncio
import time
from collections import defaultdict, deque
from collections.abc import AsyncGenerator, Generator
from contextlib import asynccontextmanager, contextmanager, nullcontext
from urllib.parse import SplitResult, urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...tools.errors import FormupError, InputError
from .hub import Hub, error_response, formup_error_response
from .tokens import Person

OPEN = ("/health/", "/v1/pictures/", "/page/")
"""Paths open without a token: they show nothing secret, or have a secret in the address."""
LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
STALLED = 60.0
"""Seconds after which a client that stops reading a response is cut off."""

KNOWN = 2.0
"""Seconds between checks that the token of a long request is still valid."""


class Guard:
    """An ASGI middleware that refuses requests before any route sees them.

    Args:
        hub: the server's; supplies tokens, settings and counts.
    """

    def __init__(self, app: ASGIApp, hub: Hub) -> None:
        self._app, self._hub = app, hub
        self._recent: dict[str, deque[float]] = defaultdict(deque)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers, refused = Headers(scope=scope), list[Exception]()
        begun = False

        async def watched(message: Message) -> None:
            nonlocal begun
            if refused and not begun:
                return  # the refusal is sent below in place of this response
            begun = True
            self._hub.metrics.answered(message.get("status", 0))
            async with asyncio.timeout(STALLED):
                await send(message)

        try:
            self._check_origin(scope["method"], headers)
            async with self._authenticated(scope["method"], scope["path"], headers) as person:
                scope.setdefault("state", {})["person"] = person
                counts = nullcontext() if _is_open(scope["path"]) else self._counted(person)
                with counts:
                    await self._app(scope, self._bounded(receive, headers, refused), watched)
            if refused and not begun:
                raise refused[0]
        except FormupError as error:
            if begun:
                raise
            refused.clear()
            await formup_error_response(error)(scope, receive, watched)
        except _RefusedError as error:
            refused.clear()
            if begun:
                await send({"type": "http.response.body"})
                return
            response = error_response(error.status, str(error))
            if error.status == 401:
                response.headers["WWW-Authenticate"] = "Bearer"
            await response(scope, receive, watched)

    @asynccontextmanager
    async def _authenticated(
        self, method: str, path: str, headers: Headers
    ) -> AsyncGenerator[Person]:
        """Yield who asks, and end their request if their token is revoked meanwhile."""
        loop, person = asyncio.get_running_loop(), self._person(path, headers)
        there = f"/api/sessions/{person.sees}"
        inside = path == there or path.startswith(f"{there}/")
        if person.sees and not (method in SAFE and inside):
            raise _RefusedError(403, "A shared link shows one session and allows nothing else.")

        def look() -> None:
            nonlocal looks
            try:
                self._person(path, headers)
            except (FormupError, _RefusedError):
                limit.reschedule(loop.time())
            else:
                looks = loop.call_later(KNOWN, look)

        looks = loop.call_later(KNOWN, look)
        try:
            async with asyncio.timeout(None) as limit:
                yield person
        except TimeoutError:
            self._person(path, headers)
            raise
        finally:
            looks.cancel()

    def _check_origin(self, method: str, headers: Headers) -> None:
        """Refuse hosts that are not names of this server, and unsafe calls of other origins."""
        host, settings = headers.get("host", ""), self._hub.settings
        name = _parsed_address(f"//{host}").hostname or ""
        mine = LOOPBACK | {settings.host} | set(_parts(settings.hosts))
        if name not in mine and (settings.hosts or not self._hub.tokens.needed):
            raise _RefusedError(
                421, f"This server has no host name {name!r}; FORMUP_HOSTS lists its other names."
            )
        origin = headers.get("origin")
        if origin is None and headers.get("sec-fetch-site") in (None, "same-origin", "none"):
            return
        same = origin is not None and _parsed_address(origin).netloc == host
        if not same and origin not in _parts(settings.origins) and method not in SAFE:
            raise _RefusedError(
                403,
                f"Pages of {origin or 'another site'} may not call this server; FORMUP_ORIGINS "
                "lists those that may.",
            )

    def _person(self, path: str, headers: Headers) -> Person:
        kind, _, token = headers.get("authorization", "").partition(" ")
        if kind.lower() == "share" and not _is_open(path):
            if (looking := self._hub.tokens.looking(token.strip())) is None:
                raise _RefusedError(401, "This link is no longer valid; ask for another.")
            return looking
        if _is_open(path) or not self._hub.tokens.needed:
            return Person()
        person = self._hub.tokens.person(token.strip()) if kind.lower() == "bearer" else None
        if person is None:
            known = "A token is needed" if not token else "This token is not known here"
            raise _RefusedError(401, f"{known}: send Authorization: Bearer TOKEN.")
        return person

    @contextmanager
    def _counted(self, person: Person) -> Generator[None]:
        """Count a request, or refuse it beyond those a person may make at a time or in a minute."""
        settings, name, now = self._hub.settings, person.name, time.monotonic()
        recent, running = self._recent[name], self._hub.running
        while recent and recent[0] < now - 60:
            recent.popleft()
        if len(recent) >= settings.requests_per_minute or running[name] >= settings.requests:
            raise InputError(
                f"Too many requests: at most {settings.requests} at a time and "
                f"{settings.requests_per_minute} per minute are allowed; wait a moment.",
                "too_many",
            )
        recent.append(now)
        running[name] += 1
        try:
            yield
        finally:
            running[name] -= 1

    def _bounded(self, receive: Receive, headers: Headers, refused: list[Exception]) -> Receive:
        """Wrap `receive` with limits of size and time.

        Args:
            refused: gets the error that a request is refused for.

        Raises:
            InputError: the declared size is too large (`too_large`).
        """
        most, seconds = self._hub.settings.upload_bytes, self._hub.settings.body_seconds
        large = InputError(
            f"The request is larger than the {most:,} bytes that are allowed.", "too_large"
        )
        declared = headers.get("content-length", "0")
        if not declared.isdecimal() or int(declared) > most:
            raise large
        until, size, whole = time.monotonic() + seconds, 0, False

        async def bounded() -> Message:
            nonlocal size, whole
            if whole:
                return await receive()
            try:
                async with asyncio.timeout(until - time.monotonic()):
                    message = await receive()
            except TimeoutError:
                late = f"The request did not arrive within {seconds:g} s."
                refused.append(_RefusedError(408, late))
                raise refused[0] from None
            size += len(message.get("body", b""))
            whole = not message.get("more_body", False)
            if size > most:
                refused.append(large)
                raise large
            return message

        return bounded


class _RefusedError(Exception):
    """A request that is refused before any route sees it."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


def _is_open(path: str) -> bool:
    return path == "/" or path.startswith(OPEN)


def _parsed_address(text: str) -> SplitResult:
    """Split an address into its parts; they are empty if it is not valid."""
    try:
        return urlsplit(text)
    except ValueError:
        return urlsplit("")


def _parts(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())
