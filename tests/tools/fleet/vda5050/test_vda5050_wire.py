"""What goes over the wire: valid to the letter, a little at a time, and never after a stop."""

import asyncio
import time
from collections import defaultdict
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from formup.tools.fleet.mqtt.link import Link
from formup.tools.fleet.protocol import FleetStoppedError, Motion, StalePosesError
from formup.tools.fleet.vda5050.checkup import checked
from formup.tools.fleet.vda5050.messages import Writer, mistake
from formup.tools.fleet.wire import fleet as fleet_module
from outside import driven

Halls = Callable[..., Any]
Json = dict[str, Any]
Fault = Callable[[str, Json], Json | None]


def until(what: Callable[[], object], seconds: float = 10.0) -> None:
    ends = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < ends
        time.sleep(0.01)


def drive(there: Any, path: list[tuple[float, float]], stop_after: int | None = None) -> None:
    """Vehicle a along a path from where it is."""

    async def go() -> None:
        fleet, frames = there.fleet(), 0
        first, *_ = await fleet.observe()
        places = np.array([(first.x, first.y), *path])
        async for _ in fleet.drive(Motion({first.id: places})):
            frames += 1
            if frames == stop_after:
                await fleet.stop()

    asyncio.run(go())


@pytest.mark.parametrize("version", ["2.1", "3.0"])
def test_all_that_is_said_is_valid_and_orders_go_on_bit_by_bit(hall: Halls, version: Any) -> None:
    there = hall(version=version)
    said = there.overhear()
    there.simulate()
    drive(there, [(250, 50), (250, 150)])
    assert np.allclose(there.robots.points[0], (250, 150), atol=1)
    kinds: dict[str, list[Json]] = defaultdict(list)
    for topic, message in there.all_of(said):
        interface, level, maker, serial, kind = topic.split("/")
        assert (interface, level, maker) == (there.settings.interface, f"v{version[0]}", "KIT")
        assert not mistake(version, kind, message), (kind, message)
        kinds[f"{serial} {kind}"].append(message)
    assert {"a order", "a state", "a visualization", "a connection"} <= set(kinds)
    assert "b order" not in kinds
    orders = kinds["a order"]
    assert len({order["orderId"] for order in orders}) == 1
    assert [order["orderUpdateId"] for order in orders] == [*range(len(orders))]
    for before, after in pairwise(orders):
        assert before["nodes"][-1] == after["nodes"][0]
    for order in orders:
        numbers = [node["sequenceId"] for node in order["nodes"]]
        number = 2 * order["orderUpdateId"]
        assert (numbers, order["edges"][0]["sequenceId"]) == ([number, number + 2], number + 1)
    points = np.array([[o["nodes"][1]["nodePosition"][k] for k in "xy"] for o in orders])
    ways = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert ways.max() <= there.settings.speed * fleet_module.AHEAD + 1e-6
    corner = np.linalg.norm(points - (250, 50), axis=1).min()
    assert corner <= there.settings.tracking_error, "it turns where it was to turn"


def test_after_a_stop_nothing_is_sent_but_what_ends_the_order(hall: Halls) -> None:
    there = hall()
    said = there.overhear()
    there.simulate()
    with pytest.raises(FleetStoppedError):
        drive(there, [(500, 50)], stop_after=8)
    vehicle = there.robots.vehicles["a"]
    until(lambda: vehicle.cancelled and not vehicle.paused)
    sent = [
        (t.split("/")[3:], m)
        for t, m in there.all_of(said)
        if t.endswith(("order", "instantActions"))
    ]
    told = [
        [action["actionType"] for action in message["actions"]] or kind
        for (robot, kind), message in sent
        if robot == "a" and "actions" in message
    ]
    assert [names for names in told if names != ["stateRequest"]] == [
        ["startPause", "cancelOrder"],
        ["stopPause"],
    ]
    kinds = [kind for (robot, kind), _ in sent if robot == "a"]
    assert "order" not in kinds[kinds.index("instantActions", kinds.index("order")) :]
    held = there.robots.points.copy()
    time.sleep(0.3)
    assert abs(there.robots.points - held).max() < 0.5


