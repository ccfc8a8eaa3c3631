"""Trials of tasks by a method without a folder of their own, for tests of methods and suites."""

from collections.abc import Sequence
from pathlib import Path

from formup.evals.experiments.methods import Method, trials_of
from formup.evals.experiments.suite_work import SuiteWork
from formup.evals.experiments.trials import Trial, TrialRow
from formup.evals.tasks.rendered_pictures import render
from formup.evals.tasks.task import Task


def work_of(
    tasks: Sequence[Task], arm: Method, folder: Path, count: int = 1, attempts: Path | None = None
) -> tuple[SuiteWork, list[Trial]]:
    """What runs the trials of tasks, and the trials."""
    pictures = {name: made.path for name, made in render(tasks, folder).items()}
    trials = trials_of("0" * 64, tasks, [arm.arm], count)
    arms = {trial.arm.name: arm for trial in trials}
    return SuiteWork({task.id: task for task in tasks}, pictures, arms, attempts), trials


def tried(tasks: Sequence[Task], arm: Method, folder: Path, count: int = 1) -> list[TrialRow]:
    """The rows of all trials; drawn pictures and attempts are kept in a folder."""
    work, trials = work_of(tasks, arm, folder, count, folder)
    return [work(trial) for trial in trials]
