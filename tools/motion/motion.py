"""What robots are to drive: a path for each, when it is where, and who passes where first.

Robots that keep to the order of passage never touch, however late any of them is: this is the
action dependency graph of Hoenig et al. (2019) with arc lengths for vertices. Frame: image pixels.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from ..geometry.outline import FloatArray

Indices = NDArray[np.intp]


def _none() -> Indices:
    return np.empty(0, dtype=np.intp)


@dataclass(frozen=True)
class Passages:
    """Who waits for whom: g rows, in the order of `waiting` and then of `at`.

    Attributes:
        waiting: (g,) the robot that waits, as its index among the paths of a motion.
        at: (g,) arc length along its path where it waits, px.
        first: (g,) the robot that it waits for, likewise.
        past: (g,) arc length along that robot's path, px, which that one has to reach first.
    """

    waiting: Indices = field(default_factory=_none)
    at: FloatArray = field(default_factory=lambda: np.empty(0))
    first: Indices = field(default_factory=_none)
    past: FloatArray = field(default_factory=lambda: np.empty(0))

    def __len__(self) -> int:
        return len(self.waiting)


@dataclass(frozen=True)
class Motion:
    """What robots are to drive.

    Attributes:
        paths: polyline, (k, 2) px with k >= 2, by robot id; it begins where the robot stands.
            Robots that are not in it stay where they are.
        headings: which way robots look at the end, radians clockwise from the x axis, by id;
            only for a fleet that turns.
        times: (k,) when a robot is at each vertex of its path if nothing delays it, seconds from
            the start, by id; where it waits a vertex comes twice. Empty where nobody planned it.
        passages: the order in which robots pass each other; to be kept, whatever the time.
    """

    paths: Mapping[str, FloatArray]
    headings: Mapping[str, float] = field(default_factory=dict[str, float])
    times: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    passages: Passages = field(default_factory=Passages)

    @property
    def makespan(self) -> float:
        """Seconds until the last robot arrives if nothing delays any."""
        return max((float(times[-1]) for times in self.times.values()), default=0.0)


def as_line(path: FloatArray) -> BaseGeometry:
    """Return a polyline, (k, 2), as a line, or as a point if it lacks the length of a line."""
    return LineString(path) if (path != path[0]).any() else Point(path[0])


def arc_lengths(path: FloatArray) -> FloatArray:
    """Return how far along a polyline, (k, 2), each of its vertices is, (k,), px."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
