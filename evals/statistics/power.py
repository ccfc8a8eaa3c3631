"""Numbers of tasks and trials that show a difference, given the spread seen in a comparison."""

import math
from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from ...tools.geometry.outline import FloatArray
from .intervals import least_error

ALPHA, POWER = 0.05, 0.8
MOST = 100_000
"""More tasks or trials per task than anybody runs."""


@dataclass(frozen=True)
class Spread:
    """Variances of paired differences.

    Attributes:
        tasks: how many.
        trials: pairs per task (harmonic mean).
        between: variance of the true differences of tasks.
        within: variance of the difference of one pair of trials; 0 if there is one pair per task,
            as all variance then counts as `between`.
    """

    tasks: int
    trials: float
    between: float
    within: float

    @property
    def fixed_error(self) -> float:
        """Standard error of the mean difference on these very tasks."""
        return math.sqrt(self.within / self.trials / self.tasks)


@dataclass(frozen=True)
class Needed:
    """What settles a question, either of the two: more trials of these tasks, or more tasks.

    Attributes:
        difference: the one that can then be detected, 0 to 1.
        trials: per task, with the tasks there are; None if no number of trials is enough.
        tasks: with as many trials of each as now; None if no number of tasks is enough.
    """

    difference: float
    trials: int | None
    tasks: int | None


def spread(differences: list[FloatArray]) -> Spread:
    """Estimate the variances from the paired differences of each task's trials.

    Args:
        differences: one array of (n,) pairs per task, n at least 1.
    """
    counts = np.array([len(d) for d in differences], dtype=float)
    means = np.array([d.mean() for d in differences])
    total = float(means.var(ddof=1)) if len(means) > 1 else 0.0
    repeated = [float(d.var(ddof=1)) for d in differences if len(d) > 1]
    trials = float(len(counts) / np.sum(1 / counts))
    if not repeated:
        return Spread(len(counts), trials, total, 0.0)
    within = max(float(np.mean(repeated)), counts.sum() * least_error(counts.sum()) ** 2)
    return Spread(len(counts), trials, max(0.0, total - within / trials), within)


def needed(seen: Spread, difference: float, *, one_sided: bool = False) -> Needed:
    """Return the trials or tasks that tell a difference from 0 with power .8 at level .05.

    Args:
        seen: the spread to expect.
        difference: above 0, else neither number exists.
        one_sided: for a bound instead of an interval.
    """
    if difference <= 0:
        return Needed(difference, None, None)
    trials = tasks = None
    if seen.tasks > 1 and seen.within > 0:
        error = difference / _errors_needed(seen.tasks, one_sided)
        left = error**2 * seen.tasks - seen.between
        trials = math.ceil(seen.within / left) if left > seen.within / MOST else None
    each = seen.between + seen.within / seen.trials

    def enough(count: int) -> bool:
        return count >= each * (_errors_needed(count, one_sided) / difference) ** 2

    if enough(MOST):
        tasks = bisect_left(range(2, MOST), True, key=enough) + 2
    return Needed(difference, trials, tasks)


def _errors_needed(tasks: int, one_sided: bool) -> float:
    """Return how many standard errors a difference must measure."""
    from scipy.special import stdtrit

    level = 1 - ALPHA / (1 if one_sided else 2)
    return float(stdtrit(tasks - 1, level) + stdtrit(tasks - 1, POWER))
