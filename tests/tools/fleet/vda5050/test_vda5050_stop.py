"""Vehicles of VDA 5050 are held from a program other than the one that drives them."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from deploying import deployed, stand, wait_for
from formup.tools.fleet.protocol import Fleet, FleetStoppedError
from formup.tools.fleet.vda5050.messages import Writer, action
from formup.tools.fleet.wire.stopping import stopped
from outside import SLOW, check_stop_at_a_second_terminal, check_stop_while_the_driver_hangs

Halls = Callable[..., Any]


@pytest.mark.parametrize("version", ["2.1", "3.0"])
def test_a_stop_at_a_second_terminal_ends_a_deployment_and_leaves_no_pause(
    hall: Halls, version: str
) -> None:
    there = hall(version=version, **SLOW).simulate()
    fleet = there.fleet()
    check_stop_at_a_second_terminal(there, fleet)
    vehicles = there.robots.vehicles.values()
    assert all(vehicle.cancelled and not vehicle.base for vehicle in vehicles)
    wait_for(lambda: not any(vehicle.paused for vehicle in vehicles))
    with pytest.raises(FleetStoppedError):
        deployed(there, fleet)
    asyncio.run(fleet.close())


def test_vehicles_are_held_while_the_program_that_drives_them_hangs(hall: Halls) -> None:
    there = hall().simulate()
    check_stop_while_the_driver_hangs(there)
    assert not any(vehicle.paused for vehicle in there.robots.vehicles.values())


def test_a_vehicle_that_has_heard_is_not_told_again(hall: Halls) -> None:
    there = hall()
    said = there.overhear()
    there.simulate()
    _, standing = asyncio.run(stopped(there.fleet()))
    assert standing
    told = [
        [act["actionType"] for act in message["actions"]]
        for topic, message in there.all_of(said)
        if topic.endswith("a/instantActions")
    ]
    pauses = ["startPause", "cancelOrder"], ["stopPause"]
    assert [names for names in told if names in pauses] == [*pauses]


def test_a_pause_that_another_program_demands_is_a_stop(hall: Halls) -> None:
    there = hall(**SLOW).simulate()

    def pauses(hall: Any, fleet: Fleet) -> None:
        body = {"actions": [action("startPause", "p")]}
        message = Writer(hall.settings).message("b", "instantActions", body)
        hall.link().say(hall.settings.topic("b", "instantActions"), message)

    fleet = there.fleet()
    arrival = deployed(there, fleet, pauses)
    assert (arrival.ended, arrival.failed) == ("stopped", ())
    assert stand(there)
    asyncio.run(fleet.close())
