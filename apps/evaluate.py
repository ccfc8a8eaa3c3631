"""`formup eval photos`: success over photographs, as a table and as JSON."""

import json
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from ..evals.pointed import JITTERED, Row, as_json, evaluate, mode_named, one_target, summary
from ..evals.suite import load_tasks
from ..tools.store import write_whole
from . import inputs
from . import options as o

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def group() -> None:
    """How good it is, on tasks with known answers."""


@app.command()
def photos(
    data: o.DataFolder = None,
    mode: o.Mode = "box",
    seeds: o.Seeds = "3",
    out: o.JsonFile = Path("photos-eval.json"),
) -> None:
    """Success over a folder of photographs, the shipped ones by default.

    Tasks about two things are left out where only one is pointed at: in all modes but truth.
    """
    chosen, tasks = mode_named(mode), load_tasks(data)
    if chosen != "truth":
        tasks = one_target(tasks)
    jitters = inputs.whole("--seeds", seeds, least=1)
    count = len(tasks) * (jitters if chosen in JITTERED else 1)
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task(f"{chosen}, {len(tasks)} tasks", total=count)
        rows = evaluate(tasks, chosen, jitters, lambda row: progress.advance(bar))
    means = summary(rows)
    _print(means, rows, chosen)
    if out is not None:
        content = {
            "mode": chosen,
            "seeds": jitters,
            "data": str(data) if data else "shipped",
            "summary": means,
            "rows": [as_json(row) for row in rows],
        }
        write_whole(out, json.dumps(content, indent=1).encode())


def _print(means: dict[str, dict[str, float | None]], rows: list[Row], mode: str) -> None:
    console = Console(highlight=False)
    table = Table(title=f"offline planner, pointed by {mode}", header_style="cyan")
    for name in ("category", "runs", "placed", "success", "strict", "mean IoU"):
        table.add_column(name, justify="left" if name == "category" else "right")
    for name, values in means.items():
        shares = [values[k] for k in ("placed", "success", "strict", "iou")]
        cells = ["-" if v is None else f"{v:.3f}" for v in shares]
        table.add_row(name, f"{values['runs']:.0f}", *cells)
    console.print(table)
    for row in rows:
        if not row.strict:
            kind = "not strict" if row.success else row.status if row.failures else "failed"
            why = "; ".join(row.failures) if row.status == "deployed" else row.message
            console.print(f"{row.task} seed {row.seed}: {kind}: {why[:150]}", soft_wrap=True)
