"""Doors that compute positions: sample_along_edges, sample_inside, sample_shape."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from ..errors import ToolError
from ..formation.contract import MAX_ROBOTS, MIN_SPACING, Contract, Group, SideName, with_defaults
from ..formation.place import place
from ..geometry.curves import Frame, segment
from ..geometry.outline import FloatArray
from ..geometry.sampling import along_curve
from ..perception.prompts import Point
from ..tool import ToolResult, tool, violations
from ..workspace import Workspace
from .seeing import FRAME

Count = Annotated[int, Field(ge=1, le=MAX_ROBOTS)]
Pixels = Annotated[float, Field(ge=0, allow_inf_nan=False)]


@tool("read")
def sample_along_edges(
    workspace: Workspace,
    target: str,
    n: Count,
    offset: Pixels | None = None,
    side: SideName | None = None,
    edges: tuple[int, ...] | None = None,
    at: Literal["even", "corners"] = "even",
) -> ToolResult:
    """Positions outside a target: evenly around it, along one side or chosen edges, or at corners.

    Args:
        target: target id, such as t1.
        n: how many positions.
        offset: distance from the outline, image pixels; left out: the default clearance.
        side: only along this side of it, as seen in the picture, or its long or short side.
        edges: only along these edges, numbered as in describe_shape.
        at: even = equal arc length; corners = one per corner.
    """
    if side is not None and edges is not None:
        raise ToolError("sample_along_edges: give a side or edges, not both.")
    relation = "corners" if at == "corners" else "around" if side is edges is None else "along"
    group: dict[str, Any] = {"relation": relation, "targets": (target,), "robots": n}
    if offset is not None:
        group["clearance"] = (offset, offset)
    return _sampled(workspace, "sample_along_edges", group | {"side": side, "edges": edges})


@tool("read")
def sample_inside(
    workspace: Workspace, target: str, n: Count, margin: Pixels | None = None
) -> ToolResult:
    """Positions spread evenly over the inside of a target, holes left out.

    Args:
        target: target id, such as t1.
        n: how many positions.
        margin: least distance from the target's edge, image pixels; left out: the default.
    """
    group: dict[str, Any] = {"relation": "inside", "targets": (target,), "robots": n}
    if margin is not None:
        deepest = workspace.scene.target(target).outline.size
        group["clearance"] = (margin, max(margin, deepest))
    return _sampled(workspace, "sample_inside", group)


@tool("read")
def sample_shape(
    workspace: Workspace,
    kind: Literal["line", "between", "centre"],
    n: Count,
    targets: tuple[str, ...] = (),
    start: Point | None = None,
    end: Point | None = None,
    layout: Literal["line", "divider"] = "line",
) -> ToolResult:
    """Positions on a shape: a straight line, between two targets, or at a target's centre.

    Args:
        kind: line (needs start and end), between (two targets), centre (one target).
        n: how many positions.
        targets: target ids: two for between, one for centre, none for line.
        start: first point (x, y) of a line, image pixels, y down.
        end: last point (x, y) of a line, image pixels, y down.
        layout: between: line joins the targets, divider parts them.
    """
    if kind == "line":
        if start is None or end is None:
            raise ToolError("sample_shape: a line needs start and end.")
        picture = workspace.scene.picture
        curve = segment(np.asarray(start), np.asarray(end), Frame(picture.width, picture.height))
        points = along_curve(curve, n)
        if len(points) < n or curve.length < MIN_SPACING * (n - 1):
            raise ToolError(
                f"{n} positions do not fit on {curve.length:.0f} px inside the picture."
            )
        return _reply(workspace, points)
    wanted = 2 if kind == "between" else 1
    if len(targets) != wanted:
        raise ToolError(f"sample_shape: {kind} takes {wanted} target(s), got {len(targets)}.")
    group = {"relation": kind, "targets": targets, "robots": n, "layout": layout}
    return _sampled(workspace, "sample_shape", group)


def _sampled(workspace: Workspace, tool_name: str, group: dict[str, Any]) -> ToolResult:
    try:
        checked = Group.model_validate(group)
    except ValidationError as error:
        raise ToolError(f"{tool_name}: {violations(error)}") from None
    radius = workspace.settings.robot_radius or 0.0
    contract = Contract(groups=(checked,), robot_radius=radius)
    site = workspace.scene.site(contract)
    return _reply(workspace, place(with_defaults(contract, site.outlines, site.room), site))


def _reply(workspace: Workspace, points: FloatArray) -> ToolResult:
    rounded = np.round(points, 2)
    data: dict[str, Any] = {
        "sample": workspace.keep_sample(rounded),
        "positions": rounded.tolist(),
        "frame": FRAME,
    }
    return ToolResult(data)
