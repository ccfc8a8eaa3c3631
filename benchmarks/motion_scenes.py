"""Seeded scenes of robots that drive to a formation, for the benchmarks of motion.

They vary outlines (squares, Ls, Cs, things in the photographs), starts (random, packed in a corner,
in two opposite corners), relations, and things around the target that no robot may drive over.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import affinity
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..evals.tasks.annotations import ANNOTATIONS, PHOTOS, read_entries
from ..tools.errors import ToolError
from ..tools.fleet.assigning import assign_robots
from ..tools.fleet.protocol import Pose
from ..tools.formation.contract import Contract, Group
from ..tools.formation.plan import Plan, make_plan
from ..tools.formation.site import Site
from ..tools.geometry.assignment import EXACT
from ..tools.geometry.outline import FloatArray, largest_part, outline_of
from ..tools.motion.planning import Ground, Team, assigned
from ..tools.motion.routes import named_obstacles

RADIUS, SPEED = 3.0, 100.0
"""Radius and speed of a robot, px and px/s."""
ROOM = 5_000.0
"""Area of the picture per robot, px^2; the picture is at least 640 x 480."""
PITCH, RANDOM_PITCH = 2.6 * RADIUS, 2.1 * RADIUS
"""Distance between packed starts, and least distance between random ones, px."""
TARGET = (0.15, 0.45)
"""Range of the size of targets, as a fraction of the picture's shorter side."""
TRIES = 60
DRAWN = {
    "square": ((0, 0), (1, 0), (1, 1), (0, 1)),
    "L": ((0, 0), (1, 0), (1, 0.35), (0.35, 0.35), (0.35, 1), (0, 1)),
    "C": ((0, 0), (1, 0), (1, 0.3), (0.3, 0.3), (0.3, 0.7), (1, 0.7), (1, 1), (0, 1)),
}
SHAPES = (*DRAWN, "real")
STARTS = ("random", "packed", "crossing")
RELATIONS = ("around", "inside", "along", "cage")
SIDES = ("left", "right", "top", "bottom")


@dataclass(frozen=True)
class Scene:
    """A drive: the plan, its site, and where robots start, (n, 2) px."""

    name: str
    plan: Plan
    site: Site
    starts: FloatArray

    @property
    def goals(self) -> FloatArray:
        """The places, (n, 2) px."""
        return self.plan.formation.points

    @cached_property
    def ground(self) -> Ground:
        """The obstacles that robots drive around."""
        return Ground(named_obstacles(self.plan.formation.contract, self.site), self.site)

    def poses(self) -> list[Pose]:
        """Return the poses of all robots at their starts."""
        return [Pose(str(i), float(x), float(y)) for i, (x, y) in enumerate(self.starts, start=1)]

    def team(self, error: float) -> Team:
        """Return the robots, each in the row of the place assigned to it.

        Args:
            error: how far they may deviate from their paths, px.
        """
        if len(self.starts) > EXACT:
            rows = np.array([int(i) - 1 for i in assign_robots(self.poses(), self.goals).robots])
        else:
            rows = assigned(self.starts, self.goals, self.ground, RADIUS)
        return Team(tuple(str(i + 1) for i in rows), self.starts[rows], RADIUS, SPEED, error)


