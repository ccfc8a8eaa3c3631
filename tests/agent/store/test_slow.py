"""A store that is slow: it holds up the turn that writes, no other one and no stop."""

import asyncio
import json
import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply, Result, turn_of
from formup.agent.model import Request
from formup.agent.service import Service
from formup.agent.session import load_run
from formup.agent.store.database import DatabaseLog
from formup.agent.store.folder import FolderLog
from formup.agent.store.protocol import Store
from formup.agent.wrappers.doubles import FunctionModel
from formup.tools.context import Settings
from formup.tools.perception.image import Picture, picture_from_array

PATIENCE = 60
"""Seconds until a test gives up."""
STORES = pytest.mark.parametrize("address", ["folder", "sqlite", "postgresql"], indirect=True)


class Slow:
    """Holds up one write, the n-th from when `left` is set to n, until `go_on` is set."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.left, self.kind = 0, ""
        self.begun, self.go_on = threading.Event(), threading.Event()
        for log in (DatabaseLog, FolderLog):
            monkeypatch.setattr(log, "append", self._slowed(log.append))

    async def reached(self) -> None:
        """Until the write is under way."""
        assert await asyncio.to_thread(self.begun.wait, PATIENCE)

    def _slowed(self, append: Any) -> Any:
        def slowed(log: Any, kind: Any, data: Mapping[str, Any]) -> int:
            self.left -= 1
            if self.left == 0:
                self.kind = kind
                self.begun.set()
                assert self.go_on.wait(PATIENCE)
            return append(log, kind, data)

        return slowed


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Slow:
    return Slow(monkeypatch)


@pytest.fixture
def picture() -> Picture:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return picture_from_array(pixels)


def deciding(request: Request) -> Reply:
    """Proposes and deploys, then says so."""
    results = [m for m in turn_of(request.messages) if isinstance(m, Result)]
    if not results:
        group = {"relation": "around", "targets": ["t1"], "robots": 6}
        arguments: dict[str, Any] = {"contract": {"groups": [group]}}
        arguments["targets"] = [{"id": "t1", "box": [55, 35, 125, 95]}]
        return Reply(calls=(Call(id="p", name="propose_formation", arguments=arguments),))
    if len(results) == 1:
        plan = json.loads(results[0].text)["plan_id"]
        return Reply(calls=(Call(id="d", name="deploy", arguments={"plan_id": plan}),))
    return Reply(text="They are there.")


def service(store: Store) -> Service:
    return Service(Agent(FunctionModel(deciding)), store, auto=True)


@STORES
def test_another_conversation_goes_on(store: Store, picture: Picture, slow: Slow) -> None:
    async def scenario() -> None:
        talks = service(store)
        one, other = talks.open(picture), talks.open(picture)
        slow.left = 3
        waits = talks.say(one, "Surround it").task
        await slow.reached()
        run = await talks.say(other, "Surround it")
        assert run.report.status == "deployed"
        assert not waits.done()
        slow.go_on.set()
        assert (await waits).report.status == "deployed"
        for session in (one, other):
            held = talks.session(session).run
            assert held is not None
            assert load_run(store.open(session)).outcome == held.outcome
        await talks.close()

    asyncio.run(scenario())


@STORES
def test_a_stop_holds_the_robots_at_once(store: Store, picture: Picture, slow: Slow) -> None:
    async def scenario() -> None:
        talks = service(store)
        session = talks.open(picture)
        first = await talks.say(session, "Surround it")
        (fleet,) = first.context.services.fleets.values()
        slow.left = 2
        turn = talks.say(session, "Again").task
        await slow.reached()
        stop = asyncio.create_task(talks.stop(session))
        while not fleet.stopped:
            await asyncio.sleep(0)
        assert not slow.go_on.is_set() and not turn.done()
        slow.go_on.set()
        stopped = await stop
        assert stopped is not None and stopped.report.status == "stopped"
        await talks.close()

    asyncio.run(scenario())


async def stopped_at(number: int, store: Store, picture: Picture, slow: Slow) -> bool:
    """Stop a first turn twice while it makes its n-th write; whether it made so many."""
    talks, (begun, go_on) = service(store), (slow.begun, slow.go_on)
    begun.clear()
    go_on.clear()
    session = talks.open(picture, settings=Settings())
    slow.left = number
    turn = talks.say(session, "Surround it").task
    reached = asyncio.create_task(slow.reached())
    await asyncio.wait([turn, reached], return_when=asyncio.FIRST_COMPLETED)
    if turn.done():
        begun.set()
        await reached
        return False
    stops = [asyncio.create_task(talks.stop(session)) for _ in range(2)]
    for _ in range(10):
        await asyncio.sleep(0)
    go_on.set()
    ended = await turn
    assert [await stop for stop in stops] == [ended, ended]
    held, stored = talks.session(session), store.open(session)
    kinds = [event.kind for event in stored.events()]
    assert held.run is ended and ended.events == len(kinds) and kinds[-1] == "end"
    assert load_run(stored).outcome == ended.outcome
    over = ended.report.status == "deployed"
    assert not (over and slow.kind in ("session", "turn", "moving"))
    if not over:
        assert ended.report.status == "stopped"
        assert not ended.world.arrivals and all(p.seen == 0 for p in ended.world.robots)
    again = await talks.say(session, "Go on")
    assert again.report.status == "deployed"
    assert load_run(stored).outcome == again.outcome
    await talks.close()
    return True


@pytest.mark.parametrize("address", ["folder", "sqlite"], indirect=True)
def test_a_stop_during_any_write(
    address: str, opened: Callable[[str], Store], picture: Picture, slow: Slow
) -> None:
    number = 1
    while asyncio.run(stopped_at(number, opened(address), picture, slow)):
        number += 1
    assert number > 10
