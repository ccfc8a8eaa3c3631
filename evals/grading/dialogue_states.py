"""The state after a turn of a dialogue, and a turn with all that it is judged by.

Robots are named by their ids, things t1, t2, ... in the order in which they were pointed at.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry import Polygon

from ...agent.report import Status
from ...tools.geometry.outline import FloatArray
from ..tasks.task import Dialogue, Thing

UNMOVED = 1.0
"""A robot this near to where it was, px, has not moved."""


@dataclass(frozen=True)
class State:
    """The state after a turn.

    Attributes:
        robots: their ids.
        positions: of each, (n, 2) px.
        headings: degrees clockwise from the right, None for any; empty if there are none.
        observed: where robots were seen after a motion in this turn, (n, 2) px; None for no motion.
        kept_off: outlines no robot may enter.
    """

    status: Status
    message: str = ""
    plan_id: str | None = None
    parent: str | None = None
    robots: tuple[str, ...] = ()
    positions: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    headings: tuple[float | None, ...] = ()
    certified: bool = False
    observed: FloatArray | None = None
    kept_off: tuple[Polygon, ...] = ()

    @cached_property
    def at(self) -> dict[str, FloatArray]:
        """The position of each robot by its id."""
        return dict(zip(self.robots, self.positions, strict=True))


NOTHING = State("answered")
"""The state before anything was said."""


@dataclass(frozen=True)
class Case:
    """A turn with all it is judged by.

    Attributes:
        past: the state before the first turn and after each one before this.
        after: the state after this turn.
        scale: metres per pixel; None if not known.
    """

    past: Sequence[State]
    after: State
    things: Mapping[str, Thing]
    size: tuple[int, int]
    scale: float | None = None

    @property
    def before(self) -> State:
        """The state the turn began with."""
        return self.past[-1]

    @cached_property
    def remaining(self) -> list[str]:
        """Ids of robots that were there before and still are."""
        return [name for name in self.before.robots if name in self.after.at]

    def moved(self, name: str) -> FloatArray:
        """Return how far a robot has moved, (2,) px."""
        return self.after.at[name] - self.before.at[name]

    def owners(self, state: State) -> dict[str, list[str]]:
        """Return the robots nearest to each thing by its id; things with none are left out."""
        far = np.stack([distances_to(t, state.positions) for t in self.things.values()])
        found: dict[str, list[str]] = {name: [] for name in self.things}
        for robot, thing in zip(state.robots, far.argmin(axis=0), strict=True):
            found[list(self.things)[thing]].append(robot)
        return {name: robots for name, robots in found.items() if robots}

    def distances(self, state: State) -> FloatArray:
        """Return how far each robot is from the thing nearest to it, (n,) px; 0 inside."""
        return np.stack([distances_to(t, state.positions) for t in self.things.values()]).min(0)

    def rings(self) -> Iterator[tuple[Thing, FloatArray]]:
        """Yield each thing with the positions of the robots nearest to it."""
        for name, robots in self.owners(self.after).items():
            yield self.things[name], np.array([self.after.at[robot] for robot in robots])


def case_of(
    dialogue: Dialogue, past: Sequence[State], after: State, scale: float | None = None
) -> Case:
    """Return a turn of a dialogue with all it is judged by."""
    things = {f"t{i}": thing for i, thing in enumerate(dialogue.things, start=1)}
    return Case(past, after, things, dialogue.size, scale)


def same_places(a: State, b: State) -> bool:
    """Return whether the same robots stand in the same places in both states."""
    return set(a.robots) == set(b.robots) and all(
        float(np.linalg.norm(a.at[name] - b.at[name])) <= UNMOVED for name in a.robots
    )


def distances_to(thing: Thing, points: FloatArray) -> FloatArray:
    """Return how far points are from what a thing covers, (n,) px; 0 inside."""
    return np.asarray(shapely.distance(thing.region, shapely.points(points)), dtype=float)
