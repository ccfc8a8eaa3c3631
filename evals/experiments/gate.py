"""The gate for replacing an old version: pass, block, or inconclusive, which is not a pass.

Non-inferiority: a version passes if it is shown to be no worse than the margin, and is blocked if
it is shown to be worse than that. "Shown" is a one-sided bound at 95 % on new tasks, for success,
invalid output and tokens alike, so that versions that are equal are hardly ever blocked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...tools.geometry.outline import FloatArray
from ..statistics.intervals import TINY, least_error, paired_t

MARGIN = 0.05
"""Loss of success that is tolerated: a share, 5 points."""
INVALID_MARGIN = 0.02
TOKENS_MARGIN = 0.20
"""Rise of the tokens, as a share, that is tolerated without a gain in success."""
MUST_PASS = 0.9
ONE_SIDED = 0.90
"""Level of an interval whose ends are one-sided bounds at 95 %."""
NAMED = 5
"""Most tasks named in a reason."""

Verdict = Literal["pass", "block", "inconclusive"]


@dataclass(frozen=True)
class Paired:
    """Two versions on the same tasks, over trials that both have: row 0 is the old, row 1 the new.

    Attributes:
        tasks: ids, T of them.
        pairs: trials of each task, (T,).
        score: mean of each task, 0 to 1, (2, T).
        invalid: share of output that could not be used, (2, T).
        tokens: mean of each task, (2, T).
        must_pass: tasks that always succeed, (T,).
    """

    tasks: tuple[str, ...]
    pairs: FloatArray
    score: FloatArray
    invalid: FloatArray
    tokens: FloatArray
    must_pass: NDArray[np.bool_]


@dataclass(frozen=True)
class Rise:
    """New minus old: the estimate and its one-sided bounds at 95 %."""

    estimate: float
    low: float
    high: float

    @property
    def words(self) -> str:
        """The same as text, in points."""
        values = (self.estimate, self.low, self.high)
        estimate, low, high = (f"{round(100 * value, 1) + 0.0:+.1f}" for value in values)
        return f"{estimate} points, bounds {low} and {high}"


@dataclass(frozen=True)
class Gated:
    """The verdict, what led to it, and the figures it rests on.

    Attributes:
        success: points of success gained, as a share.
        invalid: rise of the share of invalid output.
        tokens: tokens of the new version over those of the old, minus 1; None without tokens.
    """

    verdict: Verdict
    reasons: tuple[str, ...]
    success: Rise
    invalid: Rise
    tokens: float | None


def gate(
    paired: Paired, margin: float = MARGIN, unfinished: Sequence[str] = (), scale: str = "success"
) -> Gated:
    """Judge a new version against the old one.

    Args:
        margin: loss of success that is tolerated, above 0.
        unfinished: what is wrong with the runs themselves; if anything, nothing is concluded.
        scale: name of the score, for the reasons.
    """
    least = least_error(float(paired.pairs.sum()))
    success, invalid = _rise(paired.score, least), _rise(paired.invalid, least)
    tokens, dearer = _token_rise(paired)
    blocks, doubts = list[str](), list[str]()
    if success.high < -margin:
        blocks.append(f"{scale} falls by more than {_in_points(margin)}: {success.words}")
    elif not success.low > -margin:
        doubts.append(f"{scale} may fall by more than {_in_points(margin)}: {success.words}")
    failing = paired.must_pass & (paired.score[1] < MUST_PASS) & (paired.score[0] >= MUST_PASS)
    if failing.any():
        names = [name for name, fails in zip(paired.tasks, failing, strict=True) if fails]
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        blocks.append(f"below 9 of 10 on what must pass: {', '.join(names[:NAMED])}{more}")
    if invalid.estimate > INVALID_MARGIN + TINY:
        shown = invalid.low > INVALID_MARGIN
        text = f"invalid output rises by more than {_in_points(INVALID_MARGIN)}: {invalid.words}"
        (blocks if shown else doubts).append(text if shown else f"perhaps {text}")
    if tokens is not None and tokens > TOKENS_MARGIN and not success.low > 0:
        text = f"tokens rise by {100 * tokens:.0f} % without a gain that is shown"
        (blocks if dearer else doubts).append(text if dearer else f"perhaps {text}")
    verdict: Verdict = "block" if blocks else "inconclusive" if doubts else "pass"
    if unfinished:
        verdict = "inconclusive"
    return Gated(verdict, (*unfinished, *blocks, *doubts), success, invalid, tokens)


def _rise(values: FloatArray, least: float) -> Rise:
    """Return the rise of shares, (2, T)."""
    differences = values[1] - values[0]
    found = paired_t(differences, ONE_SIDED, least)
    return Rise(float(differences.mean()), max(-1.0, found.low), min(1.0, found.high))


def _token_rise(paired: Paired) -> tuple[float | None, bool]:
    """Return the rise of the tokens, and whether it is shown to be above the margin."""
    before, after = paired.tokens
    if before.sum() < TINY:
        return None, False
    rise = float(after.sum() / before.sum()) - 1
    return rise, paired_t(after - (1 + TOKENS_MARGIN) * before, ONE_SIDED).low > 0


def _in_points(share: float) -> str:
    return f"{100 * share:g} points"
