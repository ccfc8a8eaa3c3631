"""Draws a deployment frame by frame: where the robots are, and where they are going."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from ..fleet.deploy import ARRIVED_PX, ARRIVED_SHARE
from ..fleet.follow import Rigid
from ..formation.plan import Plan
from ..geometry.outline import FloatArray
from ..geometry.sampling import nearest
from ..perception.image import Picture
from ..world import World
from .canvas import (
    ALLOWED,
    CERTIFIED,
    FINDING,
    MUTED,
    PAPER,
    ROBOT,
    TARGET,
    WHITE,
    Canvas,
)
from .captions import (
    FOOTER,
    FOOTER_HEIGHT,
    LINE,
    PAD,
    TITLE,
    draw_bars,
    draw_footer,
    footer_middle,
    left_text,
    make_page,
)
from .marks import draw_idle_robots, draw_met, draw_outline, draw_robots, rings, robot_size
from .overlay import idle_robots

SIDE = 640
"""Longest side of a frame, page px."""
UNIT = 0.8 / SIDE
"""Unit of strokes and text, as a share of a frame's longest side."""
TITLE_LINES = 2
NARROWEST = 400.0
NUMBERED, TRAILED = 30, 400
"""The most robots that are drawn with numbers, and with trails."""
NUMBER_RADIUS = 8.0
TRAIL = 10
"""Length of a trail, in frames."""


def draw_deployment(
    picture: Picture,
    world: World,
    plan: Plan,
    frames: Sequence[FloatArray],
    title: str,
    *,
    moments: Sequence[int] | None = None,
    side: int = SIDE,
    moved: Sequence[Rigid] = (),
) -> list[Image.Image]:
    """Draw one picture per frame, all of the same size.

    Args:
        world: the world that the plan was made in.
        plan: the plan whose places are the goals.
        frames: (n, 2) each, px: the robots' positions over time, in the order of their places.
        title: usually the instruction.
        moments: indices of the frames to draw; all by default.
        side: longest side that a picture may have, px.
        moved: how the thing that the robots follow had moved, one for each of the last frames.

    Raises:
        ToolError: the plan names a target that the world does not have.
    """
    goals, unit = plan.formation.points, UNIT * side
    long = _photo_long_side(picture, side)
    canvas, lines = make_page(picture, long, unit, title, TITLE_LINES, NARROWEST)
    for name in plan.formation.contract.target_ids:
        draw_outline(canvas, world.outline(name))
    draw_met(canvas, world.met(plan.id).values())
    radius = robot_size(canvas, goals)
    _draw_goals(canvas, plan, radius)
    draw_idle_robots(canvas, idle_robots(world, plan), radius)
    draw_bars(canvas, lines)
    where: list[Rigid | None] = [*[None] * (len(frames) - len(moved)), *moved]
    made: list[Image.Image] = []
    for i in range(len(frames)) if moments is None else moments:
        page, rigid = canvas.copy(), where[i]
        if rigid is not None:
            outline = world.outline(rigid.sighting.id).polygon
            page.cased(rings(rigid.moved(outline)), TARGET, 2.6)
        places = goals if rigid is None else rigid.carried(goals)
        recent = frames[max(i - TRAIL, 0) : i + 1]
        made.append(_frame(page, recent, plan, places, radius, (i, len(frames))))
    return made


def _photo_long_side(picture: Picture, side: int) -> int:
    """Return the long side of the photograph, px, that keeps any page within `side`.

    The title may take up to its greatest number of lines.
    """
    bars = (TITLE_LINES * TITLE * LINE + 2 * PAD + FOOTER_HEIGHT) * UNIT * side + 2
    factor = min(side / picture.width, (side - bars) / picture.height)
    return int(factor * max(picture.size))


def _draw_goals(canvas: Canvas, plan: Plan, radius: float) -> None:
    goals = plan.formation.points
    for goal in goals:
        canvas.circle(goal, radius, WHITE, max(0.15 * radius, 0.7))
    if not _shows_numbers(len(goals), radius):
        return
    for robot, goal in zip(plan.formation.robot_of_place, canvas.at(goals), strict=True):
        canvas.text(goal, robot, 1.2 * radius, WHITE)


def _shows_numbers(count: int, radius: float) -> bool:
    return count <= NUMBERED and radius >= NUMBER_RADIUS


def _frame(
    canvas: Canvas,
    recent: Sequence[FloatArray],
    plan: Plan,
    places: FloatArray,
    radius: float,
    step: tuple[int, int],
) -> Image.Image:
    """Draw trails, robots and footer, and return the page; the last of `recent` is the present."""
    now = recent[-1]
    last = step[0] == step[1] - 1
    if not last and len(recent) > 1 and len(now) <= TRAILED:
        canvas.trails(np.stack(recent), ALLOWED, 0.5 * radius)
    robots = plan.formation.robot_of_place
    draw_robots(canvas, dict(zip(robots, now, strict=True)), radius)
    if _shows_numbers(len(now), radius):
        for robot, centre in zip(robots, canvas.at(now), strict=True):
            canvas.text(centre, robot, 1.25 * radius, WHITE, ROBOT)
    if last:
        _draw_end(canvas, now, places)
    else:
        _draw_progress(canvas, *step)
    return canvas.finish()


def _draw_progress(canvas: Canvas, index: int, count: int) -> None:
    """Draw the step's number and a progress bar in the footer."""
    y, pad = footer_middle(canvas), PAD * canvas.unit
    text = f"step {index + 1} of {count}"
    width = canvas.text_size(f"step {count} of {count}", FOOTER)[0]
    left_text(canvas, pad, y, text, FOOTER, MUTED)
    x0, x1 = 2 * pad + width, canvas.size[0] - pad
    x, half = x0 + (x1 - x0) * (index + 1) / count, 3 * canvas.unit
    canvas.box((x0, y - half, x1, y + half), MUTED, 3, 0.35)
    canvas.box((x0, y - half, x, y + half), PAPER, 3)


def _draw_end(canvas: Canvas, now: FloatArray, goals: FloatArray) -> None:
    """Write how many goals have a robot within the deployment's tolerance of arrival."""
    diagonal = float(np.hypot(*(canvas.source)))
    tolerance = max(ARRIVED_PX, ARRIVED_SHARE * diagonal)
    there = int((nearest(now, goals, 1)[0] <= tolerance).sum())
    noun = "robot" if len(goals) == 1 else "robots"
    if there == len(goals):
        draw_footer(canvas, "arrived", CERTIFIED, [f"{len(goals)} {noun} in place"])
    else:
        draw_footer(canvas, "not arrived", FINDING, [f"{there} of {len(goals)} {noun} in place"])
