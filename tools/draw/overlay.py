"""Pictures for people and models: a plan on its photograph, a look at a scene, a deployment.

Only drawing: every position, outline and verdict comes from elsewhere. Photographs of any size
come out at about the same size, so that strokes and text always read.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..formation.place import Site
from ..formation.plan import Plan
from ..formation.verdict import Verdict
from ..geometry.outline import FloatArray
from ..perception.attributes import Candidate
from ..perception.image import Picture
from ..scene import Box, Scene
from .canvas import CERTIFIED, FINDING, INK, PAPER, Canvas, Colour, Labels, Margins
from .marks import (
    directions,
    draw_areas,
    draw_guides,
    draw_outline,
    draw_robots,
    label_openings,
    number_robots,
    robot_size,
    target_room,
)
from .numbered import colours_of, draw_numbered
from .page import draw_bars, draw_footer, make_page
from .text import drawable

LEAST_LONG, MOST_LONG = 1200, 1500
"""The photograph's long side on the page, page px."""
UNITS = 1200
"""The long side in units of strokes and text."""
NARROWEST = 700.0
TITLE_LINES = 3
TAG = 16.0
RULER_TEXT, RULER_LABELS = 15.0, 16
RULER: Margins = (52, 30, 52, 30)
"""Room for the rulers, units of the page."""
MEASURES = (
    ("min_clearance_px", "clearance {:.1f} px"),
    ("widest_opening_px", "widest opening {:.1f} px"),
    ("worst_gap_px", "widest gap {:.1f} px"),
    ("max_from_corner_px", "{:.1f} px from corners at most"),
    ("max_from_centre_px", "{:.1f} px from the centre at most"),
    ("spacing_ratio", "spacing ratio {:.2f}"),
    ("min_spacing_px", "closest pair {:.1f} px"),
)
"""What the footer tells: of those measured the first three."""
NEAR = 2.0
"""Robots more than so many long sides of the picture away are not led lines to."""


def draw_plan(scene: Scene, plan: Plan, title: str) -> Image.Image:
    """The photograph with the contract, the robots and the verdict.

    Areas where robots' centres may stand are tinted; what a ring leaves open, a side, a line
    and the ways to corners are dashed. Robots with a finding are red with a cross.

    Args:
        scene: what the plan was made in.
        plan: certified or not; robots at no finite place are left out.
        title: usually the instruction; in any language, of any length.

    Returns:
        RGB, the photograph's long side 1200 to 1500 px, with a title above and a footer below.

    Raises:
        ToolError: the plan names a target that the scene does not have.
    """
    contract, points = plan.formation.contract, plan.formation.points
    site = scene.site(contract)
    long = _long(scene.picture)
    page = make_page(scene.picture, long, long / UNITS, title, TITLE_LINES, NARROWEST)
    canvas = page.canvas
    draw_areas(canvas, contract, site, points)
    drivable = len(points) == contract.robots and _near(points, site).all()
    if drivable:
        draw_guides(canvas, contract, site, points)
    labels = Labels(canvas.photo)
    _draw_robots(canvas, plan, site, labels)
    if drivable:
        label_openings(canvas, contract, site, points, labels)
    draw_bars(page)
    draw_footer(canvas, *_verdict_badge(plan.verdict), _facts(plan))
    return canvas.finish()


def draw_look(
    scene: Scene,
    *,
    plan: Plan | None = None,
    candidates: Sequence[Candidate] = (),
    rulers: bool = True,
) -> Image.Image:
    """The photograph as a model is shown it, with what coordinates and ids can be read from.

    Args:
        scene: its targets are outlined and tagged with their ids.
        plan: its robots are drawn.
        candidates: outlined and numbered, 3 for c3.
        rulers: whether all four edges bear rulers in image pixels.

    Returns:
        RGB, the photograph's long side 1200 to 1500 px.

    Raises:
        ToolError: the plan names a target that the scene does not have.
    """
    long = _long(scene.picture)
    unit = long / UNITS
    left, top, right, bottom = (round(m * unit) if rulers else 0 for m in RULER)
    canvas = Canvas(scene.picture, long, unit, (left, top, right, bottom))
    labels = Labels(canvas.photo)
    count = len(scene.targets)
    colours = colours_of([thing.outline for thing in (*scene.targets, *candidates)])
    for target, colour in zip(scene.targets, colours[:count], strict=True):
        draw_outline(canvas, target.outline, colour)
    if plan is not None:
        _draw_robots(canvas, plan, scene.site(plan.formation.contract), labels)
    draw_numbered(canvas, candidates, colours[count:], labels)
    for target, colour in zip(scene.targets, colours[:count], strict=True):
        _draw_tag(canvas, target.id, target.box, colour, labels)
    if rulers:
        _draw_rulers(canvas)
    return canvas.finish()


