"""Every fault behind the bridge, and of it, ends with robots that stand, and is named."""

import asyncio
import re
import time
from collections.abc import Callable
from contextlib import aclosing
from typing import Any

import numpy as np
import pytest
from deploying import SURE, Act, Case, deployed, stand, stops, wait_for
from formup.tools.fleet import getting_on
from formup.tools.fleet.protocol import (
    Fleet,
    FleetUnreachableError,
    Motion,
    StalePosesError,
)
from formup.tools.fleet.wire import fleet as fleet_module
from outside import driven

Labs = Callable[..., Any]
Said = dict[str, Any]
MODES = ["pose", "cmd_vel", "nav2"]


def fault(of: Callable[[Said, int], Said | None]) -> Act:
    """Robot b says something else from now on, made of what it would say and of its number."""
    return lambda lab, fleet: lab.robots.faults.update(b=of)


def doing(of: Callable[[Any], object]) -> Act:
    """The stand-ins do something."""
    return lambda lab, fleet: of(lab.robots)


def moved(said: Said, **by: float) -> Said:
    place = said["pose"]["position"]
    there = place | {axis: place[axis] + way for axis, way in by.items()}
    return said | {"pose": said["pose"] | {"position": there}}


def at(said: Said, **place: object) -> Said:
    return said | {"pose": said["pose"] | {"position": said["pose"]["position"] | place}}


def stamped(said: Said, seq: int) -> Said:
    sec, nanosec = divmod(seq * 50_000_000, 10**9)
    return said | {"header": said["header"] | {"stamp": {"sec": sec, "nanosec": nanosec}}}


def framed(said: Said, frame: str) -> Said:
    return said | {"header": said["header"] | {"frame_id": frame}}


def held_elsewhere(lab: Any, fleet: Fleet) -> None:
    lab.say(lab.settings.topics.hold, {"data": "stop"})


def driven_elsewhere(lab: Any, fleet: Fleet) -> None:
    twist = {"linear": {"x": 1.0}, "angular": {"z": 0.5}}
    goal = {"pose": {"position": {"x": 50, "y": 50}}}
    lab.say(lab.goal("a"), twist if lab.settings.drive_by == "cmd_vel" else goal)


CASES = {
    "none": Case(doing(lambda robots: None), "arrived"),
    "one glitch": Case(fault(lambda m, n: moved(m, x=300 * (n % 40 == 0))), "arrived"),
    "twice and out of order": Case(
        fault(lambda m, n: at(stamped(m, n - 5), x=0) if n % 3 == 0 else m), "arrived"
    ),
    "silent": Case(fault(lambda m, n: None), "failed", "b not seen for 1.", ("b",)),
    "not a number": Case(fault(lambda m, n: at(m, y=None)), "failed", "malformed", ("b",)),
    "no quaternion": Case(
        fault(lambda m, n: m | {"pose": m["pose"] | {"orientation": dict.fromkeys("xyzw", 1.0)}}),
        "failed",
        "malformed",
        ("b",),
    ),
    "stale": Case(fault(lambda m, n: stamped(m, 7)), "failed", "out of order", ("b",)),
    "wrong frame": Case(
        fault(lambda m, n: framed(m, "odom")), "failed", "in the frame 'odom', not 'map'", ("b",)
    ),
    "carried away": Case(
        fault(lambda m, n: moved(m, x=300)), "failed", "in two places|jumped", ("b",)
    ),
    "two of one id": Case(
        fault(lambda m, n: moved(m, x=300 * (n % 2))), "failed", "in two places", ("b",)
    ),
    "stopped": Case(stops, "stopped", "was stopped"),
    "stopped elsewhere": Case(held_elsewhere, "stopped", "was stopped"),
    "driven elsewhere": Case(driven_elsewhere, "failed", "Another program"),
}
OF_ALL_MODES = ("none", "silent", "stopped", "stopped elsewhere")
"""Goals of Nav2 are seen by nobody but who sent them."""


@pytest.mark.parametrize(
    ("by", "name"),
    [
        *(("pose", name) for name in CASES),
        *(("cmd_vel", name) for name in (*OF_ALL_MODES, "driven elsewhere")),
        *(("nav2", name) for name in OF_ALL_MODES),
    ],
)
def test_a_fault_on_the_way_ends_with_robots_that_stand_and_is_named(
    lab: Labs, by: str, name: str
) -> None:
    case, there = CASES[name], lab(**SURE, drive_by=by).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, case.act)
    assert (arrival.ended, arrival.failed) == (case.ended, case.failed), arrival.reason
    if case.words:
        assert re.search(case.words, arrival.reason or ""), arrival.reason
    assert stand(there)
    asyncio.run(fleet.close())


def test_robots_that_begin_to_count_anew_are_held_and_then_believed_again(lab: Labs) -> None:
    there = lab(**SURE).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, doing(lambda robots: robots.reboot()))
    assert (arrival.ended, arrival.failed) == ("failed", ("a", "b", "c"))
    assert "out of order" in (arrival.reason or "")
    assert stand(there)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


@pytest.mark.parametrize("by", ["pose", "nav2"])
def test_a_robot_that_does_not_move_does_not_get_on(
    lab: Labs, by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(getting_on, "STALLED_S", 1.0)
    stuck = {"starts": [[50, 50], [50, 100], [50, 150]], "stuck": [{"robot": "b"}]}
    there = lab(**SURE, drive_by=by, simulated=stuck).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet)
    assert (arrival.ended, arrival.failed) == ("failed", ("b",))
    assert "Robot b does not get on" in (arrival.reason or "")
    asyncio.run(fleet.close())


