"""Tools that commit: propose_formation, deploy, ask_user, report_impossible."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import WithJsonSchema
from pydantic.json_schema import SkipJsonSchema

from ..context import Context, Settings
from ..errors import ToolError
from ..fleet.follow import Follow
from ..formation.checking.instruction_doubts import doubts
from ..formation.contract import MIN_CLEARANCE, Contract, Group, exact_clearance, nominal
from ..formation.placement.avoidance import off_others
from ..formation.placement.caging import CUT_SHORT
from ..formation.placement.partial import best_partial
from ..formation.plan import Plan, make_plan
from ..formation.site import PlacementError
from ..formation.units import contract_in_pixels, length_text, with_metres
from ..geometry.cages.budget import cut_short, search_budget
from ..perception.target_prompt import Point, TargetPrompt
from ..tool import FilledBy, ToolResult, in_thread, tool
from ..world import PlanNode, ShownCandidate, Target, World
from .others import with_hard_keep_outs, with_others
from .robots import drive_to, with_observed, with_robots
from .seeing import sighting
from .targets import (
    closer_views,
    corrections,
    doubtful,
    framed,
    measured_all,
    summary,
    well_missed,
    with_pointed,
)

MAX_FINDINGS = 12
"""Findings spelled out in a reply; the rest are counted."""
SLACK_SHARE, SLACK_PX = 0.25, 3.0
"""How far off an outline may be, as a share of the distance kept from it, but at least this, px."""
SHOW_PARTIAL = "To show it to the person, pass its plan_id to report_impossible."
"""Ends the answer to what cannot be met in full; for a model, not for the person."""


@tool("commit")
async def propose_formation(
    context: Context,
    contract: Contract,
    targets: tuple[TargetPrompt, ...] = (),
    positions: tuple[Point, ...] | None = None,
    samples: Annotated[tuple[str, ...] | None, FilledBy("sample_inside")] = None,
    tell: str | None = None,
) -> ToolResult:
    """State what is demanded; robots are placed so and certified.

    Args:
        contract: its robots add up to Robots, or the words' number. unit: of lengths, where
            Metres per pixel is told; places are px. keep_out: ids no robot may touch.
            reading: only after a doubt, why this is meant.
        targets: things not measured yet, or to correct.
        positions: (x, y) of all robots in order of the groups.
        samples: names of samples (s1, ...) to use.
        tell: to the person, where Deploy is false; ends the turn.
    """
    if positions is not None and samples is not None:
        raise ToolError("propose_formation: give positions or samples, not both.")
    stated = contract_in_pixels(contract, context.world.metres_per_pixel)
    _check_against_words(context, stated)
    held = with_hard_keep_outs(_with_fixed_settings(stated, context.settings), context.world)
    targets = with_pointed(context.world, targets, held.target_ids)

    def work() -> tuple[World, PlanNode | PlacementError, Plan | None]:
        world = with_others(context.at(measured_all(context, targets)))
        places = positions if samples is None else _sampled(world, samples)
        try:
            return world, *_planned(context.at(world), held, places)
        except ToolError as error:
            raise error.showing(*closer_views(context.at(world), context.world, targets)) from None

    world, found, partial = await in_thread(work)
    offered: dict[str, Any] = {}
    if partial is not None:
        less = PlanNode(plan=partial, words=context.words, unseen=_unseen(world, held))
        world = await with_robots(context.at(world), less)
        offered = {"partial": _offer(world.latest.plan), "next": SHOW_PARTIAL}
    if isinstance(found, PlacementError):
        context.observed(world)
        shown = closer_views(context.at(world), context.world, targets)
        raise _refusal(found, offered["partial"]).showing(*shown)
    world = await with_robots(context.at(world), found)
    return _proposed(context, world, targets, offered, tell)


def _proposed(
    context: Context,
    world: World,
    targets: Sequence[TargetPrompt],
    offered: dict[str, Any],
    tell: str | None,
) -> ToolResult:
    """Return the result of a proposal that has come to a plan, the latest of the next world."""
    node = world.latest
    data = proposal_data(world, node.plan) | corrections(context.world, world, targets) | offered
    return tell_of(context, world, node, data, targets, tell)


def tell_of(
    context: Context,
    world: World,
    node: PlanNode,
    data: dict[str, Any],
    targets: Sequence[TargetPrompt],
    tell: str | None,
) -> ToolResult:
    """Return the result of a tool that made a plan: what to look at first, or the last word."""
    now, message, certified = context.at(world), None, node.plan.verdict.certified
    looked = tuple(_seen(t) if t.id in node.unseen else t for t in world.targets)
    if certified and (advice := _look_first_advice(now, node)):
        data |= {"look_first": advice}
    elif certified and not context.settings.may_deploy:
        message = tell or None
    shown = closer_views(now, context.world, targets, node.plan, node.unseen)
    return ToolResult(data, shown, world=world.having(targets=looked), message=message)


def _seen(target: Target) -> Target:
    """Return a target marked as one whose outline has been shown."""
    return target if target.seen else target.model_copy(update={"seen": True})


def _check_against_words(context: Context, contract: Contract) -> None:
    """Check the contract, in px, against the number of robots and the words of the person."""
    settings, asked = context.settings, context.settings.robots
    if asked is not None and contract.robots != asked:
        raise ToolError(
            f"The person asked for {asked} robots; the contract's groups add up to "
            f"{contract.robots}.",
            "count",
        )
    found = doubts(
        context.words,
        contract,
        counted=asked is not None,
        measured=settings.clearance is not None or settings.robot_radius is not None,
        scale=context.world.metres_per_pixel,
    )
    if found and not (contract.reading and context.doubted.issuperset(found)):
        doubt = f"A doubt: {'; '.join(found)}."
        raise ToolError(
            f"{doubt} Propose again with a contract that says what is meant; if this one does, "
            "say why in its `reading`.",
            "doubt",
            doubts=found,
            plain=doubt,
        )


def _planned(
    context: Context, held: Contract, places: Any
) -> tuple[PlanNode | PlacementError, Plan | None]:
    """Return a contract's plan or why there is none, and the best partial plan if not certified."""
    world = context.world
    site, version = world.site(held), world.version_of(held)
    with search_budget():
        try:
            plan = make_plan(held, site, version, places)
        except PlacementError as error:
            partial = best_partial(held, site, version, error)
            if partial is None and cut_short() and CUT_SHORT not in str(error):
                raise ToolError(f"{error}{CUT_SHORT}", error.kind, **error.facts) from None
            if partial is None:
                raise
            return error, off_others(partial, site)
        partial = None
        if places is None:
            plan = off_others(plan, site)
        if places is None and not plan.verdict.certified:
            partial = best_partial(held, site, version, None)
    return PlanNode(plan=plan, words=context.words, unseen=_unseen(world, held)), partial


