"""Every fault of a vehicle or its wire ends with vehicles that stand, and is named."""

import asyncio
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from deploying import Act, deployed, stand
from formup.tools.fleet import getting_on
from formup.tools.fleet.protocol import Fleet, FleetUnreachableError
from formup.tools.fleet.vda5050.messages import Writer
from formup.tools.fleet.wire import fleet as fleet_module

Halls = Callable[..., Any]
Json = dict[str, Any]


def said(of: Callable[[str, Json], Json | None]) -> Act:
    """Vehicle b says something else from now on, made of the kind and what it would say."""
    return lambda hall, fleet: hall.robots.faults.update(b=of)


def moved(message: Json, by: float) -> Json:
    """The same message from elsewhere."""
    for key in ("agvPosition", "mobileRobotPosition"):
        if key in message:
            return message | {key: message[key] | {"x": message[key]["x"] + by}}
    return message


def became(**what: Any) -> Act:
    """Something has happened at vehicle b."""
    return lambda hall, fleet: [
        setattr(hall.robots.vehicles["b"], name, value) for name, value in what.items()
    ]


def switched(hall: Any, fleet: Fleet) -> None:
    """A person took b over, and gave it back before it had said so."""
    vehicle = hall.robots.vehicles["b"]
    vehicle.cancelled, vehicle.base = True, []


def breaks(hall: Any, fleet: Fleet) -> None:
    hall.robots._connection("b", hall.settings.dialect.broken)


def deaf(times: int) -> Act:
    """Vehicle b does not hear of each order as often as that."""

    def act(hall: Any, fleet: Fleet) -> None:
        vehicle, heard = hall.robots.vehicles["b"], dict[int, int]()
        take = vehicle.take

        def now(message: Json) -> None:
            number = message["orderUpdateId"]
            heard[number] = heard.get(number, 0) + 1
            if heard[number] > times:
                take(message)

        vehicle.take = now

    return act


def twice(hall: Any, fleet: Fleet) -> None:
    """Vehicle b says everything twice."""

    def of(kind: str, message: Json) -> Json:
        hall.robots._links["b"].say(hall.settings.topic("b", kind), message)
        return message

    hall.robots.faults["b"] = of


def stops(hall: Any, fleet: Fleet) -> None:
    asyncio.get_running_loop().create_task(fleet.stop())


def driven_elsewhere(hall: Any, fleet: Fleet) -> None:
    position = {"x": 1, "y": 1, "mapId": "hall"}
    node: Json = {"nodeId": "n", "sequenceId": 0, "released": True, "actions": []}
    body: Json = {"orderId": "o", "orderUpdateId": 0, "edges": []}
    body["nodes"] = [node | {"nodePosition": position}]
    message = Writer(hall.settings).message("a", "order", body)
    hall.link().say(hall.settings.topic("a", "order"), message)


def error(kind: str, level: str) -> Act:
    return became(errors=[{"errorType": kind, "errorLevel": level, "errorDescription": "dust"}])


@dataclass(frozen=True)
class Case:
    """What happens on the way, how it ends, what is told of it, and in which versions."""

    act: Act
    ended: str
    words: str = ""
    failed: tuple[str, ...] = ()
    versions: tuple[str, ...] = ("2.1",)


BOTH = "2.1", "3.0"
B = ("b",)
CHARGING = {"batteryState": {"batteryCharge": 1, "charging": True}}
CASES = {
    "none": Case(lambda hall, fleet: None, "arrived", versions=BOTH),
    "late": Case(
        said(
            lambda k, m: moved(m | {"headerId": m["headerId"] - 5}, -90) if m["headerId"] % 3 else m
        ),
        "arrived",
    ),
    "said twice": Case(twice, "arrived"),
    "another clock": Case(
        said(lambda k, m: m | {"timestamp": "1991-03-11T11:40:03.12Z"}), "arrived"
    ),
    "no order heard at once": Case(deaf(1), "arrived", versions=BOTH),
    "no harm": Case(error("maintenance", "WARNING"), "arrived"),
    "no harm yet": Case(error("batteryLow", "URGENT"), "arrived", versions=("3.0",)),
    "silent": Case(said(lambda k, m: None), "failed", "b not seen for 1.", B),
    "another's serial": Case(
        said(lambda k, m: m | {"serialNumber": "z"}), "failed", "malformed", B
    ),
    "no number": Case(said(lambda k, m: m | {"agvPosition": {"x": "?"}}), "failed", "malformed", B),
    "carried away": Case(said(lambda k, m: moved(m, 300)), "failed", "in two places|jumped", B),
    "manual": Case(became(mode="MANUAL"), "failed", "operating mode MANUAL", B, BOTH),
    "taken over": Case(switched, "failed", "its order .* is gone", B, BOTH),
    "lost": Case(became(localised=False), "failed", "not localised", B, BOTH),
    "emergency stop": Case(became(emergency="MANUAL"), "failed", "emergency stop", B, BOTH),
    "field violated": Case(became(violated=True), "failed", "fieldViolation", B),
    "paused": Case(became(paused=True), "failed", "'paused'", B),
    "charging": Case(
        said(
            lambda k, m: (
                m if k != "state" else m | {"batteryState": {"batteryCharge": 1, "charging": True}}
            )
        ),
        "failed",
        "'charging'",
        B,
    ),
    "fatal": Case(error("laser", "FATAL"), "failed", r"laser \(FATAL\): dust", B, BOTH),
    "critical": Case(error("laser", "CRITICAL"), "failed", r"laser \(CRITICAL\)", B, ("3.0",)),
    "unreachable": Case(
        error("NODE_UNREACHABLE", "CRITICAL"), "failed", "NODE_UNREACHABLE", B, ("3.0",)
    ),
    "refused": Case(became(end=("n", 99)), "failed", "refused order .*orderUpdateError", B),
    "refused in 3.0": Case(
        became(end=("n", 99)), "failed", "refused order .*INVALID_ORDER", B, ("3.0",)
    ),
    "deaf": Case(deaf(99), "failed", "has not taken order", B),
    "link broken": Case(breaks, "failed", "connection CONNECTION_?BROKEN", B, BOTH),
    "stopped": Case(stops, "stopped", "was stopped", versions=BOTH),
    "driven elsewhere": Case(driven_elsewhere, "failed", "Another program"),
}
RUNS = [(name, version) for name, case in CASES.items() for version in case.versions]


