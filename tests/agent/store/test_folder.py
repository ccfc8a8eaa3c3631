"""A folder as a store: events written at once and whole, by one process, and files by hash."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from formup.agent.store.folder import FolderArtefacts, FolderLog, read_events
from formup.tools.errors import StorageError

OPENED = """
import sys
from pathlib import Path
from formup.agent.store.folder import FolderLog
log = FolderLog(Path(sys.argv[1]))
print("open", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A log of three events."""
    log = FolderLog(tmp_path / "trace.jsonl", begin=True)
    assert [log.append("session", {"x": 1}), log.append("turn", {}), log.append("end", {})] == [
        1,
        2,
        3,
    ]
    log.close()
    return tmp_path / "trace.jsonl"


def test_events_come_back_in_order_with_their_numbers(path: Path) -> None:
    events = read_events(path)
    assert [(e.number, e.kind) for e in events] == [(1, "session"), (2, "turn"), (3, "end")]
    assert events[0].data == {"x": 1}
    assert read_events(path.parent) == events
    log = FolderLog(path)
    assert log.events(after=1) == events[1:]
    log.close()


def test_each_event_is_on_the_disk_at_once(tmp_path: Path) -> None:
    log = FolderLog(tmp_path / "trace.jsonl", begin=True)
    for number in range(1, 4):
        log.append("message", {"text": "ü" * number})
        assert len(read_events(tmp_path)) == number
    log.close()


@pytest.mark.parametrize("rest", [b'{"n":4,"type":"mes', b"\xff", b"no json"])
def test_a_line_that_was_broken_off_is_left_out_and_cut_away(path: Path, rest: bytes) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole + rest)
    assert len(read_events(path)) == 3
    log = FolderLog(path)
    assert path.read_bytes() == whole
    assert log.append("resume", {}) == 4
    log.close()
    assert [e.kind for e in read_events(path)] == ["session", "turn", "end", "resume"]


def test_begun_anew_it_is_empty(path: Path) -> None:
    log = FolderLog(path, begin=True)
    assert log.append("session", {}) == 1
    log.close()
    assert len(read_events(path)) == 1


def test_a_second_writer_is_refused_and_changes_nothing(path: Path) -> None:
    log = FolderLog(path)
    for begin in (False, True):
        with pytest.raises(StorageError, match="being written by another process"):
            FolderLog(path, begin=begin)
    assert log.append("resume", {}) == 4
    log.close()
    assert len(read_events(path)) == 4


def test_nor_may_another_process_until_this_one_ends(path: Path) -> None:
    whole = path.read_bytes()
    other = subprocess.Popen(
        [sys.executable, "-c", OPENED, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "open\n"
    for begin in (False, True):
        with pytest.raises(StorageError, match="being written by another process"):
            FolderLog(path, begin=begin)
    assert path.read_bytes() == whole
    assert len(read_events(path)) == 3
    other.kill()
    other.communicate()
    FolderLog(path).close()


class Full:
    """A file on a disk on which so many more bytes have room."""

    def __init__(self, file: Any, room: int) -> None:
        self._file, self._room = file, room

    def write(self, data: bytes) -> int:
        if not self._room:
            raise OSError(28, os.strerror(28))
        written = self._file.write(data[: self._room])
        self._room -= written
        return written

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@pytest.mark.parametrize("room", [0, 1, 20])
def test_what_has_no_room_is_not_half_written(path: Path, room: int) -> None:
    whole = path.read_bytes()
    log = FolderLog(path)
    file = log._file  # type: ignore[attr-defined]
    log._file = Full(file, room)  # type: ignore[attr-defined]
    with pytest.raises(StorageError, match=r"trace\.jsonl cannot be written: No space left"):
        log.append("resume", {"reason": "x" * 100})
    assert path.read_bytes() == whole
    log._file = file  # type: ignore[attr-defined]
    assert log.append("resume", {}) == 4
    log.close()
    assert len(read_events(path)) == 4


@pytest.mark.parametrize(
    "text",
    [
        "{}\n",
        "[]\n",
        "null\n",
        "no json\n",
        '{"n":1,"type":"session"}\n',
        '{"n":1,"type":"king","seconds":0}\n',
        '{"n":2,"type":"session","seconds":0}\n',
        '{"n":1,"type":"session","seconds":-1}\n',
        '{"n":1,"type":"session","seconds":0}\n{"n":3,"type":"turn","seconds":0}\n',
        '{"n":1,"type":"session","seconds":0}\n\n{"n":2,"type":"turn","seconds":0}\n',
    ],
)
def test_what_is_no_log_is_refused_in_one_sentence(text: str, tmp_path: Path) -> None:
    path = tmp_path / "t.jsonl"
    path.write_text(text)
    for read in (read_events, FolderLog):
        with pytest.raises(StorageError, match=r"t\.jsonl") as caught:
            read(path)
        assert "\n" not in str(caught.value)
    assert path.read_text() == text


def test_what_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="cannot be read"):
        read_events(tmp_path / "nothing.jsonl")
    with pytest.raises(StorageError, match="cannot be written"):
        FolderLog(tmp_path / "nothing.jsonl")
    with pytest.raises(StorageError, match="cannot be written"):
        FolderLog(tmp_path / "no folder" / "t.jsonl", begin=True)


def test_files_go_by_their_hash(tmp_path: Path) -> None:
    files = FolderArtefacts(tmp_path / "pictures")
    for data, suffix in (
        (b"\xff\xd8x", "jpg"),
        (b"\x89PNGx", "png"),
        (b"{}", "json"),
        (b"x", "bin"),
    ):
        sha256 = files.put(data)
        assert sha256 == hashlib.sha256(data).hexdigest() == files.put(data)
        assert files.get(sha256) == data
        assert files.name(sha256) == f"pictures/{sha256[:16]}.{suffix}"
    assert len(list((tmp_path / "pictures").iterdir())) == 4


def test_files_that_are_missing_or_changed_are_refused(tmp_path: Path) -> None:
    files = FolderArtefacts(tmp_path / "pictures")
    assert files.name("0" * 64) is None
    with pytest.raises(StorageError, match="lacks the file 0000"):
        files.get("0" * 64)
    sha256 = files.put(b"{}")
    (path,) = (tmp_path / "pictures").iterdir()
    path.write_bytes(b"{} ")
    with pytest.raises(StorageError, match="was changed since"):
        files.get(sha256)


def test_a_line_is_json_that_others_can_read(path: Path) -> None:
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [set(line) for line in lines] == [{"n", "type", "seconds", "x"}] + 2 * [
        {"n", "type", "seconds"}
    ]
