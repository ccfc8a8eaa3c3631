"""Runs the trials of a sweep that its folder does not hold yet, within a budget and rate limits.

A trial is named by its key; a killed run is gone on with by running it again. Order: every task
gets its first trial in every arm before any gets its second, arms side by side, so that a sweep
that stops is balanced and a model that drifts drifts under all arms alike.
"""

import re
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...tools.errors import InputError
from .executors import Executor, Serial, Work
from .journal import Arm, Journal, Manifest
from .trials import Trial, TrialRow

IN_A_ROW = 10
"""Infrastructure errors one after the other, after which going on is of no use."""


@dataclass(frozen=True)
class Progress:
    """How far a sweep is; `row` is the latest, None at the start."""

    done: int
    total: int
    cost_usd: float
    row: TrialRow | None


@dataclass(frozen=True)
class Sweep:
    """How a sweep ended; `stopped` says why it did before its end."""

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
    rate: Mapping[str, float] | None = None,
    shard: str | None = None,
    done: Callable[[Progress], None] = lambda progress: None,
) -> Sweep:
    """Run what is not scored yet and append each row to the folder's trials.jsonl.

    Args:
        trials: of the whole sweep, in any order.
        work: runs and grades one; the row's times and host are filled in.
        executor: Serial by default.
        budget_usd: over all rows of the folder. No trial starts that could exceed it if it cost
            what the dearest of its model did; the first of a model runs alone.
        rate: trials begun per minute, by model; none stands for no limit.
        shard: i/n runs the i-th of n parts, 1/n to n/n.
        done: told at the start and after every row.

    Raises:
        InputError: several suites or trials of one key, a folder of another suite or in use.
    """
    manifest, mine = Manifest.of(trials), part(balanced(trials), shard)
    if budget_usd is not None and not budget_usd > 0:
        raise InputError(f"A budget of {budget_usd:g} USD buys nothing; give one above 0.")
    queue = Queue(rate or {})
    with Journal(folder, manifest) as journal:
        run = _Run(queue, journal, _Purse(budget_usd, journal.rows.values()), len(mine), done)
        for trial in mine:
            row = journal.rows.get(trial.key)
            if row is not None and row.scored:
                run.scored += 1
            else:
                queue.add(trial)
        run.tell(None)
        if queue:
            runs_on = executor or Serial()
            runs_on.start(work)
            try:
                run.through(runs_on)
            finally:
                runs_on.close()
        return Sweep(run.scored, len(mine), journal.cost_usd, run.stopped)


def balanced(trials: Iterable[Trial]) -> list[Trial]:
    """By trial number, then task in the order given, its arms side by side and taking turns first.

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
        arms = sorted(cells[place], key=lambda trial: Arm.of(trial).name)
        first = turn % len(arms)
        ordered += arms[first:] + arms[:first]
    return ordered


def part(trials: Sequence[Trial], shard: str | None) -> list[Trial]:
    """The trials of a shard i/n, chosen by their keys; all of them for None.

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


class Queue:
    """Trials that wait, in order; those of a model start no faster than its rate.

    Args:
        rate: trials per minute, by model.
    """

    def __init__(self, rate: Mapping[str, float]) -> None:
        for model, limit in rate.items():
            if not limit > 0:
                raise InputError(f"The rate of {model} is {limit:g}; give trials per minute.")
        self._rate = rate
        self._waiting: dict[str, deque[tuple[int, Trial]]] = {}
        self._free_at: dict[str, float] = {}
        self._added = 0

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def add(self, trial: Trial) -> None:
        """Put a trial last."""
        self._waiting.setdefault(trial.model, deque()).append((self._added, trial))
        self._added += 1

    def first(self, now: float) -> Trial | None:
        """The first whose model may be asked at `now`, seconds on a steady clock."""
        free = [
            waiting[0]
            for model, waiting in self._waiting.items()
            if waiting and self._free_at.get(model, now) <= now
        ]
        return min(free, key=lambda entry: entry[0])[1] if free else None

    def take(self, trial: Trial, now: float) -> None:
        """Take out a trial that `first` gave, which starts at `now`."""
        self._waiting[trial.model].popleft()
        if trial.model in self._rate:
            self._free_at[trial.model] = now + 60 / self._rate[trial.model]

    def wait(self, now: float) -> float | None:
        """Seconds until `first` gives one; None if nothing waits."""
        free = [self._free_at.get(model, now) for model, w in self._waiting.items() if w]
        return max(0.0, min(free) - now) if free else None


class _Purse:
    """What may still be spent, with what is under way reserved."""

    def __init__(self, budget: float | None, rows: Iterable[TrialRow]) -> None:
        self._budget = budget
        self._dearest: dict[str, float] = {}
        self._running: Counter[str] = Counter()
        for row in rows:
            self._learn(row)

    def allows(self, model: str, spent: float) -> bool:
        """Whether a trial of the model may start."""
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
        self._running[row.model] -= 1
        self._learn(row)

    def _learn(self, row: TrialRow) -> None:
        if row.scored:
            self._dearest[row.model] = max(self._dearest.get(row.model, 0.0), row.cost_usd)


@dataclass
class _Run:
    queue: Queue
    journal: Journal
    purse: _Purse
    total: int
    done: Callable[[Progress], None]
    scored: int = 0
    running: int = 0
    failing: int = 0
    stopped: str | None = None

    def through(self, executor: Executor) -> None:
        """Run the queue until it is empty, or something stops it."""
        while True:
            pause = self._fill(executor)
            if self.running:
                for row in executor.collect(pause):
                    self._take(row)
            elif pause is None:
                return
            else:
                time.sleep(pause)

    def tell(self, row: TrialRow | None) -> None:
        self.done(Progress(self.scored, self.total, self.journal.cost_usd, row))

    def _fill(self, executor: Executor) -> float | None:
        """Start what may start; seconds until more may, None if that takes a row, or is never."""
        while self.stopped is None and self.running < executor.capacity:
            now = time.monotonic()
            trial = self.queue.first(now)
            if trial is None:
                return self.queue.wait(now)
            if not self.purse.allows(trial.model, self.journal.cost_usd):
                if not self.running:
                    self.stopped = (
                        f"The next trial could exceed the budget: {self.journal.cost_usd:.4f} USD "
                        f"are spent, {len(self.queue)} of {self.total} trials are left."
                    )
                return None
            self.queue.take(trial, now)
            self.purse.begins(trial.model)
            self.running += 1
            executor.submit(trial)
        return None

    def _take(self, row: TrialRow) -> None:
        self.journal.append(row)
        self.purse.ends(row)
        self.running -= 1
        self.scored += row.scored
        self.failing = 0 if row.scored else self.failing + 1
        if self.failing == IN_A_ROW:
            self.stopped = f"{IN_A_ROW} infrastructure errors in a row; the last: {row.feedback}"
        self.tell(row)
