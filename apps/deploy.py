"""`formup deploy PLAN.json`: a person's approval of exactly that plan, and the move."""

import asyncio
import sys
from pathlib import Path

import typer
from rich.console import Console

from ..agent.report import Report, metric_data, target_data
from ..agent.store.folder import PICTURES, FolderArtefacts
from ..tools.builtin.robots import drive_to
from ..tools.context import Context, Settings
from ..tools.errors import FleetError, InputError, ToolError
from ..tools.formation.plan import Plan
from ..tools.formation.units import length_text
from ..tools.perception.image import load_picture
from ..tools.store import StoredWorld, picture_of, plan_file, read_world, write_whole
from ..tools.world import World
from . import options as o
from .run_display import show_report
from .run_files import animate


def deploy(
    plan: o.PlanFile,
    fleet: o.FleetName = "simulated",
    image: o.PictureFile = None,
    as_json: o.Json = False,
) -> None:
    """Move robots to a certified plan; naming the file is the approval."""
    stored = read_world(plan)
    if stored.plan_id is None or stored.plan_id not in stored.world.plans:
        raise InputError(f"{plan} holds no plan to deploy; give a plan.json written by formup run.")
    picture = picture_of(stored, plan, None if image is None else load_picture(image))
    settings = Settings(fleet=fleet, approved=stored.plan_id)
    context = Context.of(picture, settings, stored.world)
    context.services.artefacts = FolderArtefacts(plan.parent / PICTURES)
    chosen = stored.world.plans[stored.plan_id].plan
    if chosen.partial is not None:
        print(f"formup: a partial plan: {chosen.partial.sentence}", file=sys.stderr)  # noqa: T201
    context = context.at(_driven(context, chosen, plan))
    write_whole(plan, plan_file(context.world, chosen.id, stored.instruction or "", picture))
    animation = plan.with_name("deploy.gif")
    drawn = animate(animation, context, chosen, stored.instruction or "")
    report = _report(chosen, context.world, stored, animation.name if drawn else None)
    if as_json:
        print(report.model_dump_json(indent=2))  # noqa: T201
        print(f"formup: files in {plan.parent}", file=sys.stderr)  # noqa: T201
    else:
        show_report(Console(highlight=False), report, str(plan.parent))
    raise typer.Exit(report.exit_code)


def _driven(context: Context, plan: Plan, path: Path) -> World:
    """The world after the robots have driven; where they failed on the way, with what was seen."""
    observed: list[World] = []
    watching = Context(context.world, context.services, context.settings, observed=observed.append)
    try:
        return asyncio.run(drive_to(watching, watching.world.plan(plan.id)))[1]
    except ToolError as error:
        raise InputError(f"{path}: {error}") from None
    except FleetError:
        if not observed or observed[-1].arrivals is context.world.arrivals:
            raise
        return observed[-1]


def _report(plan: Plan, world: World, stored: StoredWorld, animation: str | None) -> Report:
    arrival = world.arrivals[plan.id]
    state = "All arrived" if arrival.arrived else arrival.reason or "Not all arrived"
    furthest = length_text(max(arrival.residual_px), world.metres_per_pixel)
    return Report(
        status="deployed" if arrival.arrived else "failed",
        message=f"{state}; the furthest is {furthest} from its place."
        + (f" The plan is partial: {plan.partial.sentence}" if plan.partial else ""),
        instruction=stored.instruction or "",
        image=world.picture.model_dump(),
        targets=tuple(target_data(t) for t in world.targets),
        contract=plan.formation.contract,
        plan_id=plan.id,
        robots=plan.formation.robots or None,
        positions=plan.formation.positions,
        verdict=plan.verdict,
        partial=plan.partial,
        arrival=arrival,
        metric=metric_data(world, plan, arrival),
        model="none",
        files={"plan": None, "picture": None, "animation": animation, "trace": None},
    )
