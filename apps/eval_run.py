"""`formup eval run`, `suites` and `add`: a suite by a method, as counts with the chance level."""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from ..evals.experiments.executors import executor
from ..evals.experiments.journal import Arm, read_rows
from ..evals.experiments.methods import Method, SuiteWork, arm_key, method, trials_of
from ..evals.experiments.runner import Sweep
from ..evals.experiments.trials import Trial
from ..evals.grading.check_tasks import check_task
from ..evals.statistics.cells import Cell, Chance, cells, chances
from ..evals.tasks.heldout_ledger import NAME as LEDGER
from ..evals.tasks.heldout_ledger import look
from ..evals.tasks.load import described, load_suite, shipped, write_suite
from ..evals.tasks.rendered_pictures import Hung, hang
from ..evals.tasks.stored_suite import ATTEMPTS, PICTURES, keep_suite
from ..evals.tasks.suite_task import Suite
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import arguments as inputs
from . import eval_options as e
from . import options as o
from .eval_progress import sweep
from .evaluate import app

RUNS = Path("formup-runs")
SUMMARY = "summary.json"


@app.command("run")
def run_suite(
    suite: e.SuiteName,
    method: e.MethodName = "rules",
    model: e.ModelList = None,
    base_url: o.BaseUrl = None,
    prompt: e.PromptList = None,
    prompts: o.PromptsFolder = None,
    descriptor: e.DescriptorList = None,
    trials: e.Trials = "1",
    split: e.Split = "dev",
    out: e.RunFolder = None,
    shard: e.Shard = None,
    budget: e.Budget = None,
    rate: e.RateList = None,
    jobs: e.Jobs = "1",
) -> None:
    """Run a suite: successes of trials by category and setup, with intervals and the chance level.

    Several models, prompts and descriptors are run side by side. A killed run is gone on with by
    naming its folder again. The split test shows scores only, and each look at it is written down.
    """
    workers = inputs.whole("--jobs", jobs, least=1)
    paces = {name: n / workers for name, n in inputs.rates("--rate", rate, model or []).items()}
    arms = _arms(method, model, prompt, descriptor, PromptLibrary(prompts), paces)
    made = [arm.facts(base_url) for arm in arms]  # what cannot be asked is found before the work
    count, limit = inputs.whole("--trials", trials, least=1), inputs.dollars("--budget", budget)
    loaded = load_suite(suite, split)
    folder, levels = out or _fresh(loaded.name), chances(loaded.tasks)
    with ExitStack() as stack:
        pictures = folder / PICTURES
        if split == "test":
            pictures = Path(stack.enter_context(TemporaryDirectory()))
        hung = _hung(loaded, pictures)
        sha256 = loaded.sha256({name: picture.pixels for name, picture in hung.items()})
        planned = trials_of(sha256, loaded.tasks, made, count)
        if split == "test":
            _look(folder.parent, loaded.name, sha256, planned)
        work = SuiteWork(
            tasks={task.id: task for task in loaded.tasks},
            pictures={name: picture.path for name, picture in hung.items()},
            arms={_key(planned, i): arm for i, arm in enumerate(arms)},
            base_url=base_url,
            keep=None if split == "test" else _made(folder / ATTEMPTS),
        )
        keep_suite(_made(folder), loaded, split, sha256, hung, levels)
        runs_on = executor("serial" if workers == 1 else "pool", workers)
        done = sweep(planned, work, folder, executor=runs_on, budget_usd=limit, shard=shard)
    _show(loaded, folder, planned, levels)
    _end(done)


def _end(done: Sweep) -> None:
    """Exit code 4 where something stopped the run before its end."""
    if done.stopped is not None:
        print(f"formup: stopped: {done.stopped}", file=sys.stderr)  # noqa: T201
        raise typer.Exit(4)


@app.command()
def suites() -> None:
    """The suites that ship with formup."""
    table = Table(header_style="cyan", box=None)
    for name in ("suite", "what it is"):
        table.add_column(name, no_wrap=name == "suite")
    for name in shipped():
        table.add_row(name, described(name))
    Console(highlight=False).print(table)


