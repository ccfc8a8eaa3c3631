"""Tools that change the current plan: edit_formation and undo.

Whatever an edit does not name stays as it is, and every robot keeps its number.
"""

import json
from collections.abc import Sequence
from contextlib import suppress
from itertools import count
from typing import Annotated, Any

import numpy as np
from pydantic import WithJsonSchema
from pydantic.json_schema import SkipJsonSchema

from ..context import Context
from ..errors import ToolError
from ..formation.editing.edit_kinds import Edit, Offset, Place, Shift
from ..formation.editing.edits import Edited, edited
from ..formation.plan import Plan
from ..formation.units import with_metres
from ..perception.target_prompt import TargetPrompt
from ..tool import ToolResult, in_thread, tool
from ..world import PlanNode, Step, World
from .committing import MAX_FINDINGS, proposal_data, tell_of
from .others import with_others
from .robots import with_robots
from .targets import doubtful, measured_all, with_pointed

MOST_MOVES = 12
"""Most robots whose ways a reply lists; of all it gives the number and the longest way."""
SHARES = (0.75, 0.5, 0.25)
"""Shares that are tried of a way for which there is no room."""
STAYS = 0.05
"""A robot whose place is nearer than this to the one it had, px, stays."""
SHORT: dict[str, Any] = {
    "type": "array",
    "items": {"type": "object", "properties": {"id": {}, "label": {}, "outline": {}, "box": {}}},
}
"""Schema of targets that models are offered; the whole one comes with propose_formation."""
NOT_MOVED = "robots stay where they are until deploy"


@tool("commit")
async def edit_formation(
    context: Context,
    edits: tuple[Edit, ...],
    plan_id: str | None = None,
    targets: Annotated[tuple[TargetPrompt, ...], WithJsonSchema(SHORT)] = (),
    stay: tuple[int, ...] = (),
    tell: str | None = None,
    share: SkipJsonSchema[bool] = False,
) -> ToolResult:
    """Change the plan that stands; what is not named stays as it is.

    Args:
        edits: in order.
        plan_id: an earlier plan instead.
        targets: unmeasured things edits name, as of propose_formation.
        stay: robots that do not move.
        tell: as of propose_formation.
        share: whether robots may take each other's places, which a person agreed to; in no schema.
    """
    if not edits:
        raise ToolError("edit_formation: name at least one edit.")
    parent = context.world.plan(plan_id)
    targets = with_pointed(context.world, targets, _named(edits))

    def work() -> tuple[World, Edited]:
        world = with_others(context.at(measured_all(context, targets)))
        return world, _edited(world, parent.plan, edits, stay)

    world, made = await in_thread(work)
    known = set(parent.plan.formation.contract.target_ids)
    unseen = [t.id for t in world.targets if t.id not in known and doubtful(t) and not t.seen]
    node = PlanNode(
        plan=made.plan,
        parent=parent.plan.id,
        words=context.words,
        edit=json.dumps([_edit_facts(edit) for edit in edits], separators=(",", ":")),
        unseen=tuple(unseen),
    )
    world = await with_robots(context.at(world), node, made.robots, share)
    node = world.latest
    data = {"parent": parent.plan.id, **proposal_data(world, node.plan)}
    data |= with_metres(moves(parent.plan, node.plan), world.metres_per_pixel)
    return tell_of(context, world, node, data, targets, tell)


def _edited(world: World, plan: Plan, edits: Sequence[Edit], stay: Sequence[int]) -> Edited:
    """Return the certified plan after edits.

    Raises:
        ToolError: an edit makes no sense, or its result is not certified; nothing has changed.
    """
    made = edited(plan, edits, world.whole_site, world.version_of, stay)
    verdict = made.plan.verdict
    if not verdict.certified:
        findings = [finding.sentence for finding in verdict.findings]
        more = len(findings) - MAX_FINDINGS
        text = " ".join([*findings[:MAX_FINDINGS], *([f"And {more} more."] if more > 0 else [])])
        raise ToolError(
            f"Nothing was changed: plan {plan.id} stands, because after this {text}"
            f"{_possible(world, plan, edits, stay)}",
            "edit",
            findings=findings,
        )
    return made


def _possible(world: World, plan: Plan, edits: Sequence[Edit], stay: Sequence[int]) -> str:
    """Return how much of a refused move would do, as a sentence; "" if none is known to."""
    for share in SHARES:
        less = [_lessened(edit, share) for edit in edits]
        with suppress(ToolError):
            made = edited(plan, less, world.whole_site, world.version_of, stay)
            if less != list(edits) and made.plan.verdict.certified:
                return f" {share:.0%} of that way would do."
    return ""


