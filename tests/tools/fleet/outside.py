"""Programs beside a test's own: one that drives a fleet of a file, and one that stops it."""

import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deploying import Act, deployed, stand, wait_for
from formup.tools.fleet.protocol import Fleet

SLOW = {"speed": 15, "pose_timeout": 1.0}
"""Robots are on their way for longer than a program takes to begin."""
GIVEN_UP = ("FleetStoppedError", "FleetUnreachableError", "StalePosesError")
"""What a program that hung learns first, of all that has happened meanwhile."""
DRIVE = """
import asyncio, sys
import numpy as np
from formup.tools.fleet.described import fleet_named
from formup.tools.fleet.protocol import FleetRequest, Motion

async def go():
    fleet = fleet_named(sys.argv[1])(FleetRequest((640.0, 480.0), 1))
    ways = {p.id: np.array([(p.x, p.y), (p.x + 5000, p.y)]) for p in await fleet.observe()}
    async for poses in fleet.drive(Motion(ways)):
        print(poses[0].x, flush=True)

asyncio.run(go())
"""


@contextmanager
def driven(path: Path) -> Generator["subprocess.Popen[str]"]:
    """A program that drives all robots far to the right, and prints where the first one is."""
    command = [sys.executable, "-c", DRIVE, str(path)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as driver:
        try:
            assert driver.stdout is not None
            assert float(driver.stdout.readline()) > 0
            yield driver
        finally:
            driver.kill()


def stopping(path: Path) -> "subprocess.Popen[str]":
    """`formup fleet stop`, as somebody types it at a second terminal."""
    command = [sys.executable, "-m", "formup", "fleet", "stop", str(path)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def check_stop_at_a_second_terminal(there: Any, fleet: Fleet) -> None:
    """A deployment ends as stopped, its robots stand, and it is told so."""
    begun = list[subprocess.Popen[str]]()
    act: Act = lambda lab, fleet: begun.append(stopping(lab.path))  # noqa: E731
    arrival = deployed(there, fleet, act)
    assert (arrival.ended, arrival.failed) == ("stopped", ()), arrival.reason
    assert "was stopped" in (arrival.reason or "")
    told, _ = begun[0].communicate()
    assert (begun[0].returncode, "3 robots were told to hold; all stand." in told) == (0, True)
    assert stand(there)
    assert fleet.stopped


def check_stop_while_the_driver_hangs(there: Any, late: float = 0.5) -> None:
    """Robots of a program that hangs stand; it does not go on when it comes to itself.

    Args:
        late: px that robots may go by a goal that was on its way out when it hung.
    """
    with driven(there.path) as driver:
        wait_for(lambda: there.was_told("driving"))
        driver.send_signal(signal.SIGSTOP)
        stop = stopping(there.path)
        told, _ = stop.communicate()
        assert (stop.returncode, "all stand" in told) == (0, True), told
        held = there.robots.points.copy()
        driver.send_signal(signal.SIGCONT)
        _, problem = driver.communicate()
        assert any(error in problem for error in GIVEN_UP), problem
        assert abs(there.robots.points - held).max() < late
        assert stand(there)
