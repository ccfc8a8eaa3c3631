"""A disk that fills: before robots move it is one sentence; after that, they have moved."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply
from formup.agent.session import load_run
from formup.agent.store.folder import FolderArtefacts, FolderLog, read_events
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.context import Settings
from formup.tools.errors import InputError, StorageError
from formup.tools.perception.image import Picture

FULL = "the disk is full: No space left on device."


class Disk:
    """Room for so many events; from then on nothing can be written."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.room: int | None = None
        append, put = FolderLog.append, FolderArtefacts.put

        def bounded(log: FolderLog, kind: Any, data: Mapping[str, Any]) -> int:
            if self.room == 0:
                raise StorageError(FULL)
            if self.room is not None:
                self.room -= 1
            return append(log, kind, data)

        def stored(artefacts: FolderArtefacts, data: bytes) -> str:
            if self.room == 0:
                raise StorageError(FULL)
            return put(artefacts, data)

        monkeypatch.setattr(FolderLog, "append", bounded)
        monkeypatch.setattr(FolderArtefacts, "put", stored)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


def agent(propose: Call) -> Agent:
    replies = [
        Reply(calls=(Call(id="l", name="look", arguments={}),)),
        Reply(calls=(propose, Call(id="d", name="deploy", arguments={}))),
        Reply(calls=(Call(id="k", name="look", arguments={}),)),
        Reply(text="They stand there."),
    ]
    return Agent(ScriptedModel(replies))


def first(picture: Picture, propose: Call, folder: Path) -> Any:
    folder.mkdir()
    settings = Settings(robots=6)
    return agent(propose).run(
        picture, "Surround it", settings=settings, trace=folder / "trace.jsonl"
    )


def test_whatever_write_fails_first(
    red_box: Picture, propose: Call, drives: list[Any], disk: Disk, tmp_path: Path
) -> None:
    whole = first(red_box, propose, tmp_path / "whole")
    events = read_events(tmp_path / "whole")
    moving = [event.kind for event in events].index("moving")
    assert 5 < moving < len(events) - 4
    for room in range(len(events)):
        disk.room = room
        drives.clear()
        folder = tmp_path / f"{room}"
        if room <= moving:
            with pytest.raises(InputError) as caught:
                first(red_box, propose, folder)
            assert str(caught.value) == FULL
            assert drives == []
        else:
            done = first(red_box, propose, folder)
            assert drives
            assert (done.report.status, done.report.exit_code) == ("deployed", 0)
            assert done.report.arrival is not None
            assert done.report.positions == whole.report.positions
            assert done.outcome.messages == whole.outcome.messages
            said = "They stand there. The log ends before this: "
            assert done.report.message == said + FULL
        disk.room = None
        if room == 0:
            with pytest.raises(StorageError, match="broken off before anything began"):
                read_events(folder)
            continue
        assert [e.kind for e in read_events(folder)] == [e.kind for e in events[:room]]
        if room > 4:
            assert load_run(folder).report.instruction == "Surround it"


def test_a_log_that_broke_off_after_a_move_is_not_gone_on_with(
    red_box: Picture, propose: Call, disk: Disk, tmp_path: Path
) -> None:
    whole = first(red_box, propose, tmp_path / "whole")
    assert whole.events is not None
    moving = [event.kind for event in read_events(tmp_path / "whole")].index("moving")
    disk.room = moving + 1
    moved = first(red_box, propose, tmp_path / "run")
    disk.room = None
    assert moved.report.status == "deployed"
    before = (tmp_path / "run" / "trace.jsonl").read_bytes()
    with pytest.raises(StorageError, match="could not be written to its end"):
        Agent(ScriptedModel([Reply(text="No.")])).say(moved, "And now")
    assert (tmp_path / "run" / "trace.jsonl").read_bytes() == before
    load_run(tmp_path / "run")


def test_a_later_turn_that_cannot_be_written_moves_nothing(
    red_box: Picture, propose: Call, drives: list[Any], disk: Disk, tmp_path: Path
) -> None:
    done = first(red_box, propose, tmp_path / "run")
    group = {"relation": "around", "targets": ["t1"], "robots": 5}
    other = Call(id="o", name="propose_formation", arguments={"contract": {"groups": [group]}})
    deploy = Call(id="e", name="deploy", arguments={})
    replies = [Reply(calls=(other, deploy)), Reply(text="Five.")]
    drives.clear()
    for room in range(5):
        disk.room = room
        with pytest.raises(InputError, match="the disk is full"):
            Agent(ScriptedModel(replies)).say(done, "Now five", settings=Settings())
        assert drives == []
        disk.room = None
        done = load_run(tmp_path / "run")
    assert done.world.arrivals.keys() == {done.report.plan_id}
    five = Agent(ScriptedModel(replies)).say(done, "Now five", settings=Settings())
    assert five.report.status == "deployed"
    assert len(five.report.positions or ()) == 5