@pytest.mark.parametrize("by", MODES)
def test_a_bridge_that_dies_ends_it_and_all_is_observed_anew_when_it_is_back(
    lab: Labs, by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 1.0)
    there = lab(**SURE, drive_by=by).simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, doing(lambda robots: robots.link.close()))
    assert (arrival.ended, "out of reach" in (arrival.reason or "")) == ("failed", True)
    if by != "nav2":  # it goes on to its last goal
        wait_for(lambda: there.was_told("no goal came for 1 s: held"))
    with pytest.raises(FleetUnreachableError):
        asyncio.run(fleet.observe())
    wait_for(lambda: stand(there))
    held = there.robots.points.copy()
    there.robots.heard.clear()
    there.robots.restart_bridge()
    monkeypatch.setattr(fleet_module, "WAIT", 10.0)
    poses = asyncio.run(fleet.observe(max_age=1.0))
    assert stand(there), "nothing moves because of what was said before"
    assert np.allclose([(p.x, p.y) for p in poses], held, atol=0.5)
    said = [m for m in there.robots.heard if m["op"] not in ("subscribe", "advertise")]
    assert said[0] == {
        "op": "publish",
        "topic": "/formup/hold",
        "msg": {"data": said[0]["msg"]["data"]},
    }
    assert all("send" not in m["op"] for m in said)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


@pytest.mark.parametrize("by", ["pose", "cmd_vel"])
def test_robots_hold_by_themselves_when_the_process_that_drives_them_is_killed(
    lab: Labs, by: str
) -> None:
    there = lab(drive_by=by).simulate()
    with driven(there.path) as driver:
        wait_for(lambda: there.named("driving") == {"a", "b", "c"})
        driver.kill()
    wait_for(lambda: there.named("no goal came for 0.5 s: held") == {"a", "b", "c"})
    wait_for(lambda: stand(there))
    assert there.robots.points[:, 0].max() < 1000


def test_nav2_goes_no_further_than_its_last_goal_when_the_process_is_killed(lab: Labs) -> None:
    there = lab(drive_by="nav2").simulate()
    with driven(there.path) as driver:
        wait_for(lambda: there.was_told("driving"))
        driver.kill()
    begun = there.robots.points[:, 0].copy()
    wait_for(lambda: stand(there))
    assert (there.robots.points[:, 0] - begun).max() <= 4.0 * there.settings.speed + 1


def test_goals_that_nav2_gives_up_are_named(lab: Labs) -> None:
    there = lab(**SURE, drive_by="nav2").simulate()
    fleet = there.fleet()
    arrival = deployed(there, fleet, doing(lambda robots: robots.result(6)))
    assert arrival.ended == "failed"
    assert "Nav2 gave up its goal, status 6" in (arrival.reason or "")
    assert stand(there)
    assert deployed(there, fleet).arrived
    asyncio.run(fleet.close())


def test_nav2_is_sent_another_goal_only_every_step(lab: Labs) -> None:
    there = lab(drive_by="nav2").simulate()

    async def go() -> int:
        fleet, frames = there.fleet(), 0
        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 300, first.y)])
        async for _ in fleet.drive(Motion({first.id: path})):
            frames += 1
        await fleet.close()
        return frames

    frames = asyncio.run(go())
    sent = [m for m in there.robots.heard if m["op"] == "send_action_goal"]
    assert len(sent) < frames / 10
    assert len({m["id"] for m in sent}) == len(sent)
    assert sent[-1]["args"]["pose"]["pose"]["position"]["x"] == pytest.approx(350)


@pytest.mark.parametrize("by", ["pose", "cmd_vel"])
def test_robots_hold_while_whoever_drives_hangs(lab: Labs, by: str) -> None:
    there = lab(**SURE, drive_by=by).simulate()
    fleet = there.fleet()

    async def go() -> None:
        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 400, first.y)])
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
    assert abs(there.robots.points[0, 0] - 450) < 2


def test_velocities_end_with_zero(lab: Labs) -> None:
    there = lab(drive_by="cmd_vel").simulate()

    async def go() -> None:
        fleet = there.fleet()
        first, *_ = await fleet.observe()
        path = np.array([(first.x, first.y), (first.x + 300, first.y)])
        async with aclosing(fleet.drive(Motion({first.id: path}))) as moving:
            for _ in range(10):
                await anext(moving)
            await fleet.close()

    asyncio.run(go())
    told = [m for m in there.robots.heard if m.get("topic") == there.goal("a")]
    wait_for(lambda: told and told[-1]["op"] == "publish")
    assert max(m["msg"]["linear"]["x"] for m in told if m["op"] == "publish") > 10
    last = told[-1]["msg"]
    assert (last["linear"]["x"], last["angular"]["z"]) == (0, 0)


def test_a_robot_without_a_heading_is_not_driven_by_velocities(
    lab: Labs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 0.5)
    there = lab(drive_by="cmd_vel").simulate()
    zeros = dict.fromkeys("xyzw", 0.0)
    fault(lambda m, n: m | {"pose": m["pose"] | {"orientation": zeros}})(
        there, fleet := there.fleet()
    )
    with pytest.raises(
        StalePosesError, match="Robot b not seen yet; its last message was without a"
    ):
        asyncio.run(fleet.observe())
    asyncio.run(fleet.close())
