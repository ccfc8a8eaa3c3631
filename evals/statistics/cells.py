"""Results of a suite by cell (category x setup) and style: counts, intervals, chance levels.

Intervals are Wilson's and hold for these tasks, not for new ones. Infrastructure errors are left
out, but counted.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..experiments.trials import Trial, TrialRow
from ..grading.policies import chance
from ..tasks.task import Task
from .intervals import Interval, wilson

CATEGORIES = ("general", "infill", "caging")
SETUPS = ("single", "multi", "hidden")
TOTAL = "total"
ORDER = (*(f"{c} {s}" for c in CATEGORIES for s in SETUPS), *CATEGORIES, *SETUPS)


@dataclass(frozen=True)
class Chance:
    """What the best policy without understanding scores."""

    sr: float
    gcr: float


@dataclass(frozen=True)
class Cell:
    """Results of trials that belong together.

    Attributes:
        name: category and setup, one of them, a style, or total.
        tasks: how many.
        passed: successes, k.
        scored: trials, n.
        interval: of the success rate at 95 %, on these tasks.
        gcr: mean.
        strict: successes at the tighter tolerances.
        placed: trials in which robots were placed; `placed_passed` of them succeeded.
        right_thing: (right, known): trials that placed robots about the thing meant, of those
            for which it is known.
        iou: mean overlap of the outlines measured with the true ones; None if none were.
        e95: mean of their boundary errors; None if there were none.
        invalid: trials whose output could not be used.
        lost: infrastructure errors.
        chance: the chance level on these tasks.
    """

    name: str
    tasks: int
    passed: int
    scored: int
    interval: Interval
    gcr: float
    strict: int
    placed: int
    placed_passed: int
    right_thing: tuple[int, int]
    iou: float | None
    e95: float | None
    invalid: int
    lost: int
    chance: Chance


def chances(tasks: Sequence[Task]) -> dict[str, Chance]:
    """Return the chance level of every cell that has tasks, by name."""
    return {
        name: Chance(*chance([task.goals for task in tasks if name in cell_names(task)]))
        for name in _ordered_names(tasks)
    }


def cells(rows: Sequence[TrialRow], levels: dict[str, Chance]) -> list[Cell]:
    """Return the cells of one arm, those without rows left out.

    Args:
        rows: of one arm.
        levels: chance levels by name of cell.
    """
    return [
        _cell(name, [row for row in rows if name in cell_names(row)], levels[name])
        for name in _ordered_names(rows)
    ]


def cell_names(of: Task | Trial) -> list[str]:
    """Return the names of the cells that a task or trial belongs to."""
    both = f"{of.category} {of.setup}"
    return [name for name in (both, of.category, of.setup, of.style, TOTAL) if name]


def _ordered_names(there: Iterable[Task | Trial]) -> list[str]:
    """Return the names of all cells: the paper's, then styles, then the total."""
    names = {name for of in there for name in cell_names(of)} - {TOTAL}
    known = [name for name in ORDER if name in names]
    return [*known, *sorted(names.difference(known)), TOTAL]


def _cell(name: str, rows: Sequence[TrialRow], level: Chance) -> Cell:
    scored = [row for row in rows if row.scored]
    placed = [row for row in scored if row.placed]
    passed = sum(bool(row.sr) for row in scored)
    known = [row.object_correct for row in placed if row.object_correct is not None]
    return Cell(
        name=name,
        tasks=len({row.task for row in rows}),
        passed=passed,
        scored=len(scored),
        interval=wilson(passed, len(scored)) if scored else Interval(0.0, 1.0),
        gcr=sum(row.gcr or 0.0 for row in scored) / max(len(scored), 1),
        strict=sum(bool(row.strict) for row in scored),
        placed=len(placed),
        placed_passed=sum(bool(row.sr) for row in placed),
        right_thing=(sum(known), len(known)),
        iou=_mean([row.iou for row in scored if row.iou is not None]),
        e95=_mean([row.e95 for row in scored if row.e95 is not None]),
        invalid=sum(row.status == "model_invalid" for row in scored),
        lost=len(rows) - len(scored),
        chance=level,
    )


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
