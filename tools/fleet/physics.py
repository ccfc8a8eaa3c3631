"""What simulated robots can do, and what goes wrong with them: the words of a fleet's file."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from ..formation.value import Value
from ..geometry.outline import FloatArray
from .moving import Above0, Pixels, Seconds, TargetMotion

RobotId = Annotated[
    str,
    BeforeValidator(lambda name: str(name) if type(name) is int else name),
    WithJsonSchema({"type": ["string", "integer"]}),
]


class Noise(Value):
    """Standard deviations.

    Attributes:
        actuation: of how far robots, or wheels, go in a step, as a share of it.
        sensing: of where robots are seen, px, along either axis.
    """

    actuation: float = Field(default=0.0, ge=0, le=0.5)
    sensing: float = Field(default=0.0, ge=0, le=100)


class Spell(Value):
    """When a robot is out of order: from when on, for how long; None for good."""

    robot: RobotId
    after: Seconds = 0.0
    lasting: Seconds | None = None


class Push(Value):
    """A robot is pushed by (x, y) px at a time."""

    robot: RobotId
    at: Seconds
    by: tuple[Pixels, Pixels]


class Physics(Value):
    """How robots move; times are seconds since the fleet was opened.

    Attributes:
        drive: point: any way at once; differential: two wheels, turning on the spot at corners.
        speed: greatest, of the robot or of a wheel, px per second.
        acceleration: likewise, px per second squared.
        radius: of a robot, and half the way between its wheels, px.
        slip: robots fall short of what is commanded by a share of their own, up to this.
        delay: of commands, seconds.
        drop_outs: share of poses that are lost.
        stuck: robots that do not move.
        lost: robots that are not seen.
        pushes: robots that something moves.
        targets: how things that robots follow move, by their ids.
    """

    drive: Literal["point", "differential"] = "point"
    speed: Above0
    acceleration: Above0
    radius: Above0 = 3.0
    noise: Noise = Noise()
    slip: float = Field(default=0.0, ge=0, le=0.9)
    delay: float = Field(default=0.0, ge=0, le=2)
    drop_outs: float = Field(default=0.0, ge=0, le=0.9)
    stuck: tuple[Spell, ...] = ()
    lost: tuple[Spell, ...] = ()
    pushes: tuple[Push, ...] = ()
    targets: dict[str, TargetMotion] = Field(default_factory=dict[str, TargetMotion])


def braking_speed(room: FloatArray, deceleration: float, step: float) -> FloatArray:
    """The greatest speed, (n,) px/s, from which a robot stops within its room exactly, in steps.

    Args:
        room: (n,) px.
        deceleration: px/s2.
        step: seconds.
    """
    change = deceleration * step
    unit = room / (change * step)
    whole = np.floor((np.sqrt(1 + 8 * unit) - 1) / 2)
    return np.asarray(change * (whole / 2 + unit / (whole + 1)))
