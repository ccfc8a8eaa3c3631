"""Every fault on the wire ends with robots that stand, and is named."""

import asyncio
import re
import time
from collections.abc import Callable
from contextlib import aclosing
from typing import Any

import numpy as np
import pytest
from deploying import SURE, Act, Case, deployed, stand, stops
from formup.tools.fleet import getting_on
from formup.tools.fleet.protocol import (
    Fleet,
    FleetStoppedError,
    FleetUnreachableError,
    Motion,
    StalePosesError,
)
from formup.tools.fleet.wire import fleet as fleet_module

Labs = Callable[..., Any]


def fault(of: Callable[[dict[str, Any], int], dict[str, Any] | None]) -> Act:
    """Robot b says something else from now on, made of what it would say and of its number."""
    return lambda lab, fleet: lab.robots.faults.update(b=of)


def act(of: Act) -> Act:
    """What happens, with its types."""
    return of


def lagging(lab: Any, fleet: Fleet) -> None:
    """What all robots say of where they are is half a second old from now on."""
    for robot in lab.settings.robots:
        was: list[dict[str, Any]] = []

        def of(message: dict[str, Any], n: int, was: list[dict[str, Any]] = was) -> dict[str, Any]:
            was.append(message)
            return {**was[max(len(was) - 10, 0)], "seq": n}

        lab.robots.faults[robot] = of


def elsewhere(topic: str, **message: Any) -> Act:
    """Somebody else says something, again and again for half a second."""
    return lambda lab, fleet: [lab.link().say(lab.topic(topic, "a"), message)]


CASES = {
    "none": Case(act(lambda lab, fleet: None), "arrived"),
    "one glitch": Case(
        fault(lambda m, n: m | ({"x": m["x"] + 300} if n % 40 == 0 else {})), "arrived"
    ),
    "late and out of order": Case(
        fault(lambda m, n: m | ({"seq": n - 5, "x": 0} if n % 3 == 0 else {})), "arrived"
    ),
    "more said than is asked": Case(
        fault(lambda m, n: m | {"state": "done", "sent": -1e9}), "arrived"
    ),
    "a link that lags": Case(lagging, "arrived"),
    "silent": Case(fault(lambda m, n: None), "failed", "b not seen for 1.", ("b",)),
    "not a number": Case(fault(lambda m, n: m | {"y": "NaN"}), "failed", "malformed", ("b",)),
    "no number": Case(fault(lambda m, n: {"x": m["x"]}), "failed", "malformed", ("b",)),
    "carried away": Case(
        fault(lambda m, n: m | {"x": m["x"] + 300}), "failed", "in two places|jumped", ("b",)
    ),
    "two of one id": Case(
        fault(lambda m, n: m | {"x": m["x"] + 300 * (n % 2)}), "failed", "in two places", ("b",)
    ),
    "at manual": Case(
        fault(lambda m, n: m | {"fault": "switch at manual"}),
        "failed",
        "b cannot drive: 'switch at manual'",
        ("b",),
    ),
    "stopped": Case(stops, "stopped", "was stopped"),
    "stopped elsewhere": Case(elsewhere("hold", reason="button"), "stopped", "was stopped"),
    "driven elsewhere": Case(
        elsewhere("goal", drive="other", seq=1, x=50, y=50), "failed", "Another program"
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_fault_on_the_way_ends_with_robots_that_stand_and_is_named(lab: Labs, name: str) -> None:
    case, there = CASES[name], lab(**SURE).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, case.act)
    assert (arrival.ended, arrival.failed) == (case.ended, case.failed), arrival.reason
    if case.words:
        assert re.search(case.words, arrival.reason or ""), arrival.reason
    assert stand(there)
    asyncio.run(fleet.close())


def test_stand_ins_may_have_wheels_and_be_lost(lab: Labs, monkeypatch: pytest.MonkeyPatch) -> None:
    starts = [[50, 50], [50, 100], [50, 150]]
    there = lab(**SURE, simulated={"starts": starts, "drive": "differential"}).simulate()
    fleet = there.fleet()
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())
    there.end()
    monkeypatch.setattr(fleet_module, "WAIT", 1.0)
    there = lab(**SURE, simulated={"starts": starts, "lost": [{"robot": "b"}]}).simulate()
    fleet = there.fleet()
    with pytest.raises(StalePosesError, match="Robot b not seen yet") as lost:
        asyncio.run(fleet.observe())
    assert lost.value.ids == ("b",)
    asyncio.run(fleet.close())


def test_robots_that_begin_to_count_anew_are_held_and_then_believed_again(lab: Labs) -> None:
    there = lab(**SURE).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, act(lambda lab, fleet: lab.robots.reboot()))
    assert (arrival.ended, arrival.failed) == ("failed", ("a", "b", "c"))
    assert "out of order" in (arrival.reason or "")
    assert stand(there)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


