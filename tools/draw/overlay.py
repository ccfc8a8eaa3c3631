"""Pictures for people and models: a plan on its photograph, and a look at a scene.

This module only draws: every position, outline and verdict comes from elsewhere. Photographs of
any size come out at about the same size, so that strokes and text are always legible.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..formation.placement.place import Site
from ..formation.plan import Plan
from ..formation.units import length_text
from ..geometry.outline import FloatArray
from ..perception.image import Picture
from ..perception.referring.attributes import Candidate
from ..perception.target_prompt import Box
from ..world import World
from .canvas import CERTIFIED, FINDING, INK, MET, PARTIAL, Canvas, Colour, Labels
from .captions import draw_bars, draw_footer, make_page
from .change import draw_moves, moves_between
from .escape_path import draw_escape
from .marks import (
    draw_areas,
    draw_guides,
    draw_headings,
    draw_idle_robots,
    draw_met,
    draw_outline,
    draw_robots,
    draw_ways,
    label_openings,
    number_robots,
    outward_vectors,
    robot_size,
    target_room,
)
from .numbered import colours_of, draw_numbered
from .rulers import RULER, draw_rulers
from .scale_bar import draw_scale_bar
from .text import drawable

LEAST_LONG, MOST_LONG = 1200, 1500
"""Least and greatest length of the photograph's long side on the page, page px."""
UNITS = 1200
"""Length of the long side in units of strokes and text."""
NARROWEST = 700.0
TITLE_LINES = 3
TAG = 16.0
MEASURES = (
    ("min_clearance_px", "clearance {}"),
    ("widest_opening_px", "widest opening {}"),
    ("worst_gap_px", "widest gap {}"),
    ("max_from_corner_px", "{} from corners at most"),
    ("max_from_centre_px", "{} from the centre at most"),
    ("spacing_ratio", "spacing ratio {:.2f}"),
    ("min_spacing_px", "closest pair {}"),
)
"""Measures in the footer, most important first; it shows at most three facts."""
CAGED = {
    "certified": "cannot get out",
    "not certified": "may get out",
    "gets out": "can get out",
}
NO_WAYS: Mapping[str, FloatArray] = MappingProxyType({})
NEAR = 2.0
"""Robots are not drawn if a coordinate exceeds this many long sides of the picture."""


def draw_plan(
    picture: Picture,
    world: World,
    plan: Plan,
    title: str,
    before: Plan | None = None,
    ways: Mapping[str, FloatArray] = NO_WAYS,
) -> Image.Image:
    """Draw the photograph with the contract, the robots and the verdict.

    Areas where robots' centres may stand are tinted; other things that robots stand on, or drive
    over or far around, are orange, and so are rings around the robots that stand on them or at the
    picture's border. The curves that robots stand along are dashed, see `draw_guides`; thin lines
    lead from circles where robots start. Robots with a finding are red with a cross. If a target
    was found to get out of a cage, its path is shown. A known scale adds metres and a scale bar.

    Args:
        world: the world that the plan was made in.
        plan: certified or not; robots at no finite place, or far outside the picture, are left out.
        title: usually the instruction; in any language, of any length.
        before: the plan that an edit made this one from; arrows show which robots move.
        ways: (k, 2) px by robot, how they are to get there.

    Returns:
        RGB, the photograph's long side 1200 to 1500 px, with a title above and a footer below.

    Raises:
        ToolError: the plan names a target that the world does not have.
    """
    contract, points = plan.formation.contract, plan.formation.points
    site = world.site(contract)
    long = _long(picture)
    canvas, lines = make_page(picture, long, long / UNITS, title, TITLE_LINES, NARROWEST)
    draw_areas(canvas, contract, site, points)
    drivable = len(points) == contract.robots and _near_picture(points, site).all()
    if drivable:
        draw_guides(canvas, contract, site, points)
    if plan.verdict.escape is not None:
        draw_escape(canvas, plan.verdict.escape, site)
    labels, met = Labels(canvas.photo), world.met(plan.id)
    draw_met(canvas, met.values())
    draw_ways(canvas, ways.values())
    _draw_robots(canvas, world, plan, labels, before)
    for name, outline in met.items():
        _draw_tag(canvas, name, outline.bounds, MET, labels)
    if drivable:
        label_openings(canvas, contract, site, points, labels)
    draw_bars(canvas, lines)
    _draw_verdict(canvas, plan, world.metres_per_pixel)
    return canvas.finish()


def draw_look(
    picture: Picture, world: World, *, candidates: Sequence[Candidate] = ()
) -> Image.Image:
    """Draw the photograph so that coordinates and ids can be read from it.

    Args:
        world: the world whose targets are outlined and tagged with their ids.
        candidates: outlined and numbered, 3 for c3.

    Returns:
        RGB, the photograph's long side 1200 to 1500 px, with rulers in image pixels on all edges.
    """
    long = _long(picture)
    unit = long / UNITS
    left, top, right, bottom = (round(m * unit) for m in RULER)
    canvas = Canvas(picture, long, unit, (left, top, right, bottom))
    draw_world(canvas, world, None, candidates)
    draw_rulers(canvas)
    return canvas.finish()


