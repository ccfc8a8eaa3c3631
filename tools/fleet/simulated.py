"""A kinematic simulator: robots that follow their paths but slip, so that arrival is earned."""

import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from ..formation.contract import MIN_SPACING
from ..formation.placement.place import Site
from ..geometry.curves import Curve, Frame
from ..geometry.interior import inside
from ..geometry.outline import FloatArray, distances, largest_part, outline_of
from ..geometry.sampling import along_curve
from ..motion.motion import along

MAX_ROBOTS = 1_000
"""Above this, motion and its animation are not simulated yet."""
SLIP = 0.02
"""A robot covers between 1 - SLIP and all of a commanded path: wheels slip, odometry drifts."""
TICKS = 36
START_MARGIN = 0.03


class SimulatedFleet:
    """Robots on the picture's plane; `frames` keeps every pose for the animation."""

    def __init__(self, starts: FloatArray, *, seed: int = 0) -> None:
        self._poses = np.array(starts, dtype=float)
        self._random = np.random.default_rng(seed)
        self.frames: list[FloatArray] = [self._poses.copy()]

    async def observe(self) -> FloatArray:
        """Exact poses, (n, 2)."""
        return self._poses.copy()

    async def move(self, paths: list[FloatArray]) -> None:
        """Follow the paths in step, each robot stopping a little short."""
        covered = 1 - SLIP * self._random.random(len(paths))
        longest = max(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in paths)
        ticks = TICKS if longest > 20 else 3  # a correction is a twitch, not a journey
        for tick in range(1, ticks + 1):
            self.frames.append(along(paths, tick / ticks * covered))
        self._poses = self.frames[-1].copy()


def spread_starts(n: int, site: Site, solid: BaseGeometry, radius: float) -> FloatArray:
    """Starting poses along the picture's border, off the targets, evenly apart, (n, 2).

    Args:
        n: how many.
        site: the picture.
        solid: what robots may not stand on.
        radius: of a robot, px.

    Raises:
        InputError: there is no room for n robots outside the targets.
    """
    margin = radius + START_MARGIN * min(site.room)
    room = Frame(site.width, site.height, margin).box
    blocked = solid.buffer(radius + 2.0)
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
    starts: FloatArray, n: int, site: Site, solid: BaseGeometry, radius: float
) -> FloatArray:
    """A user's starting poses, refused where a robot could not stand.

    Raises:
        InputError: another number than n, not finite, outside the picture, or on a target.
    """
    if len(starts) != n:
        raise InputError(f"The starts give {len(starts)} positions for {n} robots.")
    if not np.isfinite(starts).all():
        raise InputError("A starting position is not a finite number.")
    away = distances(site.frame(0).box, starts)
    if away.max() > 0:
        i = int(np.argmax(away))
        x, y = starts[i]
        raise InputError(
            f"Robot {i + 1} starts at ({x:g}, {y:g}), outside the picture of "
            f"{site.width:g} x {site.height:g} px."
        )
    off = distances(solid, starts)
    if not solid.is_empty and off.min() <= radius:
        i = int(np.argmin(off))
        x, y = starts[i]
        raise InputError(f"Robot {i + 1} starts at ({x:g}, {y:g}), on the target; start it beside.")
    return starts