def test_what_was_told_at_once_is_told_again_until_it_was_heard(hall: Halls) -> None:
    there = hall().simulate()
    vehicle, heard = there.robots.vehicles["a"], list[str]()
    act = vehicle.act

    def second_time(action: Json) -> None:
        heard.append(action["actionId"])
        if heard.count(action["actionId"]) > 1:
            act(action)

    vehicle.act = second_time
    with pytest.raises(FleetStoppedError):
        drive(there, [(800, 50)], stop_after=8)
    until(lambda: any(action["actionType"] == "stopPause" for action in vehicle.actions))
    done = {action["actionId"] for action in vehicle.actions}
    assert len(done) == 3 and all(heard.count(name) == 2 for name in done)


def test_a_pause_that_is_left_is_lifted_when_a_person_says_go_and_what_was_left_is_not_driven(
    hall: Halls,
) -> None:
    there = hall().simulate()
    vehicle, act = there.robots.vehicles["a"], there.robots.vehicles["a"].act

    def pausing_only(action: Json) -> None:
        if action["actionType"] == "startPause":
            act(action)

    vehicle.act = pausing_only
    with pytest.raises(FleetStoppedError):
        drive(there, [(800, 50)], stop_after=8)
    assert vehicle.paused and vehicle.base
    held = there.robots.points.copy()
    time.sleep(4.5)  # longer than it has to answer
    assert vehicle.paused, "an order may be left"
    vehicle.act = act

    async def go() -> None:
        fleet = there.fleet()
        await fleet.observe()
        await fleet.release()
        await fleet.close()

    asyncio.run(go())
    until(lambda: not vehicle.paused)
    assert vehicle.cancelled
    assert abs(there.robots.points - held).max() < 0.5


def test_vehicles_end_at_the_last_node_when_the_process_that_drives_them_is_killed(
    hall: Halls,
) -> None:
    there = hall().simulate()
    with driven(there.path) as driver:
        until(lambda: float(driver.stdout.readline()) > 100)  # pyright: ignore[reportOptionalMemberAccess]
        driver.kill()
        at = there.robots.points.copy()
    until(lambda: there.was_told("standing"))
    until(lambda: not any(vehicle.base for vehicle in there.robots.vehicles.values()))
    ahead = there.settings.speed * fleet_module.AHEAD
    assert (there.robots.points - at).max() <= ahead + 1
    held = there.robots.points.copy()
    time.sleep(0.5)
    assert abs(there.robots.points - held).max() < 0.5


@pytest.mark.parametrize("kind", ["state", "connection"])
def test_what_was_kept_by_the_broker_is_no_news(
    hall: Halls, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 0.5)
    there = hall()
    writer, link = Writer(there.settings), there.link()
    said = {"connectionState": "ONLINE"}
    if kind == "state":
        there.simulate()
        said = there.robots.vehicles["a"].state() | there.robots.vehicles["a"].position()
        there.end()
    for robot in there.settings.robots:
        link = there.link()
        message = writer.message(robot, kind, said)
        link.say(there.settings.topic(robot, kind), message, kept=True)
    fleet = there.fleet()
    with pytest.raises(StalePosesError, match="a not seen yet"):
        asyncio.run(fleet.observe())
    asyncio.run(fleet.close())


def test_a_vehicle_whose_state_is_not_known_is_asked_and_not_seen_before(
    hall: Halls, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 1.5)
    there = hall().simulate()
    said = there.overhear()
    faults: dict[str, Fault] = there.robots.faults
    faults["b"] = lambda kind, message: message if kind == "visualization" else None
    fleet = there.fleet()
    with pytest.raises(StalePosesError, match="Robot b not seen yet") as lost:
        asyncio.run(fleet.observe())
    assert lost.value.ids == ("b",)
    asked = [
        m["actions"][0]["actionType"]
        for t, m in there.all_of(said)
        if t.endswith("b/instantActions")
    ]
    assert asked and set(asked) == {"stateRequest"}
    asyncio.run(fleet.close())


