"""`formup eval run`: runs a suite with one or several methods; counts beside the chance level."""

import json
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import typer
from rich.console import Console
from rich.progress import Progress

from ..evals.experiments.executors import Executor, executor
from ..evals.experiments.journal import read_rows
from ..evals.experiments.methods import Method, check_method, trials_of
from ..evals.experiments.pointing import JITTERED, mode_named
from ..evals.experiments.runner import Sweep
from ..evals.experiments.suite_work import SuiteWork
from ..evals.experiments.trials import Trial
from ..evals.statistics.cells import Chance, cells, chances
from ..evals.tables.definition import usual_tokens
from ..evals.tables.results import expected, expected_usd
from ..evals.tasks.heldout_ledger import NAME as LEDGER
from ..evals.tasks.heldout_ledger import look
from ..evals.tasks.rendered_pictures import RenderedPicture, render
from ..evals.tasks.stored_suite import ATTEMPTS, PICTURES, store_suite
from ..evals.tasks.suites import load_suite
from ..evals.tasks.task import Suite, Task
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import arguments as inputs
from . import eval_options as e
from . import options as o
from .eval_progress import sweep
from .eval_tables import print_misses, print_placed, print_scores, print_spent, print_turns
from .terminal import say

RUNS = Path("formup-runs")
SUMMARY = "summary.json"
JITTERS = 3
"""Default tries of a task in a mode where each try points in another way."""


def run_suite(
    suite: e.SuiteName,
    method: e.MethodName = "rules",
    mode: e.ModeName = "words",
    seeds: e.Seeds = None,
    task: e.TaskList = None,
    model: e.ModelList = None,
    base_url: o.BaseUrl = None,
    planner: o.PlannerName = None,
    prompt: e.PromptList = None,
    prompts: o.PromptsFolder = None,
    descriptor: e.DescriptorList = None,
    trials: e.Trials = None,
    split: e.Split = "dev",
    out: e.RunFolder = None,
    shard: e.Shard = None,
    budget: e.Budget = None,
    rate: e.RateList = None,
    jobs: e.Jobs = "1",
    dry_run: e.DryRun = False,
) -> None:
    """Run a suite and count successes.

    Successes are counted by category and setup, with confidence intervals and the chance level.
    Several models, prompts and descriptors are run side by side. To continue a killed run, give
    its folder again with --out. Tasks that cannot be pointed at in the chosen mode, or that have
    no recording to replay, are left out. The test split shows scores only, and each look at it is
    recorded.
    """
    workers = inputs.whole("--jobs", jobs, least=1)
    rates = {name: n / workers for name, n in inputs.rates("--rate", rate, model or []).items()}
    common = Method(method, mode=mode_named(mode), planner=planner, base_url=base_url)
    common = replace(common, library=PromptLibrary(prompts))
    arms = _arms(common, model, prompt, descriptor, rates)
    tries = trials or str(JITTERS if common.mode in JITTERED else 1)
    count, limit = inputs.whole("--trials", tries, least=1), inputs.dollars("--budget", budget)
    loaded = load_suite(suite, split, seeds)
    tasks, folder = tasks_tried(loaded, arms, task), out or new_folder(loaded.name)
    if dry_run:
        _say_costs(arms, len(tasks) * count)
        return
    tried = [(arm, tasks, count) for arm in arms]
    with prepared(loaded, tried, split, folder) as made:
        planned = [trial for own in made.trials for trial in own]
        runs_on = processes(workers)
        done = sweep(planned, made.work, folder, executor=runs_on, budget_usd=limit, shard=shard)
    _print_summary(loaded, folder, planned, made.levels)
    say_stopped(done)


def processes(count: int) -> Executor:
    """Return an executor that runs trials in that many processes."""
    return executor("serial" if count == 1 else "pool", count)


def say_stopped(done: Sweep) -> None:
    """If a sweep stopped early, say why and exit with code 4."""
    if done.stopped is not None:
        say(f"formup: stopped: {done.stopped}", error=True)
        raise typer.Exit(4)


def _arms(
    common: Method,
    models: list[str] | None,
    prompts: list[str] | None,
    descriptors: list[str] | None,
    rates: Mapping[str, float],
) -> list[Method]:
    """Return the method with every combination of model, prompt and descriptor."""
    return [
        check_method(
            replace(
                common,
                model=model or "",
                prompt=prompt,
                descriptor=inputs.descriptor(descriptor),
                rate=rates.get(model or ""),
            )
        )
        for model in models or [None]
        for prompt in prompts or [None]
        for descriptor in descriptors or ["edges"]
    ]


def _say_costs(arms: Sequence[Method], trials: int) -> None:
    """Print roughly what each arm's trials would cost, with the tokens its method usually takes."""
    costs = list[float | None]()
    for arm in arms:
        each, model = usual_tokens(arm.name), "+".join(filter(None, (arm.model, arm.planner)))
        costs.append(expected_usd(model, trials, each, base_url=arm.base_url))
        named = " ".join(filter(None, (arm.name, arm.prompt, model)))
        say(f"{named}: {expected(trials, each, costs[-1])}")
    more = ", and what has no known price" if None in costs else ""
    say(f"all: {len(arms) * trials:,} trials; about {sum(filter(None, costs)):.2f} USD{more}")


