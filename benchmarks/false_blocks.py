"""`python -m formup.benchmarks.false_blocks`: how often the gate blocks versions, equal or worse.

Seeded comparisons of simulated versions go through the gate itself. Success rates of tasks come
from a beta distribution with ICC .3; tasks with a rate of .99 or more must pass. Of the output,
.02 is invalid.
"""

import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evals.experiments.gate import Paired, gate
from ..evals.statistics.intervals import ICC, Interval, wilson
from ..tools.geometry.outline import FloatArray

COMPARISONS, SEED = 2000, 0
SIZES = ((15, 2), (15, 10), (30, 10), (60, 10), (150, 10))
"""Numbers of tasks, and of trials of each."""
MEAN, TASK_SD = 0.7, 0.05
"""Mean success rate of the old version; standard deviation of the effect between tasks."""
INVALID = 0.02
TOKENS, TOKENS_SD = 3000.0, 0.1
"""Mean tokens of a trial, and the relative spread of a task's mean."""
ALWAYS = 0.99
REGRESSION = 0.10
PLANTED = ((12, 10), (12, 20), (12, 30), (30, 10), (60, 10))
"""Numbers of tasks, and of trials of each, for a version with planted lapses."""


@dataclass(frozen=True)
class Blocked:
    """How often comparisons ended in each verdict."""

    tasks: int
    trials: int
    regression: float
    blocked: int
    passed: int
    comparisons: int

    @property
    def interval(self) -> Interval:
        """The interval of the rate of blocks, at 95 %."""
        return wilson(self.blocked, self.comparisons)


def simulate(
    tasks: int,
    trials: int,
    regression: float = 0.0,
    *,
    task_sd: float = 0.0,
    comparisons: int = COMPARISONS,
) -> Blocked:
    """Put simulated comparisons through the gate.

    Args:
        regression: what the new version's rate loses on every task, down to 0.
        task_sd: standard deviation of its effect on each task except those that must pass.
    """
    random = np.random.default_rng([SEED, tasks, trials, round(1000 * regression)])
    paired = (_versions(random, tasks, trials, regression, task_sd) for _ in range(comparisons))
    return _judged(tasks, trials, regression, paired)


def _judged(tasks: int, trials: int, regression: float, paired: Iterable[Paired]) -> Blocked:
    verdicts = Counter(gate(versions).verdict for versions in paired)
    blocked, passed = verdicts["block"], verdicts["pass"]
    return Blocked(tasks, trials, regression, blocked, passed, verdicts.total())


def rates(random: np.random.Generator, shape: tuple[int, ...], mean: float = MEAN) -> FloatArray:
    """Return success rates of tasks, from the beta distribution with that mean and the ICC."""
    weight = 1 / ICC - 1
    return random.beta(mean * weight, (1 - mean) * weight, shape)


def _versions(
    random: np.random.Generator, tasks: int, trials: int, regression: float, task_sd: float
) -> Paired:
    """Simulate the trials of two versions."""
    before = rates(random, (tasks,))
    always = before >= ALWAYS
    effect = np.where(always, 0.0, random.normal(0, 1, tasks) * task_sd)
    after = np.clip(before + effect - regression, 0, 1)
    both = np.stack([before, after])
    tokens = TOKENS * (1 + TOKENS_SD * random.normal(size=both.shape) / np.sqrt(trials))
    score = random.binomial(trials, both) / trials
    invalid = random.binomial(trials, INVALID, both.shape) / trials
    return _paired(trials, score, invalid, tokens, always)


def _paired(
    trials: int,
    score: FloatArray,
    invalid: FloatArray,
    tokens: FloatArray,
    must_pass: NDArray[np.bool_],
) -> Paired:
    tasks = len(must_pass)
    names, pairs = tuple(map(str, range(tasks))), np.full(tasks, float(trials))
    return Paired(names, pairs, score, invalid, tokens, must_pass)


def planted(tasks: int, trials: int, share: float, *, comparisons: int = COMPARISONS) -> Blocked:
    """Put a version through the gate that lapses in some trials, where the old one always passes.

    Any trial may lapse alike, as in evals/experiments/simulated_model.py.

    Args:
        share: fraction of trials that lapse.
    """
    random = np.random.default_rng([SEED, tasks, trials, round(1000 * share)])
    nothing, tokens = np.zeros((2, tasks)), np.full((2, tasks), TOKENS)

    def versions() -> Paired:
        lapses = random.binomial(trials, share, tasks) / trials
        score = np.stack([np.ones(tasks), 1 - lapses])
        return _paired(trials, score, nothing, tokens, np.zeros(tasks, dtype=bool))

    return _judged(tasks, trials, share, (versions() for _ in range(comparisons)))


def main() -> None:
    """Print the rates; exit code 1 if false blocks are not compatible with 5 % or less."""
    began = time.perf_counter()
    rows = [simulate(tasks, trials) for tasks, trials in SIZES]
    uneven = [simulate(*SIZES[-1], task_sd=TASK_SD), simulate(15, 10, task_sd=TASK_SD)]
    print(f"{COMPARISONS:,} comparisons each; blocks with Wilson's interval at 95 %\n")  # noqa: T201
    _print_rates("equal on every task", rows)
    _print_rates(f"equal on average, tasks differ by {TASK_SD:g}", uneven)
    lost = [simulate(tasks, trials, REGRESSION) for tasks, trials in SIZES]
    _print_rates(f"{100 * REGRESSION:.0f} points worse on every task", lost)
    worse = [planted(tasks, trials, REGRESSION) for tasks, trials in PLANTED]
    _print_rates(
        f"a lapse in {REGRESSION:.0%} of the trials of a version that else always succeeds", worse
    )
    print(f"{time.perf_counter() - began:.1f} s")  # noqa: T201
    sys.exit(int(any(row.interval.low > 0.05 for row in [*rows, *uneven])))


def _print_rates(title: str, rows: list[Blocked]) -> None:
    print(title)  # noqa: T201
    for row in rows:
        low, high = row.interval
        share, passed = row.blocked / row.comparisons, row.passed / row.comparisons
        print(  # noqa: T201
            f"  {row.tasks:4d} tasks x {row.trials:2d}: blocked {share:.4f} ({low:.4f} to "
            f"{high:.4f}), passed {passed:.3f}"
        )


if __name__ == "__main__":
    main()
