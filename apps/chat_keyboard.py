"""Keyboard input of a chat with the terminal in its ordinary mode: plain, or during a turn.

Lines that arrive together, as in a paste, make one message.
"""

import asyncio
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Any

from .terminal import say

TOGETHER = 0.05
"""Seconds of silence that end a message; lines with shorter gaps belong together."""
PROMPT = "you: "


class Typed:
    """A queue of messages typed at a terminal in its ordinary mode, with no prompt of ours open."""

    def __init__(self) -> None:
        self._messages: deque[str] = deque()
        self._lines: list[str] = []
        self._begun, self._closed = b"", False
        self._quiet: asyncio.TimerHandle | None = None

    def take(self) -> str | None:
        """Return the next message already typed; None if there is none yet.

        Raises:
            EOFError: the input has ended and there will be none.
        """
        if self._messages:
            return self._messages.popleft()
        if self._closed:
            raise EOFError
        return None

    @contextmanager
    def listening(self, handles: Callable[[str], bool]) -> Generator[asyncio.Event, None, None]:
        """Read what is typed meanwhile.

        Args:
            handles: called with each line at once; a line for which it returns true is left out
                of the messages.

        Yields:
            An event, set when a message is there or the input has ended.
        """
        loop, keyboard, there = asyncio.get_running_loop(), sys.stdin.fileno(), asyncio.Event()

        def together() -> None:
            if text := "\n".join(self._lines).strip():
                self._messages.append(text)
            self._lines, self._quiet = [], None
            there.set()

        def read() -> None:
            data = os.read(keyboard, 1 << 16)
            if not data:
                self._closed = True
                loop.remove_reader(keyboard)
            *lines, self._begun = (self._begun + (data or b"\n")).split(b"\n")
            texts = (line.decode(errors="replace") for line in lines)
            self._lines += [text for text in texts if not handles(text)]
            if self._quiet is not None:
                self._quiet.cancel()
            self._quiet = loop.call_later(TOGETHER, together)

        try:
            loop.add_reader(keyboard, read)
        except (NotImplementedError, OSError):  # as on Windows: read at the next prompt instead
            yield there
            return
        try:
            yield there
        finally:
            loop.remove_reader(keyboard)
            if self._quiet is not None:
                self._quiet.cancel()
                together()


async def ask_plainly(typed: Typed) -> str:
    """Ask for the next message, with the terminal's own line editing.

    Raises:
        EOFError: the input has ended.
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    say(PROMPT, end="")
    with typed.listening(lambda _: False) as there, interrupts_to(there.set) as interrupted:
        while (text := typed.take()) is None:
            await there.wait()
            there.clear()
            if interrupted:
                say("")
                raise KeyboardInterrupt
    return text


def lines_piped() -> Iterator[str]:
    """Yield lines of stdin as a program writes them; Ctrl-C ends the wait for one."""
    while True:
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            line = sys.stdin.buffer.readline()
        finally:
            signal.signal(signal.SIGINT, before)
        if not line:
            return
        yield line.decode(errors="replace")


@contextmanager
def interrupts_to(act: Callable[[], Any]) -> Generator[list[bool], None, None]:
    """Have Ctrl-C call `act` in the event loop; yield a list that grows by an item each time."""
    loop, hits = asyncio.get_running_loop(), list[bool]()

    def hit(*_: object) -> None:
        hits.append(True)
        loop.call_soon_threadsafe(act)

    before = signal.signal(signal.SIGINT, hit)
    try:
        yield hits
    finally:
        signal.signal(signal.SIGINT, before)
