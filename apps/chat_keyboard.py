"""What a person types in a chat with the terminal in its ordinary mode: plainly, or during a turn.

Lines that come together, as a paste does, are one message.
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
"""Seconds within which lines come together."""
PROMPT = "you: "


class Typed:
    """Messages typed at a terminal in its ordinary mode, with no prompt of ours open."""

    def __init__(self) -> None:
        self._messages: deque[str] = deque()
        self._lines: list[str] = []
        self._begun, self._closed = b"", False
        self._quiet: asyncio.TimerHandle | None = None

    def take(self) -> str | None:
        """The next message that is there already.

        Raises:
            EOFError: there will be none.
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
            handles: is given each line at once; one that it handles is in no message.

        Returns:
            What is set when a message is there, or there will be none.
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
        except (NotImplementedError, OSError):  # such as on Windows: it is read at the next prompt
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
    """The next message, read as the terminal edits it.

    Raises:
        EOFError: there will be none.
        KeyboardInterrupt: Ctrl-C.
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
    """Lines as a program writes them; Ctrl-C ends the wait for one."""
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
    """Have Ctrl-C call that in the event loop instead; the list gets an item each time."""
    loop, hits = asyncio.get_running_loop(), list[bool]()

    def hit(*_: object) -> None:
        hits.append(True)
        loop.call_soon_threadsafe(act)

    before = signal.signal(signal.SIGINT, hit)
    try:
        yield hits
    finally:
        signal.signal(signal.SIGINT, before)
