"""Measured attributes of a thing, whatever it is: colour, size, place, shape.

Words such as "red", "round" or "the largest" are resolved by these numbers alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ...geometry.outline import Outline

ColourName = Literal[
    "red",
    "orange",
    "yellow",
    "green",
    "blue",
    "purple",
    "pink",
    "brown",
    "black",
    "grey",
    "white",
]
"""The basic colour terms of English (Berlin and Kay, 1969)."""
ShapeName = Literal[
    "circle",
    "oval",
    "square",
    "rectangle",
    "triangle",
    "pentagon",
    "hexagon",
    "star",
    "cross",
    "L",
    "arrow",
    "ring",
    "frame",
    "crescent",
    "heart",
    "C",
    "T",
    "irregular",
]


@dataclass(frozen=True)
class Attributes:
    """Label-free measures of one thing; lengths in image pixels, x right, y down.

    Attributes:
        colours: share of its pixels by colour name, largest first; they add up to 1.
        lab: mean CIE L*, a*, b* (L* 0 to 100).
        area: square px, without holes.
        centre: x, y of the centroid.
        orientation: of the long side of its minimum-area rectangle, degrees in [0, 180) from
            the x axis towards the y axis (clockwise as seen).
        elongation: long over short side of that rectangle, 1 or more.
        roundness: 4 pi area over perimeter squared, holes filled; 1 for a disc.
        shapes: how well each shape class fits, 0 to 1, best first.
        hole: share of the filled area that its holes take.
        touches_border: whether the picture's border cuts it.
    """

    colours: tuple[tuple[ColourName, float], ...]
    lab: tuple[float, float, float]
    area: float
    centre: tuple[float, float]
    orientation: float
    elongation: float
    roundness: float
    shapes: tuple[tuple[ShapeName, float], ...]
    hole: float
    touches_border: bool

    @property
    def colour(self) -> ColourName:
        """The name of its commonest colour."""
        return self.colours[0][0]

    @property
    def shape(self) -> ShapeName:
        """The shape that fits best."""
        return self.shapes[0][0]


@dataclass(frozen=True)
class Naming:
    """The fact that a network found a thing by a noun phrase, with two unrelated scores.

    Attributes:
        score: the detector's score that it is such a thing.
        outline, confidence, parts: those of the mask, as for any other mask.
    """

    phrase: str
    score: float
    outline: Outline
    confidence: float
    parts: Mapping[str, float]


@dataclass(frozen=True)
class Candidate:
    """A thing found in the picture.

    Attributes:
        id: c1, c2, ... in the order of salience, the same on every run.
        outline: image px.
        salience: 0 to 1, how much it looks like a thing.
        named: the phrases it was found by, if any.
    """

    id: str
    outline: Outline
    attributes: Attributes
    salience: float
    named: tuple[Naming, ...] = ()

    def as_named(self, phrase: str) -> Naming | None:
        """Return how it was found by a phrase, or None if it was not."""
        return next((n for n in self.named if n.phrase == phrase), None)

    @property
    def label(self) -> str:
        """Its name if it has one, else its looks: "car", "red circle", "grey thing"."""
        if self.named:
            return self.named[0].phrase
        shape = self.attributes.shape
        return f"{self.attributes.colour} {'thing' if shape == 'irregular' else shape}"
