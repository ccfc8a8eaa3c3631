"""Doors that commit: propose_formation, deploy, ask_user, report_impossible."""

from typing import Any

import numpy as np

from ..errors import ToolError
from ..fleet.deploy import Arrival
from ..fleet.deploy import deploy as drive
from ..fleet.simulated import SimulatedFleet
from ..formation.contract import Contract, Group
from ..formation.partial import REFUSALS, Refusal, best_partial
from ..formation.plan import Plan, make_plan
from ..formation.wording import doubts
from ..geometry.outline import distances
from ..perception.prompts import Point, TargetPrompt
from ..scene import Target
from ..tool import ToolResult, tool
from ..workspace import Settings, Workspace
from .seeing import FRAME, doubtful, measured, overlays, sighting, summary

MAX_FINDINGS = 12
"""Findings spelled out in a reply; the rest are counted."""
EXACT_SHARE, EXACT_PX = 0.05, 1.0
"""How exactly a clearance the person fixed is held."""
SHOW_PARTIAL = "To show it to the person, pass its plan_id to report_impossible."
"""Ends the answer to what cannot be met in full; for a model, not for the person."""


@tool("commit")
def propose_formation(
    workspace: Workspace,
    contract: Contract,
    targets: tuple[TargetPrompt, ...] = (),
    positions: tuple[Point, ...] | None = None,
    samples: tuple[str, ...] | None = None,
) -> ToolResult:
    """State what the instruction demands, and have the robots placed and certified.

    Without positions or samples the robots are placed as the contract says: the usual way.
    Every violation comes back with numbers; what is not certified cannot be deployed.

    Args:
        contract: what the instruction demands; its robots add up to Robots, or to the words'.
        targets: the things meant that are not measured yet.
        positions: (x, y) of every robot in the order of the groups, px; usually left out.
        samples: names that sample tools gave (s1, ...), to use as positions instead.
    """
    if positions is not None and samples is not None:
        raise ToolError("propose_formation: give positions or samples, not both.")
    asked = workspace.settings.robots
    if asked is not None and contract.robots != asked:
        raise ToolError(
            f"The person asked for {asked} robots; the contract's groups add up to "
            f"{contract.robots}."
        )
    found = doubts(workspace.instruction, contract, counted=asked is not None)
    if found and not contract.reading:
        raise ToolError(
            f"A doubt: {'; '.join(found)}. Propose again with a contract that says what is meant; "
            "if this one does, say why in its `reading`."
        )
    for prompt in targets:
        measured(workspace, prompt)
    held = _held_to(contract, workspace.settings)
    places = positions if samples is None else _sampled(workspace, samples)
    try:
        plan = make_plan(held, workspace.scene.site(held), workspace.scene.version, places)
    except REFUSALS as error:
        raise ToolError(f"{error}{_partial(workspace, held, error)}") from None
    _keep(workspace, plan)
    exact = workspace.exact[plan.id] = _exact(contract)
    data = _proposal(workspace, plan)
    if places is None and not plan.verdict.certified:
        found = _partial(workspace, held, None)
        _keep(workspace, plan)
        data |= {"partial": found.strip()} if found else {}
    named = map(workspace.scene.target, held.target_ids)
    shown = [target for target in named if doubtful(target) or target.id in exact]
    return ToolResult(data, overlays(workspace, shown, plan))


def _exact(contract: Contract) -> tuple[str, ...]:
    """Targets to be kept a named distance from."""
    groups = (group for group in contract.groups if group.clearance is not None)
    return tuple(sorted({name for group in groups for name in group.targets}))


@tool("actuate")
async def deploy(
    workspace: Workspace, plan_id: str | None = None, tell: str | None = None
) -> ToolResult:
    """Move the robots to a certified plan; says where they were observed to arrive.

    Args:
        plan_id: of a certified plan; left out: the one proposed in this same reply.
        tell: what to tell the person once all have arrived, which ends the run; left out where
            more is to be done.
    """
    plan = workspace.current_plan(plan_id)
    if not plan.verdict.certified:
        raise ToolError(f"Plan {plan.id} is not certified; repair its findings and propose again.")
    if plan.partial is not None and workspace.settings.approved != plan.id:
        raise ToolError(
            f"Plan {plan.id} is partial ({plan.partial.short}): nothing of a task is done unasked. "
            "A person may have exactly this plan driven, with formup deploy."
        )
    if not workspace.settings.may_deploy:
        raise ToolError("The person asked for the plan only: nothing may be moved.")
    if plan_id is None:
        _check_clear(workspace, plan)
    plan_id = plan.id
    site = workspace.scene.site(plan.formation.contract)
    fleet = workspace.fleet_for(plan.formation.contract, site)
    arrival = await drive(plan, site, fleet)
    workspace.arrivals[plan_id] = arrival
    if isinstance(fleet, SimulatedFleet):
        workspace.frames[plan_id] = fleet.frames
    worst = int(np.argmax(arrival.residual_px))
    data = {
        "plan_id": plan_id,
        "arrived": arrival.arrived,
        "corrections": arrival.corrections,
        "worst_residual_px": arrival.residual_px[worst],
        "worst_robot": worst + 1,
        "tolerance_px": arrival.tolerance_px,
    }
    if arrival.assignment_gap is not None:
        most = f"{arrival.assignment_gap:.2%} of the summed squared ways"
        data["assignment"] = f"approximate: another could have saved {most} at most"
    return ToolResult(data, told=_told(tell, arrival) if arrival.arrived else None)


