"""Grades: of one goal robot by robot, and of a whole attempt.

GCR, goal conditions recall, is divided by the larger of the robots asked for and the positions
given, so that too many robots cost as much as too few.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...tools.geometry.outline import FloatArray

VERSION = 1
"""Version of all graders together; part of a suite's hash, so a changed rule is another suite."""
STRICT_SHARE = 2 / 3
"""Strict: the share of a tolerance that may be used."""
STRICT_SPREAD = 1.25
"""Strict, inside: how many times wider the spacing and closer the coverage than the rule's."""
EVEN = 0.25
"""Strict: how far off its even place along a loop or line a robot may stand, as share of a gap."""
APART = 2.0
"""Robots nearer to each other than this, px, stand in one place, which counts once."""


@dataclass(frozen=True)
class Part:
    """The judgement of one goal.

    Attributes:
        right: whether each robot stands where it may, (m,).
        whole: share done of what the robots must do together, such as cover a region.
        problems: what is wrong, the worst first.
        strict_problems: what is wrong at the tighter tolerances only.
        measures: lengths in px, shares without a unit.
    """

    right: NDArray[np.bool_]
    whole: float = 1.0
    problems: tuple[str, ...] = ()
    strict_problems: tuple[str, ...] = ()
    measures: Mapping[str, float] = field(default_factory=dict[str, float])

    def success(self, robots: int) -> bool:
        """Return whether all of so many robots are right and together do what they must."""
        return len(self.right) == robots and bool(self.right.all()) and not self.problems

    def hits(self, robots: int) -> float:
        """Return how many robots count: at most one fewer than asked for if anything is wrong."""
        counted = min(float(self.right.sum()), self.whole * robots)
        return counted if self.success(robots) else min(counted, robots - 1.0)


@dataclass(frozen=True)
class Graded:
    """The grade of an attempt.

    Attributes:
        sr: success: every robot is right.
        gcr: goal conditions recall, 0 to 1; 1 exactly if sr.
        strict: success at the tighter tolerances.
        object_correct: whether it was about the thing meant; None if that is not known.
        iou: overlap of the best outline that was measured with the first thing's true one; None if
            none was.
        e95: of that outline: distance within which 95 % of either boundary lie of the other, as a
            share of the square root of the true area.
        feedback: what was wrong, in a sentence.
        measures: of all goals, numbered by goal if there are several.
        right: whether each robot graded stands right, in the order given.
    """

    sr: bool
    gcr: float
    strict: bool
    object_correct: bool | None = None
    iou: float | None = None
    e95: float | None = None
    feedback: str = ""
    measures: Mapping[str, float] = field(default_factory=dict[str, float])
    right: tuple[bool, ...] = ()


def distinct(points: FloatArray) -> NDArray[np.bool_]:
    """Return which of (m, 2) points count, (m,): of those that share a place, only the first."""
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) < APART
    return ~np.tril(apart, -1).any(axis=1)
