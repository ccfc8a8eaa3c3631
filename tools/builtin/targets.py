"""Targets for tools: what a prompt points at, measured and shown, or refused as too doubtful."""

import math
from collections.abc import Collection, Iterable, Sequence
from typing import Any

from ..context import Context, noun_phrase
from ..draw import draw_view, view_scale
from ..errors import InputError, ToolError
from ..formation.plan import Plan
from ..perception.measure import Deviation, measure_outline, unlike_drawn
from ..perception.segmenters.registry import segmenter_named
from ..perception.target_prompt import MAX_POINTS, TargetPrompt
from ..world import Target, World

FRAME = "image pixels, x right, y down"
CLEAR = 0.7
"""Below this confidence a mask is shown to the model: it may have to correct it."""
MISSED = 0.06
"""Rough outlines are off by up to this share of the thing's size."""
SMALL = 40.0
"""Things whose shorter side is less, px of the picture or of its view, are shown closer."""
SHOWN = "blue dashes: before; discs and crosses: your points on it and off it"
AROUND = 0.3
"""What is shown of the surroundings of such a thing, as a share of its longer side."""


def framed(world: World, more: str = "") -> dict[str, Any]:
    """Return what a reply says of coordinates and lengths: frame, and scale if it is known."""
    scale = world.metres_per_pixel
    return {"frame": FRAME + more} | ({} if scale is None else {"metres_per_pixel": scale})


def summary(target: Target) -> dict[str, Any]:
    """Return what a reply says of a target."""
    data = {
        "id": target.id,
        "label": target.label,
        "box": [round(v, 1) for v in target.box],
        "confidence": target.confidence,
        "area_px": round(target.outline.area),
        "kind": target.outline.kind,
        "corners": len(target.outline.corners),
        **({"note": target.note} if target.note else {}),
    }
    unlike = {"leaves_out_of_yours": target.missed, "adds_to_yours": target.added}
    return data | {name: _rounded_parts(parts) for name, parts in unlike.items() if parts}


def _rounded_parts(parts: Iterable[Deviation]) -> list[dict[str, int]]:
    return [dict(zip(("x", "y", "px"), map(round, part), strict=True)) for part in parts]


def with_pointed(
    world: World, prompts: Sequence[TargetPrompt], named: Collection[str]
) -> tuple[TargetPrompt, ...]:
    """Return prompts and, of what the person pointed at, what is named and not measured yet.

    Args:
        named: ids that a contract, edits or a question name.
    """
    known = {t.id for t in world.targets} | {p.id for p in prompts}
    return (*prompts, *(p for p in world.pointed if p.id in named and p.id not in known))


def measured_all(context: Context, prompts: Iterable[TargetPrompt]) -> World:
    """Return the world with the things that prompts point at as targets.

    If one is refused, those measured before it stay, and its doubtful mask is stored.

    Raises:
        ToolError: a prompt does not fit the picture, or its mask is too doubtful, in which case the
            error has a picture of it.
    """
    for given in prompts:
        context, target = trusted(context, given)
        context = context.at(context.world.with_target(target))
        context.observed(context.world)
    return context.world


def trusted(context: Context, given: TargetPrompt) -> tuple[Context, Target]:
    """Measure what a prompt points at; see `measured`.

    Raises:
        ToolError: also if its mask is too doubtful, in which case the error has a picture of it.
    """
    context, target, threshold = measured(context, given)
    if target.confidence < threshold and not _is_confirmed(context.world, target):
        context.observed(context.world.having(doubted=target))
        shown = closer_view(context, target)
        raise _insufficient(target.confidence, threshold, target.prompt).showing(shown)
    return context, target


def measured(context: Context, given: TargetPrompt) -> tuple[Context, Target, float]:
    """Measure what a prompt points at, however doubtful.

    Returns:
        The context after that, the target, and the least confidence it is used at.

    Raises:
        ToolError: the prompt does not fit the picture, or nothing can be measured there.
    """
    prompt = _correcting(context.world, given)
    if prompt.text is not None:
        context, prompt = _found_by_text(context, prompt, prompt.text)
    return context, _measured(context, prompt), _threshold(context, prompt.how)


def _is_confirmed(world: World, target: Target) -> bool:
    """Return whether a person has agreed to that very outline, however doubtful."""
    return any(t.id == target.id and t.outline == target.outline for t in world.targets)


def _found_by_text(
    context: Context, prompt: TargetPrompt, text: str
) -> tuple[Context, TargetPrompt]:
    """Return a context with what a text names among its candidates, and a prompt by that one.

    Raises:
        ToolError: nothing finds things by words, or not exactly one such thing was found.
    """
    if context.finder is None:
        raise ToolError(
            "Nothing that is set finds things by text: point with an outline, a box or points, or "
            "the person may choose another detector or segmenter."
        )
    context = context.looking_for([text])
    phrase = noun_phrase(text)
    found = [c.id for c in context.candidates() if c.as_named(phrase)]
    if len(found) != 1:
        context.observed(context.world)
        which = f": {', '.join(found[:MAX_POINTS])}. Name one as candidate" if found else ""
        raise ToolError(f'{len(found) or "No"} things were found as "{phrase}"{which}.')
    label = prompt.label or phrase
    return context, prompt.model_copy(update={"text": None, "candidate": found[0], "label": label})


