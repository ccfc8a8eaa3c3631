"""Sessions in a database: SQLite in the user's data folder, or PostgreSQL by its URL.

Each event is a transaction of its own, which says after which event it comes: a writer that does
not know of the last one is refused. Whoever writes a session holds a lock that the system frees
when the process ends.
"""

import hashlib
import sqlite3
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from pydantic_core import from_json, to_json
from sqlalchemy import Connection, delete, func, insert, select, text, update
from sqlalchemy.event import listen
from sqlalchemy.exc import DBAPIError, SQLAlchemyError
from sqlalchemy.pool import ConnectionPoolEntry

from ...tools.errors import StorageError
from .folder import KINDS
from .locks import lock_file, read_holder, taken
from .protocol import (
    Event,
    EventKind,
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
from .schema import EVENTS, FILES, SESSIONS, TURNS, engine_of, prepare


class DatabaseStore:
    """Sessions in a database.

    Args:
        url: `sqlite:///FILE` or `postgresql://USER:PASSWORD@HOST/DATABASE`.

    Raises:
        InputError: the URL is neither, or needs an extra that is not installed.
        StorageError: the database cannot be used, or its tables are not those of this formup.
    """

    def __init__(self, url: str) -> None:
        self._engine = engine_of(url)
        address = self._engine.url.set(query={})  # the query may hold a password
        self.label = address.render_as_string(hide_password=True)
        try:
            with self._as_storage_errors():
                prepare(self._engine, self.label)
        except BaseException:
            self._engine.dispose()
            raise

    def create(
        self,
        name: str = "",
        events: Sequence[Event] = (),
        files: Sequence[bytes] = (),
        owner: str = "",
    ) -> StoredSession:
        """See `Store.create`."""
        session = new_id(owner)
        facts = {"id": session, "name": checked_name(name), "created": now(), "last": len(events)}
        with self.writing() as connection:
            connection.execute(insert(SESSIONS).values(facts))
            for data in files:
                _put(connection, session, data)
            _insert(connection, session, events)
        return DatabaseSession(self, session)

    def open(self, session: str) -> StoredSession:
        """See `Store.open`."""
        found = DatabaseSession(self, session)
        found.last()
        return found

    def sessions(self, text: str = "") -> tuple[SessionFacts, ...]:
        """See `Store.sessions`."""
        said: dict[str, list[str]] = {}
        with self.reading() as connection:
            rows = connection.execute(select(SESSIONS).order_by(SESSIONS.c.created.desc())).all()
            turns = select(TURNS.c.session, TURNS.c.words).order_by(TURNS.c.number)
            for session, words in connection.execute(turns):
                said.setdefault(session, []).append(words)
        found: list[SessionFacts] = []
        for row in rows:
            words = said.get(row.id, [])
            last = words[-1] if words else ""
            facts = SessionFacts(row.id, row.name, row.created, len(words), last, row.picture)
            if matches(facts, words, text):
                found.append(facts)
        return tuple(found)

    def rename(self, session: str, name: str) -> None:
        """See `Store.rename`."""
        row = SESSIONS.c.id == session
        with self.writing() as connection:
            # Written first: it locks the row, and fails at once for whoever may not write.
            same = update(SESSIONS).where(row).values(name=SESSIONS.c.name)
            if not connection.execute(same).rowcount:
                raise missing(f"The session {session!r}")
            old = connection.execute(select(SESSIONS.c.name).where(row)).scalar_one()
            connection.execute(update(SESSIONS).where(row).values(name=renamed(old, name)))

    def delete(self, session: str) -> None:
        """See `Store.delete`."""
        stored = self.open(session)
        lock = taken(lambda: self.lock(session))
        if lock is None:
            raise busy(stored.label, holder=self.holder(session))
        with lock, self.writing() as connection:
            connection.execute(delete(SESSIONS).where(SESSIONS.c.id == session))

    def close(self) -> None:
        """See `Store.close`; a connection that a thread still reads with is closed afterwards."""
        listen(self._engine.pool, "checkin", _invalidate)
        self._engine.dispose()

    def lock(self, name: str) -> ExitStack | None:
        """See `Store.lock`; a session's only writer has the lock named by its id."""
        stack = ExitStack()
        with self._as_storage_errors():
            if self._engine.dialect.name == "sqlite":
                self._lock_file(name).parent.mkdir(exist_ok=True)
                return lock_file(self._lock_file(name))
            connection = stack.enter_context(self._engine.connect())
            number = _lock_number(name)
            taken = connection.scalar(select(func.pg_try_advisory_lock(number)))
            connection.commit()  # the lock belongs to the connection and ends with it
            if not taken:
                stack.close()
                return None
            stack.callback(_unlock, connection, number)
            return stack

    def holder(self, name: str) -> str:
        """See `Store.holder`."""
        if self._engine.dialect.name == "sqlite":
            return read_holder(self._lock_file(name))
        with self.reading() as connection:
            # PostgreSQL shows the number of an advisory lock as two halves
            return str(connection.scalar(text(_HOLDER), {"number": _lock_number(name)}) or "")

    def _lock_file(self, name: str) -> Path:
        return Path(f"{self._engine.url.database}-locks") / name

    @contextmanager
    def reading(self) -> Generator[Connection]:
        """Yield a connection within a transaction that reads."""
        with self._as_storage_errors(), self._engine.connect() as connection, connection.begin():
            yield connection

    @contextmanager
    def writing(self) -> Generator[Connection]:
        """Yield a connection within a transaction that takes effect as a whole or not at all."""
        engine = self._engine.execution_options(writes=True)
        with self._as_storage_errors(), engine.begin() as connection:
            yield connection

    @contextmanager
    def _as_storage_errors(self) -> Generator[None]:
        try:
            yield
        except (SQLAlchemyError, sqlite3.Error, OSError) as error:
            cause = error.orig if isinstance(error, DBAPIError) else error
            first = str(cause).strip().partition("\n")[0]  # further lines may quote what was said
            raise StorageError(f"{self.label} cannot be used: {first}.") from None


class DatabaseSession:
    """A session in a database."""

    def __init__(self, store: DatabaseStore, session: str) -> None:
        self._store, self.id = store, session
        self.label = f"The session {session!r}"
        self.artefacts = DatabaseFiles(store, session)

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `StoredSession.events`."""
        wanted = (EVENTS.c.number, EVENTS.c.kind, EVENTS.c.seconds, EVENTS.c.data)
        chosen = select(*wanted).where(EVENTS.c.session == self.id, EVENTS.c.number > after)
        with self._store.reading() as connection:
            rows = connection.execute(chosen.order_by(EVENTS.c.number)).all()
        if not rows and not self.last():  # `last` raises if it was deleted
            raise StorageError(f"{self.label} was broken off before anything began; run again.")
        numbers, kinds, seconds, texts = zip(*rows, strict=True) if rows else ((), (), (), ())
        try:
            data = from_json(f"[{','.join(texts)}]")
            gapless = numbers == tuple(range(after + 1, after + len(data) + 1))
            if not gapless or not KINDS.issuperset(kinds):
                raise ValueError
        except ValueError:
            raise StorageError(f"{self.label} is no whole session that formup wrote.") from None
        return tuple(map(Event, numbers, kinds, seconds, data))

    def write(self, after: int) -> EventLog:
        """See `StoredSession.write`."""
        lock = taken(lambda: self._store.lock(self.id))
        if lock is None:
            raise busy(self.label, self._since(after), self._store.holder(self.id))
        try:
            if self.last() != after:
                raise gone_on(self.label, self._since(after))
        except BaseException:
            lock.close()
            raise
        return DatabaseLog(self._store, self, lock, after)

    def last(self) -> int:
        """Return the number of the session's last event.

        Raises:
            StorageError: the session is not there.
        """
        with self._store.reading() as connection:
            last = connection.scalar(select(SESSIONS.c.last).where(SESSIONS.c.id == self.id))
        if last is None:
            raise missing(self.label)
        return last

    def _since(self, after: int) -> tuple[Event, ...]:
        return self.events(after) if self.last() > after else ()


class DatabaseLog:
    """The events of a session, open for appending."""

    def __init__(
        self, store: DatabaseStore, session: DatabaseSession, lock: ExitStack, last: int
    ) -> None:
        self._store, self._session, self._lock, self._last = store, session, lock, last
        self._began = time.perf_counter()

    @property
    def last(self) -> int:
        """See `EventLog.last`."""
        return self._last

    def append(self, kind: EventKind, data: Mapping[str, Any]) -> int:
        """See `EventLog.append`."""
        if kind in ("turn", "resume"):
            self._began = time.perf_counter()
        seconds = round(time.perf_counter() - self._began, 4)
        event = Event(self._last + 1, kind, seconds, data)
        mine = (SESSIONS.c.id == self._session.id, SESSIONS.c.last == self._last)
        with self._store.writing() as connection:
            moved = update(SESSIONS).where(*mine).values(last=event.number)  # locks the row
            written = bool(connection.execute(moved).rowcount)
            if written:
                _insert(connection, self._session.id, (event,))
        if not written:
            self._session.last()
            raise gone_on(self._session.label, self.events(self._last))
        self._last = event.number
        return event.number

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `EventLog.events`."""
        return self._session.events(after)

    def close(self) -> None:
        """See `EventLog.close`."""
        self._lock.close()


class DatabaseFiles:
    """The files of one session."""

    def __init__(self, store: DatabaseStore, session: str) -> None:
        self._store, self._session = store, session

    def put(self, data: bytes) -> str:
        """See `Artefacts.put`."""
        sha256 = hashlib.sha256(data).hexdigest()
        if sha256 not in self:
            with self._store.writing() as connection:
                _put(connection, self._session, data)
        return sha256

    def get(self, sha256: str) -> bytes:
        """See `Artefacts.get`."""
        with self._store.reading() as connection:
            data = connection.scalar(select(FILES.c.data).where(*self._named(sha256)))
        where = f"The session {self._session!r} in {self._store.label}"
        if data is None:
            raise StorageError(f"{where} lacks the file {sha256[:16]} that its log names.")
        if hashlib.sha256(data).hexdigest() != sha256:
            raise StorageError(f"{where}: the file {sha256[:16]} was changed since.")
        return bytes(data)

    def __contains__(self, sha256: str) -> bool:
        """See `Files.__contains__`."""
        with self._store.reading() as connection:
            found = connection.scalar(select(FILES.c.sha256).where(*self._named(sha256)))
        return found is not None

    def _named(self, sha256: str) -> tuple[Any, Any]:
        return FILES.c.session == self._session, FILES.c.sha256 == sha256


def _invalidate(_: object, record: ConnectionPoolEntry) -> None:
    record.invalidate()


def _put(connection: Connection, session: str, data: bytes) -> None:
    facts = {"session": session, "sha256": hashlib.sha256(data).hexdigest(), "data": data}
    connection.execute(text(_PUT), facts)


def _insert(connection: Connection, session: str, events: Sequence[Event]) -> None:
    """Write events, and what lists of sessions show of them."""
    rows = [
        {
            "session": session,
            "number": event.number,
            "kind": event.kind,
            "seconds": event.seconds,
            "data": to_json(dict(event.data)).decode(),
        }
        for event in events
    ]
    turns = [
        {"session": session, "number": event.number, "words": _storable(event.data.get("words"))}
        for event in events
        if event.kind == "turn"
    ]
    if rows:
        connection.execute(insert(EVENTS), rows)
    if turns:
        connection.execute(insert(TURNS), turns)
    for event in events[:1]:
        if event.kind == "session":
            begun = update(SESSIONS).where(SESSIONS.c.id == session)
            connection.execute(begun.values(picture=_picture_of(event)))


def _picture_of(event: Event) -> str | None:
    picture: Any = event.data.get("picture")
    return None if picture is None else str(picture["facts"]["sha256"])


def _storable(words: object) -> str:
    """Return words as text that PostgreSQL takes, which has no NUL characters."""
    return str(words or "").replace("\0", "\N{REPLACEMENT CHARACTER}")


def _lock_number(name: str) -> int:
    """Return a lock's number among the advisory locks of PostgreSQL."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big", signed=True)


_PUT = """
    INSERT INTO formup_files (session, sha256, data) VALUES (:session, :sha256, :data)
    ON CONFLICT DO NOTHING
"""  # another process or thread may put the same file at the same time
_HOLDER = """
    SELECT application_name FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND granted AND objsubid = 1
    AND ((classid::bigint << 32) | objid::bigint) = :number
"""


def _unlock(connection: Connection, number: int) -> None:
    try:
        connection.scalar(select(func.pg_advisory_unlock(number)))
    except SQLAlchemyError:
        connection.invalidate()  # so that nobody gets it from the pool with the lock
