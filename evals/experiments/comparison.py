"""The parts of a comparison: printed by `--json`, written by `--out`, read by promotion."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, PlainSerializer

from ..statistics.intervals import Interval
from ..statistics.power import Needed
from .gate import Rise, Verdict
from .trials import Arm

Metric = Literal["sr", "strict", "gcr"]
Outcome = Literal["better", "worse", "inconclusive"]

Rounded = Annotated[float, PlainSerializer(lambda value: round(value, 6), return_type=float)]


def in_points(share: float) -> str:
    """Return a difference of shares in points, with its sign."""
    return f"{round(100 * share, 1) + 0.0:+.1f}"


class _Value(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Range(_Value):
    """An interval at 95 %, or one-sided bounds at 95 %."""

    low: Rounded
    high: Rounded

    @classmethod
    def of(cls, interval: Interval) -> "Range":
        """Return an interval as a range, cut off at -1 and 1."""
        return cls(low=max(-1.0, interval.low), high=min(1.0, interval.high))


class Score(_Value):
    """How one version does.

    Attributes:
        new_tasks: interval on tasks like these.
        fixed_tasks: interval on these tasks; None for scores that are no shares of trials.
        pass_k: the chance that k trials of a task all succeed, by k, as far as there are trials.
    """

    mean: Rounded
    new_tasks: Range
    successes: int | None
    trials: int
    fixed_tasks: Range | None
    pass_k: dict[int, Rounded]


class Difference(_Value):
    """The new version minus the old, on some of the tasks.

    Attributes:
        interval: at 95 %, on tasks like these.
        p: of the paired permutation of task means; `p_holm` over all slices.
        fixed_tasks, fixed_p: on these tasks alone; no interval with one trial per task.
    """

    tasks: int
    pairs: int
    a: Score
    b: Score
    estimate: Rounded
    interval: Range
    p: Rounded
    p_holm: Rounded
    fixed_tasks: Range | None
    fixed_p: Rounded
    outcome: Outcome
    settled_by: Needed | None


class Comparison(_Value):
    """What `formup eval compare` and `gate` report, and `formup prompts promote` reads.

    Attributes:
        a: the old version, or baseline.
        b: the new one.
        verdict: of the gate.
        reasons: of the verdict, and what is wrong with the runs.
        outcome: of the comparison: better, worse or inconclusive.
        success, invalid, tokens: the figures that the gate rests on.
    """

    a: Arm
    b: Arm
    suite: str
    metric: Metric
    margin: float
    verdict: Verdict
    reasons: tuple[str, ...]
    outcome: Outcome
    success: Rise
    invalid: Rise
    tokens: Rounded | None
    overall: Difference
    slices: dict[str, dict[str, Difference]]
    unpaired: tuple[int, int]
    settled_by: Needed | None
