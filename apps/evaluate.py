"""`formup eval photos` and `formup eval scenes`: success as a table and as JSON."""

import json
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import typer
from rich.console import Console
from rich.progress import Progress, track
from rich.table import Table

from ..agent.agent import Agent
from ..evals.experiments.descriptor_cost import descriptor_costs
from ..evals.experiments.pointed import (
    JITTERED,
    Mode,
    Row,
    as_json,
    evaluate,
    mode_named,
    one_target,
    summary,
)
from ..evals.scenes.build import write_scenes
from ..evals.tasks.photographs import Task, load_tasks
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import (
    arguments as inputs,
)
from . import (
    eval_compare as compare,
)
from . import (
    eval_report as report,
)
from . import options as o

COLUMNS = {
    "placed": "placed",
    "success": "success",
    "strict": "strict",
    "right_of_placed": "right thing,\nif placed",
    "success_of_placed": "success,\nif placed",
    "iou": "mean IoU",
}
DIRECT = "former-direct"
"""What a model alone is told: to write coordinates."""
app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def group() -> None:
    """How good it is, on tasks with known answers."""


@app.command()
def photos(
    data: o.DataFolder = None,
    mode: o.Mode = "box",
    seeds: o.Seeds = "3",
    task: o.TaskList = None,
    model: o.ModelName = "offline",
    base_url: o.BaseUrl = None,
    planner: o.PlannerName = None,
    prompt: o.PromptName = None,
    prompts: o.PromptsFolder = None,
    alone: o.Alone = False,
    record: o.RecordFolder = None,
    out: o.JsonFile = Path("photos-eval.json"),
) -> None:
    """Success over a folder of photographs, the shipped ones by default.

    Tasks about two things are left out where only one is pointed at: in the modes box, outline
    and point. --model replay:FOLDER replays what --record FOLDER has kept, as far as it goes.
    """
    chosen, tasks = mode_named(mode), inputs.tasks(task, load_tasks(data))
    jitters, library = inputs.whole("--seeds", seeds, least=1), PromptLibrary(prompts)
    recorded = recordings(model)
    if recorded is not None:
        tasks = [t for t in tasks if t.id in recorded]

    def agent(task: Task) -> Agent:
        name = model if recorded is None else f"replay:{recorded[task.id]}"
        if alone:
            told = prompt or DIRECT
            return Agent(name, base_url=base_url, prompt=told, library=library, tools=())
        return Agent(name, base_url=base_url, planner=planner, prompt=prompt, library=library)

    if tasks:
        agent(tasks[0])  # what cannot be asked is found before the work
    if record is not None:
        record.mkdir(parents=True, exist_ok=True)
    rows = _run(tasks, chosen, jitters, agent, record)
    facts = {"seeds": jitters, "data": str(data) if data else "shipped", "model": model}
    if model != "offline":
        _print_costs(rows)
    _show(rows, chosen, facts, out)


@app.command()
def scenes(
    seeds: o.SceneSeeds = "0-53",
    mode: o.Mode = "words",
    keep: o.KeepFolder = None,
    out: o.JsonFile = Path("scenes-eval.json"),
) -> None:
    """Success over drawn scenes, one of each seed, with exact outlines.

    "known words" are wordings the offline planner's tables were written with, "fresh words" come
    from somebody who knew neither; they are reported apart.
    """
    chosen, (first, last) = mode_named(mode), inputs.span("--seeds", seeds)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) if keep is None else keep
        bar = track(range(first, last + 1), "drawing", console=_stderr(), transient=True)
        write_scenes(bar, folder)
        rows = _run(load_tasks(folder), chosen, 1)
    _show(rows, chosen, {"seeds": f"{first}-{last}", "data": "drawn scenes"}, out)


@app.command()
def descriptors(data: o.DataFolder = None) -> None:
    """Tokens that each way of putting a shape into text costs, over the photographs' things."""
    table = Table(title="describe_shape", header_style="cyan", box=None)
    for name in ("descriptor", "median tokens", "most", "beyond edges"):
        table.add_column(name, justify="left" if name == "descriptor" else "right")
    for cost in descriptor_costs(load_tasks(data)):
        numbers = (f"{cost.median:,.0f}", f"{cost.most:,}", f"{cost.overhead:+.0%}")
        table.add_row(cost.descriptor, *numbers)
    Console(highlight=False).print(table)


