"""The changes of a formation that can be asked for, as values with a `kind`.

One union, so that a conversation can be given its JSON Schema. Lengths are image pixels, robots
and groups are numbered from 1.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ..contract import SideName
from ..value import Value

Finite = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
Number = Annotated[int, Field(ge=1, le=10_000)]


class _GroupEdit(Value):
    group: int | None = Field(
        default=None, ge=1, description="Which group of the contract, from 1; all where left out."
    )


class Offset(_GroupEdit):
    """Further out from the target, or further in."""

    kind: Literal["out", "in"]
    px: Positive | None = None
    factor: Annotated[float, Field(gt=1, le=1000)] | None = Field(
        default=None, description="Of the distance robots' edges keep: out multiplies, in divides."
    )

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if (self.px is None) == (self.factor is None):
            raise ValueError("give either px or factor")
        return self


class Rotate(_GroupEdit):
    """Turn clockwise as seen in the picture: robots on a ring along it, others rigidly.

    Letters and grids that are turned are free positions from then on.
    """

    kind: Literal["rotate"] = "rotate"
    degrees: Finite


class Mirror(_GroupEdit):
    """Each robot to the mirror image of its place, left and right (or top and bottom) swapped.

    Letters go to the mirrored place and can still be read.
    """

    kind: Literal["mirror"] = "mirror"
    axis: Literal["left-right", "top-bottom"]


class Shift(_GroupEdit):
    """Move as it stands, px, x right, y down."""

    kind: Literal["shift"] = "shift"
    dx: Finite = 0.0
    dy: Finite = 0.0


class Scale(_GroupEdit):
    """Larger or smaller about the target's centre."""

    kind: Literal["scale"] = "scale"
    factor: Annotated[float, Field(gt=0, le=1000)]


class Add(_GroupEdit):
    """More robots; they take the last numbers of their group."""

    kind: Literal["add"] = "add"
    n: Number


class Remove(_GroupEdit):
    """Fewer robots: those named, or the n last ones of a group; the others close the gaps."""

    kind: Literal["remove"] = "remove"
    n: Number | None = None
    robots: tuple[Number, ...] | None = Field(default=None, min_length=1)

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if (self.n is None) == (self.robots is None):
            raise ValueError("give either n or robots")
        return self


class Swap(Value):
    """Two robots take each other's place."""

    kind: Literal["swap"] = "swap"
    a: Number
    b: Number


class SideOnly(_GroupEdit):
    """All to one side of the target, as near as they are."""

    kind: Literal["side"] = "side"
    side: SideName


class Skip(Value):
    """Robots leave and their places stay empty."""

    kind: Literal["skip"] = "skip"
    robots: tuple[Number, ...] = Field(min_length=1)


Edit = Annotated[
    Offset | Rotate | Mirror | Shift | Scale | Add | Remove | Swap | SideOnly | Skip,
    Field(discriminator="kind"),
]
