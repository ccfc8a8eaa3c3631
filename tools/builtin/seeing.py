"""Tools that look at the picture: look, locate_object, segment."""

from typing import Any

from pydantic import ValidationError

from ..context import Context, noun_phrase
from ..draw import draw_view, view_scale
from ..errors import ToolError
from ..perception.detectors.candidates import salient_candidates
from ..perception.image import Picture
from ..perception.referring.attributes import Candidate
from ..perception.referring.relations import Query, select
from ..perception.target_prompt import Box, Point, TargetPrompt, box_problems
from ..tool import ToolResult, tool, violations
from .targets import closer_views, corrections, framed, measured_all, summary

MOST_SHOWN = 40
"""Most candidates in a reply or a picture."""
LEAST_SHARE = 0.1
"""Colours that fewer of a thing's pixels have are left out of replies."""


def sighting(candidate: Candidate, reasons: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return what a reply says of a candidate."""
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
    if candidate.named:
        data["named"] = [
            {"noun": n.phrase, "score": round(n.score, 2), "mask": round(n.confidence, 2)}
            for n in candidate.named
        ]
    if seen.hole > 0:
        data["hole"] = round(seen.hole, 2)
    if seen.touches_border:
        data["cut_by_the_picture"] = True
    return data | ({"reasons": list(reasons)} if reasons else {})


@tool("read")
def look(
    context: Context,
    region: Box | None = None,
    plan_id: str | None = None,
    candidates: bool = False,
) -> ToolResult:
    """See the picture again with what was found, or a part closer.

    Args:
        region: x0, y0, x1, y1.
        plan_id: whose robots to draw.
        candidates: number what stands out: 3 is then c3.
    """
    picture, world = context.picture, context.world
    plan = None if plan_id is None else world.plan(plan_id).plan
    shown = context.candidates()[:MOST_SHOWN] if candidates else ()
    if region is not None:
        problems = box_problems(region, *picture.size)
        if problems:
            raise ToolError(" ".join(problems))
    image = draw_view(picture, world, plan=plan, candidates=shown, region=region)
    data: dict[str, Any] = {
        "width": picture.width,
        "height": picture.height,
        **_part_shown(picture, region),
        **framed(world),
        "targets": [summary(t) for t in world.targets],
        "candidates": [sighting(c) for c in shown],
        "notes": list(picture.notes),
    }
    return ToolResult(data, (image,))


def _part_shown(picture: Picture, region: Box | None) -> dict[str, Any]:
    if region is None:
        return {"shown_at_scale": round(view_scale(picture), 3)}
    return {"region": [round(v) for v in region], "note": "enlarged: read the rulers"}


@tool("read")
def locate_object(context: Context, query: Query | None = None) -> ToolResult:
    """Find things in the picture by how they look and where they are; code does the comparing.

    Without a query it measures what the person pointed at, or else lists all that stands out.
    With one, every match with numeric reasons. Nouns count where a network knows them,
    else `not_looked_for` names them: say "round", not "coin". Only when settled is true is there
    exactly one; doubt and lacking say why not, note what was too small to count. Absent: not
    even a part of a thing has that look.

    Args:
        query: colours, shade, shapes, traits, superlatives and relations that tell it apart.
    """
    if query is None and context.world.pointed:
        found = {t.id for t in context.world.targets}
        new = [prompt for prompt in context.world.pointed if prompt.id not in found]
        world = measured_all(context, new)
        targets = [summary(t) for t in world.targets]
        shown = closer_views(context.at(world), context.world, new)
        return ToolResult({"targets": targets, **framed(world)}, shown, world=world)
    ignored: dict[str, Any] = {}
    if query is not None and (nouns := query.nouns):
        if context.finder is None:
            ignored, query = {"not_looked_for": list(nouns)}, query.with_nouns(lambda noun: "")
        else:
            context, query = context.looking_for(nouns), query.with_nouns(noun_phrase)
    clear = salient_candidates(context.candidates())
    if query is None:
        shown = [sighting(c) for c in clear[:MOST_SHOWN]]
        data = {"candidates": shown, **framed(context.world)}
        return ToolResult(data | {"things": len(clear)})
    selection = select(clear, query, *context.picture.size)
    matches = selection.matches[:MOST_SHOWN]
    return ToolResult(
        {
            "candidates": [sighting(context.candidate(m.id), m.reasons) for m in matches],
            "settled": selection.settled,
            "doubt": selection.doubt,
            "lacking": selection.lacking,
            "absent": bool(selection.lacking) and not _hinted(query, context.candidates()),
            "things": len(clear),
            **({"note": selection.note} if selection.note else {}),
            **ignored,
            **framed(context.world),
        },
        world=context.world,
    )


def _hinted(query: Query, candidates: tuple[Candidate, ...]) -> bool:
    """Return whether some thing, however faint, shows a little of the colour asked for."""
    shares = (
        sum(share for name, share in c.attributes.colours if name in query.colours)
        for c in candidates
    )
    return bool(query.colours) and any(share >= LEAST_SHARE for share in shares)


@tool("read")
def segment(
    context: Context,
    id: str = "t1",
    label: str = "",
    candidate: str | None = None,
    text: str | None = None,
    box: Box | None = None,
    points: tuple[Point, ...] | None = None,
    negative: tuple[Point, ...] = (),
    outline: tuple[Point, ...] | None = None,
    straight: bool = False,
) -> ToolResult:
    """Measure the exact outline of one thing; needs an outline, box, points, text or candidate.

    A doubtful mask is shown or refused.

    Args:
        id: t1, t2, ...; one in use is replaced.
        label: what it is, in a few words.
        candidate: its id, such as c3.
        text: a bare noun, where nouns are found.
        box: x0, y0, x1, y1 close around it, px.
        points: (x, y) on it, px; they correct an outline or box.
        negative: points off it, px.
        outline: vertices (x, y) in order around it, px; the surest way.
        straight: its sides are.
    """
    prompt = parse_prompt(
        {
            "id": id,
            "label": label,
            "candidate": candidate,
            "text": text,
            "box": box,
            "points": points,
            "negative": negative,
            "outline": outline,
            "straight": straight,
        }
    )
    world = measured_all(context, (prompt,))
    target = world.target(prompt.id)
    changed = corrections(context.world, world, [prompt])
    data = {**summary(target), "parts": dict(target.parts), **changed, **framed(world)}
    shown = closer_views(context.at(world), context.world, [prompt])
    return ToolResult(data, shown, world=world)


def parse_prompt(values: dict[str, Any]) -> TargetPrompt:
    """Return values as a TargetPrompt.

    Raises:
        ToolError: they are against its schema.
    """
    try:
        return TargetPrompt.model_validate(values)
    except ValidationError as error:
        raise ToolError(f"segment: {violations(error)}") from None