def _measured(context: Context, prompt: TargetPrompt) -> Target:
    problems = prompt.problems(*context.world.picture.size)
    if problems:
        raise ToolError(" ".join(problems))
    prompt, note = prompt.mended()
    note = f"The outline drawn was mended: {note}." if note else ""
    segmenter = segmenter_named(context.settings.segmenter)
    candidate = None if prompt.candidate is None else context.candidate(prompt.candidate)
    try:
        found = measure_outline(context.picture, prompt, segmenter, candidate)
    except InputError as error:
        context.observed(context.world.having(doubted=None))
        text = f"Insufficient segmentation accuracy. {error} {ADVICE[prompt.how]}."
        threshold = _threshold(context, prompt.how)
        raise ToolError(text, "low_confidence", threshold=threshold) from None
    missed, added = unlike_drawn(found.outline, prompt, *context.world.picture.size)
    return Target(
        id=prompt.id,
        label=prompt.label or "the thing pointed at",
        box=found.outline.bounds,
        confidence=round(found.confidence, 3),
        outline=found.outline,
        prompt=prompt.how,
        parts={name: round(value, 3) for name, value in found.parts.items()},
        missed=missed,
        added=added,
        source=prompt if prompt.how in ("outline", "mask") else None,
        note=note if prompt.mask is None else f"Its mask is {prompt.mask.found_in}.",
    )


def _correcting(world: World, prompt: TargetPrompt) -> TargetPrompt:
    """Return the prompt, combined with the outline that its points correct if it has only points.

    A thing that a person gave a mask of stays that, however a model points at it.
    """
    pointed = next((p for p in world.pointed if p.id == prompt.id), None)
    known = next((t.source for t in world.targets if t.id == prompt.id), None)
    for given in (pointed, known):
        if given is not None and given.mask is not None:
            return given
    if prompt.how == "point" and known is not None:
        mended = known.corrected_by(prompt)
        most = max(len(mended.points or ()), len(mended.negative))
        if most > MAX_POINTS:
            raise ToolError(
                f"{prompt.id} would have {most} points that correct its outline, "
                f"{MAX_POINTS} at most: draw a closer outline."
            )
        return mended
    if prompt.how == "point" and prompt.points is None:
        raise ToolError(
            f"Negative points alone correct an outline that was drawn; {prompt.id} has none. "
            "Give an outline, a box or points with them."
        )
    return prompt


def _threshold(context: Context, how: str) -> float:
    """Return the least confidence at which a mask pointed at in that way is used."""
    if how == "mask":
        return 0.0
    chosen = context.settings.threshold
    return segmenter_named(context.settings.segmenter).thresholds[how] if chosen is None else chosen


ADVICE = {
    "point": "Draw a box close around the thing, or better a rough outline",
    "candidate": "Draw a rough outline around the thing",
    "box": "Draw a rough outline around the thing",
    "outline": "Draw the outline closer, or name points that do not belong",
}


def _insufficient(confidence: float, threshold: float, how: str) -> ToolError:
    shown = math.floor(100 * confidence) / 100  # never rounded up to the threshold
    said = (
        f"Insufficient segmentation accuracy. The mask's confidence is {shown:.2f}, below the "
        f"threshold {threshold:.2f}. {ADVICE[how]}"
    )
    return ToolError(
        f"{said}, or ask the person whether the outline shown is right.",
        "low_confidence",
        confidence=confidence,
        threshold=threshold,
        plain=f"{said}, or say yes if the outline shown is right.",
    )


def doubtful(target: Target) -> bool:
    """Return whether a mask has to be looked at before robots are sent there."""
    return target.confidence < CLEAR or bool(well_missed(target))


def well_missed(target: Target) -> list[Deviation]:
    """Return the parts that were drawn but are left out by more than a rough outline is off."""
    return [part for part in target.missed if part[2] > MISSED * target.outline.size]


def corrections(before: World, world: World, prompts: Iterable[TargetPrompt]) -> dict[str, Any]:
    """Return what a reply says of outlines that points have corrected: the areas that changed."""
    known = {t.id: t.outline.polygon for t in before.targets}
    pairs = {
        p.id: (known[p.id], world.target(p.id).outline.polygon)
        for p in prompts
        if p.id in known and (p.points or p.negative)
    }
    changed = {
        name: {"added_px": round((now - then).area), "removed_px": round((then - now).area)}
        for name, (then, now) in pairs.items()
    }
    return {"corrected": changed, "shown": SHOWN} if changed else {}


def closer_views(
    context: Context,
    before: World,
    prompts: Sequence[TargetPrompt],
    plan: Plan | None = None,
    unseen: Collection[str] = (),
) -> tuple[bytes, ...]:
    """Return pictures of the outlines that are to be looked at.

    Args:
        context: with the world as it is now.
        before: the world before anything was measured.
        prompts: what was measured; what is small, doubtful or was given points is shown.
        unseen: ids that are to be looked at in any case.
    """
    measured = {p.id: bool(p.points or p.negative) for p in prompts}
    old = {t.id: t for t in before.targets if measured.get(t.id)}
    return tuple(
        closer_view(context, target, plan, old.get(target.id))
        for target in context.world.targets
        if target.id in unseen
        or measured.get(target.id)
        or (target.id in measured and (doubtful(target) or _is_small(context, target)))
    )


def _is_small(context: Context, target: Target) -> bool:
    x0, y0, x1, y1 = target.box
    return min(x1 - x0, y1 - y0) * min(view_scale(context.picture), 1) < SMALL


def closer_view(
    context: Context, target: Target, plan: Plan | None = None, before: Target | None = None
) -> bytes:
    """Return the target's outline on a part of the picture, as a JPEG file.

    Args:
        before: the target before it was corrected, drawn dashed.
    """
    x0, y0, x1, y1 = target.box
    out = AROUND * max(x1 - x0, y1 - y0) + 2
    shown = context.world if plan else context.world.having(targets=(target,))
    region = (x0 - out, y0 - out, x1 + out, y1 + out)
    old = None if before is None else before.outline
    return draw_view(
        context.picture, shown, plan=plan, region=region, drawn=target.source, before=old
    )
