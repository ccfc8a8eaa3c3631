"""A session in a folder: trace.jsonl, one event a line, and pictures/, named by their hashes.

Every line is written at once, and what a call changed in the world before the call's result, so a
process that is killed loses at most what it was doing. Keys and times of day are not in it.
"""

import hashlib
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic_core import from_json, to_json

from ...prompts.files import lock
from ...tools.errors import StorageError
from ...tools.store import write_whole
from .locks import taken
from .protocol import Event, EventKind, busy

NAME = "trace.jsonl"
PICTURES = "pictures"
KINDS = frozenset(get_args(EventKind))


class FolderLog:
    """Events as lines of a file.

    Args:
        path: of the file.
        begin: whether to start it anew; else it continues after its last whole event.

    Raises:
        StorageError: the file cannot be written, is damaged, or is written by another process.
    """

    def __init__(self, path: Path, *, begin: bool = False) -> None:
        self.path, self._clock = path, time.perf_counter
        try:
            self._file = path.open("w+b" if begin and not path.exists() else "r+b", buffering=0)
        except OSError as error:
            raise StorageError(f"{path} cannot be written: {error.strerror}.") from None
        if not taken(lambda: lock(self._file.fileno())):
            self._file.close()
            raise busy(str(path))
        if begin:
            self._file.truncate()
        try:
            self._next = len(self._cut_to_whole_events()) + 1
        except StorageError:
            self._file.close()
            raise
        self._began = self._clock()

    @property
    def last(self) -> int:
        """The number of the last event; 0 where there is none."""
        return self._next - 1

    def _cut_to_whole_events(self) -> tuple[Event, ...]:
        """Return the events there are, and cut off a last line that was broken off."""
        data = self._file.read()
        whole = data[: data.rfind(b"\n") + 1]
        events = _read_events(whole, self.path)
        self._file.truncate(len(whole))
        self._file.seek(0, os.SEEK_END)
        return events

    def append(self, kind: EventKind, data: Mapping[str, Any]) -> int:
        """See `EventLog.append`."""
        if kind in ("turn", "resume"):
            self._began = self._clock()
        seconds = round(self._clock() - self._began, 4)
        line = event_line(Event(self._next, kind, seconds, data))
        try:
            end = self._file.seek(0, os.SEEK_END)
            if self._file.write(line) != len(line):  # the disk filled up in the middle of it
                self._file.truncate(end)
                raise OSError(28, os.strerror(28))
        except OSError as error:
            raise StorageError(f"{self.path} cannot be written: {error.strerror}.") from None
        self._next += 1
        return self._next - 1

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `EventLog.events`."""
        return read_events(self.path)[after:]

    def close(self) -> None:
        """See `EventLog.close`."""
        self._file.close()


class FolderArtefacts:
    """Files in a folder, each named by the beginning of its hash."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def put(self, data: bytes) -> str:
        """See `Artefacts.put`."""
        sha256 = hashlib.sha256(data).hexdigest()
        if self._path(sha256) is None:
            try:
                self.folder.mkdir(exist_ok=True)
            except OSError as error:
                raise StorageError(f"{self.folder} cannot be made: {error.strerror}.") from None
            write_whole(self.folder / f"{sha256[:16]}.{suffix_of(data)}", data)
        return sha256

    def get(self, sha256: str) -> bytes:
        """See `Artefacts.get`."""
        path = self._path(sha256)
        if path is None:
            raise StorageError(f"{self.folder} lacks the file {sha256[:16]} that its log names.")
        data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != sha256:
            raise StorageError(f"{path} is not the file that its log means; it was changed since.")
        return data

    def name(self, sha256: str) -> str | None:
        """Return the file's path relative to the folder's parent, or None if it is not there."""
        path = self._path(sha256)
        return None if path is None else f"{self.folder.name}/{path.name}"

    def __contains__(self, sha256: str) -> bool:
        """See `Files.__contains__`."""
        return self._path(sha256) is not None

    def _path(self, sha256: str) -> Path | None:
        return next(self.folder.glob(f"{sha256[:16]}.*"), None)


def read_events(path: Path) -> tuple[Event, ...]:
    """Return the whole events of a log; a last line that was broken off is left out.

    Args:
        path: of the file, or of a folder with a trace.jsonl.

    Raises:
        StorageError: the log is missing, unreadable, or not one that formup wrote.
    """
    try:
        data = log_path(path).read_bytes()
    except OSError as error:
        kind = "missing" if isinstance(error, FileNotFoundError) else None
        raise StorageError(f"{log_path(path)} cannot be read: {error.strerror}.", kind) from None
    events = _read_events(data[: data.rfind(b"\n") + 1], path)
    if not events:
        raise StorageError(f"{path} was broken off before anything began; run again.")
    return events


def log_path(path: Path) -> Path:
    """Return the path of the log in a folder; a path of a log is returned as it is."""
    return path / NAME if path.is_dir() else path


def _read_events(data: bytes, path: Path) -> tuple[Event, ...]:
    try:
        events = [_event(from_json(line)) for line in data.split(b"\n")[:-1]]
        if [e.number for e in events] != list(range(1, len(events) + 1)):
            raise ValueError
    except (ValueError, TypeError, KeyError, AttributeError):
        raise StorageError(f"{path} is no whole trace that formup wrote.") from None
    return tuple(events)


def _event(line: dict[str, Any]) -> Event:
    data = {k: v for k, v in line.items() if k not in ("n", "type", "seconds")}
    if line["type"] not in KINDS or not line["seconds"] >= 0:
        raise ValueError
    return Event(line["n"], line["type"], float(line["seconds"]), data)


def event_line(event: Event) -> bytes:
    """Return an event as a line of a log."""
    facts = {"n": event.number, "type": event.kind, "seconds": event.seconds}
    return to_json(facts | dict(event.data)) + b"\n"


def suffix_of(data: bytes) -> str:
    """Return the suffix of a file's name, by the file's first bytes."""
    kinds = {b"\xff\xd8": "jpg", b"\x89PNG": "png", b"{": "json"}
    return next((kind for head, kind in kinds.items() if data.startswith(head)), "bin")
