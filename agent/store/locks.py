"""Locks among processes as files, which say who has them; the system takes them back at an end."""

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TypeVar

from ...prompts.files import try_lock
from .protocol import PROCESS

T = TypeVar("T")
MOMENT = 0.1
"""Seconds that a writer asks again for a lock, which who only looks whether it is free has too."""


def taken(take: Callable[[], T]) -> T:
    """What a lock gives, asked for again for a moment while it gives nothing."""
    until = time.monotonic() + MOMENT
    while not (had := take()) and time.monotonic() < until:
        time.sleep(MOMENT / 20)
    return had


def lock_file(path: Path) -> ExitStack | None:
    """The lock that a file is; None while another has it.

    Raises:
        OSError: it cannot be made there.
    """
    file = try_lock(path)
    if file is None:
        return None
    stack = ExitStack()
    stack.callback(file.close)
    stack.callback(_unlink, path)  # first, so that nobody has a lock on a file that is gone
    file.truncate(0)
    file.write(PROCESS.encode())
    file.flush()
    return stack


def read_holder(path: Path) -> str:
    """Which process has a lock, as far as its file says."""
    with suppress(OSError):  # Windows reads no locked file
        return path.read_text(encoding="utf-8", errors="replace")
    return ""


def _unlink(path: Path) -> None:
    with suppress(OSError):  # Windows deletes no open file; it may lie there
        path.unlink()
