"""Rigid motion of a flat body among robots, checked continuously.

A pose is (x, y, theta): the position of the body's pivot, image pixels (x right, y down), and its
rotation about the pivot, radians from x to y. Moves are straight in all three, and checked by
conservative advancement (Mirtich 1996), in steps no longer than the clearance allows.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..outline import FloatArray, distances

CONTACT = 1e-5
"""Clearance below this share of the body's reach counts as contact."""
ADVANCE = 0.9
"""Share of the clearance that one step uses up; the rest keeps a verified move off contact."""
MAX_STEPS = 200
WAYS = 16
"""Number of directions in which a body that has got out may move away from the robots."""


@dataclass(frozen=True)
class Body:
    """A rigid region with its holes filled.

    Attributes:
        polygon: the region in coordinates with the pivot at (0, 0), px.
        pivot: position of the pivot at the start, (2,), image pixels: the centre of the smallest
            enclosing circle, which keeps `reach` small.
        reach: greatest distance of a point of the body from the pivot, px.
    """

    polygon: Polygon
    pivot: FloatArray
    reach: float

    @property
    def start(self) -> FloatArray:
        """The body's initial pose, (3,)."""
        return np.array([*self.pivot, 0.0])

    def at(self, pose: FloatArray) -> Polygon:
        """Return the region in a pose, image pixels."""
        ring = shapely.get_coordinates(self.polygon)
        return Polygon(_turned(ring, pose[2]) + pose[:2])


@dataclass(frozen=True)
class Obstacles:
    """What a body may not enter: robots and walls.

    Attributes:
        robots: the robots' centres, (n, 2), image pixels.
        radius: radius of each robot, px; 0 for points.
        walls: any geometry, or None.
    """

    robots: FloatArray
    radius: float
    walls: BaseGeometry | None = None


def body_of(region: Polygon) -> Body:
    """Return the region as a body at its present position."""
    ring = shapely.get_coordinates(region.exterior)
    hull = shapely.convex_hull(region)
    pivot = shapely.get_coordinates(shapely.minimum_bounding_circle(hull).centroid)[0]
    centred = ring - pivot
    return Body(Polygon(centred), pivot, float(np.linalg.norm(centred, axis=1).max()))


def seen_from(points: FloatArray, poses: FloatArray) -> FloatArray:
    """Transform points (k, 2), image pixels, into the body's frame in poses (k, 3); (k, 2), px."""
    way = points - poses[:, :2]
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.stack([cos * way[:, 0] + sin * way[:, 1], cos * way[:, 1] - sin * way[:, 0]], axis=1)


def overlaps(body: Body, obstacles: Obstacles) -> bool:
    """Return whether the body touches an obstacle in its initial pose."""
    here = body.at(body.start)
    if obstacles.walls is not None and here.intersects(obstacles.walls):
        return True
    return bool((distances(here, obstacles.robots) - obstacles.radius <= 0).any())


def clear_moves(
    body: Body, obstacles: Obstacles, before: FloatArray, after: FloatArray
) -> NDArray[np.bool_]:
    """Return a mask (m,) of the straight moves between poses (m, 3) that touch nothing on the way.

    In the body's frame, a robot moves no faster than the translation plus its distance from the
    pivot times the turn. That distance is greatest at one end of the move, so with a clearance d
    at least the share d / (that bound) of the move is free.
    """
    robots, move = obstacles.robots, after - before
    touch = CONTACT * body.reach
    ends = [np.linalg.norm(robots[None] - pose[:, None, :2], axis=2) for pose in (before, after)]
    turn = np.abs(move[:, 2:])
    speed = np.linalg.norm(move[:, :2], axis=1)[:, None] + np.maximum(*ends) * turn + touch
    done = np.zeros(speed.shape)
    clear = np.ones(len(move), dtype=bool)
    for _ in range(MAX_STEPS):
        i, j = np.nonzero((done < 1) & clear[:, None])
        if not len(i):
            break
        poses = before[i] + done[i, j, None] * move[i]
        seen = seen_from(robots[j], poses)
        gap = np.linalg.norm(seen, axis=1) - body.reach - obstacles.radius
        close = gap * ADVANCE < speed[i, j] * (1 - done[i, j])
        gap[close] = distances(body.polygon, seen[close]) - obstacles.radius
        clear[i[gap < touch]] = False
        done[i, j] += ADVANCE * np.maximum(gap, 0) / speed[i, j]
    clear &= (done >= 1).all(axis=1)
    if obstacles.walls is not None:
        for k in np.flatnonzero(clear):
            clear[k] = _clear_of(obstacles.walls, body, before[k], move[k])
    return clear


def _clear_of(walls: BaseGeometry, body: Body, before: FloatArray, move: FloatArray) -> bool:
    touch = CONTACT * body.reach
    speed = float(np.linalg.norm(move[:2]) + body.reach * abs(move[2])) + touch
    done = 0.0
    for _ in range(MAX_STEPS):
        gap = float(body.at(before + done * move).distance(walls))
        if gap < touch:
            return False
        done += ADVANCE * gap / speed
        if done >= 1:
            return True
    return False


def ways_out(body: Body, obstacles: Obstacles, pose: FloatArray) -> FloatArray:
    """Return poses a straight move away, in each of which a line parts body and robots, (16, 3)."""
    ring = _turned(shapely.get_coordinates(body.polygon), pose[2]) + pose[:2]
    angles = 2 * np.pi * np.arange(WAYS) / WAYS
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    short = (obstacles.robots @ ways.T).max(axis=0) + obstacles.radius - (ring @ ways.T).min(axis=0)
    far = np.maximum(short, 0) + CONTACT * body.reach
    return np.concatenate([pose[:2] + far[:, None] * ways, np.full((WAYS, 1), pose[2])], axis=1)


def shortened(body: Body, obstacles: Obstacles, path: FloatArray) -> FloatArray:
    """Return a path of clear moves, (k, 3), less the stops that clear straight moves can skip."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        i = kept[-1]
        after = path[i + 2 :]
        straight = clear_moves(body, obstacles, np.repeat(path[i : i + 1], len(after), 0), after)
        ahead = np.flatnonzero(straight)
        kept.append(i + 2 + int(ahead[-1]) if len(ahead) else i + 1)
    return path[kept]


def _turned(points: FloatArray, angle: float) -> FloatArray:
    cos, sin = np.cos(angle), np.sin(angle)
    return points @ np.array([[cos, sin], [-sin, cos]])
