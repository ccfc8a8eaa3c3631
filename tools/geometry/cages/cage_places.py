"""Places few robots so that they cage an object, and certifies the cage.

Evenly spaced rings are tried first. Failing that, robots slide along rings at two distances to
narrow the widest way out, as estimated on a coarse grid of configurations; `cage` then tests the
result. Everything is deterministic.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from ..curves import Curve, Frame, interpolate, ring
from ..outline import FloatArray, Outline
from ..sampling import along_curve, arc_length, min_spacing
from .budget import cut_short, spend
from .cages import QUICK, THOROUGH, State, cage
from .configuration import clearances
from .configuration_grid import Grid, component, first_grid
from .rigid import Body, Obstacles, body_of

STATIONS = 64
"""Number of places on each ring that robots may slide to."""
DEPTHS = (0.1, 0.4)
"""Where the rings lie in the range of clearances: near the object, and towards the middle."""
PHASES = 8
"""Number of rotations tried for an even ring."""
SLIDES_STEPS = 10
"""Steps of the budget spent on evaluating the stations."""
SLIDES = (8, -8, 4, -4, 2, -2, 1, -1)
"""Slides tried in search of a tighter cage, in stations, the longest first."""
SWEEPS, STARTS = 6, 2
BISECTIONS = 7
MOST_SLID = 40
"""Beyond this many robots only even rings are tried."""
TRIES = 6
"""How many team sizes are tried below that of the even ring which the disc test certifies."""


@dataclass(frozen=True)
class Demand:
    """The requirements on a cage.

    Attributes:
        outline: the object to cage.
        clearance: least and greatest distance from the object to a robot's edge, px.
        radius: radius of a robot, px.
        frame: where robots may stand.
        spacing: least distance between two robots' centres, px.
        walls: other obstacles the object cannot pass.
    """

    outline: Outline
    clearance: tuple[float, float]
    radius: float
    frame: Frame
    spacing: float = 0.0
    walls: BaseGeometry | None = None

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """Rings that follow the outline at the distances robots may stand at."""
        least, greatest = self.clearance
        span = min(greatest, 4 * least) - least if least > 0 else greatest
        offsets = (least + share * span + self.radius for share in DEPTHS)
        keep = least + self.radius
        return tuple(ring(self.outline, d, d, self.frame, keep=keep) for d in offsets)

    @cached_property
    def slides(self) -> "_Slides":
        """The search over the stations of the rings, set up once."""
        return _Slides(self)

    def state(self, points: FloatArray, levels: int, escapes: bool = False) -> State:
        """Test whether robots at `points` (n, 2) cage the object.

        They count as not certified when closer together than `spacing`, or when the budget is
        spent and a flood is asked for (`levels` > 0).
        """
        crowded = len(points) > 1 and min_spacing(points) < self.spacing
        if crowded or (levels and cut_short()):
            return "not certified"
        region, radius, walls = self.outline.filled, self.radius, self.walls
        return cage(region, points, radius, walls=walls, levels=levels, escapes=escapes).state


def fewest_cage(demand: Demand, at_least: int = 3) -> FloatArray | None:
    """Return places of the fewest robots found that certainly cage an object, (n, 2), image px.

    There are never more than in the smallest even ring that the disc test certifies; fewer might
    still do. Takes several seconds at most.

    Returns:
        None if no robots that keep their spacing and stay in the frame can be certified to cage it.
    """
    even = _even_count(demand, at_least)
    most = at_least + TRIES if even is None else min(even, at_least + TRIES)
    for n in range(at_least, most):
        points = caging_places(demand, n)
        if points is not None:
            return points
    return None if even is None else caging_places(demand, even)


def caging_places(demand: Demand, n: int, preferred: Sequence[Curve] = ()) -> FloatArray | None:
    """Return places of n >= 3 robots that certainly cage an object, (n, 2), image px, or None.

    Robots spread evenly over the `preferred` curves are tried first.
    """
    rings = [points for c in (*preferred, *demand.curves) for points in _even_rings(c, n)]
    levels = (0,) if n > MOST_SLID else (0, QUICK)
    for level in levels:
        for points in rings:
            if demand.state(points, level) == "caged":
                return points
    if n > MOST_SLID or cut_short():
        return None
    return demand.slides.places(n)


def _even_count(demand: Demand, at_least: int) -> int | None:
    """Return the smallest number of robots whose even ring the disc test certifies, or None."""
    for curve in demand.curves:
        most = int(curve.length / demand.spacing) if demand.spacing > 0 else 1000
        last, n = at_least - 1, at_least
        while n <= most:
            if _disc_cages(demand, curve, n):
                return next(k for k in range(last + 1, n + 1) if _disc_cages(demand, curve, k))
            last, n = n, max(n + 1, int(n * 1.05))
    return None


def _disc_cages(demand: Demand, curve: Curve, n: int) -> bool:
    return any(demand.state(points, 0) == "caged" for points in _even_rings(curve, n))


def _even_rings(curve: Curve, n: int) -> Iterator[FloatArray]:
    if curve.length <= 0:
        return
    yield along_curve(curve, n)
    if not curve.closed:
        return
    line = curve.lines[0]
    for phase in range(PHASES):
        yield interpolate(line, (np.arange(n) + phase / PHASES) * arc_length(line) / n)


class _Slides:
    """Searches the stations on the rings for a set whose widest way out is narrow."""

    def __init__(self, demand: Demand) -> None:
        spend(SLIDES_STEPS)
        self._demand = demand
        # A ring that the frame cuts open and no wall closes is of no use to slide on.
        rings = [
            c for c in demand.curves if c.closed or (demand.walls is not None and c.length > 0)
        ]
        self._rings = [_ring_stations(curve) for curve in rings]
        body = body_of(demand.outline.filled)
        every = np.concatenate(self._rings) if self._rings else np.empty((0, 2))
        self._grid: Grid = first_grid(body, Obstacles(every, demand.radius))
        self._seed = self._grid.seed(body.pivot)
        self._fields = [self._clearances(body, points) for points in self._rings]

    def places(self, n: int) -> FloatArray | None:
        """Return the places (n, 2) of the tightest set found that is certified, or None."""
        starts: list[tuple[float, int, list[int]]] = []
        for k, points in enumerate(self._rings):
            for phase in range(0, max(len(points) // n, 1), max(len(points) // n // PHASES, 1)):
                chosen = [(phase + len(points) * i // n) % len(points) for i in range(n)]
                starts.append((self._width(k, chosen), k, chosen))
        for width, k, chosen in sorted(starts)[:STARTS]:
            width, chosen = self._tightened(k, chosen, width)
            points = self._rings[k][chosen]
            if width < 0 and self._certified(points):
                return points
        return None

    def _certified(self, points: FloatArray) -> bool:
        """Return whether the cage is proved; coarse grids, tried first, reject most that leak."""
        state = self._demand.state(points, QUICK, escapes=True)
        if state == "not certified":
            state = self._demand.state(points, THOROUGH)
        return state == "caged"

    def _clearances(self, body: Body, points: FloatArray) -> NDArray[np.float32]:
        fields = clearances(body, points, self._demand.radius, self._grid)
        fields[:, :, ~self._grid.domain] = -np.inf
        return fields

    def _leaks(self, k: int, chosen: list[int], width: float) -> bool:
        """Return whether there is a way out with more clearance than `width` all along."""
        free = self._fields[k][chosen].min(axis=0) > width
        return bool(component(free, self._seed)[:, self._grid.border].any())

    def _width(self, k: int, chosen: list[int], high: float | None = None) -> float:
        """Return the clearance of the widest way out, px; below 0 there is no way out."""
        reach = self._grid.side * 4
        low, high = -reach, reach if high is None else high
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if self._leaks(k, chosen, middle) else (low, middle)
        return high

    def _tightened(self, k: int, chosen: list[int], width: float) -> tuple[float, list[int]]:
        """Slide robots one by one for as long as the widest way out gets narrower.

        Returns:
            The clearance of the widest way out, px, and the stations chosen.
        """
        step = self._grid.side / 20
        for _ in range(SWEEPS):
            before = width
            for i in range(len(chosen)):
                for slide in SLIDES:
                    moved = chosen.copy()
                    moved[i] = (chosen[i] + slide) % len(self._rings[k])
                    if self._keeps_spacing(k, moved, i) and not self._leaks(k, moved, width - step):
                        chosen, width = moved, self._width(k, moved, width - step)
            if width == before:
                break
        return width, chosen

    def _keeps_spacing(self, k: int, chosen: list[int], i: int) -> bool:
        points = self._rings[k][chosen]
        away = np.linalg.norm(np.delete(points, i, axis=0) - points[i], axis=1)
        return bool(away.min() >= max(self._demand.spacing, 1e-9))


def _ring_stations(curve: Curve) -> FloatArray:
    """Return points evenly spaced along the pieces of a curve, (k, 2)."""
    pieces: list[FloatArray] = []
    for line in curve.lines:
        length = arc_length(line)
        count = max(round(STATIONS * length / curve.length), 2)
        pieces.append(interpolate(line, np.arange(count) * length / count))
    return np.concatenate(pieces)
