"""Intervals, tests and reliability for success over tasks that are each tried several times.

Two questions are distinct. New tasks: the task is the sampling unit, as trials of one task are
alike. Fixed tasks: only the luck of a trial varies. Bounds at the edges (0 or all successes) stay
bounds: nothing here claims certainty from few trials.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ...tools.geometry.outline import FloatArray

ICC = 0.3
"""Share of a trial's variance that is due to its task, assumed where data cannot show it."""
EXACT = 16
"""Up to this many differences all sign flips are tried."""
DRAWS = 20_000
"""Sign flips drawn at random if there are more; p is then known to about .003."""
CHUNK = 2_000
TINY = 1e-9


class Interval(NamedTuple):
    """A range that holds the true value with the confidence asked for."""

    low: float
    high: float


def wilson(k: float, n: float, level: float = 0.95) -> Interval:
    """Return Wilson's score interval for a share (Wilson 1927).

    Args:
        k: successes, 0 to n; a fraction if n is an effective number.
        n: trials, above 0.
    """
    z = NormalDist().inv_cdf((1 + level) / 2)
    share, spread = k / n, z * z / n
    centre = (share + spread / 2) / (1 + spread)
    half = z * math.sqrt(max(share * (1 - share), 0) / n + spread / (4 * n)) / (1 + spread)
    return Interval(max(0.0, min(share, centre - half)), min(1.0, max(share, centre + half)))


def effective_trials(counts: FloatArray, icc: float = ICC) -> float:
    """Return how many independent trials the trials of tasks are worth (Kish's design effect).

    Args:
        counts: trials of each task, (T,).
    """
    return float(counts.sum() / (1 + (counts.mean() - 1) * icc))


def logit_t(means: FloatArray, counts: FloatArray, level: float = 0.95) -> Interval:
    """Return the interval of the success on new tasks: Student's t on the logits of task means.

    If all tasks have the same mean, their spread shows nothing; then it is Wilson's interval with
    the effective number of trials.

    Args:
        means: success of each task, 0 to 1, (T,).
        counts: trials of each task, (T,).
    """
    from scipy.special import expit, logit

    mean, error = float(means.mean()), standard_error(means)
    if error < TINY or not TINY < mean < 1 - TINY:
        n = effective_trials(counts)
        return wilson(min(max(mean, 0.0), 1.0) * n, n, level)
    half = _t_quantile(level, len(means)) * error / (mean * (1 - mean))
    return Interval(*(float(expit(logit(mean) + side * half)) for side in (-1, 1)))


def standard_error(values: FloatArray) -> float:
    """Return the standard error of the mean of (T,) values; 0 for a single one."""
    return float(values.std(ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else 0.0


def least_error(pairs: float) -> float:
    """Return the least standard error to assume for a mean difference of so many pairs of trials.

    It is that of two more pairs, one differing each way (Bonett and Price 2012): identical results
    of few trials do not prove that two versions are alike.
    """
    return math.sqrt(2) / (pairs + 2)


def paired_t(differences: FloatArray, level: float = 0.95, least: float = 0.0) -> Interval:
    """Return the interval of the mean difference on new tasks; unbounded for a single task.

    The ends at level .90 are the one-sided bounds at 95 %.

    Args:
        differences: of task means, (T,).
        least: the least standard error to assume.
    """
    if len(differences) < 2:
        return Interval(-math.inf, math.inf)
    mean = float(differences.mean())
    half = _t_quantile(level, len(differences)) * max(standard_error(differences), least)
    return Interval(mean - half, mean + half)


def sign_flips(differences: FloatArray, seed: int = 0) -> float:
    """Return the two-sided p of a paired permutation test, in which chance flips signs.

    With differences of task means it tests the new-task claim. With differences of paired trials
    it permutes labels within tasks only: the fixed-task claim. Exact up to 16 differences that are
    not 0, else with 20,000 flips drawn from `seed`.

    Args:
        differences: (n,), weighted so that their sum is the statistic.
    """
    nonzero = differences[np.abs(differences) > TINY]
    if not len(nonzero):
        return 1.0
    least = abs(float(nonzero.sum())) - TINY * float(np.abs(nonzero).sum())
    if len(nonzero) <= EXACT:
        bits = (np.arange(1 << len(nonzero))[:, None] >> np.arange(len(nonzero))) & 1
        return float((np.abs((1.0 - 2.0 * bits) @ nonzero) >= least).mean())
    random, hits = np.random.default_rng(seed), 0
    for _ in range(DRAWS // CHUNK):
        signs = np.where(random.random((CHUNK, len(nonzero))) < 0.5, 1.0, -1.0)
        hits += int((np.abs(signs @ nonzero) >= least).sum())
    return (1 + hits) / (1 + DRAWS)


def holm(p: Sequence[float]) -> list[float]:
    """Return Holm's adjusted p of several tests, in the order given (Holm 1979)."""
    adjusted, largest = [0.0] * len(p), 0.0
    for rank, index in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        largest = max(largest, min(1.0, (len(p) - rank) * p[index]))
        adjusted[index] = largest
    return adjusted


def pass_k(successes: FloatArray, counts: FloatArray, k: int) -> float:
    """Return the chance that k trials of a task all succeed (Yao et al. 2024, tau-bench).

    It is the mean over tasks of C(c, k) / C(n, k), which is unbiased; a power of the mean success
    is not.

    Args:
        successes: c of each task, (T,).
        counts: n of each task, (T,).
        k: 1 to the least of n.

    Raises:
        ValueError: k is out of that range.
    """
    from scipy.special import comb

    if not 1 <= k <= counts.min():
        raise ValueError(f"pass^{k} needs at least {k} trials of every task.")
    return float(np.mean(comb(successes, k) / comb(counts, k)))


@lru_cache(maxsize=1024)
def _t_quantile(level: float, values: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(values - 1, (1 + level) / 2))
