"""Doors that look at the picture: look, locate_object, segment."""

import io
from typing import Any

from pydantic import ValidationError

from ..draw import draw_look
from ..errors import ToolError
from ..perception.prompts import Box, Point, TargetPrompt
from ..scene import Target
from ..tool import ToolResult, tool, violations
from ..workspace import Workspace

FRAME = "image pixels, x right, y down"


def summary(target: Target) -> dict[str, Any]:
    """What a reply says of a target."""
    return {
        "id": target.id,
        "label": target.label,
        "box": [round(v, 1) for v in target.box],
        "confidence": target.confidence,
        "area_px": round(target.outline.area),
        "kind": target.outline.kind,
        "corners": len(target.outline.corners),
    }


@tool("read")
def look(workspace: Workspace, plan_id: str | None = None) -> ToolResult:
    """See the picture with rulers in pixels, the targets found so far and, if asked, a plan.

    Args:
        plan_id: a plan whose robots to draw in.
    """
    scene = workspace.scene
    plan = None if plan_id is None else workspace.current_plan(plan_id)
    image = draw_look(scene, plan=plan)
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    data = {
        "width": scene.picture.width,
        "height": scene.picture.height,
        "frame": FRAME,
        "targets": [summary(t) for t in scene.targets],
        "notes": list(scene.picture.notes),
    }
    return ToolResult(data, (buffer.getvalue(),))


@tool("read")
def locate_object(workspace: Workspace) -> ToolResult:
    """Find the things the person pointed at: each with id, box, confidence and size.

    Finding things from words alone is not there yet: with nothing pointed at, candidates is
    empty; then segment the thing by a box, points or an outline of your own, or ask.
    """
    found = {t.id for t in workspace.scene.targets}
    for prompt in workspace.pointed:
        if prompt.id not in found:
            workspace.segment(prompt)
    data = {"candidates": [summary(t) for t in workspace.scene.targets], "frame": FRAME}
    return ToolResult(data)


@tool("read")
def segment(
    workspace: Workspace,
    id: str = "t1",
    label: str = "",
    box: Box | None = None,
    points: tuple[Point, ...] | None = None,
    negative: tuple[Point, ...] = (),
    outline: tuple[Point, ...] | None = None,
) -> ToolResult:
    """Measure the exact outline of one thing; needs a box, points, or (best) a rough outline.

    Below the confidence threshold it answers "Insufficient segmentation accuracy" and what
    to do; then the target is not kept.

    Args:
        id: target id to give it, t1, t2, ...; an id in use is replaced.
        label: what it is, in a few words.
        box: x0, y0, x1, y1 close around the thing, image pixels, y down.
        points: points (x, y) on the thing, image pixels, y down.
        negative: points (x, y) that do not belong to it, image pixels, y down.
        outline: 3 to 30 vertices (x, y) in order around it, image pixels, y down.
    """
    prompt = parse_prompt(
        {
            "id": id,
            "label": label,
            "box": box,
            "points": points,
            "negative": negative,
            "outline": outline,
        }
    )
    target = workspace.segment(prompt)
    data = {**summary(target), "parts": dict(target.parts), "frame": FRAME}
    return ToolResult(data)


def parse_prompt(values: dict[str, Any]) -> TargetPrompt:
    """A TargetPrompt, its violations as a ToolError."""
    try:
        return TargetPrompt.model_validate(values)
    except ValidationError as error:
        raise ToolError(f"segment: {violations(error)}") from None
