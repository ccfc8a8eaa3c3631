"""The certificate, with findings, measures and notes, and the audit that collects them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, SupportsFloat, SupportsInt

from pydantic import Field

from ...geometry.outline import FloatArray, Outline
from ..contract import Contract, Group
from ..placement.place import Site
from ..value import Value
from .finding import Finding

TOLERANCE = 5e-3
"""Tolerance of every comparison, px, so that rounding positions for JSON changes no verdict."""
DECIMALS = 3
"""Decimals of the numbers in findings."""


class Escape(Value):
    """A way out of a cage that was checked all along.

    Attributes:
        target: what gets out.
        poses: x, y of the point it turns about, px, and the turn, radians from x to y; the first
            is where it is.
    """

    target: str
    poses: tuple[tuple[float, float, float], ...]


Measure = float | str
"""A number, or a word such as the state of a cage."""


class Verdict(Value):
    """`certified` means every demand of the contract holds; `measures` say by how much."""

    certified: bool
    findings: tuple[Finding, ...] = ()
    measures: dict[str, Measure] = Field(default_factory=dict[str, Measure])
    notes: tuple[str, ...] = ()
    escape: Escape | None = None


@dataclass(frozen=True)
class Part:
    """One group with its robots, as checked by the rule for its relation.

    Attributes:
        points: (n, 2) positions of the group's robots, image pixels.
        first: index of the group's first robot in the whole formation, from 0.
    """

    group: Group
    points: FloatArray
    first: int
    radius: float
    site: Site

    @property
    def outline(self) -> Outline:
        """The outline of the group's first target."""
        return self.site.outlines[self.group.targets[0]]

    @property
    def clearance(self) -> tuple[float, float]:
        """Least and greatest clearance, px; the contract's defaults have to be filled in."""
        return self.group.offsets()


@dataclass
class Audit:
    """Collects what the rules find, over all groups of one contract.

    With metres per pixel, the findings' sentences give lengths in metres too.
    """

    metres_per_pixel: float | None = None
    findings: list[Finding] = field(default_factory=list[Finding])
    measures: dict[str, Measure] = field(default_factory=dict[str, Measure])
    notes: list[str] = field(default_factory=list[str])
    escape: Escape | None = None

    def find(
        self,
        kind: str,
        value: SupportsFloat = 0.0,
        limit: SupportsFloat = 0.0,
        *,
        robot: SupportsInt | None = None,
        others: Sequence[SupportsInt] = (),
        **more: Any,
    ) -> None:
        """Record a violation, its numbers rounded to a thousandth.

        Args:
            kind: one of `SENTENCES`.
            value: what was measured.
            limit: what is allowed or needed.
            robot, others: indices from 0; `robot` is None if it is the formation as a whole.
            more: further fields of the `Finding`.
        """
        self.findings.append(
            Finding(
                kind=kind,
                robot=None if robot is None else int(robot) + 1,
                others=tuple(int(other) + 1 for other in others),
                value=round(float(value), DECIMALS),
                limit=round(float(limit), DECIMALS),
                metres_per_pixel=self.metres_per_pixel,
                **more,
            )
        )

    def least(self, key: str, value: float) -> None:
        """Record a measure; the smallest value over all groups is kept."""
        self.measures[key] = round(min(float(value), float(self.measures.get(key, "inf"))), 2)

    def greatest(self, key: str, value: float) -> None:
        """Record a measure; the greatest value over all groups is kept."""
        self.measures[key] = round(max(float(value), float(self.measures.get(key, "-inf"))), 2)

    def verdict(self) -> Verdict:
        """Return what was collected as an immutable value."""
        return Verdict(
            certified=not self.findings,
            findings=tuple(self.findings),
            measures=dict(self.measures),
            notes=tuple(dict.fromkeys(self.notes)),
            escape=self.escape,
        )


def parts_of(contract: Contract, points: FloatArray, site: Site) -> list[Part]:
    """Return the groups with their robots, in order."""
    parts: list[Part] = []
    first = 0
    for group in contract.groups:
        mine = points[first : first + group.robots]
        parts.append(Part(group, mine, first, contract.robot_radius, site))
        first += group.robots
    return parts
