"""Reading and writing files of prompts: whole or not at all, never over one that is released."""

import os
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from .prompt import PromptError

MAX_BYTES = 1 << 20
"""Of one file; a prompt is a few thousand."""
PATIENCE = 10.0
"""Seconds to wait while another process writes in the folder."""
BUSY = ".writing"
"""The file that is there while somebody writes in the folder."""


def read_text(path: Path) -> str:
    """The text of a file, line ends as LF.

    Raises:
        PromptError: it cannot be read, is too large or not UTF-8.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise PromptError(f"{path} has more than {MAX_BYTES >> 20} MiB.")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise PromptError(f"{path} cannot be read: {error.strerror or error}.") from None
    except UnicodeDecodeError:
        raise PromptError(f"{path} is no text in UTF-8.") from None


def write_whole(path: Path, text: str) -> None:
    """Write a file at once or not at all, in the place of what is there.

    Raises:
        PromptError: it cannot be written there.
    """
    with _refusals(path), _beside(path, text) as written:
        written.replace(path)


def write_new(path: Path, text: str) -> None:
    """Write a file at once or not at all where there is none.

    Raises:
        PromptError: there is one, or it cannot be written there.
    """
    with _refusals(path), _beside(path, text) as written:
        os.link(written, path)  # unlike a renaming it fails where there is a file


@contextmanager
def alone(folder: Path) -> Generator[None]:
    """The only one to write in a folder, among processes.

    Raises:
        PromptError: somebody else is still at it, or it cannot be written there.
    """
    busy, until = folder / BUSY, time.monotonic() + PATIENCE
    while True:
        try:
            os.close(os.open(busy, os.O_CREAT | os.O_EXCL))
            break
        except FileExistsError:
            if time.monotonic() > until:
                raise PromptError(
                    f"Another process writes in {folder}; if none does, delete {busy}."
                ) from None
        except OSError as error:
            raise PromptError(f"{folder} cannot be written: {error.strerror or error}.") from None
        time.sleep(0.02)
    try:
        yield
    finally:
        busy.unlink(missing_ok=True)


@contextmanager
def _beside(path: Path, text: str) -> Generator[Path]:
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
def _refusals(path: Path) -> Generator[None]:
    try:
        yield
    except FileExistsError:
        raise PromptError(f"{path} is there already and is not overwritten.") from None
    except OSError as error:
        raise PromptError(f"{path} cannot be written: {error.strerror or error}.") from None
