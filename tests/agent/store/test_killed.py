"""A chat whose process is killed at each write, and one in which each write fails once."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, History, Reply, Result, User, turn_of
from formup.agent.model import Request
from formup.agent.session import Run, load_run
from formup.agent.store.places import store_at
from formup.agent.store.protocol import Store
from formup.agent.wrappers.doubles import FunctionModel
from formup.tools.context import Settings
from formup.tools.errors import InputError, StorageError
from formup.tools.fleet.protocol import Motion
from formup.tools.perception.image import Picture, picture_from_array
from sqlalchemy import Connection, event
from sqlalchemy.exc import OperationalError

FIRST, SECOND = "Surround it with 6 robots", "Now five"


def picture() -> Picture:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return picture_from_array(pixels)


def deciding(request: Request) -> Reply:
    """Proposes and deploys in each turn, with as many robots as the words say."""
    first, *rest = turn_of(request.messages)
    robots, number = (5, 2) if SECOND in first.text else (6, 1)
    results = [m for m in rest if isinstance(m, Result)]
    group = {"relation": "around", "targets": ["t1"], "robots": robots}
    arguments: dict[str, Any] = {"contract": {"groups": [group]}}
    if not results:
        targets = [{"id": "t1", "box": [55, 35, 125, 95]}] if number == 1 else []
        call = Call(
            id=f"p{number}", name="propose_formation", arguments=arguments | {"targets": targets}
        )
    elif len(results) == 1:
        plan = json.loads(results[0].text)["plan_id"]
        call = Call(id=f"d{number}", name="deploy", arguments={"plan_id": plan})
    else:
        return Reply(text=f"Turn {number} is done.")
    return Reply(calls=(call,))


def chat(store: Store, name: str) -> Run:
    """Two turns, each of which moves robots."""
    agent = Agent(FunctionModel(deciding))
    first = agent.run(picture(), FIRST, settings=Settings(), trace=store.create(name))
    return agent.say(first, SECOND)


def at_commit(store: Store, number: int, act: Callable[[], None]) -> None:
    """Act before the n-th transaction that writes is committed."""
    left = number

    def committing(connection: Connection) -> None:
        nonlocal left
        left -= bool(connection.get_execution_options().get("writes"))
        if left == 0:
            left = -1
            act()

    event.listen(store._engine, "commit", committing)  # type: ignore[attr-defined]


def die() -> None:
    """As if the power of this process were cut."""
    os.kill(os.getpid(), signal.SIGKILL)


def strict(request: Request) -> Reply:
    """A model that insists on pairs of calls and results, and that the person spoke last."""
    waiting: set[str] = set()
    for message in request.messages:
        if isinstance(message, Result):
            waiting.remove(message.call_id)
        else:
            assert not waiting, "a call without its result"
        if isinstance(message, Reply):
            assert message.text or message.calls
            waiting = {call.id for call in message.calls}
    assert isinstance(request.messages[0], User)
    assert isinstance(request.messages[-1], User)
    return Reply(text="You are welcome.")


def goes_on(store: Store, name: str, whole: History) -> bool:
    """Whether a chat that broke off goes on with what had been written, and moves nothing."""
    (facts,) = [f for f in store.sessions() if f.name == name]
    session = store.open(facts.id)
    try:
        events = session.events()
        left = load_run(session)
    except InputError as error:
        assert "before anything began" in str(error)
        return False
    said = left.outcome.messages
    assert [m.role for m in said] == [m.role for m in whole[: len(said)]]
    assert [e.number for e in events] == list(range(1, len(events) + 1))
    done = Agent(FunctionModel(strict)).say(left, "Thanks")
    assert done.report.status in ("answered", "planned")
    after = session.events(after=len(events))
    assert not [e for e in after if e.kind == "moving"]
    assert load_run(session).outcome == done.outcome
    return True


def writes_of(store: Store) -> tuple[int, History]:
    """How many transactions the whole chat takes, and its messages."""
    counted: list[Connection] = []

    def committing(connection: Connection) -> None:
        if connection.get_execution_options().get("writes"):
            counted.append(connection)

    event.listen(store._engine, "commit", committing)  # type: ignore[attr-defined]
    whole = chat(store, "whole")
    assert whole.report.status == "deployed"
    event.remove(store._engine, "commit", committing)  # type: ignore[attr-defined]
    return len(counted), whole.outcome.messages


@pytest.mark.parametrize(
    ("address", "every"), [("sqlite", 1), ("postgresql", 4)], indirect=["address"]
)
def test_killed_at_each_write_it_goes_on(store: Store, address: str, every: int) -> None:
    writes, whole = writes_of(store)
    assert writes > 20
    points = range(1, writes + 1, every)
    command = [sys.executable, __file__, address, *map(str, points)]
    subprocess.run(command, check=True)
    names = {facts.name for facts in store.sessions()}
    assert names == {"whole", *map(str, points)} - {"1"}  # which was killed as it was made
    went_on = [point for point in points[1:] if goes_on(store, f"{point}", whole)]
    assert went_on == [point for point in points if point >= went_on[0]]
    assert went_on[0] <= 12


@pytest.mark.parametrize("address", ["sqlite", "postgresql"], indirect=True)
def test_whatever_write_fails_nothing_moves_unwritten(store: Store, drives: list[Motion]) -> None:
    writes, whole = writes_of(store)
    driven = len(drives)
    moved = 0

    def fails() -> None:
        raise OperationalError("COMMIT", None, sqlite3.OperationalError("disk is full"))

    for point in range(1, writes + 1):
        drives.clear()
        at_commit(store, point, fails)
        try:
            done = chat(store, f"{point}")
        except StorageError as error:
            if "could not be written to its end" in str(error):  # which turn 1 has said
                moved += 1
                continue
            assert "cannot be used: disk is full." in str(error)
        else:
            moved += 1
            cut = "The log ends before this: " in done.report.message
            assert cut == (done.events is None)
            assert cut or load_run(done.stored or "").outcome == done.outcome  # a film is lost
            assert len(drives) == driven
        if point > 1:
            goes_on(store, f"{point}", whole)
    assert 0 < moved < writes / 2


if __name__ == "__main__":  # a child of it is killed at each write; it names its session by that
    for point in map(int, sys.argv[2:]):
        child = os.fork()
        if child == 0:
            mine = store_at(sys.argv[1])
            at_commit(mine, point, die)
            chat(mine, f"{point}")
            os._exit(3)  # it was to be killed
        status = os.waitpid(child, 0)[1]
        assert os.WIFSIGNALED(status), (point, status)
