"""Targets for tools: what a prompt points at, measured and shown, or refused as too doubtful."""

import math
from collections.abc import Iterable
from typing import Any

from ..context import Context
from ..draw import draw_view
from ..errors import InputError, ToolError
from ..formation.plan import Plan
from ..perception.measure import measure_outline, missed_vertices
from ..perception.segmenters.registry import segmenter_named
from ..perception.target_prompt import MAX_POINTS, TargetPrompt
from ..world import Target, World

FRAME = "image pixels, x right, y down"
CLEAR = 0.7
"""Below this confidence a mask is shown to the model: it may have to correct it."""
AROUND = 0.3
"""What is shown of the surroundings of such a thing, as a share of its longer side."""


def framed(world: World, more: str = "") -> dict[str, Any]:
    """What a reply says of its coordinates and lengths: the frame, and the scale if it is known."""
    scale = world.metres_per_pixel
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


def measured_all(context: Context, prompts: Iterable[TargetPrompt]) -> World:
    """The world with the things that prompts point at as targets.

    Those measured before one that is refused are kept, as is the doubtful mask of that one.

    Raises:
        ToolError: a prompt does not fit the picture, or its mask is not to be believed, with a
            picture of it.
    """
    for prompt in prompts:
        target = _measured(context, _correcting(context.world, prompt))
        threshold = _threshold(context, prompt.how)
        if target.confidence < threshold:
            context.observed(context.world.having(doubted=target))
            shown = closer_view(context, target)
            raise _insufficient(target.confidence, threshold, prompt.how).showing(shown)
        context = context.at(context.world.with_target(target))
        context.observed(context.world)
    return context.world


def _measured(context: Context, prompt: TargetPrompt) -> Target:
    problems = prompt.problems(*context.world.picture.size)
    if problems:
        raise ToolError(" ".join(problems))
    segmenter = segmenter_named(context.settings.segmenter)
    candidate = None if prompt.candidate is None else context.candidate(prompt.candidate)
    try:
        found = measure_outline(context.picture, prompt, segmenter, candidate)
    except InputError as error:
        text = f"Insufficient segmentation accuracy. {error} {ADVICE[prompt.how]}"
        threshold = _threshold(context, prompt.how)
        raise ToolError(text, "low_confidence", threshold=threshold) from None
    return Target(
        id=prompt.id,
        label=prompt.label or "the thing pointed at",
        box=found.outline.bounds,
        confidence=round(found.confidence, 3),
        outline=found.outline,
        prompt=prompt.how,
        parts={name: round(value, 3) for name, value in found.parts.items()},
        missed=missed_vertices(found.outline, prompt),
        source=None if prompt.outline is None else prompt,
    )


def _correcting(world: World, prompt: TargetPrompt) -> TargetPrompt:
    """The prompt, with the outline that its points correct if it has no way of its own."""
    known = next((t.source for t in world.targets if t.id == prompt.id), None)
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
    """The least confidence a mask pointed at in that way is used at."""
    chosen = context.settings.threshold
    return segmenter_named(context.settings.segmenter).thresholds[how] if chosen is None else chosen


ADVICE = {
    "point": "Draw a box close around the thing, or better a rough outline.",
    "candidate": "Draw a rough outline of 4 to 12 vertices around the thing.",
    "box": "Draw a rough outline of 4 to 12 vertices around the thing.",
    "outline": "Draw the outline closer, or name points that do not belong; if what was found "
    "looks right, the person may allow a lower threshold.",
}


def _insufficient(confidence: float, threshold: float, how: str) -> ToolError:
    shown = math.floor(100 * confidence) / 100  # never rounded up to the threshold
    return ToolError(
        f"Insufficient segmentation accuracy. The mask's confidence is {shown:.2f}, below the "
        f"threshold {threshold:.2f}. {ADVICE[how]}",
        "low_confidence",
        confidence=confidence,
        threshold=threshold,
    )


def overlays(
    context: Context, targets: Iterable[Target], plan: Plan | None = None
) -> tuple[bytes, ...]:
    """Pictures of targets whose masks a model should look at before it trusts them."""
    return tuple(closer_view(context, target, plan) for target in targets)


def doubtful(target: Target) -> bool:
    """Whether a mask has to be looked at before robots are sent there."""
    return target.confidence < CLEAR or bool(target.missed)


def closer_view(context: Context, target: Target, plan: Plan | None = None) -> bytes:
    """The target's outline on a part of the picture, as a JPEG file."""
    x0, y0, x1, y1 = target.box
    out = AROUND * max(x1 - x0, y1 - y0) + 2
    shown = context.world if plan else context.world.having(targets=(target,))
    region = (x0 - out, y0 - out, x1 + out, y1 + out)
    drawn = () if target.source is None else target.source.outline or ()
    return draw_view(context.picture, shown, plan=plan, region=region, drawn=drawn)
