"""What the checker finds wrong: a kind and its numbers, from which its sentence is made.

Code reacts to the kind and reads the numbers; sentences are for people and models.
"""

from collections.abc import Sequence

from pydantic import ConfigDict, computed_field

from ..units import length_text
from ..value import Value

_AT_MOST = "Robot {robot} is {value} from {about}; {limit} at most are allowed."
_LAST = "Robot {robot} is the last before {value} without a robot; {limit} are allowed."
_OPENING = "Robot {robot} and robot {others} leave an opening of {value}; a closed ring allows "
_ALONG = "Robot {robot} and robot {others} are {value} apart along the curve; even spacing "
_HOLDS = (
    "{gap}. A ring all of whose gaps are below {limit} certainly holds it: {remedy}. Where the "
    "positions are left out, fewer may be placed."
)
SENTENCES = {
    "count": "The contract wants {limit} positions; {value} were given.",
    "no_place": "Robot {robot} has a coordinate that is no place in a picture.",
    "out_of_picture": "Robot {robot} is {value} outside the part of the picture robots may stand "
    "in.",
    "nothing_in_picture": "Nothing of {about} lies inside the picture.",
    "too_close": "Robot {robot} is {value} from robot {others}; {limit} or more are needed.",
    "keep_out": "Robot {robot} stands on {about}, which is to be kept free.",
    "on_target": "Robot {robot} stands on {about}.",
    "too_near": "Robot {robot} is {value} from {about}; {limit} or more are needed.",
    "too_far": _AT_MOST,
    "outside": "Robot {robot} is outside {about}; it must be {limit} or more inside.",
    "not_inside": "Robot {robot} is {value} from the edge of {about}; it must be {limit} or more "
    "inside.",
    "too_deep": "Robot {robot} is {value} inside {about}; {limit} at most are allowed.",
    "off_centre": _AT_MOST,
    "off_corner": _AT_MOST,
    "off_curve": _AT_MOST,
    "off_grid": _AT_MOST,
    "same_place": "Robot {robot} stands at {about} as robot {others} does.",
    "corners": "The target has {limit} corners for {value} robots.",
    "wrong_side": "Robot {robot} stands beside another side of the target, {value} off the one "
    "meant.",
    "wrong_edge": "Robot {robot} stands nearer to {about} than to those asked for.",
    "gap": _ALONG + "allows {limit}.",
    "crowded": _ALONG + "needs {limit}.",
    "crowded_figure": "Two robots are {value} apart; an even shape needs {limit}.",
    "bare_end": _LAST,
    "bare_stretch": "A stretch of {value} has no robot; even spacing allows {limit}.",
    "uneven": "The closest two robots inside are {value} apart; even spreading needs {limit} or "
    "more.",
    "uncovered": "Part of the target is {value} from the nearest robot; even spreading allows "
    "{limit}.",
    "not_enclosed": "The robots do not enclose {about}; a closed ring takes {limit} or more all "
    "round.",
    "opening": _OPENING + "{limit}{remedy}.",
    "opening_at_border": _OPENING + "{limit} (the picture's border cuts the ring there).",
    "not_caged": "It is not certified that {about} cannot get out" + _HOLDS,
    "gets_out": "{about} can get out between the robots, on a way that was checked" + _HOLDS,
}
"""Every kind of finding, and what it says."""
_RING = (
    "{needed} robots evenly on the ring do",
    "the picture's border cuts the ring of this clearance, so a nearer one is needed",
)
REMEDIES = {
    "opening": ("; {needed} robots evenly would do", ""),
    "not_caged": _RING,
    "gets_out": _RING,
}
"""What helps, where a number of robots does and where none is known to."""


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

    def renumbered(self, mapping: Sequence[int]) -> "Finding":
        """With other robots' numbers, see `Verdict.renumbered`."""
        robot = None if self.robot is None else mapping[self.robot - 1]
        others = tuple(mapping[other - 1] for other in self.others)
        return self.model_copy(update={"robot": robot, "others": others})

    def _shown(self, value: float | None) -> str:
        if value is None:
            return ""
        if self.unit == "px":
            return length_text(value, self.metres_per_pixel)
        return f"{value:.0f}" + (f" {self.unit}" if self.unit == "degrees" else "")