@pytest.mark.parametrize(("name", "version"), RUNS)
def test_a_fault_ends_with_vehicles_that_stand_and_is_named(
    hall: Halls, name: str, version: str
) -> None:
    case, there = CASES[name], hall(version=version).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, case.act)
    assert (arrival.ended, arrival.failed) == (case.ended, case.failed), arrival.reason
    if case.words:
        assert re.search(case.words, arrival.reason or ""), arrival.reason
    assert stand(there)
    asyncio.run(fleet.close())


def test_a_vehicle_that_says_it_is_done_and_is_not_there_has_not_arrived(
    hall: Halls, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(getting_on, "STALLED_S", 1.0)
    starts = [[50, 50], [50, 100], [50, 150]]
    there = hall(simulated={"starts": starts, "stuck": [{"robot": "b"}]}).simulate()
    vehicle, fleet = there.robots.vehicles["b"], there.fleet()

    def near(node: Json) -> bool:
        return True

    vehicle._near = near
    arrival = deployed(there, fleet)
    assert (arrival.ended, arrival.failed) == ("failed", ("b",))
    assert "Robot b does not get on" in (arrival.reason or "")
    assert vehicle.last[1] >= 2 and not vehicle.base, "it said that it is done"
    asyncio.run(fleet.close())


def test_a_vehicle_that_counts_anew_is_held_and_then_believed_again(hall: Halls) -> None:
    there = hall().simulate()
    fleet, counts = there.fleet(), there.robots._writer._counts
    counts.update({(robot, kind): 1_000 for robot in "abc" for kind in ("state", "visualization")})
    arrival = deployed(there, fleet, lambda hall, fleet: counts.clear())
    assert arrival.ended == "failed"
    assert "out of order" in (arrival.reason or "")
    assert stand(there)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


def test_what_a_vehicle_complained_of_before_keeps_nobody_from_driving_anew(hall: Halls) -> None:
    there = hall().simulate()
    fleet = there.fleet()
    assert "orderUpdateError" in (deployed(there, fleet, became(end=("n", 99))).reason or "")
    vehicle = there.robots.vehicles["b"]
    assert [e["errorType"] for e in vehicle.errors] == ["orderUpdateError"]
    assert deployed(there, fleet).arrived
    assert not vehicle.errors
    asyncio.run(fleet.close())


def test_a_broker_that_dies_ends_it_and_no_move_is_repeated_when_it_is_back(
    hall: Halls, brokers: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 1.0)
    broker = brokers()
    there = hall(broker).simulate()
    fleet = there.fleet()
    before = list[Any]()

    def dies(hall: Any, fleet: Fleet) -> None:
        broker.kill()
        before.append(hall.robots.points.copy())

    arrival = deployed(there, fleet, dies)
    assert arrival.ended == "failed"
    assert "vehicles drive on to the last node" in (arrival.reason or "").lower()
    time.sleep(1.0)
    assert stand(there)
    held = there.robots.points.copy()
    ahead = there.settings.speed * fleet_module.AHEAD
    assert np.linalg.norm(held - before[0], axis=1).max() <= ahead + 25, "with 0.1 s until seen"
    with pytest.raises(FleetUnreachableError):
        asyncio.run(fleet.observe())
    broker.start()
    monkeypatch.setattr(fleet_module, "WAIT", 10.0)
    poses = asyncio.run(fleet.observe(max_age=1.0))
    assert stand(there), "nothing moves because of what was said before"
    assert np.allclose([(p.x, p.y) for p in poses], held, atol=0.5)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())
