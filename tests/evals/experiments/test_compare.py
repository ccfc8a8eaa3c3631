"""Two sets of trials side by side: what is said, of what, and what is refused."""

import json
from typing import Any

import pytest
from formup.evals.experiments.compare import compare
from formup.evals.experiments.comparison import Comparison
from formup.evals.experiments.trials import Arm, Status, TrialRow
from formup.tools.errors import InputError

SUITE = "5" * 64


def row(task: str, trial: int, status: Status, version: int = 1, **facts: Any) -> TrialRow:
    return TrialRow(
        suite=facts.pop("suite", SUITE),
        task=task,
        trial=trial,
        arm=Arm(
            method="agent",
            prompt=f"former@v{version:03d}",
            sha256=f"{version:064x}",
            model="offline",
        ),
        status=status,
        sr=None if status == "infra_error" else status == "pass",
        **facts,
    )


def rows(version: int, successes: dict[str, int], trials: int = 10, **facts: Any) -> list[TrialRow]:
    return [
        row(task, n, "pass" if n < count else "fail", version, **facts)
        for task, count in successes.items()
        for n in range(trials)
    ]


OLD = {f"t{i:02d}": 5 + i % 3 for i in range(12)}
BETTER = {task: count + 2 + (count == 5) for task, count in OLD.items()}


def test_a_better_version() -> None:
    found = compare(rows(1, OLD), rows(2, BETTER))
    assert (found.outcome, found.verdict, found.reasons) == ("better", "pass", ())
    overall = found.overall
    assert (overall.tasks, overall.pairs) == (12, 120)
    assert overall.estimate == pytest.approx((sum(BETTER.values()) - sum(OLD.values())) / 120)
    assert overall.interval.low < overall.estimate < overall.interval.high
    assert overall.p == 2 / 2**12
    assert overall.settled_by is None
    assert (overall.a.successes, overall.a.trials) == (72, 120)
    assert list(overall.a.pass_k) == [1, 4, 8]


def test_exchanged_versions_mirror_each_other() -> None:
    there, back = compare(rows(1, OLD), rows(2, BETTER)), compare(rows(2, BETTER), rows(1, OLD))
    assert (back.outcome, back.verdict) == ("worse", "block")
    assert back.overall.estimate == -there.overall.estimate
    assert back.overall.interval.low == pytest.approx(-there.overall.interval.high)
    assert back.overall.p == there.overall.p


def test_equal_versions_are_inconclusive_with_what_would_settle_it() -> None:
    shuffled = dict(zip(OLD, [*list(OLD.values())[1:], OLD["t00"]], strict=True))
    found = compare(rows(1, OLD), rows(2, shuffled))
    assert (found.outcome, found.verdict) == ("inconclusive", "inconclusive")
    assert found.overall.settled_by is not None
    assert found.overall.settled_by.difference == 0.05
    assert found.overall.settled_by.tasks is not None
    assert found.overall.settled_by.tasks > 12
    assert found.settled_by is not None


def test_the_report_is_what_promotion_reads() -> None:
    found = compare(rows(1, OLD), rows(2, BETTER))
    report = json.loads(found.model_dump_json())
    assert report["a"] == {
        "method": "agent",
        "prompt": "former@v001",
        "sha256": f"{1:064x}",
        "tools": None,
        "model": "offline",
        "descriptor": None,
        "mode": "words",
        "segmenter": None,
        "frame": None,
        "without": None,
    }
    assert report["b"]["prompt"] == "former@v002"
    assert (report["suite"], report["verdict"]) == (SUITE, "pass")
    assert report["overall"]["estimate"] == round(found.overall.estimate, 6)
    assert Comparison.model_validate(report).verdict == "pass"


def test_slices_are_tested_together() -> None:
    def sliced(version: int, successes: dict[str, int]) -> list[TrialRow]:
        return [
            r.model_copy(update={"category": "caging" if int(r.task[1:]) < 6 else "infill"})
            for r in rows(version, successes)
        ]

    found = compare(sliced(1, OLD), sliced(2, BETTER))
    assert list(found.slices) == ["category"]
    caging = found.slices["category"]["caging"]
    assert (caging.tasks, caging.p) == (6, 2 / 2**6)
    assert caging.p_holm == 2 * caging.p > 0.05
    assert caging.outcome == "inconclusive"  # better by itself, not among two
    assert found.outcome == "better"


def test_only_trials_both_have_are_compared() -> None:
    found = compare(rows(1, OLD, trials=10), rows(2, dict.fromkeys(OLD, 4), trials=4))
    assert found.overall.pairs == 48
    assert found.unpaired == (72, 0)
    assert found.overall.a.mean == 1.0  # the first four trials of A all succeed


def test_infrastructure_errors_are_never_scored() -> None:
    kept = [r for r in rows(2, BETTER) if r.task != "t00" or r.trial >= 5]
    broken = [*kept, *(row("t00", n, "infra_error", 2) for n in range(5))]
    found = compare(rows(1, OLD), broken)
    assert found.overall.pairs == 115
    assert found.overall.b.trials == 115
    assert found.verdict == "inconclusive"
    assert found.reasons[0].startswith("B has 5 infrastructure errors in 120 trials")


def test_a_run_that_lacks_tasks_is_inconclusive() -> None:
    found = compare(rows(1, OLD), rows(2, {k: v for k, v in BETTER.items() if k != "t03"}))
    assert found.verdict == "inconclusive"
    assert found.reasons[0] == "B lacks 1 of the tasks; run it to its end"


def test_invalid_output_and_tokens_reach_the_gate() -> None:
    dear = rows(2, BETTER, input_tokens=900, output_tokens=100)
    found = compare(rows(1, BETTER, input_tokens=450, output_tokens=50), dear)
    assert found.tokens == pytest.approx(1.0)
    assert found.verdict == "block"
    invalid = [
        r.model_copy(update={"status": "model_invalid"}) if r.status == "fail" else r for r in dear
    ]
    worse = compare(rows(1, BETTER), invalid)
    assert worse.invalid.estimate == pytest.approx(1 - sum(BETTER.values()) / 120)
    assert any(reason.startswith("invalid output") for reason in worse.reasons)


def test_a_metric_that_is_no_share_of_trials() -> None:
    found = compare(rows(1, OLD, gcr=0.5), rows(2, OLD, gcr=0.75), metric="gcr")
    assert found.outcome == "better"
    assert found.overall.estimate == 0.25
    assert (found.overall.a.successes, found.overall.a.pass_k) == (None, {})


@pytest.mark.parametrize(
    ("a", "b", "metric", "said"),
    [
        ([], rows(2, OLD), "sr", "no trials to compare"),
        (rows(1, OLD), rows(2, OLD, suite="6" * 64), "sr", "trials of two suites"),
        ([*rows(1, OLD), *rows(2, OLD)], rows(2, OLD), "sr", "Choose one of these: agent former"),
        (rows(1, {"x": 1}), rows(2, {"y": 1}), "sr", "no scored trial in common"),
        (rows(1, OLD), rows(2, OLD), "gcr", "was not graded by gcr"),
    ],
)
def test_what_cannot_be_compared(
    a: list[TrialRow], b: list[TrialRow], metric: Any, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        compare(a, b, metric)
