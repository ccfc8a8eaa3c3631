"""Sessions in folders, SQLite and PostgreSQL: the same of all three."""

import hashlib
import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from formup.agent.store.copies import fork
from formup.agent.store.database import DatabaseFiles, DatabaseStore
from formup.agent.store.places import data_folder, store_at
from formup.agent.store.protocol import Store, StoredSession
from formup.tools.errors import InputError, StorageError
from sqlalchemy import create_engine, text

KINDS = ("folder", "sqlite", "postgresql")
everywhere = pytest.mark.parametrize("address", KINDS, indirect=True)
databases = pytest.mark.parametrize("address", KINDS[1:], indirect=True)
Opened = Callable[[str], Store]
WRITERS, APPENDS = 8, 40
FILE = b"\x89PNG\x00\xff"
SHA256 = hashlib.sha256(FILE).hexdigest()


def began(store: Store, *words: str, name: str = "") -> StoredSession:
    """A session in which so much was said."""
    session = store.create(name)
    log = session.write(0)
    session.artefacts.put(FILE)
    picture = {"facts": {"sha256": "0" * 64}, "file": SHA256}
    log.append("session", {"picture": picture})
    for said in words:
        log.append("turn", {"words": said})
        log.append("message", {"role": "user", "text": said, "images": [{"sha256": SHA256}]})
        log.append("end", {"status": "planned"})
    log.close()
    return session


@everywhere
def test_events_come_back_with_their_numbers(store: Store) -> None:
    session = began(store, "Surround it", "ü\x00\U0001f916 'quoted' \"twice\" \\n")
    events = session.events()
    assert [e.number for e in events] == list(range(1, 8))
    assert [e.kind for e in events[:4]] == ["session", "turn", "message", "end"]
    assert events[4].data["words"] == "ü\x00\U0001f916 'quoted' \"twice\" \\n"
    assert events[0].data["picture"]["file"] == SHA256
    assert all(e.seconds >= 0 for e in events)
    assert store.open(session.id).events() == events
    assert session.events(after=5) == events[5:]


@everywhere
def test_files_go_by_their_hash(store: Store) -> None:
    session, other = began(store, "a"), store.create()
    assert session.artefacts.put(FILE) == SHA256
    assert session.artefacts.get(SHA256) == FILE
    assert SHA256 in session.artefacts
    assert SHA256 not in other.artefacts
    with pytest.raises(StorageError, match="lacks the file"):
        other.artefacts.get(SHA256)


