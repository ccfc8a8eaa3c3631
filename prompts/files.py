"""Reading and writing of prompt files: atomically, and never over a released one."""

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
"""Largest size of one file in bytes; a prompt has a few thousand."""
PATIENCE = 10.0
"""How long to wait, in seconds, while another process writes in the folder."""
BUSY = ".writing"
"""The file locked while a process writes in the folder; its mere presence means nothing."""


def read_text(path: Path) -> str:
    """Return the text of a file, with line ends as LF.

    Raises:
        PromptError: the file cannot be read, is too large, or is not UTF-8.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise PromptError(f"{path} has more than {MAX_BYTES >> 20} MiB.")
        return path.read_text(encoding="utf-8-sig")  # some editors write a byte order mark
    except OSError as error:
        raise PromptError(f"{path} cannot be read: {error.strerror or error}.") from None
    except UnicodeDecodeError:
        raise PromptError(f"{path} is no text in UTF-8.") from None


def write_whole(path: Path, text: str) -> None:
    """Write a file atomically, replacing any that is there.

    Raises:
        PromptError: the file cannot be written.
    """
    with _as_prompt_errors(path), _temporary_beside(path, text) as written:
        written.replace(path)


def write_new(path: Path, text: str) -> None:
    """Write a new file atomically.

    Raises:
        PromptError: the file exists already or cannot be written.
    """
    with _as_prompt_errors(path), _temporary_beside(path, text) as written:
        try:
            os.link(written, path)  # unlike a rename, this fails if the file exists
        except FileExistsError:
            raise
        except OSError:  # this file system may have no hard links
            _rename_new(written, path)


@contextmanager
def locked_folder(folder: Path) -> Generator[None]:
    """Hold the exclusive right to write in a folder; the system frees it if the process ends.

    Raises:
        PromptError: another process is still writing after `PATIENCE`, or the folder cannot be
            written.
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
        with suppress(OSError):  # Windows cannot delete an open file; it may stay
            path.unlink()
        busy.close()


def _rename_new(written: Path, path: Path) -> None:
    """Rename to a path that has no file yet, by first claiming it with an empty one."""
    path.open("xb").close()
    try:
        written.replace(path)
    except BaseException:
        path.unlink()
        raise


def try_lock(path: Path) -> BinaryIO | None:
    """Return the file, open and locked; None if another process holds or has just deleted it."""
    with ExitStack() as stack:
        file = stack.enter_context(path.open("ab"))
        with suppress(FileNotFoundError):
            if lock(file.fileno()) and os.path.samestat(os.fstat(file.fileno()), path.stat()):
                stack.pop_all()
                return file
    return None


def lock(handle: int) -> bool:
    """Try to lock an open file and return whether it worked; closing the file frees the lock."""
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
    """Yield a temporary file in the same folder that holds the text; delete it afterwards."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    written = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        written.chmod(0o644)  # readable by others, as a file saved by an editor is
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
