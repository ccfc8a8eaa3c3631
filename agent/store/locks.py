"""Locks among processes, as files that name the holder; the system frees them when it ends."""

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TypeVar

from ...prompts.files import try_lock
from .protocol import PROCESS

T = TypeVar("T")
MOMENT = 0.1
"""Seconds for which a writer retries a lock; a mere check whether it is free takes it briefly."""


def taken(take: Callable[[], T]) -> T:
    """Take a lock, retrying for a moment, and return what taking it gave."""
    until = time.monotonic() + MOMENT
    while not (had := take()) and time.monotonic() < until:
        time.sleep(MOMENT / 20)
    return had


def lock_file(path: Path) -> ExitStack | None:
    """Take a file as a lock; return None while another process has it.

    Raises:
        OSError: the file cannot be made there.
    """
    file = try_lock(path)
    if file is None:
        return None
    stack = ExitStack()
    stack.callback(file.close)
    stack.callback(_unlink, path)  # runs first, so that nobody locks a file that is gone
    file.truncate(0)
    file.write(PROCESS.encode())
    file.flush()
    return stack


def read_holder(path: Path) -> str:
    """Return which process has a lock, as far as its file says."""
    with suppress(OSError):  # Windows cannot read a locked file
        return path.read_text(encoding="utf-8", errors="replace")
    return ""


def _unlink(path: Path) -> None:
    with suppress(OSError):  # Windows cannot delete an open file; it may stay
        path.unlink()
