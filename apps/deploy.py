"""`formup deploy PLAN.json`: a person's approval of exactly that plan, and the move."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import typer
from rich.console import Console

from ..agent.recording import LogRecorder
from ..agent.report import Report, deployed_since, metric_data, still_true, target_data
from ..agent.session import load_run
from ..agent.store.folder import NAME, PICTURES, FolderArtefacts, FolderLog
from ..tools.builtin.robots import drive_to, trajectories_to
from ..tools.context import Context, Settings
from ..tools.errors import FleetError, InputError, ToolError
from ..tools.fleet.follow import Follow
from ..tools.formation.plan import Plan
from ..tools.perception.image import load_picture
from ..tools.store import StoredWorld, picture_of, plan_file, read_world, write_whole
from ..tools.world import World
from . import options as o
from .run_display import deploy_command, show_report
from .run_files import write_films
from .terminal import say
from .window import watching

Made = TypeVar("Made")


def deploy(
    plan: o.PlanFile,
    fleet: o.FleetName = "simulated",
    image: o.PictureFile = None,
    as_json: o.Json = False,
    film: o.Film = None,
    watch: o.Watch = False,
    follow: o.FollowFor = None,
    speed: o.FollowSpeed = None,
    trajectories: o.TrajectoryFile = None,
) -> None:
    """Move robots to a certified plan; naming the file approves it."""
    if speed is not None and follow is None:
        raise InputError("--follow-speed needs --follow SECONDS; give that too.")
    leave = None if follow is None else Follow(seconds=follow, speed=speed)
    if trajectories is not None and (as_json or film or watch or leave):
        raise InputError(
            "--trajectories moves no robots; leave out --json, --film, --watch and --follow."
        )
    stored = read_world(plan)
    if stored.plan_id is None or stored.plan_id not in stored.world.plans:
        raise InputError(
            f"{plan} contains no plan to deploy; give a plan.json written by formup run."
        )
    picture = picture_of(stored, plan, None if image is None else load_picture(image))
    settings = Settings(fleet=fleet, approved=stored.plan_id)
    context = replace(Context.of(picture, settings, stored.world), words=stored.instruction or "")
    context.services.artefacts = FolderArtefacts(plan.parent / PICTURES)
    chosen = stored.world.plans[stored.plan_id].plan
    if chosen.partial is not None:
        say(f"formup: a partial plan: {chosen.partial.sentence}", error=True)
    if trajectories is not None:
        raise typer.Exit(_export_trajectories(context, chosen, plan, trajectories))

    def keep(world: World) -> None:
        write_whole(plan, plan_file(world, chosen.id, stored.instruction or "", picture))

    with watching(watch) as services:
        context.services.view = services.view
        with _session(plan, context) as session:
            context = context.at(session.start(context.world))
            context = context.at(_drive_robots(context, chosen, leave, plan, session, keep))
        films = write_films(plan.parent, film, context, chosen, context.words)
        report = _report(chosen, context.world, stored, films)
        _show(report, plan, fleet, as_json)
        raise typer.Exit(report.exit_code)


def _show(report: Report, plan: Path, fleet: str, as_json: bool) -> None:
    if as_json:
        say(report.model_dump_json(indent=2))
        say(f"formup: files in {plan.parent}", error=True)
    else:
        again = deploy_command(plan, fleet)
        show_report(Console(highlight=False), report, str(plan.parent), again)


def _export_trajectories(context: Context, chosen: Plan, plan: Path, path: Path) -> int:
    """Write robots' trajectories to a plan from where the session left them; return exit code 0."""
    with _session(plan, context) as session:
        context = context.at(session.start(context.world))
    try:
        found = asyncio.run(_closing_fleets(context, trajectories_to(context, chosen)))
    except ToolError as error:
        raise InputError(f"{plan}: {error}") from None
    scale = context.world.metres_per_pixel
    text = json.dumps(found.data(scale)) if path.suffix.lower() == ".json" else found.table(scale)
    write_whole(path, text.encode())
    say(
        f"formup: trajectories of {len(found.ids)} robots are in {path}; no robot was moved.",
        error=True,
    )
    return 0


async def _closing_fleets(context: Context, work: Awaitable[Made]) -> Made:
    """Return the result of the work, then close the fleets and their cameras, even if it fails."""
    try:
        return await work
    finally:
        await context.services.close_fleets()


@dataclass
class Session:
    """The session that a plan.json lies beside, kept up to date on its robots; or a stand-in.

    Attributes:
        world: the session's world; None if there is no session, so that nothing is recorded.
    """

    recorder: LogRecorder
    world: World | None

    def start(self, world: World) -> World:
        """Return a plan's world, with robots where the session left them."""
        return world if self.world is None else world.having(robots=self.world.robots)

    async def moving(self, plan_id: str) -> None:
        """Record that robots are about to move."""
        if self.world is not None:
            await self.recorder.moving(plan_id, self.world)

    def end(self, world: World) -> None:
        """Record where robots are, and the arrivals observed at plans of the session."""
        if self.world is None:
            return
        known = {n: a for n, a in world.arrivals.items() if n in self.world.plans}
        arrivals = {**self.world.arrivals, **known}
        asyncio.run(self.recorder.world(self.world.having(robots=world.robots, arrivals=arrivals)))


@contextmanager
def _session(plan: Path, context: Context) -> Generator[Session, None, None]:
    """Yield the session beside a plan.json, whose log no other process may write meanwhile."""
    artefacts, path = context.services.artefacts, plan.parent / NAME
    if not path.exists():
        yield Session(LogRecorder(None, artefacts, None, None), None)
        return
    with closing(FolderLog(path)) as log:
        world = load_run(path, context.picture).world
        yield Session(LogRecorder(log, artefacts, world, None), world)


def _drive_robots(
    context: Context,
    plan: Plan,
    follow: Follow | None,
    path: Path,
    session: Session,
    keep: Callable[[World], None],
) -> World:
    """Drive the robots and return the world after it; if they fail on the way, as last observed."""
    observed: list[World] = []
    watching = replace(context, observed=observed.append, moving=session.moving, agreed=True)
    try:
        node = watching.world.plan(plan.id)
        driven = asyncio.run(_closing_fleets(context, drive_to(watching, node, follow)))
        observed.append(driven[1])
    except ToolError as error:
        raise InputError(f"{path}: {error}") from None
    except FleetError:
        if not observed or observed[-1].arrivals is context.world.arrivals:
            raise
    except KeyboardInterrupt:
        if observed:
            say("formup: the robots were stopped on the way.", error=True)
        raise
    finally:
        if observed:
            session.end(observed[-1])
            keep(observed[-1])
    return observed[-1]


def _report(plan: Plan, world: World, stored: StoredWorld, films: dict[str, str | None]) -> Report:
    arrival = world.arrivals[plan.id]
    status, message = deployed_since(plan, arrival, world.metres_per_pixel)
    verdict, motion = still_true(world.plans[plan.id], arrival)
    return Report(
        status=status,
        message=message,
        instruction=stored.instruction or "",
        image=world.picture.model_dump(),
        targets=tuple(target_data(t) for t in world.targets),
        contract=plan.formation.contract,
        plan_id=plan.id,
        robots=plan.formation.robots or None,
        positions=plan.formation.positions,
        verdict=verdict,
        motion=motion,
        partial=plan.partial,
        arrival=arrival,
        metric=metric_data(world, plan, arrival),
        model="none",
        files={"plan": None, "picture": None, "animation": None, "trace": None, **films},
    )
