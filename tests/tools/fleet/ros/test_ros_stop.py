"""Robots behind a bridge are held from a program other than the one that drives them."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

import pytest
from deploying import deployed, stand, wait_for
from formup.tools.fleet.protocol import FleetStoppedError
from formup.tools.fleet.ros.messages import stamped
from formup.tools.fleet.wire import stopping
from formup.tools.fleet.wire.fleet import AHEAD
from formup.tools.fleet.wire.stopping import stopped
from outside import SLOW, check_stop_at_a_second_terminal, check_stop_while_the_driver_hangs

Labs = Callable[..., Any]
MODES = ["pose", "cmd_vel", "nav2"]


@pytest.mark.parametrize("by", MODES)
def test_a_stop_at_a_second_terminal_ends_a_deployment_until_a_person_says_go(
    lab: Labs, by: str
) -> None:
    there = lab(**SLOW, drive_by=by).simulate()
    fleet = there.fleet()
    check_stop_at_a_second_terminal(there, fleet)
    with pytest.raises(FleetStoppedError):
        deployed(there, fleet)
    asyncio.run(fleet.close())


@pytest.mark.parametrize("by", MODES)
def test_robots_are_held_while_the_program_that_drives_them_hangs(lab: Labs, by: str) -> None:
    there = lab(drive_by=by, watchdog=10).simulate()
    check_stop_while_the_driver_hangs(there, AHEAD * there.settings.speed)


def test_goals_of_nav2_are_cancelled_whoever_sent_them(lab: Labs) -> None:
    client = pytest.importorskip("websockets.sync.client")
    there = lab(drive_by="nav2").simulate()
    args = {"pose": stamped("map", (90_000, 50)), "behavior_tree": ""}
    sent = {"op": "send_action_goal", "id": "other", "action": there.goal("a"), "args": args}
    with client.connect(there.settings.url, proxy=None) as socket:
        socket.send(json.dumps(sent))
        wait_for(lambda: there.was_told("driving: a"))
        told, stood = asyncio.run(stopped(there.fleet()))
    assert stood, told
    assert stand(there)


def test_a_bridge_that_is_out_of_reach_is_one_sentence(
    lab: Labs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopping, "WAIT", 0.5)
    (told,), stood = asyncio.run(stopped(lab().fleet()))
    assert (stood, "is out of reach" in told) == (False, True)
    assert told.endswith("nobody was told to hold: use the robots' own stop.")
