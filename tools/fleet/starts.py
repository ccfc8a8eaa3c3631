"""Where simulated robots are set down: where they were, where a person wants them, or spread."""

import math
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
from .protocol import FleetRequest, Pose, points_of

START_MARGIN = 0.03
START_GAP = 2.0
"""Least gap between a robot that is set down and what it is set down beside, px."""


def set_down(request: FleetRequest) -> list[Pose]:
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
            "give their starting positions, or take fewer robots."
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
