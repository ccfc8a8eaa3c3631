"""The command line: `formup run`, `resume`, `deploy`, `trace`, `tools`, `eval`, `prompts`."""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer

from ..agent.agent import Agent
from ..agent.outcomes import Answered, Paused
from ..agent.session import load_run, prompt_name
from ..agent.store.folder import log_path, read_events
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from ..tools.perception.image import load_picture
from . import (
    arguments,
    calibrate,
    chat,
    demo,
    deploy,
    doctor,
    evaluate,
    prompts,
    serve,
    sessions,
    tools,
    trace,
)
from . import fleet as fleet_commands
from . import options as o
from .agents import agent_of, tracer_of_environment
from .given import picture_and_words, settings_given
from .mcp.command import mcp
from .run_files import Folder, write_files
from .stated import resolve_decider
from .terminal import say
from .terminal_session import TerminalSession
from .window import watching

app = typer.Typer(
    name="formup",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(tools.app, name="tools", help="List, describe and call the tools that models use.")
app.add_typer(evaluate.app, name="eval", help="Evaluate formup on tasks with known answers.")
app.add_typer(
    sessions.app, name="sessions", help="List, search, copy, export and delete stored sessions."
)
app.add_typer(
    prompts.app, name="prompts", help="Manage the versions of the prompts that models get."
)
app.add_typer(fleet_commands.app, name="fleet", help="Check a fleet of robots, or stand in for it.")


def _say_version(wanted: bool) -> None:
    if wanted:
        say(f"formup {version('formup')}")
        raise typer.Exit


@app.callback()
def formup(
    shown: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Say where a team of robots should stand; get a certified formation and watch it arrive."""


@app.command()
def run(
    ctx: typer.Context,
    image: o.ImageOrWords = None,
    instruction: o.Instruction = None,
    robots: o.Robots = None,
    point: o.Points = None,
    box: o.Boxes = None,
    outline: o.Outlines = None,
    target: o.Candidates = None,
    mask: o.Masks = None,
    keep_out: o.KeepOuts = None,
    contract: o.ContractFile = None,
    plan_only: o.PlanOnly = False,
    as_json: o.Json = False,
    out: o.Out = None,
    record: o.Record = None,
    film: o.Film = None,
    watch: o.Watch = False,
    model: o.ModelName = "offline",
    base_url: o.BaseUrl = None,
    planner: o.PlannerName = None,
    prompt: o.PromptName = None,
    prompts: o.PromptsFolder = None,
    numbered: o.Numbered = False,
    limit: o.LimitList = None,
    policy: o.PolicyList = None,
    detector: o.DetectorName = "standout",
    segmenter: o.SegmenterName = "grabcut",
    threshold: o.Threshold = None,
    descriptor: o.DescriptorName = "edges",
    fleet: o.FleetName = "simulated",
    starts: o.Starts = None,
    metres_per_pixel: o.MetresPerPixel = None,
    camera: o.Camera = None,
    calibration: o.CalibrationFile = None,
    robot_radius: o.Radius = None,
    clearance: o.Clearance = None,
    seed: o.Seed = "0",
) -> None:
    """Carry out an instruction on a picture."""
    (picture, words), keep = picture_and_words(ctx.params), arguments.recording(record)
    settings = settings_given(ctx.params, picture, may_deploy=not plan_only)
    given = arguments.shown((point, box, outline, target), mask, picture)
    things = arguments.numbered(given), arguments.keep_out_things(keep_out), settings
    who, said = resolve_decider(contract, *things, model=model, planner=planner, picture=picture)
    decider = agent_of(*who, base_url, prompt, prompts, limit, policy)
    with decider as agent, Folder(out) as home, watching(watch) as services:
        made = agent.run(picture, words, trace=home.trace, services=services, **said)
        raise typer.Exit(TerminalSession(agent, home, as_json, keep, film).serve(made))


@app.command()
def resume(
    folder: o.RunFolder,
    words: o.NextWords = None,
    answer: o.Answer = None,
    approve: o.Approve = None,
    image: o.PictureFile = None,
    as_json: o.Json = False,
    model: o.ResumeModel = None,
    base_url: o.BaseUrl = None,
    limit: o.LimitList = None,
    policy: o.PolicyList = None,
    watch: o.Watch = False,
) -> None:
    """Continue a run that waits for you or was stopped or killed.

    Answer its question, approve or refuse its plan, or give the next instruction.
    """
    if words is not None and (answer is not None or approve is not None):
        raise InputError(
            "Give either the next instruction or an answer (--answer, --approve, --refuse), not "
            "both."
        )
    path = log_path(folder)
    left = load_run(path, None if image is None else load_picture(image))
    start = read_events(path)[0].data
    home = Folder(path.parent, resumed=True)
    with tracer_of_environment() as tracer, home, watching(watch) as services:
        left.context.services.view = services.view
        agent = Agent(
            model or start["model"],
            base_url=base_url or (None if model else start["base_url"]),
            planner=None if model else start.get("planner"),
            prompt=prompt_name(start["prompt"]),
            library=PromptLibrary(start.get("library") and Path(start["library"])),
            limits=arguments.limits(limit, start["limits"]),
            policy=arguments.policy(policy, start["policy"]),
            tracer=tracer,
        )
        _unchanged(agent, start)
        session = TerminalSession(agent, home, as_json)
        if words is not None:
            left = agent.say(left, words)
        elif answer is approve is None and isinstance(left.outcome, Answered | Paused):
            if isinstance(left.outcome, Paused) and not session.can_ask:
                write_files(home, left)  # it may have been killed before writing them
                agent.resume(left)  # raises an error that says what it waits for
        else:
            left = agent.resume(left, answer=answer, approve=approve)
        raise typer.Exit(session.serve(left))


app.command(name="chat", cls=chat.InOrder)(chat.chat)
app.command(name="serve")(serve.serve)
app.command(name="mcp")(mcp)
app.add_typer(serve.tokens, name="tokens")
app.command(name="deploy")(deploy.deploy)
app.command(name="calibrate")(calibrate.calibrate)
app.command(name="trace")(trace.show_trace)


@app.command(name="demo")
def demonstrate(out: o.DemoOut = Path("formup-runs", "demo")) -> None:
    """Run four instructions on pictures that come with formup."""
    raise typer.Exit(demo.show_demo(lambda words: app(words, standalone_mode=False) or 0, out))


@app.command(name="doctor")
def look_around(as_json: o.Json = False) -> None:
    """Show what is installed and within reach, for bug reports.

    Secrets are never shown.
    """
    say(doctor.findings_text(as_json=as_json))


def _unchanged(agent: Agent, start: Mapping[str, Any]) -> None:
    """Check that no prompt, such as a draft, has changed since the run began; else InputError."""
    was = {prompt_name(p): p["sha256"] for p in start.get("prompts", ())}
    for prompt in agent.prompts:
        if was.get(prompt.name, prompt.sha256) != prompt.sha256:
            raise InputError(
                f"{prompt.name} has changed since this run began; restore its text, or start a "
                "new run."
            )
