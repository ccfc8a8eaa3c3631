"""Judges which things fit a description, in three values: sure, possible, no.

What is neither clearly so nor clearly not stays possible, so that guesses are not reported. Pairs
of limits are for sure and for possible.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from ...errors import ToolError
from ...geometry.outline import FloatArray
from .attributes import Attributes, Candidate, ShapeName
from .query import Description, Trait

IntArray = NDArray[np.int64]
NO, POSSIBLE, SURE = 0, 1, 2

COLOUR = (0.55, 0.25)
"""Share of pixels: more than half names a thing, less than a quarter is a pattern on it."""
DARK, LIGHT = (45.0, 60.0), (60.0, 45.0)
"""L*: mid grey is 53, and anything from 45 to 60 may be called either."""
SHAPE_FIT, SHAPE_LEAD = (0.8, 0.7), (0.03, -0.05)
"""Overlap with a shape's template, and its lead over the next; noise shifts an overlap by 0.03."""
UNNAMED = "irregular"
"""Not a rival of other shapes: it only means that none fits well."""
MAIN, MAIN_LEAD = 0.4, 2.0
"""A colour of at least this share also names a thing if no other has more than half as many."""
ROUNDNESS = (0.85, 0.8)
"""A traced disc has 0.91, a square 0.79 or less."""
ROUND_ELONGATION = (1.25, 1.45)
"""An oval of 1.2 is still called round, one of 1.5 no longer."""
ANGULAR = (0.02, 0.045)
"""Lead of the best angular shape over the best round one: a hexagon's is 0.06, an oval's none."""
LONG = (1.7, 1.4)
"""Long over short side: a car from above has about 2.2, a roughly drawn hatchback 1.7."""
SOLID = (0.9, 0.8)
"""Share of the convex hull: a disc or a square has 1, a star 0.5, a crescent 0.8 or less."""
HOLLOW = (0.1, 0.03)
"""Share of holes: less than three hundredths is a flaw of the outline."""
SIMPLER = 0.0005
"""Outlines are simplified by this share of the picture's longer side before measuring distances."""
ROUND_SHAPES: tuple[ShapeName, ...] = ("circle", "oval", "ring")
ANGULAR_SHAPES: tuple[ShapeName, ...] = (
    "square",
    "rectangle",
    "triangle",
    "pentagon",
    "hexagon",
    "star",
    "cross",
    "L",
    "arrow",
)


@dataclass(frozen=True)
class Things:
    """Candidates as arrays, in the order of their numbers, in a picture of width x height px."""

    candidates: tuple[Candidate, ...]
    width: int
    height: int

    def each(self, measured: Callable[[Attributes], float]) -> FloatArray:
        """Return a number for every thing, (n,)."""
        return np.array([measured(c.attributes) for c in self.candidates], dtype=float)

    @cached_property
    def centres(self) -> FloatArray:
        """Centroids, (n, 2), px."""
        rows = [c.attributes.centre for c in self.candidates]
        return np.array(rows, dtype=float).reshape(-1, 2)

    @cached_property
    def boxes(self) -> FloatArray:
        """Bounding boxes x0, y0, x1, y1, (n, 4), px."""
        return np.array([c.outline.bounds for c in self.candidates], dtype=float).reshape(-1, 4)

    @cached_property
    def areas(self) -> FloatArray:
        """Areas without holes, (n,), square px."""
        return self.each(lambda a: a.area)

    @cached_property
    def labs(self) -> FloatArray:
        """Mean CIE L*, a*, b*, (n, 3)."""
        return np.array([c.attributes.lab for c in self.candidates], dtype=float).reshape(-1, 3)

    @cached_property
    def regions(self) -> NDArray[np.object_]:
        """The polygons, (n,), simplified where that leaves them valid."""
        polygons = [c.outline.polygon for c in self.candidates]
        far = SIMPLER * max(self.width, self.height)
        exact: NDArray[np.object_] = np.array(polygons, dtype=object)
        thin: NDArray[np.object_] = shapely.simplify(exact, far, preserve_topology=False)
        whole = shapely.is_valid(thin) & ~shapely.is_empty(thin)
        return np.where(whole, thin, exact)

    @cached_property
    def _gaps(self) -> dict[int, FloatArray]:
        return {}

    def gaps(self, index: int) -> FloatArray:
        """Return the edge-to-edge distance of one thing to every thing, (n,), px; 0 on overlap."""
        if index not in self._gaps:
            found = shapely.distance(self.regions[index], self.regions)
            self._gaps[index] = np.asarray(found, dtype=float)
        return self._gaps[index]

    def gap(self, one: int, other: int) -> float:
        """Return the edge-to-edge distance of two things, px; 0 if they overlap."""
        first: Polygon = self.regions[one]
        second: Polygon = self.regions[other]
        return first.distance(second)

    def index(self, name: str) -> int:
        """Return the index of a candidate id.

        Raises:
            ToolError: there is no such candidate; the message lists those there are.
        """
        ids = [c.id for c in self.candidates]
        if name not in ids:
            shown = listed(self.candidates, range(len(ids)), most=8) if ids else "none"
            raise ToolError(f"There is no candidate {name}; there are {len(ids)}: {shown}.")
        return ids.index(name)


