"""The stand-in takes and refuses orders as the standard has it."""

from typing import Any

import pytest
from formup.tools.fleet.vda5050.messages import Writer, action, mistake
from formup.tools.fleet.vda5050.settings import Vda5050Settings
from formup.tools.fleet.vda5050.spec import DIALECTS, Version
from formup.tools.fleet.vda5050.vehicle import Vehicle

Json = dict[str, Any]


@pytest.fixture(params=DIALECTS)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    settings = {
        "version": request.param,
        "broker": "mqtt://h",
        "interface": "uagv",
        "manufacturer": "KIT",
        "map": "hall",
        "robots": ["a"],
        "speed": 1,
        "radius": 1,
        "tracking_error": 0.1,
    }
    return Vehicle(Vda5050Settings.model_validate(settings))


def order(vehicle: Vehicle, number: int, *xs: float, first: int = 0, **more: Any) -> Json:
    """An order along the x axis, which is valid."""
    dialect = vehicle.settings.dialect
    nodes: list[Json] = [
        {
            "nodeId": f"n{first + 2 * i}",
            "sequenceId": first + 2 * i,
            "released": True,
            "nodePosition": {
                "x": x,
                "y": 0.0,
                "mapId": "hall",
                "allowedDeviationXY": dialect.deviation(0.1),
            },
            "actions": [],
        }
        for i, x in enumerate(xs)
    ]
    edges: list[Json] = [
        {"edgeId": f"e{i}", "sequenceId": first + 2 * i + 1, "released": True, "actions": []}
        | dialect.ends(f"n{first + 2 * i}", f"n{first + 2 * i + 2}")
        for i in range(len(xs) - 1)
    ]
    body: Json = {"orderId": "o", "orderUpdateId": number, "nodes": nodes, "edges": edges}
    return Writer(vehicle.settings).message("a", "order", body | more)


def complaints(vehicle: Vehicle) -> list[str]:
    return [error["errorType"] for error in vehicle.errors]


def test_it_drives_to_what_was_released_and_no_further(vehicle: Vehicle) -> None:
    whole = order(vehicle, 0, 0, 1, 2)
    whole["nodes"][2]["released"] = whole["edges"][1]["released"] = False
    vehicle.take(whole)
    assert vehicle.go_on((0, 0), False) == (1, 0)
    assert vehicle.state()["nodeStates"] == [{"nodeId": "n2", "sequenceId": 2, "released": True}]
    assert vehicle.go_on((1, 0.05), False) is None
    assert (vehicle.last, vehicle.state()["nodeStates"]) == (("n2", 2), [])
    vehicle.take(order(vehicle, 1, 1, 2, 3, first=2))
    assert vehicle.go_on((1, 0), False) == (2, 0)
    assert vehicle.go_on((1.95, 0), True) == (3, 0), "it does not stop on the way"
    assert not vehicle.errors


def test_it_says_what_is_valid(vehicle: Vehicle) -> None:
    version: Version = vehicle.settings.version
    vehicle.take(order(vehicle, 0, 0, 1, 2))
    vehicle.act(action("cancelOrder", "1"))
    vehicle.complain("x")
    state = Writer(vehicle.settings).message("a", "state", vehicle.state() | vehicle.position())
    assert mistake(version, "state", state) is None


