"""Doors that look at the picture: look, locate_object, segment."""

import io
from typing import Any

from pydantic import ValidationError

from ..draw import draw_look
from ..errors import ToolError
from ..perception.attributes import Candidate
from ..perception.candidates import clear_ones
from ..perception.prompts import Box, Point, TargetPrompt
from ..perception.relations import Query, select
from ..scene import Target
from ..tool import ToolResult, tool, violations
from ..workspace import Workspace

FRAME = "image pixels, x right, y down"
MOST_SHOWN = 40
"""Candidates that a reply or a picture holds."""
LEAST_SHARE = 0.1
"""Colours that fewer of a thing's pixels have are left out of replies."""


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


def sighting(candidate: Candidate, reasons: tuple[str, ...] = ()) -> dict[str, Any]:
    """What a reply says of a candidate."""
    seen = candidate.attributes
    data: dict[str, Any] = {
        "id": candidate.id,
        "label": candidate.label,
        "box": [round(v) for v in candidate.outline.bounds],
        "colours": {n: round(v, 2) for n, v in seen.colours if v >= LEAST_SHARE},
        "shapes": {n: round(v, 2) for n, v in seen.shapes[:2]},
        "lightness": round(seen.lab[0]),
        "area_px": round(seen.area),
        "elongation": round(seen.elongation, 2),
        "roundness": round(seen.roundness, 2),
        "orientation_deg": round(seen.orientation),
        "salience": round(candidate.salience, 2),
    }
    if seen.hole > 0:
        data["hole"] = round(seen.hole, 2)
    if seen.touches_border:
        data["cut_by_the_picture"] = True
    return data | ({"reasons": list(reasons)} if reasons else {})


@tool("read")
def look(workspace: Workspace, plan_id: str | None = None, candidates: bool = False) -> ToolResult:
    """See the picture with rulers in pixels, the targets found so far and, if asked, a plan.

    Args:
        plan_id: a plan whose robots to draw in.
        candidates: whether to number the things that stand out (c1 is drawn as 1).
    """
    scene = workspace.scene
    plan = None if plan_id is None else workspace.current_plan(plan_id)
    shown = workspace.candidates()[:MOST_SHOWN] if candidates else ()
    image = draw_look(scene, plan=plan, candidates=shown)
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    data = {
        "width": scene.picture.width,
        "height": scene.picture.height,
        "frame": FRAME,
        "targets": [summary(t) for t in scene.targets],
        "candidates": [sighting(c) for c in shown],
        "notes": list(scene.picture.notes),
    }
    return ToolResult(data, (buffer.getvalue(),))


@tool("read")
def locate_object(workspace: Workspace, query: Query | None = None) -> ToolResult:
    """Find things in the picture by how they look and where they are; code does the comparing.

    Without a query it measures what the person pointed at, or else lists all that stands out.
    With one the reply has every match with numeric reasons. Nothing is recognised: say "round",
    not "coin". Only when settled is true is there exactly one; doubt and lacking say why not.
    Absent is true only where not even a part of a thing has the look asked for.

    Args:
        query: colours, shade, shapes, traits, superlatives and relations that tell it apart.
    """
    if query is None and workspace.pointed:
        found = {t.id for t in workspace.scene.targets}
        for prompt in workspace.pointed:
            if prompt.id not in found:
                workspace.segment(prompt)
        targets = [summary(t) for t in workspace.scene.targets]
        return ToolResult({"targets": targets, "frame": FRAME})
    clear = clear_ones(workspace.candidates())
    if query is None:
        data = {"candidates": [sighting(c) for c in clear[:MOST_SHOWN]], "frame": FRAME}
        return ToolResult(data | {"things": len(clear)})
    selection = select(clear, query, *workspace.scene.picture.size)
    matches = selection.matches[:MOST_SHOWN]
    return ToolResult(
        {
            "candidates": [sighting(workspace.candidate(m.id), m.reasons) for m in matches],
            "settled": selection.settled,
            "doubt": selection.doubt,
            "lacking": selection.lacking,
            "absent": bool(selection.lacking) and not _hinted(query, workspace.candidates()),
            "things": len(clear),
            "frame": FRAME,
        }
    )


def _hinted(query: Query, candidates: tuple[Candidate, ...]) -> bool:
    """Whether some thing, however faint, shows a little of the colour asked for."""
    shares = (
        sum(share for name, share in c.attributes.colours if name in query.colours)
        for c in candidates
    )
    return bool(query.colours) and any(share >= LEAST_SHARE for share in shares)


@tool("read")
def segment(
    workspace: Workspace,
    id: str = "t1",
    label: str = "",
    candidate: str | None = None,
    box: Box | None = None,
    points: tuple[Point, ...] | None = None,
    negative: tuple[Point, ...] = (),
    outline: tuple[Point, ...] | None = None,
) -> ToolResult:
    """Measure the exact outline of one thing; needs a candidate, box, points or outline.

    Below the confidence threshold it answers "Insufficient segmentation accuracy" and what
    to do; then the target is not kept.

    Args:
        id: target id to give it, t1, t2, ...; an id in use is replaced.
        label: what it is, in a few words.
        candidate: id of a candidate that locate_object or look showed: c3.
        box: x0, y0, x1, y1 close around the thing, image pixels, y down.
        points: points (x, y) on the thing, image pixels, y down.
        negative: points (x, y) that do not belong to it, image pixels, y down.
        outline: 3 to 30 vertices (x, y) in order around it, image pixels, y down.
    """
    prompt = parse_prompt(
        {
            "id": id,
            "label": label,
            "candidate": candidate,
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
