"""Tools that compute positions: sample_along_edges, sample_inside, sample_shape."""

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from ..context import Context
from ..errors import ToolError
from ..formation.contract import (
    MAX_ROBOTS,
    MIN_SPACING,
    Contract,
    Group,
    SideName,
    Unit,
    default_clearance,
    with_defaults,
)
from ..formation.placement.place import place, reference_curve
from ..formation.shape_spec import Where
from ..formation.site import Site
from ..formation.units import in_pixels
from ..geometry.curves import Frame
from ..geometry.figures.shapes import Kind
from ..geometry.outline import FloatArray
from ..geometry.rings import equal_chords, hole_rings, nested_rings
from ..geometry.sampling import min_spacing
from ..perception.target_prompt import Box, Point
from ..tool import ToolResult, tool, violations
from .seeing import framed

Count = Annotated[int, Field(ge=1, le=MAX_ROBOTS)]
Pixels = Annotated[float, Field(ge=0, allow_inf_nan=False)]


@tool("read")
def sample_along_edges(
    context: Context,
    target: str,
    n: Count,
    offset: Pixels | None = None,
    side: SideName | None = None,
    edges: tuple[int, ...] | None = None,
    at: Literal["even", "corners"] = "even",
    chords: bool = False,
    rings: Annotated[int, Field(ge=1, le=20)] = 1,
    step: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None,
    holes: bool = False,
    unit: Unit | None = None,
) -> ToolResult:
    """Positions outside a target: evenly around it, along one side or chosen edges, or at corners.

    Args:
        target: target id, such as t1.
        n: how many positions.
        offset: distance from the outline, image pixels; left out: the default clearance.
        side: only along this side of it, as seen in the picture, or its long or short side.
        edges: only along these edges, numbered as in describe_shape.
        at: even = equal arc length; corners = one per corner.
        chords: neighbours at equal straight distances, not arc lengths.
        rings: so many rings around it, one behind the other.
        step: from ring to ring, image pixels; left out: the offset again.
        holes: inside the target's holes, along their edges.
        unit: of offset and step, px or m; said if Metres per pixel is told.
    """
    offset, step = (_px(context, length, unit) for length in (offset, step))
    if side is not None and edges is not None:
        raise ToolError("sample_along_edges: give a side or edges, not both.")
    if holes or rings > 1:
        if side is not None or edges is not None or at == "corners" or chords:
            raise ToolError("sample_along_edges: rings and holes go with n, offset and step alone.")
        return _rings(context, target, n, offset, step, None if holes else rings)
    if chords and at == "corners":
        raise ToolError("sample_along_edges: chords are for at: even, not for corners.")
    relation = "corners" if at == "corners" else "around" if side is edges is None else "along"
    group: dict[str, Any] = {"relation": relation, "targets": (target,), "robots": n}
    if offset is not None:
        group["clearance"] = (offset, offset)
    group |= {"side": side, "edges": edges}
    if chords:
        return _chords(context, group)
    return _sampled(context, "sample_along_edges", group)


@tool("read")
def sample_inside(
    context: Context,
    target: str,
    n: Count,
    margin: Pixels | None = None,
    unit: Unit | None = None,
) -> ToolResult:
    """Positions spread evenly over the inside of a target, holes left out.

    Args:
        target: target id, such as t1.
        n: how many positions.
        margin: least distance from the target's edge, image pixels; left out: the default.
        unit: of the margin, px or m; said if Metres per pixel is told.
    """
    margin = _px(context, margin, unit)
    group: dict[str, Any] = {"relation": "inside", "targets": (target,), "robots": n}
    if margin is not None:
        deepest = context.world.target(target).outline.size
        group["clearance"] = (margin, max(margin, deepest))
    return _sampled(context, "sample_inside", group)


@tool("read")
def sample_shape(
    context: Context,
    kind: Literal["line", "between", "centre"] | Kind,
    n: Count,
    targets: tuple[str, ...] = (),
    start: Point | None = None,
    end: Point | None = None,
    layout: Literal["line", "divider"] = "line",
    text: str | None = None,
    points: tuple[Point, ...] | None = None,
    rows: int | None = None,
    corners: int | None = None,
    angles: Point | None = None,
    box: Box | None = None,
    where: Where | None = None,
) -> ToolResult:
    """Positions on a shape: a line, a drawn form, between two targets, or at a target's centre.

    Args:
        kind: line (start and end, or a box), between (two targets), centre (one target), or a form.
        n: how many positions.
        targets: target ids: two for between, one for centre or where, none for line.
        start: first point (x, y) of a line, image pixels, y down.
        end: last point (x, y) of a line, image pixels, y down.
        layout: between: line joins the targets, divider parts them.
        text: letters: A-Z, 0-9, blanks; outlined: any ASCII.
        points: polyline: (x, y) in turn, image pixels.
        rows: grid: how many.
        corners: polygon, star: how many tips.
        angles: arc: from, to in degrees, clockwise from the right.
        box: x0, y0, x1, y1 to fit a form into, image pixels; or where.
        where: of the target a form is placed by.
    """
    form: dict[str, Any] = {"text": text, "points": points, "rows": rows, "corners": corners}
    form |= {"angles": angles, "box": box, "where": where}
    form = {name: value for name, value in form.items() if value is not None}
    plain = kind in ("between", "centre") or (kind == "line" and not form)
    ends = {name: at for name, at in (("start", start), ("end", end)) if at is not None}
    if form if plain else ends:
        given = ", ".join(form if plain else ends)
        raise ToolError(f"sample_shape: {given} cannot be used with this {kind}.")
    if plain:
        return _plain_shape(context, kind, n, targets, (start, end), layout)
    group = {"relation": "shape", "targets": targets, "robots": n, "shape": {"kind": kind} | form}
    return _sampled(context, "sample_shape", group)


