"""The checks every fleet has to pass, for authors of one to run in tests of their own.

`await check_fleet(make)` runs them all, each on a fleet of its own that it closes. They drive the
first robot to and fro by `way` px along x, so there has to be room for that.
"""

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
)

Poses = tuple[Pose, ...]
Check = Callable[[Fleet, float, float], Awaitable[None]]
"""A check of a fleet with at least two robots, with a way and a tolerance in px."""
SETTLE_S = 0.1
"""Robots that were stopped are looked at again after so long."""


async def check_fleet(
    make: Callable[[], Fleet], *, way: float = 40.0, tolerance: float = 2.0
) -> None:
    """Run every check.

    Args:
        make: opens the fleet anew, with at least two robots.
        way: px the first robot is driven; takes many control periods.
        tolerance: px by which robots may miss the end of a path, or be seen to move though they
            stand.

    Raises:
        AssertionError: saying what does not hold.
    """
    for check in CHECKS:
        fleet = make()
        try:
            await check(fleet, way, tolerance)
        except FleetError as error:
            raise AssertionError(f"{check.__name__} met an error: {error!r}") from error
        finally:
            await fleet.close()


async def check_ids(fleet: Fleet, way: float, tolerance: float) -> None:
    """Robots keep their ids and their order, and stand somewhere."""
    before = await fleet.observe()
    ids = [pose.id for pose in before]
    assert len(ids) >= 2, f"the checks need two robots, there are {len(ids)}"
    assert len(set(ids)) == len(ids), f"ids are not unique: {ids}"
    assert all(ids), "an id is empty"
    for poses in [before, *await _driven(fleet, way), await fleet.observe()]:
        assert [pose.id for pose in poses] == ids, "ids or their order have changed"
        assert np.isfinite(_places(poses)).all(), "a position is not finite"


async def check_times(fleet: Fleet, way: float, tolerance: float) -> None:
    """Poses say when they were seen, and are refused when that is too long ago."""
    seen = [await fleet.observe(), *await _driven(fleet, way), await fleet.observe()]
    times = np.array([[pose.seen for pose in poses] for poses in seen])
    assert np.isfinite(times).all(), "a time is not finite"
    assert (np.diff(times, axis=0) >= 0).all(), "a pose was seen before the one before it"
    assert times[-1, 0] > times[0, 0], "the time of a robot that drives stands still"
    await _refused(fleet.observe(max_age=-1.0), StalePosesError, "poses that are too old")


async def check_arrival(fleet: Fleet, way: float, tolerance: float) -> None:
    """A robot drives to the end of its path, is seen on the way, and stands; others stay."""
    before = _places(await fleet.observe())
    moved = np.array([_places(poses) for poses in await _driven(fleet, way)]) - before
    assert len(moved), "drive yields no poses"
    share = moved[:, 0, 0] / way
    assert ((share > 0.1) & (share < 0.9)).any(), "the robot is not seen on its way"
    assert abs(moved[-1, 0] - (way, 0)).max() <= tolerance, "the robot has not come to its end"
    assert abs(moved[:, 1:]).max() <= tolerance, "a robot has moved that was not sent"
    await _stands(fleet, before + moved[-1], tolerance)


async def check_stop(fleet: Fleet, way: float, tolerance: float) -> None:
    """A stop holds the robots at once, and until it is released."""
    start = _places(await fleet.observe())
    async with aclosing(fleet.drive(await _motion(fleet, way))) as moving:
        await anext(moving)
        await fleet.stop()
        await _refused(_rest(moving), FleetStoppedError, "going on after a stop")
    assert fleet.stopped, "the fleet does not say that it is stopped"
    held = await _held_on_the_way(fleet, start, way, tolerance)
    for _ in range(2):
        drive = anext(fleet.drive(await _motion(fleet, way)))
        await _refused(drive, FleetStoppedError, "a drive while the stop is in force")
    await _stands(fleet, held, tolerance)
    await fleet.release()
    assert not fleet.stopped, "the fleet does not say that it is released"
    await check_arrival(fleet, way, tolerance)


async def check_release(fleet: Fleet, way: float, tolerance: float) -> None:
    """Robots that were stopped do not go on because the stop is released."""
    start = _places(await fleet.observe())
    async with aclosing(fleet.drive(await _motion(fleet, way))) as moving:
        await anext(moving)
        await fleet.stop()
        await fleet.release()
        await _refused(_rest(moving), FleetStoppedError, "going on after a release")
    await _held_on_the_way(fleet, start, way, tolerance)
    await check_arrival(fleet, way, tolerance)