def test_what_comes_while_a_fleet_is_still_being_opened_is_taken_in(
    hall: Halls, monkeypatch: pytest.MonkeyPatch
) -> None:
    there, starts = hall().simulate(), Link.start

    def slowly(link: Link) -> Link:
        starts(link)
        time.sleep(0.5)
        return link

    monkeypatch.setattr(Link, "start", slowly)
    fleet = there.fleet()
    assert len(asyncio.run(fleet.observe())) == 3
    asyncio.run(fleet.close())


def test_a_look_says_who_is_there_and_what_is_wrong(hall: Halls) -> None:
    there = hall(robots=["a", "b", "c", "d"], simulated={}).simulate()
    vehicles = there.robots.vehicles
    faults: dict[str, Fault] = there.robots.faults
    faults["b"] = lambda kind, message: None
    vehicles["c"].mode = "MANUAL"
    vehicles["d"].localised = False
    vehicles["a"].complain("maintenance")
    vehicles["a"].complain(there.settings.dialect.idle)
    before = there.robots.points.copy()
    told, fit = checked(there.settings, 1.5)
    said = "\n".join(told)
    assert not fit
    assert "is reachable, in the clear" in said
    assert "Robot a was seen 0." in said
    assert "Robot b not seen yet." in said
    assert "Robot c cannot drive: 'operating mode MANUAL'" in said
    assert "Robot d not seen yet; it cannot drive: 'not localised" in said
    assert "Robot a says: maintenance (WARNING)." in said
    assert "Robot a says: noOrderToCancel" not in said
    assert "last node released to them, at most 0.5 s away, and stand" in said
    assert said.endswith("1 of 4 robots can be driven.")
    faults.clear()
    for vehicle in vehicles.values():
        vehicle.mode, vehicle.localised = "AUTOMATIC", True
    assert checked(there.settings, 1.5)[1]
    assert not (there.robots.points - before).any()


def test_a_look_says_which_other_version_vehicles_speak(hall: Halls) -> None:
    there = hall().simulate()
    file = there.settings.model_copy(update={"version": "3.0"})
    told, fit = checked(file, 1.5)
    assert not fit
    assert "Robot a not seen yet; its last message was in VDA 5050 2.1.0, where the f" in told[1]
    faults: dict[str, Fault] = there.robots.faults
    faults["b"] = lambda kind, message: message | {"version": "3.0.0"}
    told, fit = checked(there.settings, 1.5)
    assert not fit
    assert "in VDA 5050 3.0.0, where the file says 2.1" in told[2]
    assert "refused" not in told[1]


def test_a_look_says_who_else_speaks(hall: Halls) -> None:
    there = hall().simulate()
    stranger = hall(robots=["z"], simulated={}).simulate()
    position = {"x": 1, "y": 1, "mapId": "hall"}
    node: Json = {"nodeId": "n", "sequenceId": 0, "released": True, "actions": []}
    nodes = [node | {"nodePosition": position}]
    body: Json = {"orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": []}

    def beside(kind: str, message: Json) -> Json:
        order = Writer(there.settings).message("b", "order", body)
        link.say(there.settings.topic("b", "order"), order)
        return message

    link = there.link()
    there.robots.faults["a"] = beside
    told, fit = checked(there.settings, 1.0)
    stranger.end()
    assert not fit
    assert "not in the file speak too: KIT/z." in "\n".join(told)
    assert "Another program is sending goals to robot b." in "\n".join(told)


def test_vehicles_say_that_they_come_and_go(hall: Halls) -> None:
    there = hall(robots=["a"], simulated={})
    said = there.overhear()
    there.simulate()
    until(lambda: any(t.endswith("connection") for t, _ in said))
    client = there.robots.link._client
    client.socket().close()

    def states() -> list[str]:
        return [m["connectionState"] for t, m in [*said] if t.endswith("connection")]

    until(lambda: states() == ["ONLINE", "CONNECTIONBROKEN", "ONLINE"])
    there.robots.close()
    until(lambda: states()[-1] == "OFFLINE")