def _px(context: Context, length: float | None, unit: Unit | None) -> float | None:
    return length and in_pixels(length, unit, context.world.metres_per_pixel)


def _plain_shape(
    context: Context,
    kind: str,
    n: int,
    targets: tuple[str, ...],
    ends: tuple[Point | None, Point | None],
    layout: str,
) -> ToolResult:
    if kind == "line":
        start, end = ends
        if start is None or end is None:
            raise ToolError("sample_shape: a line needs start and end.")
        if targets:
            raise ToolError("sample_shape: a line from start to end takes no targets.")
        drawn = {"relation": "shape", "robots": n, "line": (*start, *end)}
        return _sampled(context, "sample_shape", drawn)
    wanted = 2 if kind == "between" else 1
    if len(targets) != wanted:
        raise ToolError(f"sample_shape: {kind} takes {wanted} target(s), got {len(targets)}.")
    group = {"relation": kind, "targets": targets, "robots": n, "layout": layout}
    return _sampled(context, "sample_shape", group)


def _rings(
    context: Context,
    name: str,
    n: int,
    offset: float | None,
    step: float | None,
    rings: int | None,
) -> ToolResult:
    """Sample positions on several rings, innermost first, or in the holes if `rings` is None."""
    outline, picture = context.world.target(name).outline, context.picture
    radius = context.settings.robot_radius or 0.0
    room = (float(picture.width), float(picture.height))
    away = radius + (default_clearance(outline, room, radius) if offset is None else offset)
    if away <= 0:
        raise ToolError("sample_along_edges: an offset of 0 px leaves robots on the outline.")
    if rings is None:
        placed = hole_rings(outline, n, away)
    else:
        frame = Frame(picture.width, picture.height, radius)
        placed = nested_rings(outline, n, away, step or away, rings, frame)
    points = np.concatenate([np.empty((0, 2)), *placed])
    floor = max(2 * radius, MIN_SPACING)
    if len(points) < n or min_spacing(points) < floor:
        where = f"in the holes of {name}" if rings is None else f"on {rings} rings around {name}"
        raise ToolError(f"{n} positions do not fit {where}, {away:.1f} px from its edge.")
    reply = _reply(context, points)
    data = reply.data | {"robots_per_ring": [len(ring) for ring in placed]}
    return replace(reply, data=data)


def _chords(context: Context, group: dict[str, Any]) -> ToolResult:
    contract, site = _contract(context, "sample_along_edges", group)
    curve = reference_curve(contract.groups[0], site, contract.robot_radius)
    points = equal_chords(curve, contract.robots)
    if len(points) < contract.robots or min_spacing(points) < contract.spacing_floor:
        long = f"{curve.length:.0f} px inside the picture"
        raise ToolError(f"{contract.robots} positions do not fit on {long}.")
    return _reply(context, points)


def _contract(context: Context, tool_name: str, group: dict[str, Any]) -> tuple[Contract, Site]:
    try:
        checked = Group.model_validate(group)
    except ValidationError as error:
        raise ToolError(f"{tool_name}: {violations(error)}") from None
    radius = context.settings.robot_radius or 0.0
    contract = Contract(groups=(checked,), robot_radius=radius)
    site = context.world.site(contract)
    return with_defaults(contract, site.outlines, site.room), site


def _sampled(context: Context, tool_name: str, group: dict[str, Any]) -> ToolResult:
    return _reply(context, place(*_contract(context, tool_name, group)))


def _reply(context: Context, points: FloatArray) -> ToolResult:
    rounded = np.round(points, 2)
    places: list[Point] = [(float(x), float(y)) for x, y in rounded]
    world, name = context.world.with_sample(places)
    data: dict[str, Any] = {
        "sample": name,
        "positions": rounded.tolist(),
        **framed(context.world),
    }
    return ToolResult(data, world=world)
