"""The results of a suite by cell (category x setup): counts first, intervals, and the chance level.

Intervals are Wilson's: of these tasks, not of new ones. Infrastructure errors are left out and
counted.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from ..experiments.trials import TrialRow
from ..grading.policies import chance
from ..tasks.suite_task import SuiteTask
from .intervals import Interval, wilson

CATEGORIES = ("general", "infill", "caging")
SETUPS = ("single", "multi", "hidden")
TOTAL = "total"


@dataclass(frozen=True)
class Chance:
    """What the best policy without understanding scores."""

    sr: float
    gcr: float


@dataclass(frozen=True)
class Cell:
    """Trials that belong together.

    Attributes:
        name: category and setup, one of them, or total.
        tasks: how many.
        passed: successes, k.
        scored: trials, n.
        interval: of the success rate at 95 %, of these tasks.
        gcr: mean.
        strict: successes at the tighter tolerances.
        right_thing: of the trials of which it is known, those about the thing meant; and how many
            these are.
        invalid: trials whose output could not be used.
        lost: infrastructure errors.
        chance: of these tasks.
    """

    name: str
    tasks: int
    passed: int
    scored: int
    interval: Interval
    gcr: float
    strict: int
    right_thing: tuple[int, int]
    invalid: int
    lost: int
    chance: Chance


def chances(tasks: Sequence[SuiteTask]) -> dict[str, Chance]:
    """The chance level of every cell that has tasks, by name."""
    return {
        name: Chance(*chance([task.goals for task in tasks if holds(*task.cell)]))
        for name, holds in _groups(task.cell for task in tasks).items()
    }


def cells(rows: Sequence[TrialRow], levels: dict[str, Chance]) -> list[Cell]:
    """The cells of one arm's rows, those of nothing left out.

    Args:
        rows: of one arm.
        levels: chance by name of cell.
    """
    groups = _groups((row.category, row.setup) for row in rows)
    return [
        _cell(name, [row for row in rows if holds(row.category, row.setup)], levels[name])
        for name, holds in groups.items()
    ]


def _groups(there: Iterable[tuple[str, str]]) -> dict[str, Callable[[str, str], bool]]:
    """Which cells are told of, in order, and what belongs to each."""
    known = set(there)
    groups: dict[str, Callable[[str, str], bool]] = {}
    for category in CATEGORIES:
        for setup in SETUPS:
            if (category, setup) in known:
                cell = (category, setup)
                groups[f"{category} {setup}"] = lambda c, s, cell=cell: (c, s) == cell
    for category in CATEGORIES:
        if any(c == category for c, _ in known):
            groups[category] = lambda c, s, category=category: c == category
    for setup in SETUPS:
        if any(s == setup for _, s in known):
            groups[setup] = lambda c, s, setup=setup: s == setup
    groups[TOTAL] = lambda c, s: True
    return groups


def _cell(name: str, rows: Sequence[TrialRow], level: Chance) -> Cell:
    scored = [row for row in rows if row.scored]
    passed = sum(bool(row.sr) for row in scored)
    known = [row.object_correct for row in scored if row.object_correct is not None]
    return Cell(
        name=name,
        tasks=len({row.task for row in rows}),
        passed=passed,
        scored=len(scored),
        interval=wilson(passed, len(scored)) if scored else Interval(0.0, 1.0),
        gcr=sum(row.gcr or 0.0 for row in scored) / max(len(scored), 1),
        strict=sum(bool(row.strict) for row in scored),
        right_thing=(sum(known), len(known)),
        invalid=sum(row.status == "model_invalid" for row in scored),
        lost=len(rows) - len(scored),
        chance=level,
    )
