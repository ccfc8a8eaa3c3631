"""The tables of a database with sessions, and the engine that reaches them.

The schema has a version: it is made where there is none, and refused where it is another or
incomplete. Writers wait before they read in SQLite (BEGIN IMMEDIATE), on locked rows in PostgreSQL.
"""

import sqlite3
import time
from pathlib import Path
from typing import Any

from sqlalchemy import (
    URL,
    Column,
    Connection,
    Engine,
    Float,
    ForeignKey,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    create_engine,
    event,
    insert,
    inspect,
    make_url,
    select,
    text,
)
from sqlalchemy.exc import ArgumentError, NoSuchModuleError

from ...tools.errors import InputError, StorageError
from .protocol import PROCESS

VERSION = 1
PATIENCE = 10
"""Seconds to wait for a database that others are writing, or that does not answer."""
MAKING = 0x666F726D7570
"""The lock in PostgreSQL under which tables are made, so that no two processes do it at once."""

METADATA = MetaData()
SCHEMA = Table("formup_schema", METADATA, Column("version", Integer, primary_key=True))
SESSIONS = Table(
    "formup_sessions",
    METADATA,
    Column("id", Text, primary_key=True),
    Column("name", Text, nullable=False),
    Column("created", Text, nullable=False),
    Column("last", Integer, nullable=False),  # the number of its last event
    Column("picture", Text),
)


def _of_session() -> Column[Any]:
    return Column("session", ForeignKey("formup_sessions.id", ondelete="CASCADE"), primary_key=True)


EVENTS = Table(
    "formup_events",
    METADATA,
    _of_session(),
    Column("number", Integer, primary_key=True),
    Column("kind", Text, nullable=False),
    Column("seconds", Float, nullable=False),
    Column("data", Text, nullable=False),
)
TURNS = Table(  # the words of `turn` events, for lists
    "formup_turns",
    METADATA,
    _of_session(),
    Column("number", Integer, primary_key=True),
    Column("words", Text, nullable=False),
)
FILES = Table(
    "formup_files",
    METADATA,
    _of_session(),
    Column("sha256", Text, primary_key=True),
    Column("data", LargeBinary, nullable=False),
)


def engine_of(url: str) -> Engine:
    """Return the engine for a database.

    Args:
        url: `sqlite:///PATH` or `postgresql://...`.

    Raises:
        InputError: the URL is neither, or needs an extra that is not installed.
    """
    try:
        address = make_url(url)
        if address.get_backend_name() not in ("sqlite", "postgresql"):
            raise ArgumentError
        if address.drivername == "sqlite" and address.database in (None, "", ":memory:"):
            raise ArgumentError
        return _sqlite(address) if address.drivername == "sqlite" else _postgresql(address)
    except (ArgumentError, NoSuchModuleError):
        raise InputError(
            "A store is a folder, sqlite:///FILE or postgresql://USER:PASSWORD@HOST/DATABASE; "
            f"{url.partition(':')[0][:20]}:... is none of them."
        ) from None
    except ImportError:
        raise InputError(
            "PostgreSQL needs an extra that is not installed: pip install 'formup[postgres]'."
        ) from None


def _sqlite(address: URL) -> Engine:
    path = Path(str(address.database))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{path.parent} cannot be made: {error.strerror}.") from None
    engine = create_engine(address, hide_parameters=True, connect_args={"timeout": PATIENCE})

    @event.listens_for(engine, "connect")
    def connected(connection: Any, record: object) -> None:
        connection.isolation_level = None  # `begun` begins transactions instead
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute(
            "PRAGMA synchronous = NORMAL"
        )  # a kill loses nothing, a power cut little

    @event.listens_for(engine, "begin")
    def begun(connection: Connection) -> None:
        writes = connection.get_execution_options().get("writes")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _postgresql(address: URL) -> Engine:
    waits = {"connect_timeout": PATIENCE, "options": f"-c lock_timeout={PATIENCE}s"}
    waits["application_name"] = PROCESS
    return create_engine(
        address,
        hide_parameters=True,
        pool_pre_ping=True,
        max_overflow=-1,  # each session that is being written holds a connection
        connect_args=waits,
    )


def prepare(engine: Engine, label: str) -> None:
    """Make the tables if there are none.

    Raises:
        StorageError: the tables are of another version, or incomplete.
        SQLAlchemyError, sqlite3.Error: the database cannot be used.
    """
    if engine.dialect.name == "sqlite":
        _write_ahead(engine)
    with engine.connect().execution_options(writes=True) as connection, connection.begin():
        if engine.dialect.name == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": MAKING})
        if _is_whole(connection, label):
            return
        METADATA.create_all(connection)
        connection.execute(insert(SCHEMA).values(version=VERSION))


def _is_whole(connection: Connection, label: str) -> bool:
    """Return whether all tables are there, False if there are none.

    Raises:
        StorageError: the tables are of another version, or incomplete.
    """
    tables = inspect(connection)
    there = {name for name in tables.get_table_names() if name.startswith("formup_")}
    if not there:
        return False
    versions: list[int] = []
    if SCHEMA.name in there:
        columns = {column["name"] for column in tables.get_columns(SCHEMA.name)}
        versions = list(connection.scalars(select(SCHEMA.c.version))) if columns else []
    wanted = {table.name: set(table.columns.keys()) for table in METADATA.sorted_tables}
    if versions != [VERSION]:
        found = ", ".join(map(str, versions)) or "none"
        raise StorageError(
            f"{label} holds sessions by schema {found}; this formup reads schema {VERSION}: use "
            "the formup that wrote it, or another store."
        )
    if {n: {c["name"] for c in tables.get_columns(n)} for n in there} != wanted:
        lacking = ", ".join(sorted(wanted.keys() - there)) or "columns"
        raise StorageError(
            f"{label} is no whole store of formup: its tables are others ({lacking}); restore it "
            "from a copy, or use another store."
        )
    return True


def _write_ahead(engine: Engine) -> None:
    """Log writes ahead, so that readers need not wait; retried, as others may do this just now."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            with engine.connect() as connection:
                raw = connection.connection.cursor()
                raw.execute("PRAGMA journal_mode = WAL")
                raw.close()
            return
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > until:
                raise
            time.sleep(0.01)