async def check_closed_drive(fleet: Fleet, way: float, tolerance: float) -> None:
    """A drive that is closed stops the robots, without latching."""
    start = _places(await fleet.observe())
    async with aclosing(fleet.drive(await _motion(fleet, way))) as moving:
        await anext(moving)
    await _held_on_the_way(fleet, start, way, tolerance)
    assert not fleet.stopped, "closing a drive has latched the stop"
    await check_arrival(fleet, way, tolerance)


async def check_cancelled_drive(fleet: Fleet, way: float, tolerance: float) -> None:
    """Cancelling the task that drives stops the robots, without latching."""
    start, under_way = _places(await fleet.observe()), asyncio.Event()

    async def go() -> None:
        async with aclosing(fleet.drive(await _motion(fleet, way))) as moving:
            async for _ in moving:
                under_way.set()

    task = asyncio.ensure_future(go())
    await under_way.wait()
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task
    await _held_on_the_way(fleet, start, way, tolerance)
    assert not fleet.stopped, "cancelling a drive has latched the stop"
    await check_arrival(fleet, way, tolerance)


async def check_one_drive(fleet: Fleet, way: float, tolerance: float) -> None:
    """A second drive is refused while one goes on, which it does not disturb."""
    motion = await _motion(fleet, way)
    async with aclosing(fleet.drive(motion)) as moving:
        await anext(moving)
        await _refused(anext(fleet.drive(motion)), FleetBusyError, "a second drive")
        await _rest(moving)
    (robot, path), *_ = motion.paths.items()
    poses = {pose.id: (pose.x, pose.y) for pose in await fleet.observe()}
    assert math.dist(poses[robot], path[-1]) <= tolerance, "the first drive did not go on"


async def check_unknown_robots(fleet: Fleet, way: float, tolerance: float) -> None:
    """Robots that do not exist are refused by their ids, and nobody moves."""
    start = _places(await fleet.observe())
    motion = await _motion(fleet, way)
    (_, path), *_ = motion.paths.items()
    drive = anext(fleet.drive(Motion({**motion.paths, "no such robot": path})))
    error = await _refused(drive, RobotsFailedError, "a robot that does not exist")
    assert error.ids == ("no such robot",), f"it names the robots {error.ids}"
    await _stands(fleet, start, tolerance)


async def check_close(fleet: Fleet, way: float, tolerance: float) -> None:
    """A fleet can be closed twice, and does nothing after."""
    motion = await _motion(fleet, way)
    await fleet.close()
    await fleet.close()
    await _refused(fleet.observe(), FleetClosedError, "observing a closed fleet")
    await _refused(anext(fleet.drive(motion)), FleetClosedError, "driving a closed fleet")


CHECKS: tuple[Check, ...] = (
    check_ids,
    check_times,
    check_arrival,
    check_stop,
    check_release,
    check_closed_drive,
    check_cancelled_drive,
    check_one_drive,
    check_unknown_robots,
    check_close,
)


def _places(poses: Poses) -> FloatArray:
    return np.array([(pose.x, pose.y) for pose in poses], dtype=float)


async def _motion(fleet: Fleet, way: float) -> Motion:
    """The first robot from where it is along x."""
    first = (await fleet.observe())[0]
    return Motion({first.id: np.array([(first.x, first.y), (first.x + way, first.y)])})


async def _driven(fleet: Fleet, way: float) -> list[Poses]:
    return [poses async for poses in fleet.drive(await _motion(fleet, way))]


async def _rest(moving: AsyncIterator[Poses]) -> None:
    async for _ in moving:
        pass


async def _stands(fleet: Fleet, places: FloatArray, tolerance: float) -> None:
    await asyncio.sleep(SETTLE_S)
    now = _places(await fleet.observe())
    assert abs(now - places).max() <= tolerance, "a robot moves that should stand"


async def _held_on_the_way(
    fleet: Fleet, start: FloatArray, way: float, tolerance: float
) -> FloatArray:
    """Where robots stand, (n, 2), none of which has come far."""
    held = _places(await fleet.observe())
    assert abs(held - start).max() < way / 2, "the robot went on as if it had not been stopped"
    await _stands(fleet, held, tolerance)
    return held


Refusal = TypeVar("Refusal", bound=FleetError)


async def _refused(call: Awaitable[object], error: type[Refusal], what: str) -> Refusal:
    """The error of a call that has to fail with it."""
    try:
        await call
    except error as refusal:
        assert str(refusal), f"the refusal of {what} says nothing"
        return refusal
    except (FleetError, StopAsyncIteration) as other:
        raise AssertionError(f"{what} must raise {error.__name__}, not {other!r}") from other
    raise AssertionError(f"{what} must be refused with {error.__name__}")