def test_a_stop_holds_until_a_person_releases_it(lab: Labs) -> None:
    there = lab(**SURE).simulate()
    fleet = there.fleet()
    assert deployed(there, fleet, CASES["stopped elsewhere"].act).ended == "stopped"
    for _ in range(2):
        with pytest.raises(FleetStoppedError):
            deployed(there, fleet)
    asyncio.run(fleet.release())
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


def test_no_goal_is_sent_after_a_stop_but_to_hold(lab: Labs) -> None:
    said: list[str] = []

    def heard(topic: str, payload: bytes) -> None:
        said.append(topic)

    there = lab(**SURE).simulate()
    goal, hold = there.topic("goal", "a"), there.topic("hold")
    there.link(goal, hold, heard=heard)

    async def go() -> None:
        fleet, frames = there.fleet(), 0
        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 200, first.y)])
        with pytest.raises(FleetStoppedError):
            async for _ in fleet.drive(Motion({first.id: path})):
                frames += 1
                if frames == 5:
                    await fleet.stop()
        await fleet.close()

    asyncio.run(go())
    ends = time.monotonic() + 5
    while said.count(hold) < 2 and time.monotonic() < ends:
        time.sleep(0.01)
    assert said == [*[goal] * 5, hold, hold]  # of the stop, and of the end of the drive


def test_a_robot_that_says_it_is_done_and_is_not_there_has_not_arrived(
    lab: Labs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(getting_on, "STALLED_S", 1.0)
    stuck = {"stuck": [{"robot": "b"}]}
    there = lab(**SURE, simulated={"starts": [[50, 50], [50, 100], [50, 150]], **stuck}).simulate()
    fault(lambda m, n: m | {"state": "done"})(there, fleet := there.fleet())
    arrival = deployed(there, fleet)
    assert (arrival.ended, arrival.failed) == ("failed", ("b",))
    assert "Robot b does not get on" in (arrival.reason or "")
    asyncio.run(fleet.close())


def test_a_broker_that_dies_ends_it_and_all_is_observed_anew_when_it_is_back(
    lab: Labs, brokers: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 1.0)
    broker = brokers()
    there = lab(broker, **SURE).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, act(lambda lab, fleet: broker.kill()))
    assert arrival.ended == "failed"
    assert "out of reach" in (arrival.reason or "")
    until = time.monotonic() + 5
    while not there.was_told("no goal came for 1 s") and time.monotonic() < until:
        time.sleep(0.05)
    assert there.was_told("no goal came for 1 s: held")
    with pytest.raises(FleetUnreachableError):
        asyncio.run(fleet.observe())
    assert stand(there)
    held = there.robots.points.copy()
    broker.start()
    monkeypatch.setattr(fleet_module, "WAIT", 10.0)
    poses = asyncio.run(fleet.observe(max_age=1.0))
    assert stand(there), "nothing moves because of what was said before"
    assert np.allclose([(p.x, p.y) for p in poses], held, atol=0.5)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


def test_robots_hold_while_whoever_drives_hangs(lab: Labs) -> None:
    there = lab(**SURE).simulate()
    fleet = there.fleet()

    async def go() -> None:
        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 150, first.y)])
        async with aclosing(fleet.drive(Motion({first.id: path}))) as moving:
            await anext(moving)
            time.sleep(1.6)  # nobody asks for poses, and the loop stands still
            held = there.robots.points.copy()
            assert there.was_told("no goal came for 1 s: held")
            assert held[0, 0] < path[1, 0] - 5
            async for _ in moving:
                pass
        await fleet.close()

    asyncio.run(go())
    assert abs(there.robots.points[0, 0] - 200) < 2


def test_nothing_is_driven_while_a_robot_does_not_hold(lab: Labs) -> None:
    there = lab(**SURE).simulate()
    fleet = there.fleet()
    arrival = deployed(
        there, fleet, act(lambda lab, fleet: (lab.robots.runaway.add("b"), stops(lab, fleet)))
    )
    assert arrival.ended == "stopped"
    asyncio.run(fleet.release())
    arrival = deployed(there, fleet)
    assert (arrival.ended, arrival.failed) == ("failed", ("b",))
    assert "Robot b moves, though it is not driven" in (arrival.reason or "")
    asyncio.run(fleet.close())


def test_what_was_kept_by_the_broker_is_no_news(lab: Labs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 0.5)
    there = lab()
    for robot in there.settings.robots:
        for seq in (1, 2):
            kept = f'{{"seq": {seq}, "x": 9, "y": 9}}'
            pytest.importorskip("paho.mqtt.publish").single(
                there.topic("pose", robot), kept, retain=True, port=there.settings.address[1]
            )
    fleet = there.fleet()
    with pytest.raises(StalePosesError, match="a not seen yet"):
        asyncio.run(fleet.observe())
    asyncio.run(fleet.close())
