"""Comparison of two versions: first how large the difference is, then whether it could be chance.

It rests on trials that both have, paired by task and number, which have the same seed. Claims
about new tasks take the task as the sampling unit; fixed-task figures hold for these tasks alone.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray
from ..statistics.intervals import (
    Interval,
    holm,
    least_error,
    logit_t,
    paired_t,
    pass_k,
    sign_flips,
    wilson,
)
from ..statistics.power import Needed, Spread, needed, spread
from .comparison import (
    Comparison,
    Difference,
    Metric,
    Outcome,
    Range,
    Score,
)
from .gate import MARGIN, Gated, Paired, gate
from .trials import Arm, TrialRow

SLICES = ("category", "setup")
RELIABILITY = (1, 4, 8)
ALPHA = 0.05
TOLERATED = 0.01
"""Share of trials that may lack a result."""
Z = 1.959964


@dataclass(frozen=True)
class _Pairs:
    """The trials of one task that both versions have, and their scores, (2, n)."""

    rows: tuple[tuple[TrialRow, TrialRow], ...]
    scores: FloatArray

    @property
    def differences(self) -> FloatArray:
        return self.scores[1] - self.scores[0]

    def means(self, value: Callable[[TrialRow], float]) -> tuple[float, float]:
        """Return the means of a value over the trials, (old, new)."""
        old, new = (
            float(np.mean([value(row) for row in side])) for side in zip(*self.rows, strict=True)
        )
        return old, new


def compare(
    a: Sequence[TrialRow], b: Sequence[TrialRow], metric: Metric = "sr", margin: float = MARGIN
) -> Comparison:
    """Compare the rows of a new version `b` with those of the old one `a`.

    Args:
        a: of one arm, one row per trial.
        b: of one arm, one row per trial.
        metric: what is compared.
        margin: for the gate: loss that is tolerated, as a share above 0.

    Raises:
        InputError: several arms, other suites, no trials in common, or the metric was not graded.
    """
    old, new = only_arm(a), only_arm(b)
    if a[0].suite != b[0].suite:
        raise InputError(
            f"These are trials of two suites ({a[0].suite[:12]} and {b[0].suite[:12]}), which "
            "cannot be compared; run both versions on one."
        )
    tasks = _pairs(a, b, metric)
    judged = gate(_paired(tasks), margin, _unfinished(a, b), _called(metric))
    overall = _difference_of(tasks, metric, margin)
    slices = _slices(tasks, metric, margin)
    count = sum(len(pairs.rows) for pairs in tasks.values())
    return Comparison(
        a=old,
        b=new,
        suite=a[0].suite,
        metric=metric,
        margin=margin,
        verdict=judged.verdict,
        reasons=judged.reasons,
        outcome=overall.outcome,
        success=judged.success,
        invalid=judged.invalid,
        tokens=judged.tokens,
        overall=overall,
        slices=slices,
        unpaired=(len(a) - count, len(b) - count),
        settled_by=_gate_settled(judged, tasks, margin),
    )


def only_arm(rows: Iterable[TrialRow]) -> Arm:
    """Return the arm that all rows are of.

    Raises:
        InputError: there are none or several; the text names them.
    """
    arms = {row.arm.name: row.arm for row in rows}
    if len(arms) == 1:
        return next(iter(arms.values()))
    if not arms:
        raise InputError("There are no trials to compare.")
    raise InputError(f"Choose one of these: {'; '.join(sorted(arms))}.")


def _pairs(a: Sequence[TrialRow], b: Sequence[TrialRow], metric: Metric) -> dict[str, _Pairs]:
    """Return the pairs of each task, sorted by task."""
    old = {(row.task, row.trial): row for row in a if row.scored}
    tasks: dict[str, list[tuple[TrialRow, TrialRow]]] = {}
    for row in sorted(b, key=lambda row: row.order):
        before = old.get((row.task, row.trial))
        if row.scored and before is not None:
            tasks.setdefault(row.task, []).append((before, row))
    if not tasks:
        raise InputError("The two have no scored trial in common (same task, same number).")
    return {
        task: _Pairs(
            tuple(rows),
            np.array([[_score(row, metric) for row in side] for side in zip(*rows, strict=True)]),
        )
        for task, rows in tasks.items()
    }


def _score(row: TrialRow, metric: Metric) -> float:
    value = row.sr if metric == "sr" else row.strict if metric == "strict" else row.gcr
    if value is None:
        raise InputError(
            f"Task {row.task}, trial {row.trial} was not graded by {metric}; compare by sr."
        )
    return float(value)


def _paired(tasks: dict[str, _Pairs]) -> Paired:
    every = tasks.values()
    return Paired(
        tasks=tuple(tasks),
        pairs=np.array([float(len(pairs.rows)) for pairs in every]),
        score=np.array([pairs.scores.mean(axis=1) for pairs in every]).T,
        invalid=np.array([pairs.means(_is_invalid) for pairs in every]).T,
        tokens=np.array([pairs.means(_row_tokens) for pairs in every]).T,
        must_pass=np.array([any(new.must_pass for _, new in pairs.rows) for pairs in every]),
    )


def _is_invalid(row: TrialRow) -> float:
    return float(row.status == "model_invalid")


def _row_tokens(row: TrialRow) -> float:
    return float(row.input_tokens + row.output_tokens)


def _unfinished(a: Sequence[TrialRow], b: Sequence[TrialRow]) -> list[str]:
    """Return what is wrong with the runs, so that no verdict should rest on them."""
    found = list[str]()
    for name, rows, others in (("A", a, b), ("B", b, a)):
        errors = sum(not row.scored for row in rows)
        if errors > TOLERATED * len(rows):
            found.append(
                f"{name} has {errors} infrastructure errors in {len(rows)} trials; "
                "run it again, which retries them"
            )
        lacking = {row.task for row in others} - {row.task for row in rows if row.scored}
        if lacking:
            found.append(f"{name} lacks {len(lacking)} of the tasks; run it to its end")
    return found


def _difference_of(tasks: dict[str, _Pairs], metric: Metric, margin: float) -> Difference:
    differences = [pairs.differences for pairs in tasks.values()]
    means = np.array([d.mean() for d in differences])
    counts = np.array([float(len(d)) for d in differences])
    estimate, p = float(means.mean()), sign_flips(means / len(means))
    interval = paired_t(means, 0.95, least_error(counts.sum()))
    seen = spread(differences)
    weighted = np.concatenate([d / (len(d) * len(differences)) for d in differences])
    outcome = _outcome_of(estimate, p, interval)
    return Difference(
        tasks=len(means),
        pairs=int(counts.sum()),
        a=_of_version(tasks, 0, metric),
        b=_of_version(tasks, 1, metric),
        estimate=estimate,
        interval=Range.of(interval),
        p=p,
        p_holm=p,
        fixed_tasks=_fixed(estimate, seen),
        fixed_p=sign_flips(weighted),
        outcome=outcome,
        settled_by=needed(seen, max(abs(estimate), margin)) if outcome == "inconclusive" else None,
    )


def _outcome_of(estimate: float, p: float, interval: Interval) -> Outcome:
    if p >= ALPHA or interval.low <= 0 <= interval.high:
        return "inconclusive"
    return "better" if estimate > 0 else "worse"


def _fixed(estimate: float, seen: Spread) -> Range | None:
    half = Z * seen.fixed_error
    return Range.of(Interval(estimate - half, estimate + half)) if half > 0 else None


def _of_version(tasks: dict[str, _Pairs], side: int, metric: Metric) -> Score:
    scores = [pairs.scores[side] for pairs in tasks.values()]
    means, counts = (np.array([f(s) for s in scores], dtype=float) for f in (np.mean, len))
    mean, total = float(means.mean()), int(counts.sum())
    interval = Range.of(logit_t(means, counts))
    if metric == "gcr":
        return Score(
            mean=mean,
            new_tasks=interval,
            successes=None,
            trials=total,
            fixed_tasks=None,
            pass_k={},
        )
    successes = np.array([s.sum() for s in scores])
    return Score(
        mean=mean,
        new_tasks=interval,
        successes=int(successes.sum()),
        trials=total,
        fixed_tasks=Range.of(wilson(successes.sum(), total)),
        pass_k={k: pass_k(successes, counts, k) for k in RELIABILITY if k <= counts.min()},
    )


def _slices(
    tasks: dict[str, _Pairs], metric: Metric, margin: float
) -> dict[str, dict[str, Difference]]:
    """Return differences by category and by setup, if any; p is adjusted over all together."""
    found: dict[tuple[str, str], Difference] = {}
    for kind in SLICES:
        named = {task: str(getattr(pairs.rows[0][1], kind)) for task, pairs in tasks.items()}
        for value in sorted(set(named.values()) - {""}):
            chosen = {task: pairs for task, pairs in tasks.items() if named[task] == value}
            found[kind, value] = _difference_of(chosen, metric, margin)
    adjusted = holm([difference.p for difference in found.values()])
    slices: dict[str, dict[str, Difference]] = {}
    for ((kind, value), difference), p in zip(found.items(), adjusted, strict=True):
        lost = difference.outcome != "inconclusive" and p >= ALPHA
        changed = {"p_holm": p, **({"outcome": "inconclusive"} if lost else {})}
        slices.setdefault(kind, {})[value] = difference.model_copy(update=changed)
    return slices


def _gate_settled(judged: Gated, tasks: dict[str, _Pairs], margin: float) -> Needed | None:
    """Return what would tell the success from the margin, if that is what is undecided."""
    low, high = judged.success.low, judged.success.high
    if judged.verdict != "inconclusive" or low > -margin or high < -margin:
        return None
    seen = spread([pairs.differences for pairs in tasks.values()])
    return needed(seen, abs(judged.success.estimate + margin), one_sided=True)


def _called(metric: Metric) -> str:
    return {"sr": "success", "strict": "strict success", "gcr": "goal conditions recall"}[metric]
