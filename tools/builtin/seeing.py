"""Doors that look at the picture: look, locate_object, segment."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from ..draw import draw_view, view_scale
from ..errors import ToolError
from ..formation.plan import Plan
from ..perception.detectors.candidates import salient_candidates
from ..perception.referring.attributes import Candidate
from ..perception.referring.relations import Query, select
from ..perception.target_prompt import Box, Point, TargetPrompt, box_problems
from ..scene import Scene, Target
from ..tool import ToolResult, tool, violations
from ..world import Workspace

FRAME = "image pixels, x right, y down"
MOST_SHOWN = 40
"""Candidates that a reply or a picture holds."""
CLEAR = 0.7
"""Below this confidence a mask is shown to the model: it may have to correct it."""
AROUND = 0.3
"""What is shown of the surroundings of such a thing, as a share of its longer side."""
LEAST_SHARE = 0.1
"""Colours that fewer of a thing's pixels have are left out of replies."""


def framed(scene: Scene, more: str = "") -> dict[str, Any]:
    """What a reply says of its coordinates and lengths: the frame, and the scale if it is known."""
    scale = scene.metres_per_pixel
    return {"frame": FRAME + more} | ({} if scale is None else {"metres_per_pixel": scale})


def summary(target: Target) -> dict[str, Any]:
    """What a reply says of a target."""
    data = {
        "id": target.id,
        "label": target.label,
        "box": [round(v, 1) for v in target.box],
        "confidence": target.confidence,
        "area_px": round(target.outline.area),
        "kind": target.outline.kind,
        "corners": len(target.outline.corners),
    }
    return data | ({"leaves_out_your_vertices": target.missed} if target.missed else {})


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
def look(
    workspace: Workspace,
    region: Box | None = None,
    plan_id: str | None = None,
    candidates: bool = False,
) -> ToolResult:
    """See the picture again with what was found, or a part of it closer.

    Args:
        region: x0, y0, x1, y1 of the part to see closer, px.
        plan_id: a plan whose robots to draw in.
        candidates: whether to number what stands out; the thing numbered 3 is then c3.
    """
    scene = workspace.scene
    plan = None if plan_id is None else workspace.current_plan(plan_id)
    shown = workspace.candidates()[:MOST_SHOWN] if candidates else ()
    if region is not None:
        problems = box_problems(region, *scene.picture.size)
        if problems:
            raise ToolError(" ".join(problems))
    image = draw_view(scene, plan=plan, candidates=shown, region=region)
    data: dict[str, Any] = {
        "width": scene.picture.width,
        "height": scene.picture.height,
        **_part_shown(scene, region),
        **framed(scene),
        "targets": [summary(t) for t in scene.targets],
        "candidates": [sighting(c) for c in shown],
        "notes": list(scene.picture.notes),
    }
    return ToolResult(data, (image,))


def _part_shown(scene: Scene, region: Box | None) -> dict[str, Any]:
    if region is None:
        return {"shown_at_scale": round(view_scale(scene.picture), 3)}
    return {"region": [round(v) for v in region], "note": "enlarged: read the rulers"}


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
        return ToolResult({"targets": targets, **framed(workspace.scene)})
    clear = salient_candidates(workspace.candidates())
    if query is None:
        shown = [sighting(c) for c in clear[:MOST_SHOWN]]
        data = {"candidates": shown, **framed(workspace.scene)}
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
            **framed(workspace.scene),
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
    straight: bool = False,
) -> ToolResult:
    """Measure the exact outline of one thing; needs an outline, box, points or a candidate.

    A doubtful mask is shown; a bad one is refused with "Insufficient segmentation accuracy".

    Args:
        id: target id to give it, t1, t2, ...; an id in use is replaced.
        label: what it is, in a few words.
        candidate: id of a numbered candidate, such as c3.
        box: x0, y0, x1, y1 close around it, px.
        points: points (x, y) on it, px; beside an outline or box they correct it.
        negative: points (x, y) that are not part of it, px.
        outline: rough outline, 3 to 30 vertices (x, y) in order around it, px; the surest way.
        straight: whether the outline's sides are straight lines between its vertices.
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
            "straight": straight,
        }
    )
    target = measured(workspace, prompt)
    data = {**summary(target), "parts": dict(target.parts), **framed(workspace.scene)}
    return ToolResult(data, overlays(workspace, (target,) if doubtful(target) else ()))


def measured(workspace: Workspace, prompt: TargetPrompt) -> Target:
    """The target that a prompt points at.

    Raises:
        ToolError: as `Workspace.segment` does, with the doubtful mask as a picture.
    """
    before = workspace.doubted
    try:
        return workspace.segment(prompt)
    except ToolError as error:
        doubted = workspace.doubted
        if doubted is None or doubted is before:
            raise
        raise error.showing(_closer(workspace.scene, doubted)) from None


def overlays(
    workspace: Workspace, targets: Iterable[Target], plan: Plan | None = None
) -> tuple[bytes, ...]:
    """Pictures of targets whose masks a model should look at before it trusts them."""
    return tuple(_closer(workspace.scene, target, plan) for target in targets)


def doubtful(target: Target) -> bool:
    """Whether a mask has to be looked at before robots are sent there."""
    return target.confidence < CLEAR or bool(target.missed)


def _closer(scene: Scene, target: Target, plan: Plan | None = None) -> bytes:
    x0, y0, x1, y1 = target.box
    out = AROUND * max(x1 - x0, y1 - y0) + 2
    shown = replace(scene, targets=(target,)) if plan is None else scene
    region = (x0 - out, y0 - out, x1 + out, y1 + out)
    drawn = () if target.source is None else target.source.outline or ()
    return draw_view(shown, plan=plan, region=region, drawn=drawn)


def parse_prompt(values: dict[str, Any]) -> TargetPrompt:
    """A TargetPrompt, its violations as a ToolError."""
    try:
        return TargetPrompt.model_validate(values)
    except ValidationError as error:
        raise ToolError(f"segment: {violations(error)}") from None
