"""The part of a contract about shapes: what robots draw, and where."""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import Field, WithJsonSchema, model_validator

from ..errors import InputError
from ..geometry.figures.letters import letter_strokes
from ..geometry.figures.shapes import Kind, Opens
from ..geometry.figures.typeface import letter_outlines
from .value import Value

Coordinate = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]


def numbers(count: int) -> WithJsonSchema:
    """Return the schema of a fixed-length list of numbers; some providers lack prefixItems."""
    return WithJsonSchema(
        {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}
    )


Pair = Annotated[tuple[Coordinate, Coordinate], numbers(2)]
Four = Annotated[tuple[Coordinate, Coordinate, Coordinate, Coordinate], numbers(4)]
Where = Literal["around", "inside", "on", "left", "right", "above", "below"]
ENCLOSING: frozenset[Kind] = frozenset({"arc", "v", "u", "circle", "polygon", "star"})
TOWARDS: dict[str, Opens] = {"left": "right", "right": "left", "above": "down", "below": "up"}
"""The direction towards the target from each place beside it."""


class ShapeSpec(Value):
    """Through points (line, polyline), in a box (x0, y0, x1, y1), or where by the target.

    angles: of an arc, from and to; opens: the mouth of v, u, arc.
    """

    kind: Kind
    text: str | None = Field(default=None, max_length=40)
    points: tuple[Pair, ...] | None = Field(default=None, min_length=2, max_length=500)
    rows: int | None = Field(default=None, ge=1)
    corners: int | None = Field(default=None, ge=3, le=100)
    angles: Pair | None = None
    opens: Opens | None = None
    box: Four | None = None
    where: Where | None = None

    @property
    def name(self) -> str:
        """The name of the shape in texts for people."""
        return self.kind.upper() if self.kind in ("v", "u") else self.kind.replace("_", " ")

    @property
    def mouth(self) -> Opens | None:
        """The side on which a V, a U or a half circle is open; None for other shapes."""
        if self.kind not in _FIELD_OF["opens"] or self.angles is not None:
            return None
        return self.opens or TOWARDS.get(self.where or "", "up")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = [*self._misplaced(), *self._placeless()]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    def _misplaced(self) -> Iterator[str]:
        for name, kinds in _FIELD_OF.items():
            if getattr(self, name) is not None and self.kind not in kinds:
                yield f"{name} belongs to {' or '.join(kinds)}, not to {self.kind}"
        if self.kind in _FIELD_OF["text"]:
            try:
                (letter_strokes if self.kind == "letters" else letter_outlines)(self.text or "")
            except InputError as error:
                yield str(error).rstrip(".")
        if self.kind == "polyline" and self.points is None:
            yield "a polyline takes points"
        if self.angles is not None and self.opens is not None:
            yield "an arc takes angles or opens, not both"
        if self.angles is not None and self.angles[0] == self.angles[1]:
            yield f"an arc takes two angles that differ, not {self.angles}"
        if self.points is not None and len(set(self.points)) < 2:
            yield "points must differ"

    def _placeless(self) -> Iterator[str]:
        given = (self.box is not None) + (self.where is not None)
        if given > 1 or (not given and self.points is None):
            yield f"{self.kind} takes either a box, or where with a target"
        if self.where == "around" and self.kind not in ENCLOSING:
            yield f"only {', '.join(sorted(ENCLOSING))} go around a target, not {self.kind}"
        if self.box is not None and not (self.box[0] <= self.box[2] and self.box[1] <= self.box[3]):
            yield f"box {self.box} must be x0 <= x1, y0 <= y1"


_FIELD_OF: dict[str, tuple[Kind, ...]] = {
    "text": ("letters", "outlined_letters"),
    "points": ("line", "polyline"),
    "rows": ("grid",),
    "corners": ("polygon", "star"),
    "angles": ("arc",),
    "opens": ("arc", "v", "u"),
}