@app.command()
def add(folder: e.NewFolder, name: e.Name = None) -> None:
    """Make a suite of a folder of pictures in the photos' format, once its tasks hold.

    Of every task a right answer must score 1 and answers without understanding less.
    """
    path = write_suite(folder, name or folder.resolve().name)
    try:
        made = load_suite(str(path))
        problems = [problem for task in made.tasks for problem in check_task(task)]
        if problems:
            more = f" (and {len(problems) - 5} more)" if len(problems) > 5 else ""
            raise InputError(f"{' '.join(problems[:5])}{more}")
    except InputError:
        path.unlink()
        raise
    print(f"{path}: {len(made.tasks)} tasks. Run them: formup eval run {folder}")  # noqa: T201


def _arms(
    name: str,
    models: list[str] | None,
    prompts: list[str] | None,
    descriptors: list[str] | None,
    library: PromptLibrary,
    paces: Mapping[str, float],
) -> list[Method]:
    """Every model with every prompt and descriptor."""
    return [
        replace(
            method(name, model, prompt, inputs.descriptor(descriptor), library),
            rate=paces.get(model or ""),
        )
        for model in models or [None]
        for prompt in prompts or [None]
        for descriptor in descriptors or ["edges"]
    ]


def _hung(suite: Suite, folder: Path) -> dict[str, Hung]:
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("pictures", total=len(suite.tasks))
        return hang(suite.tasks, folder, lambda: progress.advance(bar))


def _look(folder: Path, suite: str, sha256: str, trials: Sequence[Trial]) -> None:
    arms = sorted({Arm.of(trial).name for trial in trials})
    count = look(folder, suite, sha256, arms)
    text = f"formup: look {count} at the test split of {suite}, written down in {folder / LEDGER}."
    print(text, file=sys.stderr)  # noqa: T201


def _key(trials: Sequence[Trial], arm: int) -> str:
    """Of the arm of that number: the trials of one task begin with all of them, in order."""
    return arm_key(trials[arm])


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _fresh(suite: str) -> Path:
    return RUNS / f"{suite}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"


def _show(suite: Suite, folder: Path, planned: Sequence[Trial], levels: dict[str, Chance]) -> None:
    """A table of each arm, and all of them as JSON."""
    keys = {trial.key for trial in planned}
    rows = [row for row in read_rows(folder) if row.key in keys]
    summary = dict[str, object]()
    for arm in sorted({Arm.of(row).name for row in rows}):
        found = cells([row for row in rows if Arm.of(row).name == arm], levels)
        summary[arm] = [asdict(cell) for cell in found]
        _print(f"{suite.name}, {arm}", found)
    content = {"suite": suite.name, "sha256": planned[0].suite, "arms": summary}
    write_whole(folder / SUMMARY, json.dumps(content, indent=1).encode())
    Console(highlight=False, soft_wrap=True).print(
        "Success: k of n trials; the intervals are of these tasks alone. Thing: it was the one "
        "meant, of those known. Chance: the best of five policies that know where the thing is and "
        f"nothing else.\n{folder}\n"
        f"To look at it: formup eval report {folder}"
    )


COLUMNS = ("success", "95 %", "GCR", "strict", "thing", "chance SR", "chance GCR")


def _print(title: str, found: Sequence[Cell]) -> None:
    table = Table(title=title, header_style="cyan", box=None)
    extra = [n for n in ("invalid", "lost") if any(getattr(cell, n) for cell in found)]
    for name in ("", *COLUMNS, *extra):
        table.add_column(name, justify="right" if name else "left", no_wrap=True)
    for cell in found:
        right, known = cell.right_thing
        low, high = cell.interval
        table.add_row(
            cell.name,
            f"{cell.passed}/{cell.scored}",
            f"{low:.2f}-{high:.2f}",
            f"{cell.gcr:.2f}",
            f"{cell.strict}/{cell.scored}",
            f"{right}/{known}" if known else "-",
            f"{cell.chance.sr:.2f}",
            f"{cell.chance.gcr:.2f}",
            *(str(getattr(cell, name)) for name in extra),
        )
    Console(highlight=False).print(table)
