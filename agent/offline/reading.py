"""The value that an instruction is read into."""

from dataclasses import dataclass, field
from typing import Any

from .drawn_forms import Form

SURE = 0.55
"""Least probability to carry out an arrangement without asking, fitted on other authors' words."""
SURE_RING, SURE_EITHER_RING = 0.45, 0.8
"""Least probabilities of the likelier kind of ring, and of both kinds together."""


def unscaled(words: str) -> str:
    """Return why a metric length cannot be used where the picture has no scale."""
    return (
        f'"{words}" cannot be measured: the picture has no scale. Say it in px; metres take a '
        "picture that was given with its scale, in metres per pixel."
    )


@dataclass
class Reading:
    """What was understood of an instruction.

    Attributes:
        meanings: arrangements that may be meant with their probabilities, likeliest first.
        robots: how many; None where the words do not say.
        odd_count: words for a number of robots that is not a whole number above 0, or "".
        count: "needed" or "fit" where the words leave the number of robots to the tools, or "".
        group: fields of the contract's group beside relation, targets and robots. Lengths in px.
        robot_radius: px, where the words state it.
        shares: sides and their numbers of robots, where the words divide them; 0: an equal share.
        distances: least and greatest clearance of the robots at a side, px, where they differ.
        further: a side or "centre" and its number of robots, in addition to the arrangement.
        one_a_corner: whether each corner takes one robot.
        rings: how many rings or rows, one outside the other.
        ring_counts: how many robots stand in each of them, the inner one first, where given.
        form: the form that the robots draw, if any.
        place: around, inside or along, if the words before the thing say so of a form; else "".
        things: phrases for the thing or things that the arrangement is about.
        others: phrases for things to stay clear of.
        keep_out_clearance: how far from those, px, where the words say it.
        faced: phrase for the thing that the side of a row faces, or "".
        aims: phrases for what robots look at (heading) or an opening is towards, by that field.
        stops: why it is no order to place robots now, each a kind and the words for it.
        unread: words that no rule took.
        background: words that change nothing.
        language: the language of an instruction that is not in English, or "".
        unscaled: metric lengths, which a picture without a scale cannot give in px.
    """

    meanings: list[tuple[str, float]]
    robots: int | None = None
    odd_count: str = ""
    count: str = ""
    group: dict[str, Any] = field(default_factory=dict[str, Any])
    robot_radius: float | None = None
    shares: list[tuple[str, int]] = field(default_factory=list[tuple[str, int]])
    distances: dict[str, tuple[float, float]] = field(
        default_factory=dict[str, tuple[float, float]]
    )
    further: list[tuple[str, int]] = field(default_factory=list[tuple[str, int]])
    one_a_corner: bool = False
    rings: int = 1
    ring_counts: list[int] = field(default_factory=list[int])
    form: Form | None = None
    place: str = ""
    things: list[str] = field(default_factory=list[str])
    others: list[str] = field(default_factory=list[str])
    keep_out_clearance: float = 0.0
    faced: str = ""
    aims: dict[str, str] = field(default_factory=dict[str, str])
    stops: tuple[tuple[str, str], ...] = ()
    unread: list[str] = field(default_factory=list[str])
    background: list[str] = field(default_factory=list[str])
    language: str = ""
    unscaled: list[str] = field(default_factory=list[str])

    @property
    def relation(self) -> str:
        """The arrangement that comes first in `meanings`."""
        return self.meanings[0][0]

    @property
    def named(self) -> list[str]:
        """Phrases for things other than the arrangement's, in the order `contract_of` takes."""
        return [*self.others, *([self.faced] if self.faced else []), *self.aims.values()]

    @property
    def sure(self) -> bool:
        """Whether the arrangement is likely enough to be carried out without asking."""
        (first, likely), *others = self.meanings
        if likely >= SURE:
            return True
        pair = {first, next((m for m, _ in others if m != first), "")}
        both = likely + next((p for m, p in others if m != first), 0.0)
        return pair == {"around", "cage"} and likely >= SURE_RING and both >= SURE_EITHER_RING
