"""`formup eval suites`, `add` and `descriptors`: lists suites, makes one, measures its shapes."""

from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from ..evals.experiments.descriptor_cost import descriptor_costs
from ..evals.grading.check_tasks import check_task
from ..evals.tasks.rendered_pictures import render
from ..evals.tasks.suites import description, load_suite, shipped, write_suite
from ..tools.errors import InputError
from . import eval_options as e
from .terminal import say, styled

NAMED = 5
"""Most problems that an error spells out."""


def suites() -> None:
    """List the suites that ship with formup."""
    table = Table(header_style="cyan", box=None)
    for name in ("suite", "what it is"):
        table.add_column(name, no_wrap=name == "suite")
    for name in shipped():
        table.add_row(name, styled(description(name)))
    Console(highlight=False).print(table)


def add(folder: e.NewFolder, name: e.Name = None) -> None:
    """Make a suite from a folder of pictures, and check its tasks.

    The folder has the format of the photos suite. The suite is kept only if, for each task, a
    right answer scores 1 and answers without understanding score less.
    """
    path = write_suite(folder, name or folder.resolve().name)
    try:
        made = load_suite(str(path))
        problems = [problem for task in made.tasks for problem in check_task(task)]
        if problems:
            more = f" (and {len(problems) - NAMED} more)" if len(problems) > NAMED else ""
            raise InputError(f"{' '.join(problems[:NAMED])}{more}")
    except InputError:
        path.unlink()
        raise
    number = len(made.tasks)
    say(f"{path}: {number} task{'s' * (number != 1)}. Run it: formup eval run {folder}")


def descriptors(suite: e.DescribedSuite = "photos") -> None:
    """Count the tokens each shape descriptor takes, over a suite."""
    table = Table(title="describe_shape", header_style="cyan", box=None)
    for name in ("descriptor", "median tokens", "most", "beyond edges"):
        table.add_column(name, justify="left" if name == "descriptor" else "right")
    tasks = load_suite(suite).tasks
    with TemporaryDirectory() as folder:
        pictures = {name: made.path for name, made in render(tasks, Path(folder)).items()}
        costs = descriptor_costs(tasks, pictures)
    for cost in costs:
        numbers = (f"{cost.median:,.0f}", f"{cost.most:,}", f"{cost.overhead:+.0%}")
        table.add_row(cost.descriptor, *numbers)
    Console(highlight=False).print(table)
