"""What a look at robots behind a bridge tells, and who else is heard there."""

import json
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from formup.tools.errors import InputError
from formup.tools.fleet.ros.checkup import checked
from formup.tools.fleet.ros.link import Link

Labs = Callable[..., Any]


def told(found: tuple[list[str], bool]) -> str:
    return "\n".join(found[0])


def test_a_look_says_who_is_there_and_what_is_wrong(lab: Labs) -> None:
    there = lab(robots=["a", "b", "c", "d"], simulated={}).simulate()
    faults: dict[str, Callable[[dict[str, Any], int], object]] = there.robots.faults
    faults["b"] = lambda message, n: None
    faults["c"] = lambda message, n: message | {"header": message["header"] | {"frame_id": "odom"}}
    found = checked(there.settings, 1.0)
    assert not found[1]
    said = told(found)
    assert "is reachable, in the clear; whoever reaches it can steer." in said
    assert "Robot a was seen 0." in said
    assert "Robot b not seen yet." in said
    assert "Robot c not seen yet; its last message was in the frame 'odom', not 'map'." in said
    assert said.endswith("2 of 4 robots can be driven.")
    faults.clear()
    assert checked(there.settings, 1.0)[1]


@pytest.mark.parametrize("by", ["pose", "cmd_vel"])
def test_a_look_says_who_else_drives_but_not_who_stands_still(lab: Labs, by: str) -> None:
    there = lab(drive_by=by).simulate()
    zero = {"linear": {"x": 0.0}, "angular": {"z": 0.0}}
    goal = {"pose": {"position": {"x": 50, "y": 50}}}
    there.say(there.goal("b"), zero if by == "cmd_vel" else goal)
    found = checked(there.settings, 2.5)
    assert found[1] == (by == "cmd_vel")
    assert ("Another program is sending goals to robot b." in told(found)) == (by == "pose")


def test_nobody_answers(lab: Labs) -> None:
    found = checked(lab().settings, 0.3)
    assert (found[1], len(found[0])) == (False, 1)
    assert "of no use" in told(found)


def test_one_bridge_at_an_address(lab: Labs) -> None:
    there = lab().simulate()
    with pytest.raises(InputError, match="Nothing can stand in for the bridge"):
        type(there.robots)(there.settings, print)


def test_what_the_bridge_sends_that_is_no_message_is_not_read_and_its_complaints_are_told() -> None:
    server = pytest.importorskip("websockets.sync.server")
    sent = ["[", "[" * 50_000, "3", '"x"', b"\xff", json.dumps({"op": "publish", "topic": "/x"})]
    sent.append(json.dumps({"op": "status", "level": "error", "msg": "no such type"}))
    heard: list[Any] = []

    def talk(socket: Any) -> None:
        for text in sent:
            socket.send(text)
        for _ in socket:
            pass

    with server.serve(talk, "127.0.0.1", 0) as serving:
        threading.Thread(target=serving.serve_forever).start()
        port = serving.socket.getsockname()[1]
        link = Link(f"ws://127.0.0.1:{port}", (), (), lambda m, new: heard.append((m["op"], new)))
        link.start()
        ends = time.monotonic() + 5
        while len(heard) < 2 and time.monotonic() < ends:
            time.sleep(0.01)
        assert heard == [("publish", False), ("status", False)]
        assert (link.connected, link.trouble) == (True, "it says: no such type")
        link.close()
        serving.shutdown()
    assert not link.connected
