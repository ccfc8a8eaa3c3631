"""Intervals, tests and reliability: known values, properties, and coverage by simulation."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from formup.benchmarks.false_blocks import TASK_SD, rates
from formup.evals.statistics.intervals import (
    effective_trials,
    holm,
    least_error,
    logit_t,
    paired_t,
    pass_k,
    sign_flips,
    wilson,
)
from formup.evals.statistics.power import ALPHA, Spread, needed, spread
from formup.tools.geometry.outline import FloatArray
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import stdtrit

COUNTS = st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
TASKS = st.lists(st.integers(0, 10), min_size=2, max_size=40)
DIFFERENCES = st.lists(st.integers(-10, 10), min_size=1, max_size=8)


def means(successes: list[int]) -> tuple[FloatArray, FloatArray]:
    return np.array(successes) / 10, np.full(len(successes), 10.0)


@pytest.mark.parametrize(
    ("k", "low", "high"),
    [(7, 0.397, 0.892), (8, 0.490, 0.943), (10, 0.722, 1.0), (0, 0.0, 0.278)],
)
def test_wilson_of_ten(k: int, low: float, high: float) -> None:
    assert wilson(k, 10) == pytest.approx((low, high), abs=5e-4)


@given(COUNTS)
def test_wilson_contains_the_share_and_is_symmetric(counts: tuple[int, int]) -> None:
    k, n = counts
    low, high = wilson(k, n)
    assert 0 <= low <= k / n <= high <= 1
    assert wilson(n - k, n) == pytest.approx((1 - high, 1 - low))


@given(COUNTS)
def test_wilson_rises_with_successes_and_narrows_with_trials(counts: tuple[int, int]) -> None:
    k, n = counts
    here, more = wilson(k, n), wilson(4 * k, 4 * n)
    assert more.high - more.low < here.high - here.low
    if k < n:
        after = wilson(k + 1, n)
        assert after.low > here.low
        assert after.high > here.high


@settings(deadline=None)  # scipy is imported in the first
@given(TASKS)
def test_logit_t_contains_the_mean_and_is_symmetric(successes: list[int]) -> None:
    values, counts = means(successes)
    low, high = logit_t(values, counts)
    assert 0 <= low <= values.mean() <= high <= 1
    assert low < high
    assert logit_t(1 - values, counts) == pytest.approx((1 - high, 1 - low), abs=1e-9)


@settings(deadline=None)  # scipy is imported in the first
@given(TASKS)
def test_more_confidence_is_a_wider_interval(successes: list[int]) -> None:
    wide, narrow = (logit_t(*means(successes), level) for level in (0.95, 0.8))
    assert wide.low <= narrow.low <= narrow.high <= wide.high


def test_all_successes_leave_doubt() -> None:
    values, counts = means([10] * 15)
    assert effective_trials(counts) == pytest.approx(150 / 3.7)
    assert logit_t(values, counts) == wilson(150 / 3.7, 150 / 3.7)
    assert logit_t(values, counts).low < 0.95


def test_coverage_on_new_tasks() -> None:
    """Task means cover what they claim at ICC .3, pooled trials do not (68 %)."""
    random, draws = np.random.default_rng(1), 600
    counts, hit, pooled = np.full(15, 10.0), 0, 0
    for _ in range(draws):
        won = random.binomial(10, rates(random, (15,)))
        low, high = logit_t(won / 10, counts)
        hit += low <= 0.7 <= high
        low, high = wilson(won.sum(), 150)
        pooled += low <= 0.7 <= high
    assert hit / draws == pytest.approx(0.95, abs=0.03)
    assert pooled / draws == pytest.approx(0.68, abs=0.06)


def brute_force(values: list[int]) -> float:
    sums = [
        abs(sum(sign * value for sign, value in zip(signs, values, strict=True)))
        for signs in itertools.product((-1, 1), repeat=len(values))
    ]
    return sum(total >= abs(sum(values)) for total in sums) / len(sums)


@given(DIFFERENCES)
def test_exact_permutation_is_that_by_brute_force(values: list[int]) -> None:
    exact = sign_flips(np.array(values) / 10)
    assert exact == pytest.approx(brute_force(values))
    assert exact == sign_flips(-np.array(values) / 10)


def test_many_sign_flips_are_drawn_and_agree_with_all() -> None:
    values = [int(value) for value in np.random.default_rng(3).integers(-3, 6, 40) if value]
    assert len(values) > 16
    ways = Counter({0: 1})  # in how many ways signs make each sum, one value after the other
    for value in values:
        sums = range(-200, 201)
        ways = Counter({s: ways[s - value] + ways[s + value] for s in sums})
    extreme = sum(n for total, n in ways.items() if abs(total) >= abs(sum(values)))
    drawn = sign_flips(np.array(values) / 10)
    assert drawn == pytest.approx(extreme / 2 ** len(values), abs=0.01)
    assert drawn == sign_flips(np.array(values) / 10)
    assert sign_flips(np.ones(40)) == 1 / 20_001


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


@given(st.lists(st.floats(0, 1), max_size=8))
def test_holm_keeps_the_order_and_only_raises(p: list[float]) -> None:
    adjusted = holm(p)
    pairs = sorted(zip(p, adjusted, strict=True))
    assert all(before <= after <= 1 for before, after in pairs)
    assert [a for _, a in pairs] == sorted(adjusted)


@pytest.mark.parametrize(
    ("c", "k", "value"), [(9, 4, 0.6), (9, 8, 0.2), (8, 4, 1 / 3), (8, 8, 1 / 45), (7, 1, 0.7)]
)
def test_pass_k_of_ten(c: int, k: int, value: float) -> None:
    assert pass_k(np.array([float(c)]), np.array([10.0]), k) == pytest.approx(value)


def test_pass_k_is_the_mean_over_tasks() -> None:
    assert pass_k(np.array([10.0, 0.0]), np.array([10.0, 20.0]), 8) == 0.5
    with pytest.raises(ValueError, match="at least 11 trials"):
        pass_k(np.array([10.0]), np.array([10.0]), 11)


@settings(deadline=None)
@given(st.lists(st.integers(0, 10), min_size=1, max_size=10))
def test_pass_k_falls_with_k(successes: list[int]) -> None:
    _, counts = means(successes)
    values = [pass_k(np.array(successes, dtype=float), counts, k) for k in range(1, 11)]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(np.mean(successes) / 10)


def test_paired_t_by_hand() -> None:
    low, high = paired_t(np.array([0.1, 0.2, 0.3]))
    half = 4.30265 * 0.1 / math.sqrt(3)
    assert (low, high) == pytest.approx((0.2 - half, 0.2 + half), abs=1e-5)
    assert paired_t(np.array([0.4])) == (-math.inf, math.inf)
    certain = paired_t(np.zeros(3), least=least_error(30))
    assert certain.high == pytest.approx(4.30265 * math.sqrt(2) / 32, abs=1e-5)


def power(tasks: int, trials: int, effect: float, draws: int = 2000, seed: int = 0) -> float:
    """Share of comparisons whose paired t test on task means finds a difference, at .05 two-sided.

    Rates end at 0 and 1: of +5 points on a mean of .70, 4.4 are left.

    Args:
        trials: of each task and version.
        effect: what the second version adds to every rate, before the ends.
    """
    random = np.random.default_rng(seed)
    before = rates(random, (draws, tasks))
    change = effect + random.normal(0, TASK_SD, before.shape)
    after = np.clip(before + change, 0, 1)
    won: list[FloatArray] = [random.binomial(trials, rate) / trials for rate in (before, after)]
    gained = won[1] - won[0]
    errors: FloatArray = gained.std(axis=1, ddof=1) / math.sqrt(tasks)
    means: FloatArray = gained.mean(axis=1)
    reach = float(stdtrit(tasks - 1, 1 - ALPHA / 2))
    return float((np.abs(means) > reach * errors).mean())


@pytest.mark.parametrize(
    ("tasks", "trials", "gains"),
    [(15, 10, (0.13, 0.42, 0.89)), (60, 10, (0.43, 0.96, 1)), (120, 10, (0.76, 1, 1))],
)
def test_power_is_that_of_the_plan(tasks: int, trials: int, gains: tuple[float, ...]) -> None:
    found = [power(tasks, trials, gain) for gain in (0.05, 0.1, 0.2)]
    assert found == pytest.approx(gains, abs=0.04)


def test_equal_versions_differ_in_one_comparison_of_twenty() -> None:
    assert power(60, 10, 0.0) == pytest.approx(0.05, abs=0.025)


def test_spread_is_found_again() -> None:
    random = np.random.default_rng(0)
    true = random.normal(0, 0.2, 400)
    seen = spread([mean + random.normal(0, 0.5, 10) for mean in true])
    assert seen.between == pytest.approx(0.04, abs=0.012)
    assert seen.within == pytest.approx(0.25, abs=0.02)
    assert seen.fixed_error == pytest.approx(0.5 / math.sqrt(4000), rel=0.05)


def test_one_trial_per_task_cannot_be_told_from_the_task() -> None:
    seen = spread([np.array([0.0]), np.array([1.0]), np.array([1.0])])
    assert (seen.between, seen.within) == (pytest.approx(1 / 3), 0.0)
    assert needed(seen, 0.2).trials is None


def test_what_is_said_to_settle_it_does() -> None:
    seen = Spread(tasks=60, trials=10, between=0.0025, within=0.294)
    found = needed(seen, 0.1)
    assert found.trials is not None
    assert found.tasks is not None
    assert power(60, found.trials, 0.1) == pytest.approx(0.8, abs=0.12)
    assert power(found.tasks, 10, 0.1) == pytest.approx(0.8, abs=0.12)
    by_hand = (1.96 + 0.8416) ** 2 * (0.0025 + 0.294 / 10) / 0.05**2
    assert needed(seen, 0.05).tasks == pytest.approx(by_hand, rel=0.05)


def test_where_tasks_differ_trials_alone_do_not_settle_it() -> None:
    apart = needed(Spread(tasks=15, trials=10, between=0.2, within=0.2), 0.05)
    assert apart.trials is None
    assert apart.tasks is not None
    nothing = needed(Spread(tasks=15, trials=10, between=0.2, within=0.2), 0.0)
    assert (nothing.trials, nothing.tasks) == (None, None)
