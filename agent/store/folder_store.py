"""Sessions as folders, one each: the form that `formup run` writes and `formup trace` reads."""

import shutil
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path

from pydantic_core import from_json, to_json

from ...tools.errors import StorageError
from ...tools.store import write_whole
from .folder import NAME, PICTURES, FolderArtefacts, FolderLog, event_line, log_path, read_events
from .locks import lock_file, read_holder
from .protocol import (
    Event,
    EventLog,
    SessionFacts,
    StoredSession,
    busy,
    checked_name,
    gone_on,
    matches,
    missing,
    new_id,
    now,
    renamed,
)

FACTS = "session.json"
"""The file with a session's name and when it was made; a session without it has no name."""


class FolderSession:
    """A session in a folder.

    Args:
        path: path of its log.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.id, self.label = path.parent.name, str(path)
        self.artefacts = FolderArtefacts(path.parent / PICTURES)

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `StoredSession.events`."""
        return read_events(self.path)[after:]

    def write(self, after: int) -> EventLog:
        """See `StoredSession.write`."""
        try:
            log = FolderLog(self.path)
        except StorageError as error:
            if error.kind == "busy":
                raise busy(self.label, read_events(self.path)[after:]) from None
            raise
        if log.last != after:
            log.close()
            raise gone_on(self.label, read_events(self.path)[after:])
        return log


class FolderStore:
    """A store of one folder per session, in a folder that is made if it is not there."""

    def __init__(self, root: Path) -> None:
        self.root, self.label = root, str(root)

    def create(
        self,
        name: str = "",
        events: Sequence[Event] = (),
        files: Sequence[bytes] = (),
        owner: str = "",
    ) -> StoredSession:
        """See `Store.create`."""
        session = new_id(owner)
        with _as_storage_errors(self.root):
            self.root.mkdir(parents=True, exist_ok=True)
            begun = self.root / f".{session}"
            begun.mkdir()
            try:
                write_session(begun, events, files)
                _write_facts(begun, checked_name(name), now())
                begun.rename(self.root / session)
            except BaseException:
                shutil.rmtree(begun, ignore_errors=True)
                raise
        return FolderSession(self.root / session / NAME)

    def open(self, session: str) -> StoredSession:
        """See `Store.open`."""
        return FolderSession(self._log(session))

    def sessions(self, text: str = "") -> tuple[SessionFacts, ...]:
        """See `Store.sessions`."""
        with _as_storage_errors(self.root):
            logs = self.root.glob(f"*/{NAME}") if self.root.is_dir() else ()
            found = [_listed(p) for p in logs if not p.parent.name.startswith(".")]
        kept = [facts for facts, said in found if matches(facts, said, text)]
        return tuple(sorted(kept, key=lambda facts: facts.created, reverse=True))

    def rename(self, session: str, name: str) -> None:
        """See `Store.rename`."""
        folder = self._log(session).parent
        old, made = _named(folder)
        _write_facts(folder, renamed(old, name), made)

    def delete(self, session: str) -> None:
        """See `Store.delete`."""
        path = self._log(session)
        FolderLog(path).close()  # fails while another process writes it
        with _as_storage_errors(path):
            shutil.rmtree(path.parent)

    def lock(self, name: str) -> ExitStack | None:
        """See `Store.lock`."""
        with _as_storage_errors(self.root):
            self._lock_file(name).parent.mkdir(parents=True, exist_ok=True)
            return lock_file(self._lock_file(name))

    def holder(self, name: str) -> str:
        """See `Store.holder`."""
        return read_holder(self._lock_file(name))

    def close(self) -> None:
        """See `Store.close`."""

    def _lock_file(self, name: str) -> Path:
        return self.root / ".locks" / name

    def _log(self, session: str) -> Path:
        path = self.root / session / NAME
        if session.startswith(".") or Path(session).name != session or not path.is_file():
            raise missing(f"The session {session!r} in {self.root}")
        return path


def write_session(folder: Path, events: Sequence[Event], files: Sequence[bytes]) -> None:
    """Write a session into a folder of its own, its log last.

    Raises:
        StorageError: it cannot be written there.
    """
    artefacts = FolderArtefacts(folder / PICTURES)
    for data in files:
        artefacts.put(data)
    write_whole(log_path(folder), b"".join(map(event_line, events)))


def _listed(path: Path) -> tuple[SessionFacts, list[str]]:
    """Return a session as it is listed, and what was said in it."""
    name, created = _named(path.parent)
    picture, said = None, list[str]()
    with path.open("rb") as file:
        for line in file:
            head = line[:60]
            try:
                if b'"type":"turn"' in head:
                    said.append(str(from_json(line)["words"]))
                elif b'"type":"session"' in head:
                    picture = str(from_json(line)["picture"]["facts"]["sha256"])
            except (KeyError, TypeError, ValueError):
                break  # broken off or damaged: what comes before is listed
    last = said[-1] if said else ""
    return SessionFacts(path.parent.name, name, created, len(said), last, picture), said


def _named(folder: Path) -> tuple[str, str]:
    """Return a session's name and when it was made; if not stored, "" and when its log changed."""
    try:
        facts = from_json((folder / FACTS).read_bytes())
        return str(facts["name"]), str(facts["created"])
    except (OSError, ValueError, KeyError, TypeError):
        made = datetime.fromtimestamp(log_path(folder).stat().st_mtime, UTC)
        return "", made.isoformat(timespec="milliseconds")


def _write_facts(folder: Path, name: str, created: str) -> None:
    write_whole(folder / FACTS, to_json({"name": name, "created": created}))


@contextmanager
def _as_storage_errors(path: Path) -> Generator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path} cannot be used: {error.strerror or error}.") from None
