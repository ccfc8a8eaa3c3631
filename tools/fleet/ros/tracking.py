"""Velocities by which a robot with wheels drives to a point just ahead of it: it turns towards it,
then drives, and slows down as it comes near."""

import math

from ..wire.fleet import Point

SLOWING, TURNING = 2.0, 2.5
"""Speed for each metre that is left, and turn rate for each radian, per second."""
ASKEW = 0.1
"""A robot that looks so many radians past the point turns on the spot."""


def velocity(
    place: Point,
    heading: float,
    goal: Point,
    limits: tuple[float, float],
    near: float,
    look: float | None = None,
) -> Point:
    """Speed ahead and turn rate, per second; within `near` of the goal it drives no further.

    Args:
        heading: radians, about the x axis towards the y axis of the frame that all is in.
        limits: the greatest speed and turn rate.
        look: the heading that it turns to there; None for any.
    """
    dx, dy = goal[0] - place[0], goal[1] - place[1]
    left = math.hypot(dx, dy)
    speed, turn_speed = limits
    if left <= near:
        way, ahead = heading if look is None else look, 0.0
    else:
        way, ahead = math.atan2(dy, dx), min(SLOWING * left, speed)
    off = math.remainder(way - heading, math.tau)
    ahead *= max(1 - abs(off) / ASKEW, 0.0)
    return ahead, max(-turn_speed, min(TURNING * off, turn_speed))
