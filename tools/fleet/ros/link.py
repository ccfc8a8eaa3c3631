"""A connection to rosbridge that comes back by itself, with nothing left over but a hold.

Every connection is new, in a thread of its own that calls back: none repeats what an earlier one
had to say, and what could not be said at once is not said late.
"""

import asyncio
import json
import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ...errors import InputError

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

KEEP_ALIVE = 2.0
"""Seconds after which a link is tried out, and after so many more given up."""
AGAIN = 0.5
"""Seconds between tries to connect."""
CONNECTING = 5.0
MOST_BYTES = 65_536
"""Of a message."""
REPEATED = 1.5
"""Seconds in which what was said before one joined may be heard: rosbridge keeps it for one."""
LATE = 0.5
"""Seconds after which a message is not sent any more that was held up."""
MOST_SHOWN = 200

Message = Mapping[str, Any]


class Link:
    """Says and hears operations of the rosbridge protocol.

    It speaks and hears once it is started: what it calls must be set up before.

    Args:
        url: of the bridge.
        topics: what to listen to, and of which type it is.
        spoken: what is going to be said, likewise.
        heard: is given every operation that comes, and whether it was surely said just now.
        left: is called when the connection is lost.

    Attributes:
        joined: how often it has been connected.
        connected: whether it is now.
        trouble: why not, in words, or what the bridge complained of.

    Raises:
        InputError: the library is not installed.
    """

    def __init__(
        self,
        url: str,
        topics: Iterable[tuple[str, str]],
        spoken: Iterable[tuple[str, str]],
        heard: Callable[[Message, bool], None],
        *,
        left: Callable[[], None] = lambda: None,
    ) -> None:
        try:
            from websockets.asyncio.client import connect
        except ImportError:
            raise InputError(
                "Robots that run ROS need an extra: pip install 'formup[ros]'."
            ) from None
        ops = [("subscribe", *topic) for topic in topics]
        ops += [("advertise", *topic) for topic in spoken]
        self._greeting = [{"op": op, "topic": topic, "type": kind} for op, topic, kind in ops]
        self._url, self._connect, self._heard, self._left = url, connect, heard, left
        self.joined, self.connected, self.trouble = 0, False, "it has not answered yet"
        self._unsaid: tuple[Message, ...] = ()
        self._closed, self._since = False, 0.0
        self._loop = asyncio.new_event_loop()
        self._waiting: asyncio.Queue[tuple[float, Message] | None] = asyncio.Queue()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> "Link":
        """Connect, and call back from now on."""
        self._thread.start()
        return self

    def say(self, *messages: Message, surely: bool = False) -> None:
        """Send operations, at once or not at all; those to arrive surely later, if need be."""
        if not self.connected:
            self._unsaid = messages if surely else self._unsaid
            return
        due = math.inf if surely else time.monotonic() + LATE
        with suppress(RuntimeError):  # the loop has just been closed
            for message in messages:
                self._loop.call_soon_threadsafe(self._waiting.put_nowait, (due, message))

    def close(self) -> None:
        """Say goodbye; what was said before still goes out."""
        self._closed = True
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._waiting.put_nowait, None)
        self._thread.join(CONNECTING)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._keep())

    async def _keep(self) -> None:
        from websockets.exceptions import WebSocketException

        while not self._closed:
            try:
                async with self._connect(
                    self._url,
                    compression=None,
                    proxy=None,
                    open_timeout=CONNECTING,
                    ping_interval=KEEP_ALIVE,
                    ping_timeout=KEEP_ALIVE,
                    close_timeout=1,
                    max_size=MOST_BYTES,
                ) as socket:
                    await self._talk(socket)
                self.trouble = "the connection was closed"
            except (OSError, TimeoutError, WebSocketException) as error:
                self.trouble = getattr(error, "strerror", None) or str(error) or "no answer"
            if self.connected:
                self.connected = False
                self._left()
            if not self._closed:
                await asyncio.sleep(AGAIN)

    async def _talk(self, socket: "ClientConnection") -> None:
        for message in self._greeting:
            await socket.send(json.dumps(message))
        self._waiting = asyncio.Queue()
        self.joined, self._since = self.joined + 1, time.monotonic()
        self.connected, self.trouble = True, ""
        unsaid, self._unsaid = self._unsaid, ()
        self.say(*unsaid, surely=True)
        if self._closed:
            self._waiting.put_nowait(None)
        reading = asyncio.create_task(self._read(socket))
        try:
            while (entry := await self._waiting.get()) is not None:
                due, message = entry
                if time.monotonic() <= due:
                    await socket.send(json.dumps(message, allow_nan=False))
        finally:
            reading.cancel()
            with suppress(asyncio.CancelledError):
                await reading

    async def _read(self, socket: "ClientConnection") -> None:
        try:
            async for text in socket:
                with suppress(ValueError, RecursionError):  # no JSON
                    message: Any = json.loads(text)
                    if isinstance(message, dict):
                        self._take(message)  # pyright: ignore[reportUnknownArgumentType]
        finally:
            self._waiting.put_nowait(None)

    def _take(self, message: Message) -> None:
        if message.get("op") == "status" and message.get("level") == "error":
            self.trouble = f"it says: {message.get('msg')}"[:MOST_SHOWN]
        self._heard(message, time.monotonic() - self._since > REPEATED)
