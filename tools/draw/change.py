"""Draws what an edit moves: arrows from the old places, and the robots that come or go."""

from dataclasses import dataclass

import numpy as np
from PIL import Image

from ..formation.plan import Plan
from ..geometry.outline import FloatArray
from ..perception.image import Picture
from ..world import World
from .canvas import CERTIFIED, IDLE, PAPER, Canvas
from .marks import draw_outline, draw_robots, robot_size

MOVED_PX = 0.5
"""Robots that move no further than this count as staying, px."""
SMALL_UNITS, SMALL_ROBOT = 300, 6.0
"""Long side of a small picture and the greatest radius of a robot on it, both in units.

Strokes stay visible at this size; text would not."""


@dataclass(frozen=True)
class Moves:
    """How two plans differ; all places are (2,) px, by robot id.

    Attributes:
        moved: a robot's place in the earlier plan, and in the later one.
        joined: robots that only the later plan has.
        left: robots that only the earlier plan has.
    """

    moved: dict[str, tuple[FloatArray, FloatArray]]
    joined: dict[str, FloatArray]
    left: dict[str, FloatArray]


def moves_between(before: Plan | None, after: Plan) -> Moves:
    """Return which robots move from one plan to the next; none if there is no earlier plan."""
    if before is None:
        return Moves({}, {}, {})
    old, new = _places(before), _places(after)
    pairs = {robot: (old[robot], new[robot]) for robot in new if robot in old}
    return Moves(
        {r: pair for r, pair in pairs.items() if np.hypot(*(pair[1] - pair[0])) > MOVED_PX},
        {robot: place for robot, place in new.items() if robot not in old},
        {robot: place for robot, place in old.items() if robot not in new},
    )


def draw_moves(canvas: Canvas, moves: Moves, radius: float) -> None:
    """Draw an arrow to each robot's new place; call this before drawing the robots.

    Robots that join get a green ring; where one has left, there is an empty circle. `radius` is
    the one the robots are drawn with, units.
    """
    reach = radius / canvas.page_length(1.0)
    width = max(float(np.clip(0.3 * radius, 1.2, 3.0)), 0.9 / canvas.unit)  # nearly a pixel
    for old, new in moves.moved.values():
        canvas.circle(old, 0.35 * radius, PAPER, width / 2)
        if np.hypot(*(new - old)) > reach:
            canvas.cased(_arrow(old, new, reach), PAPER, width)
    for place in moves.joined.values():
        canvas.circle(place, 1.7 * radius, CERTIFIED, width)
    for place in moves.left.values():
        canvas.circle(place, radius, IDLE, width)


def draw_small(
    picture: Picture,
    world: World,
    plan: Plan | None,
    before: Plan | None,
    room: tuple[int, int],
) -> Image.Image:
    """Draw targets, robots and their moves, without text, as a small picture.

    Args:
        plan: the plan to draw; None draws the targets alone.
        before: the plan that arrows start from, if any.
        room: the picture's greatest width and height, px.
    """
    factor = min(room[0] / picture.width, room[1] / picture.height)
    long = max(int(factor * max(picture.size)), 1)
    canvas = Canvas(picture, long, long / SMALL_UNITS)
    for target in world.targets:
        draw_outline(canvas, target.outline)
    if plan is not None and np.isfinite(plan.formation.points).all():
        radius = min(robot_size(canvas, plan.formation.points), SMALL_ROBOT)
        draw_moves(canvas, moves_between(before, plan), radius)
        draw_robots(canvas, _places(plan), radius)
    return canvas.finish()


def _places(plan: Plan) -> dict[str, FloatArray]:
    formation = plan.formation
    return dict(zip(formation.robot_of_place, formation.points, strict=True))


def _arrow(old: FloatArray, new: FloatArray, reach: float) -> list[FloatArray]:
    """Return the polylines of an arrow, px: its shaft and its head.

    It stops short of `new` by 1.3 times `reach`, the radius of the disc there.
    """
    way = (new - old) / np.hypot(*(new - old))
    tip = new - 1.3 * reach * way
    across = np.array([-way[1], way[0]])
    head = [tip - 0.9 * reach * (way + side * 0.7 * across) for side in (-1, 1)]
    return [np.stack([old, tip]), np.stack([head[0], tip, head[1]])]
