"""What the checker finds wrong: a kind and numbers, from which a sentence is made.

Code reacts to the kind and reads the numbers; sentences are for people and models.
"""

import json
from importlib import resources

from pydantic import ConfigDict, computed_field

from ..units import length_text
from ..value import Value

_TEXTS = json.loads(resources.files(__package__ or "").joinpath("findings.json").read_text("utf-8"))
KEEP_OUTS = frozenset(("keep_out", "keep_out_near"))
"""Kinds of findings about what robots are to keep off."""
SENTENCES: dict[str, str] = _TEXTS["sentences"]
"""The sentence template of every kind of finding."""
REMEDIES: dict[str, tuple[str, str]] = _TEXTS["remedies"]
"""What helps: the text if a number of robots is known to do, and the text if none is."""


class Finding(Value):
    """One violation: what is wrong, with which robot, by how much.

    Attributes:
        kind: one of `SENTENCES`.
        robot: its number, from 1; None where it is the formation as a whole.
        others: numbers of further robots it is about.
        about: the id of a target, or the name of a curve, corner or place.
        value: what was measured, in the unit.
        limit: what is allowed or needed, in the unit.
        unit: px, degrees or robots.
        needed: how many robots would do, where a number is known to.
        metres_per_pixel: of the picture, where it is known.
    """

    model_config = ConfigDict(extra="ignore")

    kind: str
    robot: int | None = None
    others: tuple[int, ...] = ()
    about: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = "px"
    needed: int | None = None
    metres_per_pixel: float | None = None

    @computed_field
    @property
    def sentence(self) -> str:
        """For people and models; with a scale, lengths are in metres too."""
        value, others = self._shown(self.value), " and ".join(map(str, sorted(self.others)))
        gap = f": robots {others} leave a gap of {value}" if others else ""
        known, unknown = REMEDIES.get(self.kind, ("", ""))
        return SENTENCES[self.kind].format(
            robot=self.robot,
            others=others,
            about=self.about,
            value=value,
            limit=self._shown(self.limit),
            gap=gap,
            remedy=unknown if self.needed is None else known.format(needed=self.needed),
        )

    def _shown(self, value: float | None) -> str:
        if value is None:
            return ""
        if self.unit == "px":
            return length_text(value, self.metres_per_pixel)
        return f"{value:.0f}" + (f" {self.unit}" if self.unit == "degrees" else "")
