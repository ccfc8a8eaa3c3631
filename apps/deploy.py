"""`formup deploy PLAN.json`: a person's approval of exactly that plan, and the move."""

import asyncio
import json
import sys

import typer
from rich.console import Console

from ..agent.report import Report, metric_data, target_data
from ..tools.builtin.committing import deploy as deploy_tool
from ..tools.errors import InputError, ToolError
from ..tools.formation.plan import Plan
from ..tools.formation.units import length_text
from ..tools.store import Stored, read_stored, restore
from ..tools.world import Settings, Workspace
from . import options as o
from .run_display import show_report
from .run_files import animate


def deploy(plan: o.PlanFile, fleet: o.FleetName = "simulated", as_json: o.Json = False) -> None:
    """Move robots to a certified plan; naming the file is the approval."""
    Settings(fleet=fleet).check()
    stored = read_stored(plan)
    if stored.plan_id is None or stored.plan_id not in stored.plans:
        raise InputError(f"{plan} holds no plan to deploy; give a plan.json written by formup run.")
    workspace = restore(stored, None, Settings(fleet=fleet, approved=stored.plan_id))
    chosen = stored.plans[stored.plan_id]
    if chosen.partial is not None:
        print(f"formup: a partial plan: {chosen.partial.sentence}", file=sys.stderr)  # noqa: T201
    try:
        asyncio.run(deploy_tool.call(workspace, {"plan_id": chosen.id}))
    except ToolError as error:
        raise InputError(f"{plan}: {error}") from None
    animation = plan.with_name("deploy.gif")
    drawn = animate(animation, workspace, chosen, stored.instruction or "")
    report = _report(chosen, workspace, stored, animation.name if drawn else None)
    if as_json:
        print(report.model_dump_json(indent=2))  # noqa: T201
        print(f"formup: files in {plan.parent}", file=sys.stderr)  # noqa: T201
    else:
        show_report(Console(highlight=False), report, str(plan.parent))
    raise typer.Exit(report.exit_code)


def _report(plan: Plan, workspace: Workspace, stored: Stored, animation: str | None) -> Report:
    arrival, scene = workspace.arrivals[plan.id], workspace.scene
    state = "All arrived" if arrival.arrived else "Not all arrived"
    furthest = length_text(max(arrival.residual_px), scene.metres_per_pixel)
    return Report(
        status="deployed" if arrival.arrived else "failed",
        message=f"{state}; the furthest is {furthest} from its place."
        + (f" The plan is partial: {plan.partial.sentence}" if plan.partial else ""),
        instruction=stored.instruction or "",
        image=json.loads(stored.image.model_dump_json(exclude={"path", "metres_per_pixel"})),
        targets=tuple(target_data(t) for t in scene.targets),
        contract=plan.formation.contract,
        plan_id=plan.id,
        positions=plan.formation.positions,
        verdict=plan.verdict,
        partial=plan.partial,
        arrival=arrival,
        metric=metric_data(scene, plan, arrival),
        model="none",
        files={"plan": None, "picture": None, "animation": animation, "trace": None},
    )