def _refusal(error: PlacementError, partial: dict[str, str]) -> ToolError:
    """Return the error for robots that cannot all be placed, with the partial plan instead."""
    plain = f"{error} {partial['sentence']}"
    facts = error.facts | {"partial_plan": partial["plan_id"], "plain": plain}
    return ToolError(f"{plain} {SHOW_PARTIAL}", error.kind, **facts)


def _unseen(world: World, held: Contract) -> tuple[str, ...]:
    """Return the targets whose outlines have to be seen before robots move."""
    measured_from = {n for g in held.groups if g.clearance is not None for n in g.targets}
    named = (t for t in world.targets if t.id in held.target_ids and not t.seen)
    return tuple(t.id for t in named if doubtful(t) or t.id in measured_from)


@tool("actuate")
async def deploy(
    context: Context,
    plan_id: str | None = None,
    tell: str | None = None,
    follow: Annotated[Follow | None, WithJsonSchema({"type": "object"})] = None,
) -> ToolResult:
    """Move the robots to a plan that is certified.

    Args:
        plan_id: left out: of this reply, else what stands.
        tell: on arrival; ends the turn.
        follow: {seconds, speed (px/s)}: keep up with what moves.
    """
    plan_id, made = plan_id or _standing_id(context), context.proposed
    node = context.world.plan(plan_id or made)
    _check_may_move(context, node.plan)
    if plan_id is None and (advice := _look_first_advice(context, node)):
        return ToolResult({"deployed": False, "why": f"Look first: {advice}"})
    arrival, world, moved = await drive_to(context, node, follow)
    worst = int(np.argmax(arrival.residual_px))
    data = {
        "plan_id": node.plan.id,
        "arrived": arrival.arrived,
        "corrections": arrival.corrections,
        "worst_residual_px": arrival.residual_px[worst],
        "worst_robot": arrival.robots[worst],
        "tolerance_px": arrival.tolerance_px,
    }
    if not moved:
        data["already_there"] = True
    data |= {"reason": arrival.reason} if arrival.reason and moved else {}
    data |= {"followed": arrival.follow.told(world.metres_per_pixel)} if arrival.follow else {}
    message = with_observed(tell, arrival, world) if arrival.done else None
    data = with_metres(data, world.metres_per_pixel)
    return ToolResult(data, world=world, message=message)