def _lessened(edit: Edit, share: float) -> Edit:
    """Return an edit that moves by a share of the way that another one does."""
    if isinstance(edit, Shift):
        return edit.model_copy(update={"dx": edit.dx * share, "dy": edit.dy * share})
    if isinstance(edit, Place) and edit.by is not None:
        return edit.model_copy(update={"by": (edit.by[0] * share, edit.by[1] * share)})
    if isinstance(edit, Offset) and edit.px is not None:
        return edit.model_copy(update={"px": edit.px * share})
    return edit


def previewed(world: World, edits: Sequence[Edit], plan_id: str | None = None) -> Plan:
    """Return what edits would make of a plan, certified or with findings; nothing is changed.

    Raises:
        ToolError: there is no such plan, or an edit makes no sense.
    """
    plan = world.plan(plan_id).plan
    made = edited(plan, edits, world.whole_site, world.version_of)
    fleet = plan.formation.robots
    free = (str(n) for n in count(1) if str(n) not in fleet)
    taking = [next(free) if name is None else name for name in made.robots]
    more = [name for name in taking if name not in fleet]
    return made.plan.for_robots(taking, (*fleet, *more))


def _edit_facts(edit: Edit) -> dict[str, Any]:
    """Return an edit as JSON, with all that it says."""
    return edit.model_dump(mode="json", exclude_none=True)


def _named(edits: Sequence[Edit]) -> set[str]:
    """Return what edits name that may be ids of things."""
    named: set[Any] = set()
    for edit in edits:
        facts = edit.model_dump()
        demanded: dict[str, Any] = facts.get("demands") or {}
        named.update(facts.get(name) for name in ("to", "target", "towards"))
        named.update((*(facts.get("ids") or ()), *(demanded.get("targets") or ())))
    return {name for name in named if isinstance(name, str)}


def moves(before: Plan, after: Plan) -> dict[str, Any]:
    """Return which robots have another place than before and how far it is from the old one."""
    old = dict(zip(before.formation.robots, before.formation.positions, strict=False))
    new = dict(zip(after.formation.robots, after.formation.positions, strict=False))
    ways = {n: float(np.hypot(*np.subtract(new[n], old[n]))) for n in new if n in old}
    going = sorted((n for n in ways if ways[n] >= STAYS), key=lambda n: -ways[n])
    listed = [{"robot": n, "px": round(ways[n], 1)} for n in going[:MOST_MOVES]]
    return {
        "moves": listed,
        "moving": len(going),
        "longest_px": round(max(ways.values(), default=0.0), 1),
        "staying": len(ways) - len(going),
        "added": [n for n in new if n not in old],
        "removed": [n for n in old if n not in new],
    }


@tool("commit")
def undo(
    context: Context, steps: int = 1, to: str | None = None, tell: str | None = None
) -> ToolResult:
    """Go back to the plan before; robots do not move by that.

    Args:
        steps: how many; negative goes forward again.
        to: first, or the id of a plan of the conversation, instead.
        tell: to the person; ends the turn.
    """
    world, line = context.world, _line_of_plans(context)
    at = len(line) - 1 - world.undone
    wanted = at - steps if to is None else _place_of(line, to)
    if steps == 0 and to is None:
        raise ToolError("undo: steps is 1 or more to go back, -1 or less to go forward again.")
    if not 0 <= wanted < len(line):
        which = "There is nothing to undo" if wanted < 0 else "Nothing was undone"
        left = at if wanted < 0 else len(line) - 1 - at
        raise ToolError(f"{which}: {left} of {abs(steps)} steps are there.", "nothing_to_undo")
    world = world.back_at(line[wanted], len(line) - 1 - wanted)
    if world.current is None:
        return ToolResult({"plan_id": None, "robots": NOT_MOVED}, world=world, message=tell or None)
    plan = world.plan().plan
    before = context.world.plans.get(context.world.current or "")
    data = proposal_data(world, plan) | (moves(before.plan, plan) if before else {})
    return ToolResult(data | {"next": NOT_MOVED}, world=world, message=tell or None)


def _line_of_plans(context: Context) -> list[Step]:
    """Return the steps that undo goes through, including the one that this turn has made."""
    world, steps = context.world, list(context.steps)
    if world.undone == 0 and (not steps or steps[-1].current != world.current):
        steps.append(world.step)
    return steps


def _place_of(line: Sequence[Step], to: str) -> int:
    """Return the index of a plan in the line of plans.

    Raises:
        ToolError: the plan is not in it.
    """
    for place, step in enumerate(line):
        if step.current is not None and to in ("first", step.current):
            return place
    known = ", ".join(step.current for step in line if step.current) or "none yet"
    raise ToolError(f"There is no plan {to!r} to go back to; plans: {known}.", "unknown_plan")
