"""Tool that makes a target of things that are known: a group, a gap, a bay, a part."""

from collections.abc import Sequence
from typing import Annotated, Literal, get_args

import shapely
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..context import Context
from ..errors import InputError, ToolError
from ..geometry.derived import PartName, Side, bay_of, gap_between, grouped, part_of
from ..geometry.outline import Outline, outline_of
from ..perception.detectors.candidates import salient_candidates
from ..tool import ToolResult, tool
from ..world import Target
from .seeing import parse_prompt
from .targets import closer_view, framed, summary, trusted

Kind = Literal["group", "gap", "bay", "part"]
MOST_MEMBERS = 60
"""The most things of a group."""
COVERED = 0.5
"""A thing that lies this far in another is that thing, or a part of it."""
TOUCHED = 0.05
"""A note names a thing that lies at least this far in what was made."""
NAMED = 8
"""The most other things that a note names."""


@tool("read")
def derive_target(
    context: Context,
    kind: Kind,
    of: Annotated[tuple[str, ...], Field(min_length=1, max_length=MOST_MEMBERS)],
    id: str = "t1",
    label: str = "",
    where: PartName | Side | None = None,
) -> ToolResult:
    """Make one target of things that are known, by geometry alone: nothing is looked for.

    A gap or a bay is free of all that stands out; what was cut out of it is named.

    Args:
        kind: group: several as one; gap: free place between two; bay: the largest dent of one;
            part: a half of one, or an end of its long axis.
        of: ids of targets (t1) or candidates (c4), which are measured first.
        id: of the new target: t1, t2, ...; one in use is replaced.
        label: what it is, in a few words.
        where: which part; of a bay the side it opens to, where there are several.
    """
    _refuse_unfit(kind, of, where)
    prompt = parse_prompt({"id": id, "label": label, "candidate": "c1"})  # holds id and label
    members = [_member(context, name, prompt.id) for name in of]
    try:
        outline, note = _derived(context, kind, members, where)
    except InputError as error:
        raise ToolError(str(error)) from None
    target = Target(
        id=prompt.id,
        label=label or (f"the {where} of {members[0].label}" if kind == "part" else f"the {kind}"),
        box=outline.bounds,
        confidence=min(m.confidence for m in members),
        outline=outline,
        prompt=kind,
        note=note,
    )
    world = context.world.with_target(target)
    context = context.at(world)
    return ToolResult({**summary(target), **framed(world)}, (closer_view(context, target),), world)


def _refuse_unfit(kind: Kind, of: Sequence[str], where: str | None) -> None:
    """Raise a ToolError where the arguments do not go together."""
    problems: list[str] = []
    if kind == "group" and len(of) < 2:
        problems.append(f"a group is of 2 or more things; got {len(of)}")
    if kind == "gap" and len(of) != 2:
        problems.append(f"a gap is between 2 things; got {len(of)}")
    if kind in ("bay", "part") and len(of) != 1:
        problems.append(f"a {kind} is of 1 thing; got {len(of)}")
    if len(set(of)) < len(of):
        problems.append("each thing is named once")
    allowed = {"part": get_args(PartName), "bay": (None, *get_args(Side))}.get(kind, (None,))
    if where not in allowed:
        named = ", ".join(a for a in allowed if a) or "nothing"
        problems.append(f"where of a {kind} is {named}; got {where or 'nothing'}")
    if problems:
        raise ToolError(f"derive_target: {'; '.join(problems)}.")


def _member(context: Context, name: str, new: str) -> Target:
    """Return a known target, or a candidate measured as the one that is to be made."""
    if name.startswith("c"):
        prompt = parse_prompt({"id": new, "candidate": name, "label": ""})
        found = trusted(context, prompt)[1]
        return found.model_copy(update={"id": name, "label": context.candidate(name).label})
    return context.world.target(name)


def _derived(
    context: Context, kind: Kind, members: Sequence[Target], where: str | None
) -> tuple[Outline, str]:
    """Return the outline and what is to be known of it."""
    outlines = [m.outline for m in members]
    *most, last = (m.id for m in members)
    ids = f"{', '.join(most)} and {last}" if most else last
    things = _other_things(context, members)
    if kind == "group":
        outline, which = grouped(outlines)
        if cut := _named_within([t for t in things if not outline.filled.covers(t[1])], outline):
            raise InputError(
                f"The {which} of {ids} cuts through {cut}, where robots around it would stand: "
                "name that too, leave one out, or draw the outline that is meant."
            )
        among = _named_within(things, outline)
        taken = f" It takes in {among} too." if among else ""
        return outline, f"Its outline is the {which} of {ids}.{taken}"
    if kind == "part":
        half = next(p for p in get_args(PartName) if p == where)
        part = part_of(outlines[0], half)
        share = round(100 * part.area / outlines[0].area)
        said = f"{share} % of {ids}; robots keep off the rest only where it is in keep_out."
        return part, f"Cut by geometry alone: {said}"
    regions = [region for _, region in things]
    if kind == "gap":
        outline, width = gap_between(outlines[0], outlines[1], regions)
        said = f"between {ids}, {width:.0f} px at its narrowest"
    else:
        side = next((s for s in get_args(Side) if s == where), None)
        outline, said = bay_of(outlines[0], side, regions), f"in a bay of {ids}"
    cut = _named_within(things, outline_of(outline.filled.convex_hull))
    return outline, f"Free {said}.{f' Cut out of it: {cut}.' if cut else ''}"


def _other_things(context: Context, members: Sequence[Target]) -> list[tuple[str, Polygon]]:
    """Return all that is known beside the members: targets, what stands out, places kept free."""
    own = shapely.union_all([m.outline.filled for m in members])
    names = {m.id for m in members}
    places = ("gap", "bay")
    known = [(t.id, t.outline.filled) for t in context.world.targets if t.prompt not in places]
    known += [(c.id, c.outline.filled) for c in salient_candidates(context.candidates())]
    known += [(k.id, k.outline.filled) for k in context.world.keep_out if k.hard]
    return [
        (name, region)
        for name, region in known
        if name not in names
        and not _is_one(region, own)
        and not region.contains(own)  # what they lie on
    ]


def _is_one(region: BaseGeometry, own: BaseGeometry) -> bool:
    return region.intersection(own).area > COVERED * region.area


def _named_within(things: Sequence[tuple[str, Polygon]], outline: Outline) -> str:
    """Name the things that reach into an outline."""
    region = outline.filled
    found = [n for n, thing in things if region.intersection(thing).area > TOUCHED * thing.area]
    rest = len(found) - NAMED
    return ", ".join(found[:NAMED]) + (f" and {rest} more" if rest > 0 else "")