@databases
def test_the_same_file_may_be_put_twice_at_once(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = began(store, "a")

    def nowhere(files: DatabaseFiles, sha256: str) -> bool:
        return False

    monkeypatch.setattr(DatabaseFiles, "__contains__", nowhere)
    assert session.artefacts.put(FILE) == session.artefacts.put(FILE) == SHA256
    assert session.artefacts.get(SHA256) == FILE


@everywhere
def test_sessions_are_listed_searched_and_renamed(store: Store) -> None:
    assert store.sessions() == ()
    first = began(store, "Surround the car", "And 100% closer", name="Lot A")
    time.sleep(0.01)  # the order is that of their making, to the millisecond
    second = began(store, "Ring the TREE_1")
    one, other = store.sessions()[::-1]
    assert (one.id, one.name, one.turns, one.words) == (first.id, "Lot A", 2, "And 100% closer")
    assert (other.id, other.name, other.turns) == (second.id, "", 1)
    assert one.picture == "0" * 64
    assert one.created < other.created
    found = {
        t: [f.id for f in store.sessions(t)] for t in ("CAR", "tree_", "lot a", "0%", "%", "q")
    }
    assert found == {
        "CAR": [first.id],
        "tree_": [second.id],
        "lot a": [first.id],
        "0%": [first.id],
        "%": [first.id],
        "q": [],
    }
    store.rename(second.id, "  Two\n trees ")
    assert store.sessions("two TREES")[0].name == "Two trees"
    with pytest.raises(InputError, match="one line of up to 200"):
        store.rename(second.id, "x" * 201)


@everywhere
def test_a_new_name_keeps_the_marks_that_a_chat_finds_it_by(store: Store) -> None:
    mark, chat = "[0123456789ab]", "[cdef01234567]"
    for begun in (f"Cage it {mark} {chat}", f"{mark} {chat}"):
        made = store.create(begun)
        for name in ("Coins", f"Coins {mark} {chat}", f"Coins {chat}"):
            store.rename(made.id, name)
            named = {facts.id: facts.name for facts in store.sessions()}
            assert named[made.id] == f"Coins {mark} {chat}"


@everywhere
def test_a_session_that_is_not_there_is_refused(store: Store, tmp_path: Path) -> None:
    (tmp_path / "trace.jsonl").write_text("{}")
    for name in ("nothing", "", "..", "../sessions", "'; DROP TABLE formup_events; --"):
        for use in (store.open, store.delete, partial(store.rename, name="x")):
            with pytest.raises(StorageError) as caught:
                use(name)
            assert caught.value.kind == "missing"
    assert (tmp_path / "trace.jsonl").exists()


@everywhere
def test_a_deleted_session_is_gone_and_the_others_are_not(store: Store) -> None:
    kept, gone = began(store, "stay"), began(store, "go")
    log = gone.write(4)
    with pytest.raises(StorageError) as caught:
        store.delete(gone.id)
    assert caught.value.kind == "busy"
    log.close()
    store.delete(gone.id)
    assert [f.id for f in store.sessions()] == [kept.id]
    with pytest.raises(StorageError):
        gone.events()
    assert SHA256 not in gone.artefacts
    assert kept.artefacts.get(SHA256) == FILE


@everywhere
def test_of_two_writers_one_is_refused_and_told_what_happened(
    store: Store, address: str, opened: Opened
) -> None:
    session = began(store, "Surround it")
    here, there = store.open(session.id), opened(address).open(session.id)
    log = here.write(4)
    log.append("turn", {"words": "Now five"})
    with pytest.raises(StorageError, match=r'being written by another.*"Now five" was') as caught:
        there.write(4)
    assert caught.value.kind == "busy"
    log.append("end", {"status": "deployed"})
    log.close()
    with pytest.raises(StorageError, match='"Now five" was said, it came to deployed') as caught:
        there.write(4)
    assert caught.value.kind == "gone_on"
    assert "Nothing was written" in str(caught.value)
    assert len(session.events()) == 6
    log = there.write(6)
    assert log.append("resume", {}) == 7
    log.close()


@everywhere
def test_who_looks_whether_it_is_written_refuses_nobody(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("formup.agent.store.locks.MOMENT", 60)
    session = began(store, "a")
    looking, written = session.write(4), list[int]()

    def write() -> None:
        log = session.write(4)
        written.append(log.append("turn", {"words": "b"}))
        log.close()

    writer = threading.Thread(target=write)
    writer.start()
    time.sleep(0.05)
    looking.close()
    writer.join()
    assert written == [5]


@everywhere
def test_eight_writers_of_one_session_leave_no_gap(store: Store) -> None:
    session = store.create()

    def write(writer: int) -> None:
        mine, known, number = store.open(session.id), 0, 0
        while number < APPENDS:
            try:
                log = mine.write(known)
            except StorageError as error:  # another has it, or has been quicker
                assert error.kind in ("busy", "gone_on")
                time.sleep(random.random() / 8)
                known += len(mine.events(known)) if error.kind == "gone_on" else 0
                continue
            known = log.append("message", {"writer": writer, "number": number})
            number += 1
            log.close()

    together(write)
    events = session.events()
    assert [e.number for e in events] == list(range(1, WRITERS * APPENDS + 1))
    for writer in range(WRITERS):
        mine = [e.data["number"] for e in events if e.data["writer"] == writer]
        assert mine == list(range(APPENDS))


@everywhere
def test_eight_writers_of_eight_sessions_do_not_disturb_each_other(
    store: Store, address: str
) -> None:
    def write(writer: int) -> None:
        own = store_at(address)
        log = own.create(f"{writer}").write(0)
        for number in range(APPENDS):
            log.append("message", {"number": number})
        log.close()
        own.close()

    together(write)
    counts = [len(store.open(facts.id).events()) for facts in store.sessions()]
    assert counts == [APPENDS] * WRITERS


def together(work: Callable[[int], None]) -> None:
    """Have eight threads do it at once; what one raises is raised."""
    raised: list[BaseException] = []

    def run(number: int) -> None:
        try:
            work(number)
        except BaseException as error:
            raised.append(error)

    threads = [threading.Thread(target=run, args=(n,)) for n in range(WRITERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert raised == []


@databases
def test_a_writer_whose_lock_was_lost_cannot_interleave(store: Store) -> None:
    session = began(store, "Surround it")
    log, other = session.write(4), store.open(session.id)
    log._lock.close()  # type: ignore[attr-defined]  # as when the server was restarted
    quicker = other.write(4)
    quicker.append("turn", {"words": "Now five"})
    with pytest.raises(StorageError, match=r'has gone on since.*"Now five"') as caught:
        log.append("turn", {"words": "Now six"})
    assert caught.value.kind == "gone_on"
    assert [e.data.get("words") for e in session.events(after=4)] == ["Now five"]
    quicker.close()


@everywhere
def test_a_fork_leaves_the_original_as_it_is(store: Store, tmp_path: Path) -> None:
    session = began(store, "one", "two", "three", name="first")
    events = session.events()
    short = fork(store, session, 2, name="second")
    assert short.events() == events[:7]
    assert short.artefacts.get(SHA256) == FILE
    assert fork(store, session).events() == events
    log = short.write(7)
    log.append("turn", {"words": "other"})
    log.close()
    store.delete(short.id)
    assert session.events() == events
    assert session.artefacts.get(SHA256) == FILE
    for turn in (0, 4, -1):
        with pytest.raises(InputError, match=f"no turn {turn}; the session has turns 1 to 3"):
            fork(store, session, turn)
    elsewhere = fork(store_at(tmp_path / "elsewhere"), session, 1)
    assert elsewhere.events() == events[:4]


CREATED = """
import sys
from formup.agent.store.places import store_at
store = store_at(sys.argv[1])
for _ in range(3):
    log = store.create().write(0)
    log.append("session", {})
    log.close()
"""


@databases
def test_processes_that_open_a_new_database_at_once(address: str) -> None:
    command = [sys.executable, "-c", CREATED, address]
    started = [subprocess.Popen(command, stderr=subprocess.PIPE) for _ in range(4)]
    for process in started:
        error = process.communicate()[1]
        assert process.returncode == 0, error.decode()
    store = store_at(address)
    assert len(store.sessions()) == 12
    store.close()


@databases
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("UPDATE formup_schema SET version = 2", "by schema 2; this formup reads schema 1"),
        ("DELETE FROM formup_schema", "by schema none"),
        ("DROP TABLE formup_schema", "by schema none"),
        ("DROP TABLE formup_turns", r"no whole store of formup.*formup_turns"),
        ("ALTER TABLE formup_sessions ADD COLUMN king text", r"no whole store.*columns"),
        ("CREATE TABLE formup_more (a int)", r"no whole store"),
    ],
)
def test_another_or_a_partial_schema_is_refused(address: str, change: str, sentence: str) -> None:
    store_at(address).close()
    engine = create_engine(address)
    with engine.begin() as connection:
        connection.execute(text(change))
    engine.dispose()
    with pytest.raises(StorageError, match=sentence):
        store_at(address)


def test_a_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.db").write_text("no database at all, but long enough to look like one" * 20)
    with pytest.raises(StorageError, match=r"a\.db cannot be used: file is not a database"):
        store_at(f"sqlite:///{tmp_path / 'a.db'}")


@pytest.mark.parametrize(
    "address", ["sqlite://", "sqlite:///:memory:", "mysql://a:secret@b/c", "https://secret", "x://"]
)
def test_what_is_no_store_is_refused_without_showing_a_password(address: str) -> None:
    with pytest.raises(InputError, match="A store is a folder, sqlite:///FILE or postgresql") as e:
        store_at(address)
    assert "secret" not in str(e.value)


@databases
def test_a_connection_in_use_when_its_store_closes_is_closed_after_it(store: Store) -> None:
    assert isinstance(store, DatabaseStore)
    with store.reading() as connection:
        inner = connection.connection.dbapi_connection
        store.close()
        assert connection.scalar(text("SELECT 1")) == 1
    assert inner is not None
    with pytest.raises(Exception, match="closed"):
        inner.cursor().execute("SELECT 1")


def test_a_server_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(StorageError, match="cannot be used") as caught:
        store_at("postgresql://me:secret@127.0.0.1:1/nothing")
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_by_default_sessions_lie_in_the_users_data_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    assert data_folder() == tmp_path / "formup"
    store = store_at()
    began(store, "Surround it")
    store.close()
    assert (tmp_path / "formup" / "sessions.db").is_file()
