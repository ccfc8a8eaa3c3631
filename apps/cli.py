"""The command line: `formup run`, `deploy`, `tools`, `eval`."""

import sys
from pathlib import Path

import typer
from rich.console import Console

from ..agent.agent import Agent, Run
from ..agent.report import Report
from ..tools.perception.image import load_picture
from ..tools.workspace import Settings
from . import evaluate, inputs, plans, tools
from . import options as o
from .output import Folder, Trace, write_files
from .screen import ask, at_terminal, show_report

MOST_ANSWERS = 5
"""Questions answered in one run at a terminal."""

app = typer.Typer(
    name="formup",
    help="Say where a team of robots should stand; get a certified formation, watch it arrive.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(tools.app, name="tools", help="The tools the model sees.")
app.add_typer(evaluate.app, name="eval", help="How good it is.")
app.command(name="deploy")(plans.deploy)


@app.command()
def run(
    image: o.Image,
    instruction: o.Instruction,
    robots: o.Robots = None,
    point: o.Points = None,
    box: o.Boxes = None,
    outline: o.Outlines = None,
    target: o.Candidates = None,
    plan_only: o.PlanOnly = False,
    as_json: o.Json = False,
    out: o.Out = None,
    model: o.ModelName = "offline",
    base_url: o.BaseUrl = None,
    prompt: o.PromptName = None,
    segmenter: o.SegmenterName = "grabcut",
    threshold: o.Threshold = None,
    descriptor: o.DescriptorName = "edges",
    fleet: o.FleetName = "simulated",
    starts: o.Starts = None,
    robot_radius: o.Radius = None,
    clearance: o.Clearance = None,
    seed: o.Seed = "0",
) -> None:
    """Carry out an instruction on a picture."""
    settings = Settings(
        robots=inputs.robots(robots),
        robot_radius=inputs.length("--robot-radius", robot_radius),
        clearance=inputs.length("--clearance", clearance),
        segmenter=segmenter,
        threshold=inputs.share("--threshold", threshold),
        descriptor=inputs.descriptor(descriptor),
        fleet=fleet,
        starts=inputs.starts(starts),
        seed=inputs.whole("--seed", seed, least=0),
        may_deploy=not plan_only,
    )
    pointed = inputs.pointed(point or [], box or [], outline or [], target or [])
    agent, picture = _agent(model, base_url, prompt), load_picture(image)
    folder, trace = Folder(out), Trace()
    try:
        result = agent.run(picture, instruction, pointed=pointed, settings=settings, show=trace)
        report = _told(folder, result, image, trace, as_json)
        for _ in range(0 if as_json or not at_terminal() else MOST_ANSWERS):
            if report.status != "question" or not (text := ask()):
                break
            result = agent.answer(result, text, show=trace)
            report = _told(folder, result, image, trace, as_json)
    finally:
        folder.remove_if_empty()
    raise typer.Exit(report.exit_code)


def _told(folder: Folder, result: Run, image: Path, trace: Trace, as_json: bool) -> Report:
    """The report with its files, written and printed."""
    files = write_files(folder, result, image, trace)
    report = result.report.model_copy(update={"files": files})
    _print(report, folder.path, as_json)
    return report


def _agent(model: str, base_url: str | None, prompt: str | None) -> Agent:
    agent = Agent(model, base_url=base_url, prompt=prompt)
    if model != "offline" or agent.prompt is None:
        return agent
    print(  # noqa: T201
        "formup: the offline planner is rules and reads no prompt; "
        f"{agent.prompt.name} is not used.",
        file=sys.stderr,
    )
    return Agent(model)


def _print(report: Report, folder: Path, as_json: bool) -> None:
    if as_json:
        print(report.model_dump_json(indent=2))  # noqa: T201
        print(f"formup: files in {folder}", file=sys.stderr)  # noqa: T201
    else:
        show_report(Console(highlight=False), report, str(folder))