@tool("ask")
def ask_user(workspace: Workspace, question: str, candidates: tuple[str, ...] = ()) -> ToolResult:
    """Ask the person when the instruction does not settle what to do; this ends the turn.

    Args:
        question: one clear question.
        candidates: ids of numbered things (c3) or targets (t1) to choose from, if there are any.
    """
    listed = [
        sighting(workspace.candidate(c))
        if c.startswith("c")
        else summary(workspace.scene.target(c))
        for c in candidates
    ]
    return ToolResult({"question": question, "candidates": listed})


@tool("end")
def report_impossible(
    workspace: Workspace, reason: str, robots_needed: int | None = None, plan_id: str | None = None
) -> ToolResult:
    """Say that the instruction cannot be carried out, and why; this ends the run.

    Args:
        reason: why, in one sentence, with the numbers.
        robots_needed: how many robots would do, where that is the trouble.
        plan_id: the best plan that was found, certified or not.
    """
    if plan_id is not None and plan_id not in workspace.plans:
        raise ToolError(f"There is no plan {plan_id!r}.")
    data = {"reason": reason, "robots_needed": robots_needed, "plan_id": plan_id}
    return ToolResult(data, told=reason)


def _keep(workspace: Workspace, plan: Plan) -> None:
    workspace.plans.pop(plan.id, None)  # proposed again, it is the latest again
    workspace.plans[plan.id] = plan


def _partial(workspace: Workspace, held: Contract, refusal: Refusal | None) -> str:
    """Keep the best partial plan; what there is to say of it, nothing where there is none."""
    plan = best_partial(held, workspace.scene.site(held), workspace.scene.version, refusal)
    if plan is None or plan.partial is None:
        return ""
    _keep(workspace, plan)
    return f" Plan {plan.id} is certified as partial: {plan.partial.sentence} {SHOW_PARTIAL}"


def _check_clear(workspace: Workspace, plan: Plan) -> None:
    """A plan nobody has looked at may be deployed only about things that were measured clearly."""
    for name in plan.formation.contract.target_ids:
        target = workspace.scene.target(name)
        if doubtful(target) or name in workspace.exact.get(plan.id, ()):
            raise ToolError(
                f"Not deployed yet: {name} {_doubt(target)}. If the outline shown follows the "
                f"thing meant, deploy plan_id {plan.id} (with tell). Else propose again with a "
                "closer outline, with a point on what is left out beside it, or with negative "
                "points on what is not part of it."
            )


def _doubt(target: Target) -> str:
    """Why a target has to be looked at."""
    if not doubtful(target):
        return "is to be kept a named distance from, so its outline has to be seen first"
    if not target.missed:
        return f"was measured with confidence {target.confidence:.2f}"
    away = distances(target.outline.filled, np.asarray(target.missed))
    places = zip(target.missed, away, strict=True)
    left = ", ".join(f"({x:g}, {y:g}) by {px:.0f} px" for (x, y), px in places)
    return f"as measured leaves out your {left}, which has so much less clearance"


def _told(tell: str | None, arrival: Arrival) -> str | None:
    """The model's words and, after them, what was observed."""
    if not tell:
        return None
    count, worst = len(arrival.observed), max(arrival.residual_px)
    robots = "The robot was" if count == 1 else f"All {count} robots were"
    return f"{tell.strip()} {robots} observed within {max(worst, 0.1):.1f} px of the plan."


def _held_to(contract: Contract, settings: Settings) -> Contract:
    """The contract with what the person fixed: robot radius and clearance."""
    groups = tuple(_with_clearance(g, settings.clearance) for g in contract.groups)
    radius = settings.robot_radius
    fixed = {} if radius is None else {"robot_radius": radius}
    return contract.model_copy(update={"groups": groups, **fixed})


def _with_clearance(group: Group, clearance: float | None) -> Group:
    if clearance is None or not group.keeps_clearance:
        return group
    slack = max(EXACT_PX, EXACT_SHARE * clearance)
    greatest = 100_000.0 if group.relation == "inside" else clearance + slack
    least = clearance if group.relation == "inside" else max(clearance - slack, 0.0)
    return group.model_copy(update={"clearance": (least, greatest)})


def _sampled(workspace: Workspace, samples: tuple[str, ...]) -> Any:
    unknown = [s for s in samples if s not in workspace.samples]
    if unknown:
        known = ", ".join(workspace.samples) or "none yet"
        raise ToolError(f"There is no sample {unknown[0]!r}. Samples: {known}.")
    return np.concatenate([workspace.samples[s] for s in samples] or [np.empty((0, 2))])


def _proposal(workspace: Workspace, plan: Plan) -> dict[str, Any]:
    verdict, contract = plan.verdict, plan.formation.contract
    findings = [f.sentence for f in verdict.findings]
    more = len(findings) - MAX_FINDINGS
    return {
        "plan_id": plan.id,
        "certified": verdict.certified,
        "findings": findings[:MAX_FINDINGS] + ([f"and {more} more findings"] if more > 0 else []),
        "notes": list(verdict.notes),
        "measures": verdict.measures,
        "targets": [summary(workspace.scene.target(t)) for t in contract.target_ids],
        "robots": contract.robots,
        "frame": FRAME,
    }
