"""A kinematic simulator: robots that follow their paths but slip, so that arrival is earned."""

import math
from collections.abc import AsyncGenerator, Sequence
from itertools import count, islice

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from ..formation.contract import MIN_SPACING
from ..geometry.curves import Curve, Frame
from ..geometry.interior import inside
from ..geometry.outline import FloatArray, distances, largest_part, outline_of
from ..geometry.sampling import along_curve
from ..motion.routes import along
from .pace import Pace
from .protocol import (
    FleetBusyError,
    FleetClosedError,
    FleetRequest,
    FleetSizeError,
    FleetStoppedError,
    Motion,
    Pose,
    RobotsFailedError,
    check_ages,
    points_of,
)

MAX_ROBOTS = 1_000
"""Above this, motion and its animation are not simulated yet."""
PERIOD = 0.05
"""Seconds of simulated time a step takes."""
SPEED_SHARE = 0.2
"""Share of the picture's diagonal a robot drives in a second of simulated time."""
SLIP = 0.02
"""A robot covers between 1 - SLIP and all of a commanded path: wheels slip, odometry drifts."""
START_MARGIN = 0.03
START_GAP = 2.0
"""Least gap between a robot that is set down and what it is set down beside, px."""


class SimulatedFleet:
    """Robots on the picture's plane, which are observed exactly.

    Args:
        poses: where they stand.
        speed: px per second of simulated time.
        radius: of a robot, px; None for points.
        seed: of the slip.
    """

    name = "simulated"
    real = False
    turns = True

    def __init__(
        self, poses: Sequence[Pose], *, speed: float, radius: float | None = None, seed: int = 0
    ) -> None:
        self.radius, self.stopped, self.pace = radius, False, Pace()
        self._ids = tuple(pose.id for pose in poses)
        self._points = points_of(poses)
        self._headings = [pose.heading for pose in poses]
        self._now = max((pose.seen for pose in poses), default=0.0)
        self._step = speed * PERIOD
        self._random = np.random.default_rng(seed)
        self._driving = self._closed = False
        self._stops = 0

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        """Exact poses now."""
        self._check_open()
        poses = self._seen()
        check_ages(poses, self._now, max_age)
        return poses

    async def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Follow the paths in step, each robot stopping a little short; poses at every step."""
        self._check_drive(motion)
        if not motion.paths:
            return
        moving = [i for i, robot in enumerate(self._ids) if robot in motion.paths]
        paths = [motion.paths[self._ids[i]] for i in moving]
        covered = 1 - SLIP * self._random.random(len(paths))
        longest = max(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in paths)
        steps = max(math.ceil(longest / self._step), 1)
        begun = [self._headings[i] or 0.0 for i in moving]
        ends = [motion.headings.get(self._ids[i]) for i in moving]
        self._driving, stops = True, self._stops
        try:
            for step in range(1, steps + 1):
                self._points[moving] = along(paths, step / steps * covered)
                for i, begin, end, share in zip(moving, begun, ends, covered, strict=True):
                    if end is not None:
                        turn = math.remainder(end - begin, math.tau)
                        self._headings[i] = begin + turn * step / steps * float(share)
                self._now += PERIOD
                yield self._seen()
                await self.pace.step(PERIOD)
                self._check_open()
                if self._stops != stops:
                    raise FleetStoppedError("The simulated fleet was stopped on the way.")
        finally:
            self._driving = False

    async def stop(self) -> None:
        """Hold all robots where they are, until `release`."""
        self.stopped = True
        self._stops += 1

    async def release(self) -> None:
        """Lift the stop."""
        self.stopped = False

    async def close(self) -> None:
        """Hold all robots, for good."""
        self._closed = True

    def _seen(self) -> tuple[Pose, ...]:
        robots = zip(self._ids, self._points.tolist(), self._headings, strict=True)
        return tuple(Pose(robot, x, y, heading, self._now) for robot, (x, y), heading in robots)

    def _check_open(self) -> None:
        if self._closed:
            raise FleetClosedError("The simulated fleet is closed; open it again.")

    def _check_drive(self, motion: Motion) -> None:
        self._check_open()
        if self.stopped:
            raise FleetStoppedError("The simulated fleet is stopped; release it to drive.")
        if self._driving:
            raise FleetBusyError("The simulated fleet is driving already; wait, or stop it.")
        unknown = sorted(set(motion.paths) - set(self._ids))
        if unknown:
            raise RobotsFailedError(
                f"Robot {', '.join(unknown)} is not in the simulated fleet of "
                f"{len(self._ids)} robots.",
                unknown,
            )


def open_fleet(request: FleetRequest) -> SimulatedFleet:
    """Robots where they were last, at the starts a person gave, or spread along the border.

    Raises:
        FleetSizeError: more robots than are simulated.
        InputError: starts where no robot can stand, or no room for all.
    """
    if request.robots > MAX_ROBOTS:
        raise FleetSizeError(
            f"{request.robots} robots can be placed and certified, but motion is simulated only "
            f"up to {MAX_ROBOTS} so far: the plan stands, nothing was moved."
        )
    speed = SPEED_SHARE * math.hypot(*request.size)
    radius = request.radius or None
    return SimulatedFleet(_set_down(request), speed=speed, radius=radius, seed=request.seed)


def _set_down(request: FleetRequest) -> list[Pose]:
    """Poses of at least as many robots as are wanted: those that stay, others spread out."""
    frame, radius = Frame(*request.size), request.radius
    if not request.known and request.starts is not None:
        points = checked_starts(request.starts, request.robots, frame, request.solid, radius)
        return [Pose(str(i), float(x), float(y)) for i, (x, y) in enumerate(points, start=1)]
    ids = [pose.id for pose in request.known]
    unused = (name for i in count(1) if (name := str(i)) not in ids)
    ids = [*ids, *islice(unused, max(request.robots - len(ids), 0))]
    placed = _staying(request)
    missing = [robot for robot in ids if robot not in placed]
    if missing:
        bodies = [shapely.Point(p.x, p.y).buffer(radius + START_GAP) for p in placed.values()]
        taken = shapely.union_all([request.solid, *bodies]) if bodies else request.solid
        now = max((pose.seen for pose in request.known), default=0.0)
        points = spread_starts(len(missing), frame, taken, radius)
        for robot, (x, y) in zip(missing, points, strict=True):
            placed[robot] = Pose(robot, float(x), float(y), None, now)
    return [placed[robot] for robot in ids]


def _staying(request: FleetRequest) -> dict[str, Pose]:
    """Known robots by id, without those never driven that would stand on something solid.

    Raises:
        InputError: such a robot stands where a person wanted it.
    """
    known, solid, radius = request.known, request.solid, request.radius
    if request.driven or not known or solid.is_empty:
        return {pose.id: pose for pose in known}
    points = points_of(known)
    if request.starts is not None:
        checked_starts(points, len(points), Frame(*request.size), solid, radius)
    free = distances(solid, points) > radius
    return {pose.id: pose for pose, is_free in zip(known, free, strict=True) if is_free}


def spread_starts(n: int, frame: Frame, solid: BaseGeometry, radius: float) -> FloatArray:
    """Starting positions along the picture's border, off what is solid, evenly apart, (n, 2) px.

    Raises:
        InputError: there is no room for n robots.
    """
    margin = radius + START_MARGIN * min(frame.width, frame.height)
    room = Frame(frame.width, frame.height, margin).box
    blocked = solid.buffer(radius + START_GAP)
    spacing = max(2 * radius * 1.05, MIN_SPACING)
    loop = shapely.get_parts(shapely.line_merge(room.exterior.difference(blocked)))
    lines = tuple(shapely.get_coordinates(line) for line in loop if line.length > 1)
    curve = Curve(lines, len(lines) == 1 and bool(loop[0].is_closed), room.exterior.length)
    points = along_curve(curve, n)
    if len(points) == n and curve.length >= n * spacing:
        return points
    free = room.difference(blocked)
    part = largest_part(free)
    points = (
        np.empty((0, 2))
        if part is None or part.area < 4
        else inside(outline_of(part), n, 0.0, math.inf, spacing)
    )
    if len(points) < n:
        raise InputError(
            f"Only {len(points)} of {n} robots find room to start outside the target; "
            "give their starting positions with --starts."
        )
    return points


def checked_starts(
    starts: FloatArray, n: int, frame: Frame, solid: BaseGeometry, radius: float
) -> FloatArray:
    """A user's starting positions, refused where a robot could not stand.

    Raises:
        InputError: another number than n, not finite, outside the picture, on each other or on a
            target.
    """
    if len(starts) != n:
        raise InputError(f"The starts give {len(starts)} positions for {n} robots.")
    if not np.isfinite(starts).all():
        raise InputError("A starting position is not a finite number.")
    away = distances(frame.box, starts)
    if away.max() > 0:
        i = int(np.argmax(away))
        x, y = starts[i]
        turned = distances(frame.box, starts[:, ::-1]).max() == 0
        swapped = "; with y before x all would lie in it" if turned else ""
        raise InputError(
            f"Robot {i + 1} starts at ({x:g}, {y:g}), outside the picture of "
            f"{frame.width:g} x {frame.height:g} px{swapped}."
        )
    apart = np.linalg.norm(starts[:, None] - starts[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    if apart.min() < max(2 * radius, MIN_SPACING):
        i, j = map(int, np.argwhere(apart == apart.min())[0])
        x, y = starts[i]
        raise InputError(
            f"Robots {i + 1} and {j + 1} start on the same spot: {apart[i, j]:g} px apart at "
            f"({x:g}, {y:g}), where {max(2 * radius, MIN_SPACING):g} px are needed."
        )
    off = distances(solid, starts)
    if not solid.is_empty and off.min() <= radius:
        i = int(np.argmin(off))
        x, y = starts[i]
        raise InputError(f"Robot {i + 1} starts at ({x:g}, {y:g}), on the target; start it beside.")
    return starts
