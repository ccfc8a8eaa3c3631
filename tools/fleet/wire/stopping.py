"""Holds robots from a process other than the one that drives them, and looks whether they stand."""

import asyncio
import math
import time
from collections.abc import Iterable

from ..protocol import Pose
from .fleet import SETTLED, WAIT, WireFleet
from .poses import told_of

AGAIN = 0.5
"""Seconds after which robots are told again, as some may not have heard,"""
LEAST = 1.0
"""for so many at least, even where all are seen to stand: they may just wait for another,"""
LIMIT = 5.0
"""and for so many at most."""
STOOD = 0.5
"""A robot stands that has stayed where it is for so many seconds,"""
CREEPING = 0.1
"""unless it has come further than it does in these at this share of its speed."""


class Standing:
    """Since when robots have been seen to stand.

    Args:
        limit: px that a robot may seem to move while it stands.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._since: dict[str, Pose] = {}
        self._last: dict[str, Pose] = {}

    def saw(self, poses: Iterable[Pose]) -> None:
        """Take in where robots are seen now."""
        for pose in poses:
            since = self._since.setdefault(pose.id, pose)
            if math.dist((pose.x, pose.y), (since.x, since.y)) > self._limit:
                self._since[pose.id] = pose
            self._last[pose.id] = pose

    def stands(self, robot: str) -> bool:
        """Whether a robot has stayed where it is for long enough."""
        last = self._last.get(robot)
        return last is not None and last.seen - self._since[robot].seen >= STOOD


async def stopped(fleet: WireFleet) -> tuple[list[str], bool]:
    """What is to be told, and whether all robots stand, after they were told to hold.

    Args:
        fleet: is closed after.
    """
    try:
        ends = time.monotonic() + WAIT
        while not fleet.link.connected and time.monotonic() < ends:
            await asyncio.sleep(fleet.settings.period)
        if not fleet.link.connected:
            return [_unreachable(fleet, "nobody was told to hold: use the robots' own stop")], False
        moving, unseen = await _held(fleet)
        if not fleet.link.connected:
            return [_unreachable(fleet, "robots were told to hold before: look at them")], False
    finally:
        await fleet.close()
    robots = len(fleet.settings.robots)
    told = [f"Robot {', '.join(moving)} still moves: hold it by hand."] if moving else []
    if unseen:
        it, stands = ("it", "it stands") if len(unseen) == 1 else ("them", "they stand")
        why = told_of(unseen) + fleet.poses.trouble
        told.append(f"{why} Whether {stands} cannot be told from here: look at {it}.")
    standing = robots - len(moving) - len(unseen)
    stand = "all stand" if standing == robots else f"{standing} of them are seen to stand"
    told.append(
        f"{robots} robots were told to hold; {stand}. A program that drove them ends as stopped, "
        "and goes on only when a person says so there."
    )
    return told, standing == robots


async def _held(fleet: WireFleet) -> tuple[list[str], dict[str, str]]:
    """Tell robots to hold until they stand, a while at most.

    Returns:
        Those that move on, and what is to be said of each that is not seen.
    """
    settings, begun = fleet.settings, time.monotonic()
    standing = Standing(max(SETTLED, CREEPING * fleet.speed * STOOD))
    due = begun
    while True:
        now = time.monotonic()
        if now >= due:
            due = now + AGAIN
            await fleet.stop()
        standing.saw(fleet.poses.seen())
        unseen = fleet.poses.old(now, settings.pose_timeout)
        moving = [r for r in settings.robots if r not in unseen and not standing.stands(r)]
        over = LIMIT if moving or unseen else LEAST
        if now >= begun + over:
            return moving, unseen
        await asyncio.sleep(settings.period)


def _unreachable(fleet: WireFleet, so: str) -> str:
    where = fleet.settings.where
    why = fleet.link.trouble or "the connection was lost"
    return f"{where[0].upper()}{where[1:]} is out of reach: {why}; {so}."
