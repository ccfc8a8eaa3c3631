"""Reading and writing files of prompts: whole or not at all, never over one that is released."""

import os
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .prompt import PromptError

MAX_BYTES = 1 << 20
"""Of one file; a prompt is a few thousand."""
PATIENCE = 10.0
"""Seconds to wait while another process writes in the folder."""
BUSY = ".writing"
"""The file that is locked while somebody writes in the folder; by itself it means nothing."""


def read_text(path: Path) -> str:
    """The text of a file, line ends as LF.

    Raises:
        PromptError: it cannot be read, is too large or not UTF-8.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise PromptError(f"{path} has more than {MAX_BYTES >> 20} MiB.")
        return path.read_text(encoding="utf-8-sig")  # some editors put a mark at the beginning
    except OSError as error:
        raise PromptError(f"{path} cannot be read: {error.strerror or error}.") from None
    except UnicodeDecodeError:
        raise PromptError(f"{path} is no text in UTF-8.") from None


def write_whole(path: Path, text: str) -> None:
    """Write a file at once or not at all, in the place of what is there.

    Raises:
        PromptError: it cannot be written there.
    """
    with _as_prompt_errors(path), _temporary_beside(path, text) as written:
        written.replace(path)


def write_new(path: Path, text: str) -> None:
    """Write a file at once or not at all where there is none.

    Raises:
        PromptError: there is one, or it cannot be written there.
    """
    with _as_prompt_errors(path), _temporary_beside(path, text) as written:
        try:
            os.link(written, path)  # unlike a renaming it fails where there is a file
        except FileExistsError:
            raise
        except OSError:  # this file system may have no hard links
            _rename_new(written, path)


@contextmanager
def locked_folder(folder: Path) -> Generator[None]:
    """The only one to write in a folder; the system lets go of it when a process ends.

    Raises:
        PromptError: somebody else is still at it, or it cannot be written there.
    """
    path, until = folder / BUSY, time.monotonic() + PATIENCE
    with _as_prompt_errors(folder):
        busy = try_lock(path)
        while busy is None and time.monotonic() < until:
            time.sleep(0.02)
            busy = try_lock(path)
    if busy is None:
        raise PromptError(f"Another process writes in {folder}; try again when it is done.")
    try:
        yield
    finally:
        with suppress(OSError):  # Windows deletes no open file; it may lie there
            path.unlink()
        busy.close()


def _rename_new(written: Path, path: Path) -> None:
    """Rename where there is no file: an empty one of our own takes the place first."""
    path.open("xb").close()
    try:
        written.replace(path)
    except BaseException:
        path.unlink()
        raise


def try_lock(path: Path) -> BinaryIO | None:
    """The file, locked; None while another has it, or has just deleted it."""
    with ExitStack() as stack:
        file = stack.enter_context(path.open("ab"))
        with suppress(FileNotFoundError):
            if lock(file.fileno()) and os.path.samestat(os.fstat(file.fileno()), path.stat()):
                stack.pop_all()
                return file
    return None


def lock(handle: int) -> bool:
    """Whether the lock of an open file could be had; the system keeps it until it is closed."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True


@contextmanager
def _temporary_beside(path: Path, text: str) -> Generator[Path]:
    """The text in a file of its own in the same folder, gone when done."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    written = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        written.chmod(0o644)  # others may read it, as they may what an editor writes
        yield written
    finally:
        with suppress(FileNotFoundError):
            written.unlink()


@contextmanager
def _as_prompt_errors(path: Path) -> Generator[None]:
    try:
        yield
    except FileExistsError:
        raise PromptError(f"{path} is there already and is not overwritten.") from None
    except OSError as error:
        raise PromptError(f"{path} cannot be written: {error.strerror or error}.") from None
