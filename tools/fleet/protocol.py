"""What a fleet is: robots with ids that can be observed, driven and stopped.

A package adds one by an entry point of the group `formup.fleets` that names a `FleetFactory`;
`conformance` holds the checks that every fleet has to pass. Frame: image pixels, x right, y down.
"""

from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..errors import FleetError
from ..formation.contract import Contract
from ..geometry.outline import FloatArray, Outline
from ..geometry.sampling import min_spacing
from ..motion.motion import Motion


class FleetStoppedError(FleetError):
    """The stop is in force: nothing is driven until a person releases it."""


class FleetBusyError(FleetError):
    """Another deployment, or another drive, is using the fleet."""


class FleetClosedError(FleetError):
    """The fleet was closed before."""


class FleetUnreachableError(FleetError):
    """What connects the fleet is gone: robots are neither told nor seen anything."""


class FleetSizeError(FleetError):
    """The fleet has, or can drive, another number of robots than is needed."""


class RobotsFailedError(FleetError):
    """Some robots are not there, or cannot do what they are sent to do.

    Attributes:
        ids: of these robots.
    """

    def __init__(self, sentence: str, ids: Sequence[str]) -> None:
        super().__init__(sentence)
        self.ids = tuple(ids)


class StalePosesError(RobotsFailedError):
    """Robots were not seen recently enough."""


class PlaceTakenError(RobotsFailedError):
    """Robots that have no place in a plan stand where another one is to stand."""


@dataclass(frozen=True)
class Pose:
    """Where a robot was seen.

    Attributes:
        id: the fleet's name for the robot; never changes.
        x, y: image pixels.
        heading: radians, clockwise from the x axis as seen in the picture; None if not known.
        seen: when, seconds on the fleet's clock, which never goes back.
    """

    id: str
    x: float
    y: float
    heading: float | None = None
    seen: float = 0.0