def _standing_id(context: Context) -> str | None:
    """Return the id of the current plan if it is of an earlier turn; None if this reply made one.

    Raises:
        ToolError: there is no such plan, and none was made in this reply.
    """
    world = context.world
    if context.proposed is not None:
        return None
    began = context.steps[-1 - world.undone].current if context.steps else None
    if world.current is not None and (world.undone or world.current == began):
        return world.current
    known = ", ".join(world.plans) or "none yet: propose a formation first"
    raise ToolError(f"No plan was made in this reply; name plan_id. Plans: {known}.")


def _check_may_move(context: Context, plan: Plan) -> None:
    """Refuse to move robots to a plan that is not certified, or not approved as it is.

    Raises:
        ToolError: the plan is not certified, or partial and not approved, or nothing may be moved.
    """
    if not plan.verdict.certified:
        raise ToolError(f"Plan {plan.id} is not certified; repair its findings and propose again.")
    if plan.partial is not None and context.settings.approved != plan.id:
        short = plan.partial.short(context.world.metres_per_pixel)
        raise ToolError(
            f"Plan {plan.id} is partial ({short}): nothing of a task is done unasked. A person "
            "may have exactly this plan driven, by its id."
        )
    if not context.settings.may_deploy:
        raise ToolError("The person asked for the plan only: nothing may be moved.")


@tool("ask")
def ask_user(
    context: Context,
    question: str,
    candidates: tuple[str, ...] = (),
    contract: SkipJsonSchema[Contract | None] = None,
    options: SkipJsonSchema[tuple[str, ...]] = (),
) -> ToolResult:
    """Ask the person what is left open; ends the turn.

    Args:
        question: one, clear.
        candidates: to choose from (c3, t1).
        contract: that would do, shown to the person; the offline planner's, in no schema.
        options: words that would answer it; likewise.
    """
    found = {c: context.candidate(c) for c in candidates if c.startswith("c")}
    listed = [
        sighting(found[c]) if c in found else summary(context.world.target(c)) for c in candidates
    ]
    shown = tuple(
        ShownCandidate(id=c, label=thing.label, box=thing.outline.bounds)
        for c, thing in found.items()
    )
    world = context.world.having(shown=shown)
    return ToolResult({"question": question, "candidates": listed}, world=world)


@tool("end")
def report_impossible(
    context: Context,
    reason: str,
    robots_needed: int | None = None,
    plan_id: str | None = None,
    contract: SkipJsonSchema[Contract | None] = None,
) -> ToolResult:
    """Say that it cannot be done; ends the turn.

    Args:
        reason: a sentence with the numbers.
        robots_needed: how many would do.
        plan_id: the best plan found.
        contract: that would do, as of ask_user.
    """
    if plan_id is not None and plan_id not in context.world.plans:
        raise ToolError(f"There is no plan {plan_id!r}.")
    data = {"reason": reason, "robots_needed": robots_needed, "plan_id": plan_id}
    return ToolResult(data, message=reason)


