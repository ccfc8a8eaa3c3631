"""The runner of the trials of a sweep that its folder does not hold yet, within a budget.

A trial is named by its key; to resume a killed run, run it again. Order: every task gets its first
trial in every arm before any gets its second, arms side by side, so that a sweep that stops is
balanced and a model that drifts does so under all arms alike.
"""

import re
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...tools.errors import InputError
from .executors import Executor, Serial, Work
from .journal import Journal, Manifest
from .trials import Trial, TrialRow

IN_A_ROW = 10
"""Number of consecutive infrastructure errors after which there is no point in going on."""


@dataclass(frozen=True)
class Progress:
    """How far a sweep has got; `row` is the latest, None at the start."""

    done: int
    total: int
    cost_usd: float
    row: TrialRow | None


@dataclass(frozen=True)
class Sweep:
    """How a sweep ended; `stopped` says why it ended early, None if it did not."""

    scored: int
    total: int
    cost_usd: float
    stopped: str | None


def run_trials(
    trials: Sequence[Trial],
    work: Work,
    folder: Path,
    *,
    executor: Executor | None = None,
    budget_usd: float | None = None,
    shard: str | None = None,
    done: Callable[[Progress], None] = lambda progress: None,
) -> Sweep:
    """Run what is not scored yet and append each row to the folder's trials.jsonl.

    Args:
        trials: of the whole sweep, in any order.
        work: runs and grades one; the executor fills in the row's times and host.
        executor: Serial by default.
        budget_usd: for all rows of the folder. No trial starts that would exceed it if it cost
            what the dearest of its model did; the first of a model runs alone.
        shard: i/n runs the i-th of n parts, 1/n to n/n.
        done: called at the start and after every row.

    Raises:
        InputError: several suites, two trials of one key, or a folder of another suite or in use.
    """
    manifest, mine = Manifest.of(trials), part(balanced(trials), shard)
    if budget_usd is not None and not budget_usd > 0:
        raise InputError(f"A budget of {budget_usd:g} USD buys nothing; give one above 0.")
    waiting = deque[Trial]()
    with Journal(folder, manifest) as journal:
        run = _Run(waiting, journal, _Budget(budget_usd, journal.rows.values()), len(mine), done)
        for trial in mine:
            row = journal.rows.get(trial.key)
            if row is not None and row.scored:
                run.scored += 1
            else:
                waiting.append(trial)
        run.report(None)
        if waiting:
            runs_on = executor or Serial()
            runs_on.start(work)
            try:
                run.through(runs_on)
            finally:
                runs_on.close()
        return Sweep(run.scored, len(mine), journal.cost_usd, run.stopped)


def balanced(trials: Iterable[Trial]) -> list[Trial]:
    """Order trials by number, then task as given, its arms side by side and first in turns.

    Raises:
        InputError: two trials have one key.
    """
    cells: dict[tuple[int, str], list[Trial]] = {}
    tasks: dict[str, int] = {}
    seen = set[str]()
    for trial in trials:
        if trial.key in seen:
            raise InputError(f"Task {trial.task}, trial {trial.trial} is given twice for one arm.")
        seen.add(trial.key)
        tasks.setdefault(trial.task, len(tasks))
        cells.setdefault((trial.trial, trial.task), []).append(trial)
    ordered = list[Trial]()
    places = sorted(cells, key=lambda cell: (cell[0], tasks[cell[1]]))
    for turn, place in enumerate(places):
        arms = sorted(cells[place], key=lambda trial: trial.arm.name)
        first = turn % len(arms)
        ordered += arms[first:] + arms[:first]
    return ordered


def part(trials: Sequence[Trial], shard: str | None) -> list[Trial]:
    """Return the trials of a shard i/n, chosen by their keys; all of them for None.

    Raises:
        InputError: it is not i/n with 1 <= i <= n.
    """
    if shard is None:
        return list(trials)
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", shard)
    index, count = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= index <= count:
        raise InputError(f"--shard {shard!r} cannot be used; give i/n, such as 1/4 to 4/4.")
    return [trial for trial in trials if int(trial.key, 16) % count == index - 1]


class _Budget:
    """What may still be spent, with the cost of running trials reserved."""

    def __init__(self, budget: float | None, rows: Iterable[TrialRow]) -> None:
        self._budget = budget
        self._dearest: dict[str, float] = {}
        self._running: Counter[str] = Counter()
        for row in rows:
            self._learn(row)

    def allows(self, model: str, spent: float) -> bool:
        """Return whether a trial of the model may start."""
        if self._budget is None:
            return True
        running = {name: count for name, count in self._running.items() if count}
        if model not in self._dearest:
            return spent < self._budget and not running
        if not running.keys() <= self._dearest.keys():
            return False
        reserved = sum(count * self._dearest[name] for name, count in running.items())
        return spent + reserved + self._dearest[model] <= self._budget

    def begins(self, model: str) -> None:
        self._running[model] += 1

    def ends(self, row: TrialRow) -> None:
        self._running[row.arm.model] -= 1
        self._learn(row)

    def _learn(self, row: TrialRow) -> None:
        if row.scored:
            self._dearest[row.arm.model] = max(self._dearest.get(row.arm.model, 0.0), row.cost_usd)


@dataclass
class _Run:
    waiting: deque[Trial]
    journal: Journal
    budget: _Budget
    total: int
    done: Callable[[Progress], None]
    scored: int = 0
    running: int = 0
    failing: int = 0
    stopped: str | None = None

    def through(self, executor: Executor) -> None:
        """Run what is waiting until nothing is left, or something stops it."""
        self._start(executor)
        while self.running:
            for row in executor.collect():
                self._take(row)
            self._start(executor)

    def report(self, row: TrialRow | None) -> None:
        """Report progress."""
        self.done(Progress(self.scored, self.total, self.journal.cost_usd, row))

    def _start(self, executor: Executor) -> None:
        """Start the trials that may start."""
        while self.stopped is None and self.waiting and self.running < executor.capacity:
            trial = self.waiting[0]
            if not self.budget.allows(trial.arm.model, self.journal.cost_usd):
                if not self.running:
                    self.stopped = (
                        f"The next trial could exceed the budget: {self.journal.cost_usd:.4f} USD "
                        f"are spent, {len(self.waiting)} of {self.total} trials are left."
                    )
                return
            self.waiting.popleft()
            self.budget.begins(trial.arm.model)
            self.running += 1
            executor.submit(trial)

    def _take(self, row: TrialRow) -> None:
        self.journal.append(row)
        self.budget.ends(row)
        self.running -= 1
        self.scored += row.scored
        self.failing = 0 if row.scored else self.failing + 1
        if self.failing == IN_A_ROW:
            self.stopped = f"{IN_A_ROW} infrastructure errors in a row; the last: {row.feedback}"
        self.report(row)