@dataclass(frozen=True)
class Prepared:
    """A suite in a run's folder, ready to be tried.

    Attributes:
        sha256: hash of the suite with its pictures.
        trials: the trials of each arm, in the order of the arms.
        work: runs the trials.
        levels: the chance level by name of cell.
    """

    sha256: str
    trials: Sequence[Sequence[Trial]]
    work: SuiteWork
    levels: dict[str, Chance]


@contextmanager
def prepared(
    suite: Suite, tried: Sequence[tuple[Method, Sequence[Task], int]], split: str, folder: Path
) -> Generator[Prepared, None, None]:
    """Render a suite's pictures, store the suite in a run's folder, and yield it ready to be tried.

    Args:
        suite: the suite to run.
        tried: each method with the tasks it tries and the number of tries of each.
        split: of the suite; of the test split only scores are stored, and the look is recorded.
        folder: of the run.
    """
    levels, held_out, attempts = chances(suite.tasks), split == "test", folder / ATTEMPTS
    with ExitStack() as stack:
        place = stack.enter_context(TemporaryDirectory()) if held_out else folder / PICTURES
        pictures = _render(suite, Path(place))
        sha256 = suite.sha256({name: picture.pixels for name, picture in pictures.items()})
        arms = [method.arm for method, _, _ in tried]
        trials = [
            trials_of(sha256, tasks, [arm], count)
            for arm, (_, tasks, count) in zip(arms, tried, strict=True)
        ]
        if held_out:
            _note_look(folder.parent, suite.name, sha256, [t for own in trials for t in own])
        (folder if held_out else attempts).mkdir(parents=True, exist_ok=True)
        work = SuiteWork(
            tasks={task.id: task for _, tasks, _ in tried for task in tasks},
            pictures={name: picture.path for name, picture in pictures.items()},
            arms={arm.name: method for arm, (method, _, _) in zip(arms, tried, strict=True)},
            attempts=None if held_out else attempts,
        )
        store_suite(folder, suite, split, sha256, pictures, levels)
        yield Prepared(sha256, trials, work, levels)


def tasks_tried(suite: Suite, arms: Sequence[Method], names: list[str] | None) -> list[Task]:
    """Return the tasks to try: those named, or all, except any that some arm does not take.

    Raises:
        InputError: there is no task of a name, or none is left.
    """
    known = {task.id: task for task in suite.tasks}
    for name in names or ():
        if name not in known:
            raise InputError(f"Unknown task {name!r}. There are: {', '.join(known)}.")
    wanted = [known[name] for name in dict.fromkeys(names or known)]
    chosen = [task for task in wanted if all(arm.takes(task) for arm in arms)]
    if not chosen:
        raise InputError(
            "No task is left to run: this method, model and --mode can try none of them."
        )
    return chosen


def _render(suite: Suite, folder: Path) -> dict[str, RenderedPicture]:
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("pictures", total=len(suite.tasks))
        return render(suite.tasks, folder, lambda: progress.advance(bar))


def _note_look(folder: Path, suite: str, sha256: str, trials: Sequence[Trial]) -> None:
    arms = sorted({trial.arm.name for trial in trials})
    count = look(folder, suite, sha256, arms)
    text = f"formup: look {count} at the test split of {suite}, recorded in {folder / LEDGER}."
    say(text, error=True)


def new_folder(suite: str) -> Path:
    """Return the path of a folder for a run of a suite that begins now."""
    return RUNS / f"{suite}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"


def _print_summary(
    suite: Suite, folder: Path, planned: Sequence[Trial], levels: dict[str, Chance]
) -> None:
    """Print the tables of each arm, and write their cells as JSON."""
    keys = {trial.key for trial in planned}
    rows = [row for row in read_rows(folder) if row.key in keys]
    summary = dict[str, object]()
    for arm in sorted({row.arm.name for row in rows}):
        own = [row for row in rows if row.arm.name == arm]
        found = cells(own, levels)
        summary[arm] = [asdict(cell) for cell in found]
        print_scores(f"{suite.name}, {arm}", found)
        if own[0].arm.model != "none":
            print_placed(found)
            print_turns(own)
            print_spent(own)
            print_misses(own)
    content = {"suite": suite.name, "sha256": planned[0].suite, "arms": summary}
    write_whole(folder / SUMMARY, json.dumps(content, indent=1).encode())
    Console(highlight=False, soft_wrap=True).print(
        "Success: k of n trials; the intervals hold for these tasks only. Right thing: the one "
        "that was meant, out of those known. Chance: the best of five policies that know where the "
        f"thing is and nothing else.\n{folder}\n"
        f"To view it: formup eval report {folder}"
    )
