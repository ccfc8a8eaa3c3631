"""`formup eval table`: the paper's tables with our results beside the paper's, and two more."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from ..evals.experiments.methods import Method
from ..evals.experiments.runner import Sweep
from ..evals.experiments.trials import TrialRow
from ..evals.report.page import page
from ..evals.report.run_folder import side
from ..evals.tables.calibration import in_own_frame
from ..evals.tables.checks import checked_rows
from ..evals.tables.definition import Entry, entries, table_named
from ..evals.tables.formats import FORMATS, as_matrix, notes, paper, parts
from ..evals.tables.results import Planned, Result, Tabled, tabled
from ..evals.tasks.suites import load_suite
from ..evals.tasks.task import Suite, Task
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import arguments as inputs
from . import eval_options as e
from . import options as o
from .eval_progress import sweep
from .eval_run import RUNS, new_folder, prepared, processes, say_stopped, tasks_tried
from .terminal import say, styled

TERMINAL = "terminal"
HEAD, CELL = 28, 12
"""Widths in characters of the first column and the others; a table may outgrow the terminal."""
Name = Annotated[
    str, typer.Argument(metavar="TABLE", help="Table to make: 1, 2, 3, hard or ablations.")
]
Models = Annotated[
    list[str] | None,
    typer.Option("--models", help="Model as in formup run, or replay:FOLDER; repeatable."),
]
Segmenters = Annotated[
    list[str] | None,
    typer.Option("--segmenter", help="Segmentation network: NAME or NAME:CHECKPOINT; repeatable."),
]
Methods = Annotated[
    list[str] | None, typer.Option("--method", help="Run only rows of this method; repeatable.")
]
Checkpoints = Annotated[
    Path | None,
    typer.Option("--checkpoints", help="Folder of formup eval train-rl, for the method rl."),
]
Versions = Annotated[
    list[str] | None,
    typer.Option("--prompt", help="Prompt to ablate with, ID@VERSION; repeatable."),
]
Resume = Annotated[bool, typer.Option("--resume", help="Continue the latest run of the table.")]
Form = Annotated[
    str, typer.Option("--format", help=f"What is printed: {', '.join([TERMINAL, *FORMATS])}.")
]
Tries = Annotated[
    str | None,
    typer.Option("--trials", help="Trials of each task, instead of the table's own number."),
]


def table(
    name: Name,
    models: Models = None,
    segmenter: Segmenters = None,
    method: Methods = None,
    checkpoints: Checkpoints = None,
    base_url: o.BaseUrl = None,
    prompt: Versions = None,
    prompts: o.PromptsFolder = None,
    task: e.TaskList = None,
    trials: Tries = None,
    out: e.RunFolder = None,
    resume: Resume = False,
    dry_run: e.DryRun = False,
    budget: e.Budget = None,
    jobs: e.Jobs = "1",
    form: Form = TERMINAL,
) -> None:
    """Run a table of the paper and print it.

    It is also written as Markdown, CSV, JSON, LaTeX and HTML. Each cell shows k of n trials with
    a confidence interval and the paper's figure; cells that were not run say so, with the cost of
    running them. To continue a killed run, give its folder again with --out.
    """
    if form not in (TERMINAL, *FORMATS):
        raise InputError(f"Unknown format {form!r}. There are: {TERMINAL}, {', '.join(FORMATS)}.")
    wanted, limit = table_named(name), inputs.dollars("--budget", budget)
    tries = None if trials is None else inputs.whole("--trials", trials, least=1)
    base = Method("agent", base_url=base_url, library=PromptLibrary(prompts))
    found = entries(wanted, base, models or [], segmenter or [], tries, checkpoints, prompt or [])
    found = [entry for entry in found if not method or entry.row.method in method]
    suite = load_suite(wanted.suite)
    if dry_run:
        planned = [Planned(entry, (), len(ts)) for entry, ts in _with_tasks(suite, found, task)]
        _print(tabled(name, wanted, planned, (), len(suite.tasks)), form)
        return
    folder = out or _folder(name, resume)
    tried = _with_tasks(suite, [in_own_frame(entry, folder) for entry in found], task)
    how = {"executor": processes(inputs.whole("--jobs", jobs, least=1)), "budget_usd": limit}
    planned, rows, done = _ran(suite, tried, folder, how)
    made = tabled(name, wanted, planned, rows, len(suite.tasks))
    _write(made, folder)
    _print(made, form)
    if form == TERMINAL:
        say(f"{folder}: table.md, .csv, .json, .tex, .html")
    if done is not None:
        say_stopped(done)


def _ran(
    suite: Suite, tried: list[tuple[Entry, list[Task]]], folder: Path, how: dict[str, Any]
) -> tuple[list[Planned], list[TrialRow], Sweep | None]:
    """Run the trials that a folder does not hold yet.

    Returns:
        The planned rows of the table, the rows of its trials, and the sweep, None if there were
        no trials.
    """
    filled = [(e.arm, own, e.trials) for e, own in tried if e.arm is not None]
    with prepared(suite, filled, "dev", folder) as made:
        own = iter(made.trials)
        planned = [Planned(e, next(own) if e.arm else (), len(ts)) for e, ts in tried]
        todo = [trial for plan in planned for trial in plan.trials]
        methods, tasks = {e.row.method for e, _ in tried}, {t.id for _, ts in tried for t in ts}
        check = partial(checked_rows, folder, made.sha256, todo, methods=methods, tasks=tasks)
        check()
        done = sweep(todo, made.work, folder, **how) if todo else None
        return planned, check(), done


def _folder(name: str, resume: bool) -> Path:
    """Return the path of a new folder for a table, or, to resume, of its latest one.

    Raises:
        InputError: there is no folder to resume.
    """
    if not resume:
        return new_folder(f"table-{name}")
    found = sorted(RUNS.glob(f"table-{name}-*"))
    if not found:
        raise InputError(f"There is no run of table {name} in {RUNS}; leave out --resume.")
    return found[-1]


def _with_tasks(
    suite: Suite, found: list[Entry], names: list[str] | None
) -> list[tuple[Entry, list[Task]]]:
    """Pair each row with the tasks that it is tried on."""
    return [(entry, tasks_tried(suite, [entry.arm] if entry.arm else [], names)) for entry in found]


def _write(made: Tabled, folder: Path) -> None:
    """Write a table in all formats to its folder; the page shows the first try of each task."""
    for ending, write in FORMATS.values():
        write_whole(folder / f"table.{ending}", write(made).encode())
    rows = [row for row in made.trials if row.trial == 0]
    if rows:
        shown, title = as_matrix(made), made.table.title
        html = page([side(folder, rows)], PromptLibrary(), shown, title, notes(made))
        write_whole(folder / "table.html", html.encode())


def _print(made: Tabled, form: str) -> None:
    if form != TERMINAL:
        say(FORMATS[form][1](made), end="")
        return
    console = Console(highlight=False, soft_wrap=True)
    console.width = max(console.width, HEAD + CELL * len(made.table.columns))
    console.print(_grid(made))
    for note in notes(made):
        console.print(styled(note))


def _grid(made: Tabled) -> Grid:
    grid = Grid(title=styled(made.table.title), header_style="cyan", box=None, show_lines=True)
    for title in ("", *made.table.columns):
        grid.add_column(title, min_width=None if title else HEAD - 2, no_wrap=bool(title))
    for row in made.rows:
        head = styled((row.head, "bold"), *(f"\n{remark}" for remark in row.remarks))
        grid.add_row(head, *(_stacked(result) for result in row.results.values()), end_section=True)
    return grid


def _stacked(result: Result) -> Text:
    """Return a cell's lines: k/n, interval, GCR, any ablation's difference, the paper's figure."""
    told = f"\npaper {paper(result)}" if result.paper else ""
    return styled("\n".join(parts(result)), (told, "dim"))