def _long(picture: Picture) -> int:
    return min(max(*picture.size, LEAST_LONG), MOST_LONG)


def _near(points: FloatArray, site: Site) -> NDArray[np.bool_]:
    """Which points are in the picture or not absurdly far from it, (n,)."""
    # NaN compares false.
    return np.all(np.abs(points) <= NEAR * max(site.room), axis=1)


def _draw_robots(canvas: Canvas, plan: Plan, site: Site, labels: Labels) -> None:
    """Discs and numbers; the labels learn where they are."""
    contract, points = plan.formation.contract, plan.formation.points
    near = _near(points, site)
    if not near.any():
        return
    shown = {int(i) + 1: points[i] for i in np.flatnonzero(near)}
    flagged = {f.robot for f in plan.verdict.findings if f.robot is not None}
    room = target_room(contract, site, points) if near.all() else np.inf
    sound = near & ~np.isin(np.arange(1, len(points) + 1), list(flagged))
    radius = robot_size(canvas, points[sound if sound.any() else near], room)
    for point in shown.values() if contract.robot_radius > 0 else ():
        canvas.body(point, contract.robot_radius)
    draw_robots(canvas, shown, radius, flagged)
    away = directions(contract, site, points)
    number_robots(canvas, shown, radius, labels, away, flagged)


def _verdict_badge(verdict: Verdict) -> tuple[str, Colour]:
    if verdict.certified:
        return "certified", CERTIFIED
    count = len(verdict.findings)
    return f"NOT certified: {count} finding{'s' * (count != 1)}", FINDING


def _facts(plan: Plan) -> list[str]:
    """Plan id, robots and what was measured, most important first."""
    measured = plan.verdict.measures
    count = len(plan.formation.positions)
    told = [form.format(measured[key]) for key, form in MEASURES if key in measured]
    if "widest_opening_px" in measured:
        told = [fact for fact in told if not fact.startswith("widest gap")]
    return [plan.id, f"{count} robot{'s' * (count != 1)}", *told[:3]]


def _draw_tag(canvas: Canvas, name: str, box: Box, colour: Colour, labels: Labels) -> None:
    """An id at the upper left of what it names."""
    text = canvas.shortened(drawable(name), TAG, canvas.size[0] / 3)
    anchor = canvas.at(np.array([box[:2]]))[0]
    size = canvas.chip_size(text, TAG)
    where = labels.place(anchor, size, np.array([0.5, -1.0]), 3 * canvas.unit)
    canvas.chip(where, text, TAG, INK, colour)


def _draw_rulers(canvas: Canvas) -> None:
    """Ticks on all four edges at round pixels of the photograph, with their numbers."""
    x0, y0, x1, y1 = canvas.photo
    width, height = canvas.size
    for box in ((0, 0, width, y0), (0, y1, width, height), (0, y0, x0, y1), (x1, y0, width, y1)):
        canvas.box(box, PAPER)
    for axis in (0, 1):
        step = _ruler_step(canvas, axis)
        for value in range(0, canvas.source[axis], max(step // 5, 1)):
            _draw_tick(canvas, axis, value, labelled=value % step == 0)


def _draw_tick(canvas: Canvas, axis: int, value: int, *, labelled: bool) -> None:
    """One tick of the rulers for x (axis 0) or y (axis 1) on both edges."""
    unit = canvas.unit
    along = float(canvas.at(np.full((1, 2), float(value)))[0, axis]) + 0.5
    reach, half = (8 if labelled else 4) * unit, 0.75 * unit
    middle = (RULER[1] / 2 + 3 if axis == 0 else RULER[0] / 2 + 3) * unit
    near, far = canvas.photo[1 - axis], canvas.photo[3 - axis]
    for edge, out in ((near, -1), (far, 1)):
        low, high = sorted((edge, edge + out * reach))
        tick = (along - half, low, along + half, high)
        canvas.box(tick if axis == 0 else (tick[1], tick[0], tick[3], tick[2]), INK)
        if labelled:
            where = np.array([along - 0.5, edge + out * middle])
            canvas.text(where if axis == 0 else where[::-1], str(value), RULER_TEXT, INK)


def _ruler_step(canvas: Canvas, axis: int) -> int:
    """The smallest of 1, 2, 5, 10, 20, ... px whose labels are neither too many nor too tight."""
    count = canvas.source[axis]
    widest = canvas.text_size(f"{count}0", RULER_TEXT)[axis]
    for power in range(6):
        for lead in (1, 2, 5):
            step = lead * 10**power
            if count <= RULER_LABELS * step and step * canvas.scale[axis] >= 1.2 * widest:
                return step
    return 10**6
