"""The certificate: findings, measures and notes, and the audit that gathers them."""

from dataclasses import dataclass, field

from pydantic import BaseModel, ConfigDict

from ...geometry.outline import FloatArray, Outline
from ..contract import Contract, Group
from ..placement.place import Site
from ..units import also_metres

TOLERANCE = 5e-3
"""Slack of every comparison, px: rounding of positions to JSON must not turn a verdict."""


class Finding(BaseModel):
    """One violation: what is wrong, with which robot (from 1), by how much."""

    model_config = ConfigDict(frozen=True)

    code: str
    robot: int | None = None
    value: float | None = None
    limit: float | None = None
    unit: str = "px"
    sentence: str


class Escape(BaseModel):
    """A way out of a cage that was checked all along.

    Attributes:
        target: what gets out.
        poses: x, y of the point it turns about, px, and the turn, radians from x to y; the first
            is where it is.
    """

    model_config = ConfigDict(frozen=True)

    target: str
    poses: tuple[tuple[float, float, float], ...]


Measure = float | str
"""A number, or a word such as the state of a cage."""


class Verdict(BaseModel):
    """`certified` means every demand of the contract holds; `measures` say by how much."""

    model_config = ConfigDict(frozen=True)

    certified: bool
    findings: tuple[Finding, ...] = ()
    measures: dict[str, Measure] = {}
    notes: tuple[str, ...] = ()
    escape: Escape | None = None


@dataclass(frozen=True)
class Part:
    """One group with its robots: what the rule of a relation looks at.

    Attributes:
        points: (n, 2) image pixels.
        first: index of the group's first robot in the whole formation, from 0.
    """

    group: Group
    points: FloatArray
    first: int
    radius: float
    site: Site

    @property
    def outline(self) -> Outline:
        """Of the group's (first) target."""
        return self.site.outlines[self.group.targets[0]]

    @property
    def clearance(self) -> tuple[float, float]:
        """Least and greatest, px; the contract's defaults are written out by now."""
        assert self.group.clearance is not None
        return self.group.clearance


@dataclass
class Audit:
    """Gathers what the rules find, over all groups of one contract.

    With metres per pixel the sentences tell lengths in metres too.
    """

    metres_per_pixel: float | None = None
    findings: list[Finding] = field(default_factory=list[Finding])
    measures: dict[str, Measure] = field(default_factory=dict[str, Measure])
    notes: list[str] = field(default_factory=list[str])
    escape: Escape | None = None

    def robot(self, code: str, index: int, value: float, limit: float, text: str) -> None:
        """Record a violation by the robot with this index from 0; text follows its name."""
        self.findings.append(
            Finding(
                code=code,
                robot=int(index) + 1,
                value=round(float(value), 2),
                limit=round(float(limit), 2),
                sentence=f"Robot {int(index) + 1} {text}.",
            )
        )

    def whole(self, code: str, value: float, limit: float, text: str, unit: str = "px") -> None:
        """Record a violation by the formation as a whole."""
        self.findings.append(
            Finding(
                code=code,
                value=round(float(value), 2),
                limit=round(float(limit), 2),
                unit=unit,
                sentence=text,
            )
        )

    def least(self, key: str, value: float) -> None:
        """Keep the smallest value of a measure over the groups."""
        self.measures[key] = round(min(float(value), float(self.measures.get(key, "inf"))), 2)

    def greatest(self, key: str, value: float) -> None:
        """Keep the greatest value of a measure over the groups."""
        self.measures[key] = round(max(float(value), float(self.measures.get(key, "-inf"))), 2)

    def verdict(self) -> Verdict:
        """What was gathered, as a value."""
        return Verdict(
            certified=not self.findings,
            findings=tuple(
                f.model_copy(update={"sentence": self._told(f.sentence)}) for f in self.findings
            ),
            measures=dict(self.measures),
            notes=tuple(dict.fromkeys(map(self._told, self.notes))),
            escape=self.escape,
        )

    def _told(self, sentence: str) -> str:
        return also_metres(sentence, self.metres_per_pixel)


def parts_of(contract: Contract, points: FloatArray, site: Site) -> list[Part]:
    """The groups with their robots, in order."""
    parts: list[Part] = []
    first = 0
    for group in contract.groups:
        mine = points[first : first + group.robots]
        parts.append(Part(group, mine, first, contract.robot_radius, site))
        first += group.robots
    return parts
