"""What a scene is made of: coloured parts, things made of parts, grounds, and the scene itself."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import shapely
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ...tools.geometry.outline import Outline, outline_of, rectangle_of
from .palette import RGB, shade


@dataclass(frozen=True)
class Part:
    """A region of one colour."""

    region: BaseGeometry
    colour: RGB


@dataclass(frozen=True)
class Sort:
    """A sort of thing.

    Attributes:
        draw: makes the parts from a colour, in arbitrary units; the first part is the outline.
        corners: how many a person would count; 0 if that is no sensible question.
        by_colour: whether a person would name it by its colour.
        upright: whether one can see how it is turned.
        scale: its usual size relative to other things of the scene.
        is_shape: whether its noun is the word for a shape.
        also: nouns of other things that some people would call by this noun.
    """

    noun: str
    colours: Sequence[str]
    draw: Callable[[Generator, RGB], list[Part]]
    corners: int = 0
    by_colour: bool = True
    upright: bool = False
    scale: float = 1.0
    is_shape: bool = False
    plural: str = ""
    encloses: bool = False
    also: Sequence[str] = ()


@dataclass(frozen=True)
class Thing:
    """A thing in a picture, in pixels: x right, y down, pixel centres at whole numbers."""

    sort: Sort
    colour: str
    parts: tuple[Part, ...] = field(repr=False)
    turn: float = 0.0

    @cached_property
    def polygon(self) -> Polygon:
        """Its exact outline, with holes."""
        region = self.parts[0].region
        assert isinstance(region, Polygon)
        return region

    @cached_property
    def outline(self) -> Outline:
        """The outline in the form that the planner works with."""
        return outline_of(self.polygon)

    @cached_property
    def area(self) -> float:
        """Area in square pixels, holes filled."""
        return Polygon(self.polygon.exterior).area

    @property
    def size(self) -> float:
        """Square root of the area, px."""
        return math.sqrt(self.area)

    @cached_property
    def place(self) -> tuple[float, float]:
        """Where a person would say it is: the middle of its bounding box, (x, y) px."""
        x0, y0, x1, y1 = self.polygon.bounds
        return (x0 + x1) / 2, (y0 + y1) / 2

    @cached_property
    def stretch(self) -> float:
        """Length over width."""
        (ax, ay), (bx, by), (cx, cy), _ = rectangle_of(self.polygon)
        sides = math.hypot(bx - ax, by - ay), math.hypot(cx - bx, cy - by)
        return max(sides) / min(sides)

    @cached_property
    def roundness(self) -> float:
        """Share of the smallest disc around it that it fills, holes filled; a square: 0.64."""
        return self.area / (math.pi * shapely.minimum_bounding_radius(self.polygon) ** 2)

    @cached_property
    def roundish(self) -> float:
        """Roundness of its convex hull without thin things that stick out: a mug's handle."""
        reach = 0.17 * self.size
        bulk = Polygon(self.polygon.exterior).buffer(-reach).buffer(reach)
        hull = (self.polygon if bulk.is_empty else bulk).convex_hull
        return hull.area / (math.pi * float(shapely.minimum_bounding_radius(hull)) ** 2)

    @cached_property
    def solidity(self) -> float:
        """Share of its convex hull that it fills."""
        return self.polygon.area / self.polygon.convex_hull.area

    @property
    def hollow(self) -> bool:
        """Whether robots in a recess of it would come between others in order around its hull."""
        return self.area < 0.8 * self.polygon.convex_hull.area

    def moved(self, x: float, y: float, turn: float) -> "Thing":
        """Return it turned by degrees about the origin, where it was made, and put at (x, y)."""
        c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        matrix = [c, -s, s, c, x, y]
        parts = tuple(
            Part(affinity.affine_transform(part.region, matrix), part.colour) for part in self.parts
        )
        return replace(self, parts=parts, turn=turn)


def make(
    random: Generator, sort: Sort, colour: str, size: float, paint: RGB | None = None
) -> Thing:
    """Make a thing about the origin whose outline, holes filled, has the area size x size.

    `paint` is the exact colour; by default a random one of the name `colour`.
    """
    parts = sort.draw(random, paint or shade(random, colour))
    outline = parts[0].region
    assert isinstance(outline, Polygon)
    filled = Polygon(outline.exterior)
    k, x, y = size / math.sqrt(filled.area), filled.centroid.x, filled.centroid.y
    scaled = tuple(
        Part(
            affinity.affine_transform(
                outline if i == 0 else part.region.intersection(outline),
                [k, 0, 0, k, -k * x, -k * y],
            ),
            part.colour,
        )
        for i, part in enumerate(parts)
    )
    return Thing(sort, colour, scaled)


@dataclass(frozen=True)
class Look:
    """How the camera saw a scene.

    Attributes:
        shadow: offset (x, y) of cast shadows and their blur, px, and strength; None for none.
        light: brightness rises from 1 - light to 1 + light, at most, towards `way`, degrees.
        grain: strength of the texture on things.
        noise: standard deviation of the sensor's noise, grey levels.
        blur: standard deviation, px.
        jpeg: quality of a compression it went through, 0 for none.
    """

    shadow: tuple[float, float, float, float] | None
    light: float
    way: float
    grain: float
    noise: float
    blur: float
    jpeg: int


@dataclass(frozen=True)
class Ground:
    """What lies under the things: a texture, its mean colour, and marks painted on it."""

    texture: str
    colour: RGB
    marks: tuple[Part, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class Scene:
    """All that is drawn."""

    seed: int
    family: str
    size: tuple[int, int]
    ground: Ground
    things: tuple[Thing, ...]
    look: Look


@dataclass(frozen=True)
class Family:
    """A way of drawing scenes: sorts of things, and the ground they stand on.

    Attributes:
        turns: how things lie: "aligned" to one direction, "free", or "either".
        rows: how often they stand in rows.
        bays: whether those rows are painted on the ground.
        beyond: kinds of reference that cannot tell its things apart.
    """

    name: str
    sorts: tuple[Sort, ...]
    ground: Callable[[Generator, tuple[int, int]], Ground]
    turns: str = "free"
    rows: float = 0.0
    bays: bool = False
    beyond: Sequence[str] = ("shape", "colour_shape")
