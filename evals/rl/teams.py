"""Many teams of robots around targets at once: what each robot sees, how it moves, its reward.

The paper names one reward per category but no formula: caging rewards enclosing the target,
infill structured spacing inside it, general nearness to a reference point. `Teams.rewards` says
how these are understood here.
"""

from typing import Literal, get_args

import numpy as np
import shapely
from numpy.random import Generator
from numpy.typing import NDArray
from shapely import affinity
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from ...tools.geometry.outline import FloatArray
from ..scenes import polygons as shapes

Category = Literal["general", "infill", "caging"]
CATEGORIES: tuple[Category, ...] = get_args(Category)
STEPS = 32
"""Moves per episode."""
STRIDE = 0.15
"""Longest move along an axis; lengths are in units of the square root of the target's area."""
START = 2.0
"""Half the side of the square about the target in which robots start."""
CLEARANCE = 0.16
"""Distance wanted from the outline if robots stand around it."""
REACH = 0.5
"""Distance from where a robot is wanted at which the reward for nearness is 1/e."""
CROWDED = 0.15
"""Distance below which two robots cost each other reward."""
NEIGHBOURS = 4
SEEN = 6 + 2 * NEIGHBOURS
"""How many numbers a robot sees."""
FAR = 3.0
"""The largest of them, and how far from the target a robot can get along an axis."""
POINTS = 48
"""Points of an outline."""


def outline_points(polygon: Polygon) -> tuple[FloatArray, FloatArray, float]:
    """Return points evenly along an outline in units of its size, (POINTS, 2), its centre and size.

    Holes are filled: robots see the exterior alone.
    """
    filled = orient(Polygon(polygon.exterior))
    along = np.linspace(0, filled.length, POINTS, endpoint=False)
    points = shapely.get_coordinates(shapely.line_interpolate_point(filled.exterior, along))
    centre, size = shapely.get_coordinates(filled.centroid)[0], float(np.sqrt(filled.area))
    return (points - centre) / size, centre, size


def random_outlines(count: int, random: Generator) -> FloatArray:
    """Return outlines like those of drawn scenes, turned at random, (count, POINTS, 2)."""
    made = list[FloatArray]()
    for _ in range(count):
        ratio = float(random.uniform(1, 2.5))
        drawn = (
            shapes.rectangle(ratio),
            shapes.oval(ratio),
            shapes.capsule(ratio),
            shapes.regular(int(random.integers(3, 9))),
            shapes.blob(random, 0.35),
            shapes.ell(float(random.uniform(0.6, 0.9))),
        )
        shape, turn = drawn[int(random.integers(len(drawn)))], float(random.uniform(0, 360))
        made.append(outline_points(affinity.rotate(shape, turn))[0])
    return np.stack(made)