@dataclass(frozen=True)
class Filter:
    """One condition on things, and how well each of them meets it.

    Attributes:
        word: the condition: "red", "left of c4".
        degrees: NO, POSSIBLE or SURE for every thing, (n,).
        explain: returns the number behind a thing's degree as a short sentence; empty if none.
        summary: what there is instead, if no thing can meet it.
    """

    word: str
    degrees: IntArray
    explain: Callable[[int], str]
    summary: str = ""


def listed(candidates: tuple[Candidate, ...], members: range | IntArray, most: int = 5) -> str:
    """List the members' ids as in a sentence: "c1, c2 and 3 more"."""
    ids = [candidates[int(i)].id for i in members]
    rest = len(ids) - most
    return ", ".join(ids) if rest <= 0 else f"{', '.join(ids[:most])} and {rest} more"


def graded(values: FloatArray, limits: tuple[float, float]) -> IntArray:
    """Grade values (n,) by the limits for sure and for possible.

    If the limit for sure is the smaller one, small values are surer.
    """
    sure, possible = limits
    signed, at, least = (
        (values, sure, possible) if sure >= possible else (-values, -sure, -possible)
    )
    return np.where(signed >= at, SURE, np.where(signed >= least, POSSIBLE, NO)).astype(np.int64)


def attribute_filters(things: Things, description: Description) -> list[Filter]:
    """Return the filters for what a description says about a thing's looks and noun."""
    found: list[Filter] = []
    if description.noun:
        found.append(_noun_filter(things, description.noun))
    if description.colours:
        found.append(_colour_filter(things, description))
    if description.shade:
        found.append(_shade_filter(things, description.shade))
    if description.shapes:
        found.append(_shape_filter(things, description))
    return [*found, *(_trait_filter(things, trait) for trait in description.traits)]


def lacking(things: Things, filters: list[Filter]) -> str:
    """Say why nothing fits all the filters, and what there is instead."""
    count = len(things.candidates)
    if not count:
        return "no things were found in the picture"
    none = "the only thing is not" if count == 1 else f"none of {count} things is"
    for found in filters:
        if not found.degrees.any():
            return f"{none} {found.word}; {found.summary}"
    apart = ", ".join(
        f"{int((f.degrees > NO).sum())} {'is' if (f.degrees > NO).sum() == 1 else 'are'} {f.word}"
        for f in filters
    )
    return f"{none} {' and '.join(f.word for f in filters)}; {apart}"


def _there_are(names: list[str]) -> str:
    counts = sorted(Counter(names).items(), key=lambda item: (-item[1], item[0]))
    return "there are " + ", ".join(f"{name} {count}" for name, count in counts)


def _noun_filter(things: Things, noun: str) -> Filter:
    namings = [c.as_named(noun) for c in things.candidates]
    degrees = np.array([NO if n is None else SURE for n in namings], dtype=np.int64)

    def explain(index: int) -> str:
        naming = namings[index]
        return f"found as {noun} ({naming.score:.2f})" if naming else ""

    return Filter(f"found as {noun}", degrees, explain, "no network found one")


