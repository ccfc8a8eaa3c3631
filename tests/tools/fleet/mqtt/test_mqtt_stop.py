"""Robots on MQTT are held from a program other than the one that drives them."""

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import aclosing
from typing import Any

import numpy as np
import pytest
from deploying import SURE, deployed, wait_for
from formup.tools.fleet.protocol import FleetStoppedError, FleetUnreachableError, Motion
from formup.tools.fleet.wire import fleet as fleet_module
from formup.tools.fleet.wire import stopping
from formup.tools.fleet.wire.stopping import stopped
from outside import SLOW, check_stop_at_a_second_terminal, check_stop_while_the_driver_hangs

Labs = Callable[..., Any]


def test_a_stop_at_a_second_terminal_ends_a_deployment_until_a_person_says_go(lab: Labs) -> None:
    there = lab(**SLOW).simulate()
    fleet = there.fleet()
    check_stop_at_a_second_terminal(there, fleet)
    with pytest.raises(FleetStoppedError):
        deployed(there, fleet)
    asyncio.run(fleet.close())


def test_robots_are_held_while_the_program_that_drives_them_hangs(lab: Labs) -> None:
    check_stop_while_the_driver_hangs(lab(watchdog=10).simulate())


def test_a_program_that_hung_listens_before_it_sends_a_goal(lab: Labs) -> None:
    said = list[str]()

    def heard(topic: str, payload: bytes) -> None:
        said.append(topic)

    there = lab(**SURE).simulate()
    goal = there.topic("goal", "a")
    there.link(goal, heard=heard)

    async def go() -> None:
        fleet = there.fleet()

        async def stops_soon() -> None:
            await asyncio.sleep(0.1)
            await fleet.stop()

        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 200, first.y)])
        async with aclosing(fleet.drive(Motion({first.id: path}))) as moving:
            await anext(moving)
            time.sleep(0.4)
            stopping = asyncio.create_task(stops_soon())
            with pytest.raises(FleetStoppedError):
                await anext(moving)
            await stopping
        await fleet.close()

    asyncio.run(go())
    wait_for(lambda: there.was_told("told to hold"))
    assert said == [goal]


def test_a_program_that_was_frozen_until_its_connection_broke_says_so(
    lab: Labs, brokers: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "STOOD_STILL", 0.5)
    broker = brokers()
    there = lab(broker, **SURE).simulate()

    async def go() -> None:
        fleet = there.fleet()
        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 200, first.y)])
        async with aclosing(fleet.drive(Motion({first.id: path}))) as moving:
            await anext(moving)
            broker.kill()
            time.sleep(1)
            wait_for(lambda: not fleet.link.connected)
            words = "is out of reach: the connection was lost while this program stood still"
            with pytest.raises(FleetUnreachableError, match=words):
                await anext(moving)
        await fleet.close()

    asyncio.run(go())


def silent(message: dict[str, Any], n: int) -> None:
    """Nothing is said."""


def test_who_moves_on_and_who_is_not_seen_is_told(
    lab: Labs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopping, "LIMIT", 2.0)
    there = lab().simulate()
    there.robots.runaway.add("a")
    there.robots.faults.update(b=silent)
    told, stand = asyncio.run(stopped(there.fleet()))
    assert not stand
    assert told[0] == "Robot a still moves: hold it by hand."
    assert told[1].startswith("Robot b not seen yet. Whether it stands cannot be told from here")
    assert told[2].startswith("3 robots were told to hold; 1 of them are seen to stand.")


def test_all_robots_are_named_that_are_not_seen(lab: Labs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stopping, "LIMIT", 1.0)
    names = [f"r{i}" for i in range(1, 9)]
    starts = [[50, 50 * i] for i in range(1, 9)]
    there = lab(robots=names, simulated={"starts": starts}).simulate()
    there.robots.faults.update(dict.fromkeys(names, silent))
    told, stand = asyncio.run(stopped(there.fleet()))
    assert not stand
    assert told[0].startswith("Robot r1 not seen yet. Robot r2 not seen yet.")
    assert "Robot r5 not seen yet. Likewise robot r6, r7, r8. Whether they stand" in told[0]


def test_a_broker_that_is_out_of_reach_is_one_sentence(
    lab: Labs, brokers: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopping, "WAIT", 0.5)
    broker = brokers()
    there = lab(broker)

    def dies() -> None:
        time.sleep(1)
        broker.kill()

    dying = threading.Thread(target=dies)
    dying.start()
    (told,), stand = asyncio.run(stopped(there.fleet()))
    assert (stand, "is out of reach" in told) == (False, True)
    assert told.endswith("robots were told to hold before: look at them.")
    dying.join()
    (told,), stand = asyncio.run(stopped(there.fleet()))
    assert not stand
    where = f"The broker 127.0.0.1:{broker.port} is out of reach: Connection refused"
    assert told == f"{where}; nobody was told to hold: use the robots' own stop."