def _offer(plan: Plan) -> dict[str, str]:
    """Return a partial plan's id, and what there is to say of it."""
    assert plan.partial is not None
    sentence = f"Plan {plan.id} is certified as partial: {plan.partial.sentence}"
    return {"plan_id": plan.id, "sentence": sentence}


def _look_first_advice(context: Context, node: PlanNode) -> str:
    """Return what has to be looked at before an unseen plan is carried out, or ""."""
    if not node.unseen:
        return ""
    world = context.world
    target, scale = world.target(node.unseen[0]), world.metres_per_pixel
    slack = length_text(_slack(node.plan, target.id), scale, ".0f")
    call = f'call deploy {{"plan_id": "{node.plan.id}", "tell": "..."}}'
    follows = call if context.settings.may_deploy else "reply with `tell` as text, without a call"
    return (
        f"{target.id} {_doubt(target, scale)}. If the outline shown follows the thing to "
        f"within about {slack}, {follows}. Where it does not and yours (dashed) does, propose "
        f'again with targets [{{"id": "{target.id}", "points": [[x, y]], "negative": [[x, y]]}}], '
        "points on the thing there or negative ones off it; else with a closer outline."
    )


def _doubt(target: Target, scale: float | None) -> str:
    """Return why a target has to be looked at."""
    if not doubtful(target):
        return "has an edge that a named distance is measured from"
    if not (missed := well_missed(target)):
        return f"was measured with confidence {target.confidence:.2f}"
    left = (f"({x:g}, {y:g}) by {length_text(px, scale, '.0f')}" for x, y, px in missed)
    return f"as measured leaves out your {', '.join(left)}, which has so much less clearance"


def _slack(plan: Plan, name: str) -> float:
    """Return how far off an outline may be without harm, px: a share of the distance to keep."""
    groups = (g for g in plan.formation.contract.groups if name in g.targets)
    kept = [nominal(g.clearance) for g in groups if g.clearance is not None]
    return max(SLACK_SHARE * min(kept, default=MIN_CLEARANCE), SLACK_PX)


def _with_fixed_settings(contract: Contract, settings: Settings) -> Contract:
    """Return the contract with what the person fixed: robot radius and clearance."""
    groups = tuple(_with_clearance(g, settings.clearance) for g in contract.groups)
    radius = settings.robot_radius
    fixed = {} if radius is None else {"robot_radius": radius}
    return contract.model_copy(update={"groups": groups, **fixed})


def _with_clearance(group: Group, clearance: float | None) -> Group:
    if clearance is None or not group.keeps_clearance:
        return group
    return group.model_copy(update={"clearance": exact_clearance(group, clearance)})


def _sampled(world: World, samples: tuple[str, ...]) -> Any:
    if unknown := [s for s in samples if s not in world.samples]:
        known = ", ".join(world.samples) or "none yet"
        raise ToolError(f"There is no sample {unknown[0]!r}. Samples: {known}.")
    return np.concatenate([np.asarray(world.samples[s]) for s in samples] or [np.empty((0, 2))])


def proposal_data(world: World, plan: Plan) -> dict[str, Any]:
    """Return what a reply says of a plan."""
    verdict, contract = plan.verdict, plan.formation.contract
    findings = [f.sentence for f in verdict.findings]
    more = len(findings) - MAX_FINDINGS
    return {
        "plan_id": plan.id,
        "certified": verdict.certified,
        "findings": findings[:MAX_FINDINGS] + ([f"and {more} more findings"] if more > 0 else []),
        "notes": list(verdict.notes),
        "measures": with_metres(verdict.measures, world.metres_per_pixel),
        "targets": [summary(t) for t in world.targets if t.id in contract.target_ids],
        "robots": contract.robots,
        **framed(world),
    }
