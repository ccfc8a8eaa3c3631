"""The checks every fleet has to pass, for authors of one to run in tests of their own."""

import asyncio
import math
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing, suppress
from typing import TypeVar

import numpy as np

from ..errors import FleetError
from ..geometry.outline import FloatArray
from .protocol import (
    Fleet,
    FleetBusyError,
    FleetClosedError,
    FleetStoppedError,
    Motion,
    Pose,
    RobotsFailedError,
    StalePosesError,
    points_of,
)

Poses = tuple[Pose, ...]
Refusal = TypeVar("Refusal", bound=FleetError)
HEADING, HEADING_OFF = 1.0, 0.1
"""A heading that is driven to, and how far off it may be, radians."""
SETTLE_S = 0.1
"""Robots that were stopped are looked at again after so long."""


async def check_fleet(
    make: Callable[[], Fleet], *, way: float = 40.0, tolerance: float = 2.0
) -> None:
    """Run every check, each on a fleet of its own, which is closed after.

    Args:
        make: opens the fleet anew, with at least two robots and room to the right of the first.
        way: px that robot is driven to the right, up to three times; takes many control periods.
        tolerance: px by which robots may miss the end of a path, or seem to move when they stand.

    Raises:
        AssertionError: saying what does not hold.
    """
    checks = (check_drive, check_stop, check_interruption, check_refusals, check_turn, check_close)
    for check in checks:
        fleet = make()
        try:
            await check(fleet, way, tolerance)
        except FleetError as error:
            raise AssertionError(f"{check.__name__} met an error: {error!r}") from error
        finally:
            await fleet.close()


async def check_drive(fleet: Fleet, way: float, tolerance: float) -> None:
    """A robot is seen to drive to the end of its path; ids and order stay; others stay too."""
    before, motion = await fleet.observe(), await _motion(fleet, way)
    driven = [poses async for poses in fleet.drive(motion)]
    frames = [before, *driven, await fleet.observe()]
    ids = [pose.id for pose in before]
    assert fleet.radius > 0, f"its robots have the radius {fleet.radius}, which must be above 0"
    assert fleet.speed > 0, f"its robots have the speed {fleet.speed}, which must be above 0"
    assert len(ids) >= 2, f"the checks need two robots, there are {len(ids)}"
    assert len(set(ids)) == len(ids), f"ids are not unique: {ids}"
    for poses in frames:
        assert [pose.id for pose in poses] == ids, "ids or their order have changed"
    moved = np.array([points_of(poses) for poses in frames]) - points_of(before)
    assert np.isfinite(moved).all(), "a position is not finite"
    share = moved[1:-1, 0, 0] / way
    assert ((share > 0.1) & (share < 0.9)).any(), "the robot is not seen on its way"
    assert abs(moved[-1, 0] - (way, 0)).max() <= tolerance, "the robot has not come to its end"
    assert abs(moved[:, 1:]).max() <= tolerance, "a robot has moved that was not sent"
    times = np.array([[pose.seen for pose in poses] for poses in frames])
    assert np.isfinite(times).all(), "a time is not finite"
    assert (np.diff(times, axis=0) >= 0).all(), "a pose was seen before the one before it"
    assert times[-1, 0] > times[0, 0], "the time of a robot that drives stands still"
    await _refused(fleet.observe(max_age=-1.0), StalePosesError, "observing poses that are too old")
    await _stands(fleet, points_of(frames[-1]), tolerance)


async def check_turn(fleet: Fleet, way: float, tolerance: float) -> None:
    """A robot of a fleet that turns is seen to look where it was sent to look."""
    if not fleet.turns:
        return
    motion = await _motion(fleet, way)
    (robot,) = motion.paths
    await _run_out(fleet.drive(Motion(motion.paths, {robot: HEADING})))
    seen = {pose.id: pose.heading for pose in await fleet.observe()}[robot]
    assert seen is not None, "the robot has no heading"
    off = abs(math.remainder(seen - HEADING, math.tau))
    assert off <= HEADING_OFF, f"the robot looks {off:.2f} rad past its heading"