def test_it_refuses_what_is_not_due_and_goes_on_as_it_did(vehicle: Vehicle) -> None:
    names = vehicle.settings.dialect.refusals

    def refused(message: Json | None, why: Any) -> None:
        vehicle.errors = []
        before = vehicle.state()
        vehicle.take(message)
        assert complaints(vehicle) == [names[why]]
        assert vehicle.state() | {"errors": []} == before

    refused(None, "malformed")
    refused(order(vehicle, 0, 5, 6), "far")
    refused(order(vehicle, 1, 0, 1), "malformed")
    refused(order(vehicle, 0), "malformed")
    refused(order(vehicle, 0, 0, 1, first=1), "malformed")
    unlike = order(vehicle, 0, 0, 1)
    unlike["nodes"][1]["nodePosition"]["mapId"] = "cellar"
    refused(unlike, "map")
    vehicle.mode = "MANUAL"
    refused(order(vehicle, 0, 0, 1), "unavailable")
    vehicle.mode = "AUTOMATIC"
    vehicle.take(order(vehicle, 0, 0, 1))
    assert not vehicle.errors, "a new order has been taken"
    vehicle.take(order(vehicle, 1, 1, 2, first=2))
    refused(order(vehicle, 0, 0, 1), "outdated")
    refused(order(vehicle, 2, 1, 2, first=2), "unstitched")
    refused(order(vehicle, 0, 0, 1, orderId="p"), "active")
    vehicle.errors = []
    before = vehicle.state()
    vehicle.take(order(vehicle, 1, 1, 2, first=2))
    assert vehicle.state() == before, "what is sent again is disregarded"


def test_cancelling_is_done_when_it_stands_and_nothing_of_that_order_is_taken(
    vehicle: Vehicle,
) -> None:
    vehicle.take(order(vehicle, 0, 0, 1))
    assert vehicle.go_on((0.2, 0), True) == (1, 0)
    vehicle.act(action("cancelOrder", "1"))
    assert vehicle.go_on((0.3, 0), True) is None
    field = vehicle.settings.dialect.instant
    assert [a["actionStatus"] for a in vehicle.state()[field]] == ["RUNNING"]
    vehicle.take(order(vehicle, 1, 1, 2, first=2))
    assert complaints(vehicle) == [vehicle.settings.dialect.refusals["cancelled"]]
    assert vehicle.go_on((0.3, 0), False) is None
    state = vehicle.state()
    assert [a["actionStatus"] for a in state[field]] == ["FINISHED"]
    assert (state["orderId"], state["nodeStates"]) == ("o", [])
    vehicle.take(order(vehicle, 1, 1, 2, first=2))
    assert vehicle.go_on((0.3, 0), False) is None
    vehicle.act(action("cancelOrder", "2"))
    assert vehicle.state()[field][-1]["actionStatus"] == "FAILED"
    assert vehicle.settings.dialect.idle in complaints(vehicle)
    vehicle.take(order(vehicle, 0, 0.3, 1, orderId="p"))
    assert (vehicle.go_on((0.3, 0), False), complaints(vehicle)) == ((1, 0), [])


def test_an_order_may_be_cancelled_by_two(vehicle: Vehicle) -> None:
    vehicle.take(order(vehicle, 0, 0, 1))
    assert vehicle.go_on((0.2, 0), True) == (1, 0)
    for name in "12":
        vehicle.act(action("cancelOrder", name))
    assert vehicle.go_on((0.3, 0), False) is None
    field = vehicle.settings.dialect.instant
    assert [a["actionStatus"] for a in vehicle.state()[field]] == ["FINISHED", "FINISHED"]


def test_it_pauses_and_loses_its_order_when_a_person_takes_over(vehicle: Vehicle) -> None:
    vehicle.take(order(vehicle, 0, 0, 1))
    vehicle.act(action("startPause", "1"))
    assert (vehicle.go_on((0, 0), False), vehicle.state()["paused"]) == (None, True)
    vehicle.act(action("startPause", "1"))
    vehicle.act(action("stopPause", "2"))
    assert vehicle.go_on((0, 0), False) == (1, 0)
    vehicle.act(action("dance", "3"))
    statuses = [a["actionStatus"] for a in vehicle.state()[vehicle.settings.dialect.instant]]
    assert statuses == ["FINISHED", "FINISHED", "FAILED"]
    vehicle.mode = "MANUAL"
    assert vehicle.go_on((0, 0), False) is None
    vehicle.mode = "AUTOMATIC"
    assert vehicle.go_on((0, 0), False) is None
    vehicle.take(order(vehicle, 1, 1, 2, first=2))
    assert complaints(vehicle) == [vehicle.settings.dialect.refusals["cancelled"]]
