"""A stand-in for rosbridge and the ROS behind it: it passes on to all who listen what is published,
without looking at types. Robots that stand in for real ones live in the same program."""

import asyncio
import json
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ...errors import InputError
from .link import Message

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection

CLOSING = 5.0
KEPT, MOST_KEPT = 1.0, 1_000
"""Whoever joins is told what clients said in so many seconds before, as by rosbridge."""


class StandInBridge:
    """Serves at an address, in a thread of its own that calls back.

    Args:
        heard: is given every operation that comes, but those to listen.

    Attributes:
        joined, connected, trouble: as of what connects a fleet; it always is.
    """

    joined, connected, trouble = 1, True, ""

    def __init__(self, address: tuple[str, int], heard: Callable[[Message], None]) -> None:
        self._address, self._heard = address, heard
        self._listeners: dict[ServerConnection, set[str]] = {}
        self._kept = deque[tuple[float, Message]](maxlen=MOST_KEPT)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)

    def start(self) -> None:
        """Serve, and call back from now on.

        Raises:
            InputError: the library is not installed, or something is there already.
        """
        host, port = self._address
        self._thread.start()
        try:
            self._server = self._soon(self._open(host, port))
        except OSError as error:
            self._end()
            raise InputError(
                f"Nothing can stand in for the bridge {host}:{port}: {error.strerror}."
            ) from None

    def publish(self, topic: str, message: Message) -> None:
        """Pass a message on to whoever listens to its topic."""
        self.say({"op": "publish", "topic": topic, "msg": message}, topic)

    def say(self, message: Message, topic: str | None = None) -> None:
        """Send an operation to whoever listens to a topic, or to all."""
        with suppress(RuntimeError):  # the loop has just been closed
            self._loop.call_soon_threadsafe(self._pass_on, message, topic)

    def close(self) -> None:
        """Serve no longer."""
        if not self._loop.is_closed():
            self._soon(self._leave())
            self._end()

    def _soon(self, what: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(CLOSING)

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(CLOSING)
        self._loop.close()

    async def _open(self, host: str, port: int) -> "Server":
        try:
            from websockets.asyncio.server import serve
        except ImportError:
            raise InputError(
                "Robots that run ROS need an extra: pip install 'formup[ros]'."
            ) from None
        return await serve(self._serve, host, port, compression=None)

    async def _leave(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _serve(self, socket: "ServerConnection") -> None:
        from websockets.exceptions import ConnectionClosed

        topics = self._listeners[socket] = set[str]()
        try:
            with suppress(ConnectionClosed):
                async for text in socket:
                    message = json.loads(text)
                    if message["op"] == "subscribe":
                        topics.add(message["topic"])
                        since = time.monotonic() - KEPT
                        for said, kept in [*self._kept]:
                            if said > since and kept["topic"] == message["topic"]:
                                await socket.send(json.dumps(kept))
                    elif message["op"] == "publish":
                        self._kept.append((time.monotonic(), message))
                        self._pass_on(message, message["topic"])
                    self._heard(message)
        finally:
            del self._listeners[socket]

    def _pass_on(self, message: Message, topic: str | None) -> None:
        from websockets.asyncio.server import broadcast

        told = [s for s, topics in self._listeners.items() if topic is None or topic in topics]
        broadcast(told, json.dumps(message))