async def check_stop(fleet: Fleet, way: float, tolerance: float) -> None:
    """A stop ends a drive for good and holds the robots until it is released."""
    for release_at_once in (True, False):
        start = points_of(await fleet.observe())
        async with aclosing(fleet.drive(await _motion(fleet, way))) as moving:
            await anext(moving)
            await fleet.stop()
            assert fleet.stopped, "the fleet does not say that it is stopped"
            if release_at_once:
                await fleet.release()
            await _refused(_run_out(moving), FleetStoppedError, "going on after a stop")
        held = await _held_on_the_way(fleet, start, way, tolerance)
    for _ in range(2):
        drive = anext(fleet.drive(await _motion(fleet, way)))
        await _refused(drive, FleetStoppedError, "a drive while the stop is in force")
    await _stands(fleet, held, tolerance)
    await fleet.release()
    assert not fleet.stopped, "the fleet does not say that it is released"
    await check_drive(fleet, way, tolerance)


async def check_interruption(fleet: Fleet, way: float, tolerance: float) -> None:
    """Closing a drive, or cancelling its task, stops the robots without latching."""
    for interrupt in (_close_drive, _cancel_drive):
        start = points_of(await fleet.observe())
        await interrupt(fleet, await _motion(fleet, way))
        await _held_on_the_way(fleet, start, way, tolerance)
        assert not fleet.stopped, "ending a drive early has latched the stop"
    await check_drive(fleet, way, tolerance)


async def check_refusals(fleet: Fleet, way: float, tolerance: float) -> None:
    """Robots that do not exist, and a second drive at a time, are refused and change nothing."""
    start, motion = points_of(await fleet.observe()), await _motion(fleet, way)
    (robot, path), *_ = motion.paths.items()
    drive = anext(fleet.drive(Motion({robot: path, "no such robot": path})))
    error = await _refused(drive, RobotsFailedError, "a robot that does not exist")
    assert error.ids == ("no such robot",), f"it names the robots {error.ids}"
    await _stands(fleet, start, tolerance)
    async with aclosing(fleet.drive(motion)) as moving:
        await anext(moving)
        await _refused(anext(fleet.drive(motion)), FleetBusyError, "a second drive")
        await _run_out(moving)
    end = points_of(await fleet.observe())[0]
    assert math.dist(end, path[-1]) <= tolerance, "the first drive did not go on"


async def check_close(fleet: Fleet, way: float, tolerance: float) -> None:
    """A fleet can be closed twice, and does nothing after."""
    motion = await _motion(fleet, way)
    await fleet.close()
    await fleet.close()
    await _refused(fleet.observe(), FleetClosedError, "observing a closed fleet")
    await _refused(anext(fleet.drive(motion)), FleetClosedError, "driving a closed fleet")


async def _motion(fleet: Fleet, way: float) -> Motion:
    """The first robot from where it is to the right."""
    first = (await fleet.observe())[0]
    return Motion({first.id: np.array([(first.x, first.y), (first.x + way, first.y)])})


async def _run_out(moving: AsyncIterator[Poses]) -> None:
    async for _ in moving:
        pass


async def _close_drive(fleet: Fleet, motion: Motion) -> None:
    async with aclosing(fleet.drive(motion)) as moving:
        await anext(moving)


async def _cancel_drive(fleet: Fleet, motion: Motion) -> None:
    async def go() -> None:
        async with aclosing(fleet.drive(motion)) as moving:
            await anext(moving)
            task.cancel()
            await _run_out(moving)

    task = asyncio.ensure_future(go())
    with suppress(asyncio.CancelledError):
        await task


async def _held_on_the_way(
    fleet: Fleet, start: FloatArray, way: float, tolerance: float
) -> FloatArray:
    """Where robots stand, (n, 2), none of which has come far."""
    held = points_of(await fleet.observe())
    assert abs(held - start).max() < way / 2, "the robot went on as if it had not been stopped"
    await _stands(fleet, held, tolerance)
    return held


async def _stands(fleet: Fleet, places: FloatArray, tolerance: float) -> None:
    await asyncio.sleep(SETTLE_S)
    now = points_of(await fleet.observe())
    assert abs(now - places).max() <= tolerance, "a robot moves that should stand"


async def _refused(call: Awaitable[object], error: type[Refusal], what: str) -> Refusal:
    """The error of a call that has to fail with it."""
    try:
        await call
    except error as refusal:
        return refusal
    except (FleetError, StopAsyncIteration) as other:
        raise AssertionError(f"{what} must raise {error.__name__}, not {other!r}") from other
    raise AssertionError(f"{what} must be refused with {error.__name__}")
