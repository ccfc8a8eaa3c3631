"""The gate's three outcomes, and how often it errs."""

import numpy as np
import pytest
from formup.benchmarks.false_blocks import simulate
from formup.evals.experiments.gate import Gated, Paired, gate


def judged(
    old: list[float],
    new: list[float],
    *,
    trials: float = 10.0,
    invalid: tuple[float, float] = (0.0, 0.0),
    tokens: tuple[float, float] = (0.0, 0.0),
    must_pass: bool = False,
    unfinished: tuple[str, ...] = (),
) -> Gated:
    count = len(old)
    paired = Paired(
        tasks=tuple(f"t{i}" for i in range(count)),
        pairs=np.full(count, trials),
        score=np.array([old, new]),
        invalid=np.array([[share] * count for share in invalid]),
        tokens=np.array([[amount] * count for amount in tokens]),
        must_pass=np.full(count, must_pass),
    )
    return gate(paired, unfinished=unfinished)


def test_equal_versions_pass() -> None:
    found = judged([0.7] * 30, [0.7] * 30)
    assert found.verdict == "pass"
    assert found.reasons == ()
    assert -0.05 < found.success.low < 0 == found.success.estimate < found.success.high


def test_a_clear_loss_is_blocked() -> None:
    found = judged([0.8] * 30, [0.6, 0.5, 0.7] * 10)
    assert found.verdict == "block"
    assert found.reasons[0].startswith("success falls by more than 5 points: -20.0 points, bounds")


def test_few_trials_prove_nothing() -> None:
    assert judged([1.0] * 2, [1.0] * 2).verdict == "inconclusive"
    assert judged([1.0], [1.0], trials=1000).verdict == "inconclusive"
    uneven = judged([0.5] * 6, [0.2, 0.9, 0.3, 0.8, 0.4, 0.5])
    assert uneven.verdict == "inconclusive"
    assert "may fall by more than 5 points" in uneven.reasons[0]


def test_what_must_pass() -> None:
    old, new = [1.0] * 40, [*[1.0] * 39, 0.8]
    assert judged(old, new).verdict == "pass"
    found = judged(old, new, must_pass=True)
    assert (found.verdict, found.reasons) == (
        "block",
        ("below 9 of 10 on what must pass: t39",),
    )
    assert judged(old, [*[1.0] * 39, 0.9], must_pass=True).verdict == "pass"
    assert judged(new, new, must_pass=True).verdict == "pass"  # it did not drop


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.1, "block"), (0.025, "inconclusive"), (0.02, "pass")]
)
def test_invalid_output(share: float, verdict: str) -> None:
    assert judged([0.7] * 30, [0.7] * 30, invalid=(0.0, share)).verdict == verdict
    assert judged([0.7] * 30, [0.7] * 30, invalid=(share, 0.0)).verdict == "pass"


def test_tokens() -> None:
    same = [0.7] * 30
    assert judged(same, same, tokens=(1000, 1190)).verdict == "pass"
    dear = judged(same, same, tokens=(1000, 1300))
    assert (dear.verdict, dear.tokens) == ("block", pytest.approx(0.3))
    assert "tokens rise by 30 %" in dear.reasons[0]
    assert judged(same, [0.8] * 30, tokens=(1000, 1300)).verdict == "pass"  # for a gain


def test_nothing_is_concluded_from_unfinished_runs() -> None:
    for new in (0.7, 0.2):
        found = judged([0.7] * 30, [new] * 30, unfinished=("B lacks 3 of the tasks",))
        assert found.verdict == "inconclusive"
        assert found.reasons[0] == "B lacks 3 of the tasks"


@pytest.mark.parametrize(("tasks", "trials"), [(15, 2), (15, 10), (60, 10)])
def test_equal_versions_are_hardly_ever_blocked(tasks: int, trials: int) -> None:
    assert simulate(tasks, trials, comparisons=500).interval.low <= 0.05


def test_a_regression_of_ten_points_is_found_and_one_of_the_margin_does_not_pass() -> None:
    assert simulate(150, 10, 0.1, comparisons=150).blocked > 140
    at_margin = simulate(60, 10, 0.06, comparisons=300)
    assert at_margin.passed <= 0.08 * 300