def _colour_filter(things: Things, description: Description) -> Filter:
    word = " or ".join(description.colours)
    asked = description.colours
    shares = things.each(lambda a: sum(v for name, v in a.colours if name in asked))
    others = things.each(lambda a: max((v for n, v in a.colours if n not in asked), default=0.0))
    degrees = graded(shares + 1e-9, COLOUR)
    degrees[(shares >= MAIN) & (shares >= MAIN_LEAD * others)] = SURE
    return Filter(
        word,
        degrees,
        lambda i: f"{word} {shares[i]:.0%} of its pixels".replace("%", " %"),
        _there_are([c.attributes.colour for c in things.candidates]),
    )


def _shade_filter(things: Things, shade: str) -> Filter:
    light = things.labs[:, 0]
    summary = ""
    if len(light):
        most = light.min() if shade == "dark" else light.max()
        summary = f"the {shade}est has L* {most:.0f}"
    limits = DARK if shade == "dark" else LIGHT
    return Filter(shade, graded(light, limits), lambda i: f"{shade}: L* {light[i]:.0f}", summary)


def _shape_filter(things: Things, description: Description) -> Filter:
    word = " or ".join(description.shapes)
    asked = things.each(lambda a: _best_fit(a, description.shapes))
    named = (*description.shapes, UNNAMED)
    other = things.each(lambda a: max((v for s, v in a.shapes if s not in named), default=0.0))
    lead = asked - other + 1e-9
    return Filter(
        f"of shape {word}",
        np.minimum(graded(asked, SHAPE_FIT), graded(lead, SHAPE_LEAD)),
        lambda i: f"{word} fits by {asked[i]:.2f}, the next shape by {other[i]:.2f}",
        _there_are([c.attributes.shape for c in things.candidates]),
    )


def _trait_filter(things: Things, trait: Trait) -> Filter:
    if trait == "round":
        return _round_filter(things)
    if trait == "whole":
        cut = things.each(lambda a: a.touches_border)
        degrees = np.where(cut, NO, SURE).astype(np.int64)
        return Filter(
            trait,
            degrees,
            lambda i: f"the picture's border cuts {'it' if cut[i] else 'none of it'}",
            "the picture's border cuts them all",
        )
    if trait == "long":
        name, limits = "long over short side", LONG
        values = things.each(lambda a: a.elongation)
    elif trait == "hollow":
        name, limits = "share of holes", HOLLOW
        values = things.each(lambda a: a.hole)
    else:
        name, limits = "share of its convex hull", SOLID
        polygons = np.array([c.outline.polygon for c in things.candidates], dtype=object)
        hulls = np.asarray(shapely.area(shapely.convex_hull(polygons)), dtype=float)
        values = np.array([c.outline.area for c in things.candidates], dtype=float) / hulls
    return Filter(
        trait,
        graded(values, limits),
        lambda i: f"{trait}: {name} {values[i]:.2f}",
        f"the most is {values.max():.2f} ({name})" if len(values) else "",
    )


def _best_fit(attributes: Attributes, names: tuple[ShapeName, ...]) -> float:
    """Return how well the best of some shapes fits, 0 to 1."""
    return max((fit for name, fit in attributes.shapes if name in names), default=0.0)


def _round_filter(things: Things) -> Filter:
    roundness, elongation = things.each(lambda a: a.roundness), things.each(lambda a: a.elongation)
    angular = things.each(lambda a: _best_fit(a, ANGULAR_SHAPES) - _best_fit(a, ROUND_SHAPES))
    by_shape = graded(angular, ANGULAR)
    degrees = np.minimum(graded(roundness, ROUNDNESS), graded(elongation, ROUND_ELONGATION))
    return Filter(
        "round",
        np.minimum(degrees, by_shape),
        lambda i: f"roundness {roundness[i]:.2f}, long over short side {elongation[i]:.2f}",
        f"the roundest has roundness {roundness.max():.2f}" if len(roundness) else "",
    )
