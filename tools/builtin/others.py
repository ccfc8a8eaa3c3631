"""The other things in a picture, and the regions a person wants kept free, in the world."""

import math
from collections.abc import Sequence

import shapely

from ..context import Context
from ..errors import InputError, ToolError
from ..fleet.protocol import Pose
from ..formation.contract import Contract
from ..geometry.outline import MIN_AREA, Outline, outline_of
from ..perception.target_prompt import TargetPrompt
from ..world import KeepOut, World
from .targets import measured_all

FAINT = 0.4
"""Candidates that are less salient do not count as things."""
SPECK, GROUND = 2e-4, 0.33
"""What covers less of the picture may be dirt; what covers more is the ground."""
LOOKS_LARGER, WITHIN = 1.6, 0.9
"""Times its radius up to which a robot's own look is taken to reach, and the share of a thing that
has to lie within.
"""
DETAIL, DECIMALS = 1.0, 1
"""How much the outlines of other things are simplified, px, and decimals they are rounded to."""


def with_others(context: Context) -> World:
    """Return the world with what stands out in its picture as things that robots keep off."""
    world, found = context.world, list[KeepOut]()
    if any(not k.hard for k in world.keep_out):
        return world
    pixels = math.prod(world.picture.size)
    for c in context.candidates():
        area, seen = c.outline.filled.area, round(c.salience, 3)
        if seen >= FAINT and max(SPECK * pixels, MIN_AREA) <= area <= GROUND * pixels:
            region = c.outline.polygon.simplify(DETAIL)
            outline = outline_of(shapely.transform(region, lambda at: at.round(DECIMALS)))
            thing = {"id": c.id, "reason": c.label, "hard": False, "confidence": seen}
            found.append(KeepOut.model_validate({"outline": outline, **thing}))
    return world.having(keep_out=(*world.keep_out, *found))


def without_robots(world: World, poses: Sequence[Pose], radius: float) -> World:
    """Return the world without things that are its own robots, as a picture from above shows them.

    Such a thing lies almost whole within some robot's body, which may look larger by its shadow.

    Args:
        radius: of a robot, px.
    """
    bodies = shapely.points([(pose.x, pose.y) for pose in poses]).tolist()
    team = shapely.union_all([body.buffer(LOOKS_LARGER * radius) for body in bodies])
    kept = [
        k
        for k in world.keep_out
        if k.hard or k.outline.filled.intersection(team).area < WITHIN * k.outline.filled.area
    ]
    return world.having(keep_out=tuple(kept)) if len(kept) < len(world.keep_out) else world


def with_keep_outs(context: Context, prompts: Sequence[TargetPrompt]) -> World:
    """Return the world with regions that no robot may enter, k1, k2, ...

    A box or an outline is the region itself; at a point the thing is measured, and a candidate is
    taken as it was found.

    Raises:
        InputError: a region is not in the picture, or cannot be measured.
    """
    world = context.world
    for prompt in prompts:
        prompt, done = prompt.mended()
        try:
            outline = _region(context, prompt)
        except ToolError as error:
            raise InputError(f"keep-out: {error}") from None
        name = f"k{sum(k.hard for k in world.keep_out) + 1}"
        reason = f"to be kept free{f' ({done})' if done else ''}"
        region = KeepOut(id=name, outline=outline, reason=reason)
        world = world.having(keep_out=(*world.keep_out, region))
    return world


def _region(context: Context, prompt: TargetPrompt) -> Outline:
    if problems := prompt.problems(*context.world.picture.size):
        raise ToolError(" ".join(problems))
    if prompt.candidate is not None:
        return context.candidate(prompt.candidate).outline
    if prompt.box is not None:
        return outline_of(shapely.box(*prompt.box))
    if prompt.outline is not None:
        return outline_of(shapely.Polygon(prompt.outline))
    return measured_all(context, (prompt,)).target(prompt.id).outline


def with_hard_keep_outs(contract: Contract, world: World) -> Contract:
    """Return the contract with the world's regions that no robot may enter in its `keep_out`."""
    hard = (k.id for k in world.keep_out if k.hard)
    return contract.model_copy(
        update={"keep_out": tuple(dict.fromkeys((*contract.keep_out, *hard)))}
    )