app.command(name="compare")(compare.compare)
app.command(name="gate")(compare.gate)
app.command(name="merge")(compare.merge_shards)
app.command(name="report")(report.report)


def recordings(model: str) -> dict[str, Path] | None:
    """The recordings of a folder by task, where a model's name is that of one."""
    folder = Path(model.removeprefix("replay:"))
    if not model.startswith("replay:") or not folder.is_dir():
        return None
    return {path.stem: path for path in sorted(folder.glob("*.jsonl"))}


def _run(
    tasks: list[Task],
    mode: Mode,
    jitters: int,
    agent: Callable[[Task], Agent] = lambda task: Agent(),
    record: Path | None = None,
) -> list[Row]:
    """The rows of all tasks that can be pointed at this way, with a bar as they come."""
    if mode in JITTERED:
        tasks = one_target(tasks)
    if not tasks:
        raise InputError("No task is left: none has a recording here, or is about one thing alone.")
    count = len(tasks) * (jitters if mode in JITTERED else 1)
    with Progress(console=_stderr(), transient=True) as progress:
        bar = progress.add_task(f"{mode}, {len(tasks)} tasks", total=count)

        def told(row: Row) -> None:
            progress.advance(bar)

        return evaluate(tasks, mode, jitters, told, agent=agent, record=record)


def _stderr() -> Console:
    return Console(stderr=True)


def _show(rows: list[Row], mode: str, facts: dict[str, Any], out: Path | None) -> None:
    means = summary(rows)
    _print(means, rows, mode, facts.get("model", "offline"))
    if out is not None:
        content = {"mode": mode, **facts, "summary": means, "rows": [as_json(r) for r in rows]}
        write_whole(out, json.dumps(content, indent=1).encode())


def _print_costs(rows: list[Row]) -> None:
    """What each task took, and the medians."""
    table = Table(title="what each took", header_style="cyan", box=None)
    for name in ("task", "requests", "tokens in", "cached", "out", "outcome", "ok"):
        number = name in ("requests", "tokens in", "cached", "out")
        table.add_column(name, justify="right" if number else "left", no_wrap=True)
    spent = [(r.requests, r.input_tokens, r.cached_tokens, r.output_tokens) for r in rows]
    for row, counts in zip(rows, spent, strict=True):
        numbers = [f"{n:,}" for n in counts]
        table.add_row(row.task, *numbers, row.status, "yes" if row.strict else "no")
    if rows:
        middles = [f"{median(counts):,.0f}" for counts in zip(*spent, strict=True)]
        strict = f"{sum(r.strict for r in rows)}/{len(rows)}"
        table.add_row("median", *middles, "", strict)
    Console(highlight=False).print(table)


def _print(
    means: dict[str, dict[str, float | None]], rows: list[Row], mode: str, model: str
) -> None:
    console = Console(highlight=False)
    who = "offline planner" if model == "offline" else model
    how = "from words alone" if mode == "words" else f"pointed by {mode}"
    table = Table(title=f"{who}, {how}", header_style="cyan", box=None)
    for name in ("tasks", "runs", *COLUMNS.values()):
        table.add_column(
            name, justify="left" if name == "tasks" else "right", no_wrap=name == "tasks"
        )
    for name, values in means.items():
        shares = [values[key] for key in COLUMNS]
        cells = ["-" if v is None else f"{v:.3f}" for v in shares]
        table.add_row(name, f"{values['runs']:.0f}", *cells)
    console.print(table)
    for row in rows:
        if not row.strict:
            kind = "not strict" if row.success else row.status if row.failures else "failed"
            why = "; ".join(row.failures) if row.placed else row.message
            console.print(f"{row.task} seed {row.seed}: {kind}: {why[:150]}", soft_wrap=True)
