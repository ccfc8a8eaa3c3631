"""How things move in the simulator, and where they are by then: the `targets` of a fleet's file."""

import math
from collections.abc import Mapping
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from ..formation.value import Value
from ..motion.motion import arc_lengths

Seconds = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Pixels = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Above0 = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
SLIDE = 1.0
"""Seconds in which a thing that was pushed comes to a stand."""
WANDER = 1.5
"""Radians that the way of a random walk turns by in a second, standard deviation."""


class Shove(Value):
    """A thing is pushed at a time, and slides on by (x, y) px."""

    at: Seconds
    by: tuple[Pixels, Pixels]


class TargetMotion(Value):
    """How a thing moves from when robots begin to follow it; what is given adds up.

    Attributes:
        path: (x, y) px, the first of which is where it is.
        speed: along the path, px per second.
        walk: speed of a random walk, px per second.
        turn: about its middle, degrees per second, clockwise.
        pushed: when, and how far.
    """

    path: tuple[tuple[Pixels, Pixels], ...] = Field(default=(), max_length=10_000)
    speed: Above0 | None = None
    walk: Above0 | None = None
    turn: float = Field(default=0.0, ge=-360, le=360)
    pushed: tuple[Shove, ...] = ()

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.speed is None) == bool(self.path) or len(self.path) == 1:
            raise ValueError("a path takes two points or more and a speed, a speed takes a path")
        return self

    def at(self, seconds: float) -> tuple[float, float]:
        """How far it has come by then but for a walk, px."""
        x, y = 0.0, 0.0
        if self.path and self.speed:
            path = np.asarray(self.path)
            gone, along = self.speed * seconds, arc_lengths(path)
            x, y = (float(np.interp(gone, along, path[:, k]) - path[0, k]) for k in (0, 1))
        for push in self.pushed:
            since = min(max(seconds - push.at, 0.0) / SLIDE, 1.0)
            share = since * (2 - since)
            x, y = x + share * push.by[0], y + share * push.by[1]
        return x, y


class MovingTargets:
    """Things on the plane, from step to step."""

    def __init__(self, motions: Mapping[str, TargetMotion], seed: int) -> None:
        self._motions, self._random, self._time = motions, np.random.default_rng(seed), 0.0
        self._ways = dict.fromkeys(motions, math.nan)
        self._walked = dict.fromkeys(motions, (0.0, 0.0))

    def step(self, seconds: float) -> None:
        """Let time pass."""
        self._time += seconds
        for name, motion in self._motions.items():
            if motion.walk is None:
                continue
            way, (x, y) = self._ways[name], self._walked[name]
            if math.isnan(way):
                way = self._random.uniform(0, 2 * math.pi)
            way += WANDER * math.sqrt(seconds) * self._random.standard_normal()
            step = motion.walk * seconds
            self._ways[name] = way
            self._walked[name] = x + step * math.cos(way), y + step * math.sin(way)

    def where(self) -> dict[str, tuple[float, float, float]]:
        """By how much each has moved, px, and turned, radians."""
        found: dict[str, tuple[float, float, float]] = {}
        for name, motion in self._motions.items():
            (x, y), (walked_x, walked_y) = motion.at(self._time), self._walked[name]
            turned = math.radians(motion.turn * self._time)
            found[name] = x + walked_x, y + walked_y, turned
        return found