class Teams:
    """Teams of equal size, each around a target of its own.

    Attributes:
        places: of the robots, (teams, robots, 2), with the target's centroid at the origin.

    Args:
        category: one of CATEGORIES.
        robots: of each team.
        outlines: of the targets, (teams, POINTS, 2), counter-clockwise in (x, y).
        random: draws where robots start.
    """

    def __init__(self, category: str, robots: int, outlines: FloatArray, random: Generator) -> None:
        self._category, self._outlines = category, outlines
        self.places = random.uniform(-START, START, (len(outlines), robots, 2))
        self._look()

    def move(self, actions: FloatArray) -> None:
        """Move each robot away from the target's centre and counter-clockwise about it.

        Args:
            actions: (teams, robots, 2), in strides, clipped to one either way.
        """
        moves = STRIDE * np.clip(actions, -1, 1)
        out, about = self._frame
        moved = self.places + moves[..., :1] * out + moves[..., 1:] * about
        self.places = np.clip(moved, -FAR, FAR)
        self._look()

    def seen(self) -> NDArray[np.float32]:
        """Return what each robot sees, (teams, robots, SEEN), in the axes that it moves along.

        The vector to the outline, the distance from it (inside negative) and from the centre; the
        gaps to the next robots either way round, 1 if all are even; the vectors to the nearest
        others times the root of the team's size, FAR for those that do not exist.
        """
        count = self.places.shape[1]
        order = np.argsort(self._apart, axis=2)[..., : min(NEIGHBOURS, count - 1), None]
        ways = self.places[:, None] - self.places[:, :, None]
        near = np.take_along_axis(ways, order, axis=2) * np.sqrt(count)
        others = np.stack([(near * axis[:, :, None]).sum(-1) for axis in self._frame], axis=-1)
        flat = others.reshape(*self.places.shape[:2], -1)
        lacking = ((0, 0), (0, 0), (0, 2 * NEIGHBOURS - flat.shape[2]))
        to_outline = [(self._way * axis).sum(-1) for axis in self._frame]
        from_centre = np.linalg.norm(self.places, axis=2)
        own = np.stack([*to_outline, self._off, from_centre, *self._gaps], axis=-1)
        seen = np.concatenate([own, np.pad(flat, lacking, constant_values=FAR)], axis=2)
        return np.clip(seen, -FAR, FAR).astype(np.float32)

    def rewards(self) -> FloatArray:
        """Return the reward of each robot where it stands, (teams, robots), at most 1.

        General: nearness to the usual clearance from the nearest point of the outline.
        Infill: nearness to the inside, half of it scaled by the distance to the nearest robot.
        Caging: nearness as in general, half of it scaled by the lesser gap to the next robots
        either way round. Always: robots that crowd each other lose.
        """
        count, nearest = self.places.shape[1], self._apart.min(axis=2)
        crowded = np.clip(1 - nearest / CROWDED, 0, 1)
        if self._category == "infill":
            even = 1 / np.sqrt(count)
            wrong, spread = np.maximum(self._off + even / 3, 0), np.clip(nearest / even, 0, 1)
        else:
            wrong, spread = np.abs(self._off - CLEARANCE), np.clip(self._gaps.min(axis=0), 0, 1)
        near = np.exp(-wrong / REACH)
        earned = near if self._category == "general" else near * (1 + spread) / 2
        return earned - crowded

    def _look(self) -> None:
        """Measure what robots see and are rewarded for."""
        self._way, self._off, along = _to_outline(self.places, self._outlines)
        radius = np.linalg.norm(self.places, axis=2, keepdims=True)
        out = np.where(radius > 1e-6, self.places / np.maximum(radius, 1e-6), (1.0, 0.0))
        self._frame = (out, np.stack([-out[..., 1], out[..., 0]], axis=-1))
        self._apart = np.linalg.norm(self.places[:, None] - self.places[:, :, None], axis=-1)
        self._apart += 4 * FAR * np.eye(self.places.shape[1])
        order = np.argsort(along, axis=1)
        rank = np.argsort(order, axis=1)
        ordered = np.take_along_axis(along, order, axis=1)
        ahead = np.diff(ordered, axis=1, append=ordered[:, :1] + 1)
        gaps = [np.take_along_axis(g, rank, axis=1) for g in (ahead, np.roll(ahead, 1, axis=1))]
        self._gaps = self.places.shape[1] * np.stack(gaps)


def _to_outline(
    points: FloatArray, outlines: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each point's vector to its outline, distance (inside negative) and place round it.

    The place is that of the nearest point of the outline, 0 to 1.
    """
    start = outlines[:, None]
    edge = np.roll(outlines, -1, axis=1)[:, None] - start
    rel = points[:, :, None] - start
    share = np.clip((rel * edge).sum(-1) / np.maximum((edge * edge).sum(-1), 1e-12), 0, 1)
    ways = share[..., None] * edge - rel
    square = (ways * ways).sum(-1)
    best = np.argmin(square, axis=2)[..., None]
    way = np.take_along_axis(ways, best[..., None], axis=2)[:, :, 0]
    along = (best + np.take_along_axis(share, best, axis=2))[..., 0] / outlines.shape[1]
    x, y = rel[..., 0], rel[..., 1]
    across = (y < 0) != (y < edge[..., 1])
    left = np.where(across, x * edge[..., 1] - y * edge[..., 0], 0.0) * np.sign(edge[..., 1]) < 0
    inside = (across & left).sum(axis=2) % 2 == 1
    distance = np.sqrt(np.take_along_axis(square, best, axis=2)[..., 0])
    return way, np.where(inside, -distance, distance), along % 1.0
