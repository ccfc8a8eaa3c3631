"""The progress of a sweep of trials on the terminal: trials done, time left, cost so far."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..evals.experiments.executors import Work
from ..evals.experiments.runner import Progress as Sofar
from ..evals.experiments.runner import Sweep, run_trials
from ..evals.experiments.trials import Trial


def sweep(
    trials: Sequence[Trial], work: Work, folder: Path, *, console: Console | None = None, **how: Any
) -> Sweep:
    """Call `run_trials` with a progress bar on stderr; `how` are its other arguments.

    Trials done by an earlier run count as done, but not towards the speed.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[cost]:.4f} USD"),
        TextColumn("{task.fields[errors]}"),
    )
    shown = console or Console(stderr=True)
    with Progress(*columns, console=shown, transient=True) as bar:
        task = bar.add_task("trials", start=False, total=None, cost=0.0, errors="")
        errors = 0

        def tell(sofar: Sofar) -> None:
            nonlocal errors
            if sofar.row is None:
                bar.start_task(task)
            elif not sofar.row.scored:
                errors += 1
            bar.update(
                task,
                completed=sofar.done,
                total=sofar.total,
                cost=sofar.cost_usd,
                errors=f"{errors} infrastructure errors" if errors else "",
            )

        return run_trials(trials, work, folder, done=tell, **how)
