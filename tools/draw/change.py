"""What an edit moves: arrows from the places of the plan before, and the robots that come or go."""

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
"""Robots that move less than that stay."""
SMALL_UNITS, SMALL_ROBOT = 300, 6.0
"""Long side of a small picture, in units of strokes, and the greatest radius of a robot, units:
strokes stay visible, texts would not."""


@dataclass(frozen=True)
class Moves:
    """How one plan differs from another, places (2,) px by robot.

    Attributes:
        moved: where a robot is in the plan before, and in the one after.
        joined: robots only of the plan after.
        left: robots only of the plan before.
    """

    moved: dict[str, tuple[FloatArray, FloatArray]]
    joined: dict[str, FloatArray]
    left: dict[str, FloatArray]


def moves_between(before: Plan | None, after: Plan) -> Moves:
    """Who moves from a plan to the next one; nobody where there was none before."""
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
    """Arrows to the places of robots that are drawn with a radius, units, over them afterwards.

    Robots that join have a green ring; where one has left is an empty circle.
    """
    reach = radius / canvas.page_length(1.0)
    width = max(float(np.clip(0.3 * radius, 1.2, 3.0)), 0.9 / canvas.unit)  # a pixel, nearly
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
    """Targets, robots and who moves, with no text, for a picture of few pixels.

    Args:
        room: its greatest width and height, px.
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
    """The shaft up to the rim of a disc at its end, and the two strokes of the head, px."""
    way = (new - old) / np.hypot(*(new - old))
    tip = new - 1.3 * reach * way
    across = np.array([-way[1], way[0]])
    head = [tip - 0.9 * reach * (way + side * 0.7 * across) for side in (-1, 1)]
    return [np.stack([old, tip]), np.stack([head[0], tip, head[1]])]
