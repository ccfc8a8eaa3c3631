"""How a thing is pointed at: candidate, text, box, points, rough outline, or a mask from a file."""

from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema, model_validator
from pydantic.json_schema import SkipJsonSchema
from shapely.geometry import Polygon

from ..geometry.mending import mended

_Number = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]
_PAIR = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
_FOUR = {"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4}
Point = Annotated[tuple[_Number, _Number], WithJsonSchema(_PAIR)]
Box = Annotated[tuple[_Number, _Number, _Number, _Number], WithJsonSchema(_FOUR)]

MAX_POINTS = 20
"""The most points of each kind."""
MAX_VERTICES = 200
"""The most vertices of a drawn outline."""
MIN_SIDE = 2.0
"""Smallest side of a box, px."""


class Mask(BaseModel):
    """A thing's exact region, which is taken as it is.

    Attributes:
        rings: around it, then around its holes, (x, y) px.
        found_in: where it is from, and what was done to it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    rings: tuple[Annotated[tuple[Point, ...], Field(min_length=3)], ...] = Field(min_length=1)
    found_in: str = Field(max_length=1_000)

    @property
    def region(self) -> Polygon:
        """The region as a polygon with holes."""
        return Polygon(self.rings[0], self.rings[1:])


class TargetPrompt(BaseModel):
    """By outline (vertices in order; surest), box (x0, y0, x1, y1), points or candidate.

    text: a bare noun. straight: its sides are. points on it, negative ones off it correct
    what is given there, or by its id what is measured.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str = Field(default="t1", pattern=r"^t[0-9]{1,4}$")
    label: str = Field(default="", max_length=200)
    candidate: str | None = Field(default=None, pattern=r"^c[0-9]{1,4}$")
    text: str | None = Field(default=None, min_length=1, max_length=60)
    box: Box | None = None
    points: tuple[Point, ...] | None = Field(default=None, min_length=1, max_length=MAX_POINTS)
    negative: tuple[Point, ...] = Field(default=(), max_length=MAX_POINTS)
    outline: tuple[Point, ...] | None = Field(default=None, min_length=3, max_length=MAX_VERTICES)
    straight: bool = False
    mask: SkipJsonSchema[Mask | None] = None  # from a file; no model is to write one

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        leading = [self.candidate, self.text, self.box, self.outline, self.mask]
        given = sum(way is not None for way in leading)
        if given == 0 and self.points is None and not self.negative:
            raise ValueError("give a candidate, a text, a box, points or an outline")
        if given > 1:
            raise ValueError("give one of candidate, text, box and outline")
        if self.mask is not None and not (self.mask.region.is_valid and self.mask.region.area):
            raise ValueError("the mask's rings cross, or enclose nothing")
        if (self.candidate or self.text or self.mask) and (self.points or self.negative):
            what = "mask" if self.mask else "candidate" if self.candidate else "text"
            raise ValueError(f"a {what} takes no points; give an outline of yours instead")
        if self.straight and self.outline is None:
            raise ValueError("straight belongs to an outline")
        return self

    def corrected_by(self, later: "TargetPrompt") -> "TargetPrompt":
        """Return this prompt with another prompt's points, and its label if it has one, added."""
        points = (*(self.points or ()), *(later.points or ()))
        update = {"points": points or None, "negative": self.negative + later.negative}
        return self.model_copy(update=update | ({"label": later.label} if later.label else {}))

    @property
    def brief(self) -> dict[str, Any]:
        """The prompt as JSON data, with the bounding box alone in place of a mask."""
        box = {} if self.mask is None else {"box": self.mask.region.bounds}
        given = self.model_dump(mode="json", exclude_defaults=True, exclude={"mask"})
        return given | {"id": self.id} | box

    def mended(self) -> tuple["TargetPrompt", str]:
        """Return the prompt with its outline mended if it crosses itself, and what was done to it.

        The text is empty if the outline was not changed.
        """
        made = None if self.outline is None else _mended_outline(self.outline)
        if made is None:
            return self, ""
        region, done = made
        return self.model_copy(update={"outline": tuple(region.exterior.coords[:-1])}), done

    @property
    def how(self) -> str:
        """The way of pointing that leads: mask, candidate, text, outline, box or point."""
        if self.mask is not None:
            return "mask"
        if self.candidate is not None or self.text is not None:
            return "candidate" if self.candidate is not None else "text"
        if self.outline is not None:
            return "outline"
        return "box" if self.box is not None else "point"

    def problems(self, width: int, height: int) -> list[str]:
        """Return all that makes it unusable on a picture of this size, one sentence each."""
        found = [
            f"The point ({x:g}, {y:g}) lies outside the picture; {_picture_extent(width, height)}."
            for x, y in (*(self.points or ()), *self.negative)
            if not (0 <= x <= width - 1 and 0 <= y <= height - 1)
        ]
        if self.box is not None:
            found += box_problems(self.box, width, height)
        if self.outline is not None:
            found += _outline_problems(self.outline, width, height)
        if self.mask is not None:
            found += _region_problems(self.mask.region, "mask", width, height)
        return found


def box_problems(box: Box, width: int, height: int) -> list[str]:
    """Return all that makes a box unusable on a picture of this size, one sentence each."""
    x0, y0, x1, y1 = box
    shown = f"The box ({x0:g}, {y0:g}, {x1:g}, {y1:g})"
    if x1 < x0 or y1 < y0:
        return [f"{shown} is inverted; give x0,y0,x1,y1 with x0 < x1 and y0 < y1."]
    if x1 - x0 < MIN_SIDE or y1 - y0 < MIN_SIDE:
        return [f"{shown} is empty; it must be {MIN_SIDE:g} px or more on each side."]
    left, top = max(x0, 0), max(y0, 0)
    if min(x1, width - 1) - left < MIN_SIDE or min(y1, height - 1) - top < MIN_SIDE:
        return [f"{shown} lies outside the picture; {_picture_extent(width, height)}."]
    return []


def _picture_extent(width: int, height: int) -> str:
    return f"the picture is {width} x {height} px (x 0 to {width - 1}, y 0 to {height - 1})"


def _outline_problems(outline: tuple[Point, ...], width: int, height: int) -> list[str]:
    region = Polygon(outline)
    if region.convex_hull.area < MIN_SIDE**2:
        return ["The outline is empty: its vertices enclose less than 4 square px."]
    if not region.is_valid:
        made = _mended_outline(outline)
        if made is None:
            return ["The outline crosses itself; give its vertices in order around the thing."]
        region = made[0]
    return _region_problems(region, "outline", width, height)


def _mended_outline(outline: tuple[Point, ...]) -> tuple[Polygon, str] | None:
    """Mend an outline that crosses itself; None if it does not, or cannot be mended."""
    made = None if Polygon(outline).is_valid else mended(outline)
    if made is None or len(made[0].exterior.coords) - 1 > MAX_VERTICES:
        return None
    return made


def _region_problems(region: Polygon, what: str, width: int, height: int) -> list[str]:
    frame = Polygon([(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)])
    if region.intersection(frame).area < MIN_SIDE**2:
        return [f"The {what} lies outside the picture; {_picture_extent(width, height)}."]
    return []