def draw_world(
    canvas: Canvas, world: World, plan: Plan | None, candidates: Sequence[Candidate]
) -> None:
    """Draw targets with their ids, a plan's robots and numbered candidates on a photograph."""
    labels = Labels(canvas.photo)
    count = len(world.targets)
    colours = colours_of([thing.outline for thing in (*world.targets, *candidates)])
    for target, colour in zip(world.targets, colours[:count], strict=True):
        draw_outline(canvas, target.outline, colour)
    if plan is not None:
        _draw_robots(canvas, world, plan, labels)
    draw_numbered(canvas, candidates, colours[count:], labels)
    for target, colour in zip(world.targets, colours[:count], strict=True):
        _draw_tag(canvas, target.id, target.box, colour, labels)


def _long(picture: Picture) -> int:
    return min(max(*picture.size, LEAST_LONG), MOST_LONG)


def _near_picture(points: FloatArray, site: Site) -> NDArray[np.bool_]:
    """Return a mask (n,) of the points inside the picture or not absurdly far from it."""
    # NaN compares false, so points that are not finite are left out.
    return np.all(np.abs(points) <= NEAR * max(site.room), axis=1)


def _draw_robots(
    canvas: Canvas, world: World, plan: Plan, labels: Labels, before: Plan | None = None
) -> None:
    """Draw the robots with their headings, moves and numbers, and mark them in the labels."""
    contract, points = plan.formation.contract, plan.formation.points
    site, names = world.site(contract), plan.formation.robot_of_place
    near = _near_picture(points, site)
    if not near.any():
        return
    shown = {names[i]: points[i] for i in np.flatnonzero(near)}
    flagged = {str(f.robot) for f in plan.verdict.findings if f.robot is not None}
    room = target_room(contract, site, points) if near.all() else np.inf
    sound = near & ~np.isin(names, list(flagged))
    radius = robot_size(canvas, points[sound if sound.any() else near], room)
    for point in shown.values() if contract.robot_radius > 0 else ():
        canvas.body(point, contract.robot_radius)
    draw_idle_robots(canvas, idle_robots(world, plan), radius)
    node = world.plans.get(plan.id)
    for encounter in node.encounters if node is not None and near.all() else ():
        for robot in encounter.robots if encounter.how in ("on", "border") else ():
            canvas.circle(shown[robot], 1.7 * radius, MET, max(0.3 * radius, 1.2))
    if near.all():
        draw_moves(canvas, moves_between(before, plan), radius)
        draw_headings(canvas, points, plan.formation.place_headings, radius)
    draw_robots(canvas, shown, radius, flagged)
    away = dict(zip(names, outward_vectors(contract, site, points), strict=True))
    number_robots(canvas, shown, radius, labels, away, flagged)


def idle_robots(world: World, plan: Plan) -> dict[str, FloatArray]:
    """Return where robots without a place in the plan stand, (2,) px by id.

    Empty if the plan does not choose its robots.
    """
    busy = set(plan.formation.robots)
    idle = [pose for pose in world.robots if busy and pose.id not in busy]
    return {pose.id: np.array([pose.x, pose.y]) for pose in idle}


def _draw_verdict(canvas: Canvas, plan: Plan, scale: float | None) -> None:
    """Draw the footer: what the certificate says, and a scale bar where the scale is known."""
    taken = draw_scale_bar(canvas, scale) if scale else 0.0
    badge, ground = _badge(plan, scale)
    draw_footer(canvas, badge, ground, _plan_facts(plan, scale), taken)


def _badge(plan: Plan, scale: float | None) -> tuple[str, Colour]:
    if plan.partial is not None:
        return f"partial: {plan.partial.short(scale)}", PARTIAL
    if plan.verdict.certified:
        return "certified", CERTIFIED
    count = len(plan.verdict.findings)
    return f"NOT certified: {count} finding{'s' * (count != 1)}", FINDING


def _plan_facts(plan: Plan, scale: float | None) -> list[str]:
    """Return the plan id, the number of robots and up to three facts, most important first."""
    measured = plan.verdict.measures
    count = len(plan.formation.positions)
    facts = [
        form.format(length_text(float(value), scale) if key.endswith("_px") else value)
        for key, form in MEASURES
        if (value := measured.get(key)) is not None
        and not (key == "worst_gap_px" and "widest_opening_px" in measured)
    ]
    if "escape_proof" in measured:
        facts.insert(0, CAGED[str(measured["escape_proof"])])
    return [plan.id, f"{count} robot{'s' * (count != 1)}", *facts[:3]]


def _draw_tag(canvas: Canvas, name: str, box: Box, colour: Colour, labels: Labels) -> None:
    """Draw an id near the upper left corner of a box (x0, y0, x1, y1), image pixels."""
    text = canvas.shortened(drawable(name), TAG, canvas.size[0] / 3)
    anchor = canvas.at(np.array([box[:2]]))[0]
    size = canvas.chip_size(text, TAG)
    where = labels.place(anchor, size, np.array([0.5, -1.0]), 3 * canvas.unit)
    canvas.chip(where, text, TAG, INK, colour)