def scene(seed: int, robots: int, starts: str | None = None) -> Scene:
    """Return the scene of a seed, which cycles through shapes, starts and relations that fit.

    Raises:
        ValueError: no relation fits.
    """
    random = np.random.default_rng([seed, robots])
    scale = max(1.0, math.sqrt(ROOM * robots / (640 * 480)))
    size = 640 * scale, 480 * scale
    shape, starts = SHAPES[seed % 4], starts or STARTS[seed // 4 % 3]
    wanted = seed // 12 % len(RELATIONS)
    for relation in (*RELATIONS[wanted:], *RELATIONS[:wanted]):
        for _ in range(TRIES):
            made = _made(random, size, shape, starts, relation, robots)
            if made is not None:
                return made
    raise ValueError(f"no scene of {robots} robots with seed {seed}")


def _made(
    random: np.random.Generator,
    size: tuple[float, float],
    shape: str,
    starts: str,
    relation: str,
    robots: int,
) -> Scene | None:
    """Return a scene; None if the formation or the robots do not fit."""
    middle, side = np.array(size) / 2, min(size)
    things = {
        "t1": _outline(
            random, shape, middle * random.uniform(0.8, 1.2, 2), side * random.uniform(*TARGET)
        )
    }
    for k in range(random.integers(1, 5)):
        angle, away = random.uniform(0, 2 * math.pi), random.uniform(0.3, 0.5)
        centre = middle + away * np.array([math.cos(angle), math.sin(angle)]) * size
        kind = ("square", "real")[int(random.integers(2))]
        thing = _outline(random, kind, centre, side * random.uniform(0.05, 0.15))
        if min(thing.distance(other) for other in things.values()) > 8 * RADIUS:
            things[f"k{k + 1}"] = thing
    group = Group.model_validate(
        {"relation": relation, "targets": ("t1",), "robots": robots}
        | ({"side": SIDES[int(random.integers(4))]} if relation == "along" else {})
    )
    site = Site({name: outline_of(thing) for name, thing in things.items()}, *size)
    keep_out = tuple(name for name in things if name != "t1")
    try:
        contract = Contract(groups=(group,), keep_out=keep_out, robot_radius=RADIUS)
        plan = make_plan(contract, site, "bench")
    except ToolError:
        return None
    taken = shapely.union_all([*things.values()]).buffer(RADIUS + 1)
    points = _starts(random, starts, size, taken, robots)
    if points is None or not plan.verdict.certified or plan.partial is not None:
        return None
    return Scene(f"{shape}, {starts}, {relation}", plan, site, points)


@lru_cache(maxsize=1)
def _real() -> Sequence[Polygon]:
    """Return the things in the photographs, as outlined by hand."""
    things = [t for e in read_entries(PHOTOS / ANNOTATIONS) for t in e["objects"]]
    parts = [largest_part(Polygon(thing["polygon"]).buffer(0)) for thing in things]
    return [part for part in parts if part is not None]


def _outline(random: np.random.Generator, shape: str, centre: FloatArray, size: float) -> Polygon:
    """Return a shape, randomly turned, its longer side `size` px, at a centre (2,) px."""
    real = _real()
    drawn = real[int(random.integers(len(real)))] if shape == "real" else Polygon(DRAWN[shape])
    x0, y0, x1, y1 = drawn.bounds
    share = size / max(x1 - x0, y1 - y0)
    drawn = affinity.scale(drawn, share, share, origin="center")
    drawn = affinity.rotate(drawn, float(random.uniform(0, 360)), origin="center")
    return affinity.translate(drawn, centre[0] - (x0 + x1) / 2, centre[1] - (y0 + y1) / 2)


def _starts(
    random: np.random.Generator,
    kind: str,
    size: tuple[float, float],
    taken: BaseGeometry,
    robots: int,
) -> FloatArray | None:
    """Return starts off the region taken, (robots, 2) px; None if there is no room."""
    edge = 1.5 * RADIUS
    if kind == "random":
        points = random.uniform(edge, np.array(size) - edge, (10 * robots + 50, 2))
        later = cKDTree(points).query_pairs(RANDOM_PITCH, output_type="ndarray").max(axis=1)
        points = np.delete(points, np.unique(later), axis=0)
        points = points[~shapely.intersects_xy(taken, points)][:robots]
        return points if len(points) == robots else None
    many = [robots] if kind == "packed" else [robots - robots // 3, robots // 3]
    across, down = random.choice((-1, 1), 2)
    blocks = [
        _block(size, (across * turn, down * turn), taken, n)
        for turn, n in zip((1, -1), many, strict=False)
    ]
    points = np.concatenate(blocks)
    return points if len(points) == robots else None


def _block(
    size: tuple[float, float], corner: tuple[int, int], taken: BaseGeometry, robots: int
) -> FloatArray:
    """Return starts packed in a corner, (n, 2) px: 1 is left or top, -1 is right or bottom."""
    columns = math.ceil(math.sqrt(robots))
    row, column = np.divmod(np.arange(4 * robots + 8 * columns), columns)
    points = 1.5 * RADIUS + PITCH * np.stack([column, row], axis=1)
    points = np.where(np.array(corner) > 0, points, np.array(size) - points)
    inside = ((points > 0) & (points < size)).all(axis=1)
    return points[inside & ~shapely.intersects_xy(taken, points)][:robots]