class Fleet(Protocol):
    """Robots that can be observed, driven and stopped; any failure is a `FleetError`."""

    @property
    def name(self) -> str:
        """What the fleet is called in messages and on the command line."""
        ...

    @property
    def real(self) -> bool:
        """Whether a person must approve each plan before anything moves."""
        ...

    @property
    def radius(self) -> float:
        """Of a robot, px, above 0."""
        ...

    @property
    def speed(self) -> float:
        """The greatest of a robot, px per second of the fleet's clock."""
        ...

    @property
    def tracking_error(self) -> float:
        """How far a robot that nothing pushes may come off its path, px."""
        ...

    @property
    def turns(self) -> bool:
        """Whether its robots can be sent to a heading, which their poses then have."""
        ...

    @property
    def stopped(self) -> bool:
        """Whether the stop is in force."""
        ...

    async def observe(self, *, max_age: float | None = None) -> tuple[Pose, ...]:
        """Where all robots were last seen, in an order that does not change.

        Raises:
            StalePosesError: a pose is older than max_age seconds (see `check_ages`).
        """
        ...

    def drive(self, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Drive, and yield the poses of all robots as they go, as they are really seen.

        Ends when the robots have come to the ends of their paths. Closing the generator, or
        cancelling the task that awaits it, stops the robots where they are, without latching.
        However it ends, all robots stand.

        Raises:
            FleetStoppedError: the stop is in force, or came on the way, even if released since.
            FleetBusyError: another drive has not ended.
            RobotsFailedError: robots that do not exist, or that cannot go on.
        """
        ...

    async def stop(self) -> None:
        """Hold all robots where they are within one control period, until `release`."""
        ...

    async def release(self) -> None:
        """Lift the stop; only ever at a person's command."""
        ...

    async def close(self) -> None:
        """Hold all robots and let go of them; more often than once is no harm."""
        ...


@dataclass(frozen=True)
class Sighting:
    """Where a thing is seen now: turned about the centre of its outline in the picture, then moved.

    Attributes:
        id: of the target.
        dx, dy: how far it has moved, px.
        turn: radians, clockwise as seen in the picture.
        seen: when, seconds on the fleet's clock.
    """

    id: str
    dx: float
    dy: float
    turn: float = 0.0
    seen: float = 0.0


Places = Mapping[str, tuple[float, float, float, float]]
"""Where each robot is to be now, x and y px, and its velocity there, px per second."""


@runtime_checkable
class Tracker(Protocol):
    """What a fleet has beside `Fleet` that can keep up with a thing it sees moving."""

    async def sightings(self) -> tuple[Sighting, ...]:
        """Where things are seen now; none of those that it cannot see."""
        ...

    def accompany(self, places: Callable[[], Places]) -> AsyncGenerator[tuple[Pose, ...], None]:
        """Keep robots at places that move, and yield the poses of all robots every period.

        Its ends, errors and stops are those of `Fleet.drive`, but that it goes on until closed.

        Args:
            places: is asked every period; robots are driven at the velocity of their places, and
                back onto them.
        """
        ...


@runtime_checkable
class Watcher(Protocol):
    """What a `Tracker` has beside that has to be told what to look out for."""

    def watch(self, picture: NDArray[np.uint8], things: Mapping[str, Outline]) -> None:
        """Look out for things from now on, and for no others.

        Args:
            picture: (H, W, 3) BGR, in which they have their outlines.
            things: by the ids of their targets.
        """
        ...


@dataclass(frozen=True)
class FleetRequest:
    """What is known when a fleet is opened; a fleet uses what applies to it.

    Attributes:
        size: width and height of the picture, px.
        robots: the least number wanted.
        known: poses as last observed; a simulator starts there.
        driven: whether the known robots have ever been driven; if not, a simulator may set down
            anew those that stand on something solid.
        starts: (n, 2) where a person wants robots to start, px; None to leave it to the fleet.
        solid: what robots may not be set down on.
        radius: of a robot, px; 0 where nobody said.
        seed: of everything random.
        config: a file that describes the fleet, where one was given.
    """

    size: tuple[float, float]
    robots: int
    known: tuple[Pose, ...] = ()
    driven: bool = False
    starts: FloatArray | None = None
    solid: BaseGeometry = field(default_factory=Polygon)
    radius: float = 0.0
    seed: int = 0
    config: Path | None = None


FleetFactory = Callable[[FleetRequest], Fleet]


SLACK = 0.98
"""Share of half the way between a plan's nearest places that a body takes up at most."""


def body_radius(fleet: Fleet, contract: Contract, places: FloatArray) -> float:
    """The radius of a robot that all of its motion reckons with, px.

    That which the contract states, or the fleet's, which for simulated robots that nobody has
    given one is no more than the places, (n, 2) px, leave room for.
    """
    if contract.robot_radius or fleet.real:
        return max(contract.robot_radius, fleet.radius)
    return min(fleet.radius, SLACK * min_spacing(places) / 2)


def points_of(poses: Sequence[Pose]) -> FloatArray:
    """Positions, (n, 2) px."""
    return np.array([(pose.x, pose.y) for pose in poses], dtype=float).reshape(-1, 2)


def check_ages(poses: Sequence[Pose], now: float, max_age: float | None) -> None:
    """Refuse poses that were seen too long ago; for use in `observe`.

    Args:
        poses: as last seen.
        now: on the fleet's clock, seconds.
        max_age: seconds; None allows any age.

    Raises:
        StalePosesError: naming the robots.
    """
    if max_age is None:
        return
    old = {pose.id: now - pose.seen for pose in poses if now - pose.seen > max_age}
    if old:
        raise StalePosesError(
            f"Robot {', '.join(old)} not seen for {max(old.values()):.1f} s; poses may be at most "
            f"{max_age:g} s old. Nothing is driven on them; check the connection or the camera.",
            tuple(old),
        )
