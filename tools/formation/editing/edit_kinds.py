"""The edits of a formation that can be requested, as values with a `kind`.

They form one union; models get a flat JSON Schema of it, as short as possible. Lengths are image
pixels; robots are referred to by their numbers, and groups are numbered from 1.
"""

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, WithJsonSchema, model_validator

from ..contract import Angle, Length, RingPart, SideName
from ..shape_spec import Pair
from ..value import Value

Finite = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
Number = Annotated[int, Field(ge=1, le=10_000)]
Numbers = Annotated[tuple[Number, ...], Field(min_length=1)]


class _Edit(Value):
    """The base of all edits; exactly one of the fields in `ONE_OF`, if any, has to be given."""

    ONE_OF: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        given = sum(getattr(self, name) is not None for name in self.ONE_OF)
        if self.ONE_OF and given != 1:
            raise ValueError(f"give either {' or '.join(self.ONE_OF)}")
        return self


class _GroupEdit(_Edit):
    """An edit of one group, numbered from 1; if none is given, of all it can be meant for."""

    group: int | None = Field(default=None, ge=1)


class Offset(_GroupEdit):
    """Further out from the target, or further in.

    A factor is of the distance robots' edges keep: out multiplies, in divides.
    """

    ONE_OF = ("px", "factor")
    kind: Literal["out", "in"]
    px: Positive | None = None
    factor: Annotated[float, Field(gt=1, le=1000)] | None = None


class Distance(_GroupEdit):
    """Robots' edges exactly so far from the outline."""

    kind: Literal["distance"] = "distance"
    px: Length


class Spacing(_GroupEdit):
    """Neighbours' centres so far apart, or a multiple of what they are now."""

    ONE_OF = ("px", "factor")
    kind: Literal["spacing"] = "spacing"
    px: Positive | None = None
    factor: Annotated[float, Field(gt=0, le=1000)] | None = None


class Rotate(_GroupEdit):
    """Turn clockwise as seen in the picture: robots on a ring along it, others about their middle.

    Letters and grids that are turned are free positions from then on.
    """

    kind: Literal["rotate"] = "rotate"
    degrees: Finite


class Mirror(_GroupEdit):
    """Each robot to the mirror image of its place, left and right (or top and bottom) swapped.

    Letters go to the mirrored place and can still be read; about a thing that is not its own mirror
    image robots stand evenly.
    """

    kind: Literal["mirror"] = "mirror"
    axis: Literal["left-right", "top-bottom"]


class Shift(_GroupEdit):
    """Move as it stands, px, x right, y down."""

    kind: Literal["shift"] = "shift"
    dx: Finite = 0.0
    dy: Finite = 0.0


class Scale(_GroupEdit):
    """Larger or smaller about the thing robots are round or in; a row or form about its middle.

    px is how wide it is then, from the leftmost robot to the rightmost.
    """

    ONE_OF = ("px", "factor")
    kind: Literal["scale"] = "scale"
    px: Positive | None = None
    factor: Annotated[float, Field(gt=0, le=1000)] | None = None


class Add(_GroupEdit):
    """More robots; they take the last numbers of their group, or stand so around another thing."""

    kind: Literal["add"] = "add"
    n: Number
    to: str | None = None


class Remove(_GroupEdit):
    """Fewer robots: those named, or the n last ones of a group; the others close the gaps."""

    ONE_OF = ("n", "robots")
    kind: Literal["remove"] = "remove"
    n: Number | None = None
    robots: Numbers | None = None


class Count(_GroupEdit):
    """So many robots in all; as many as close the ring, hold what is in it for sure, or fit."""

    kind: Literal["count"] = "count"
    robots: Number | Literal["needed", "held", "fit"]
    px: Positive | None = None

    @model_validator(mode="after")
    def _apart(self) -> Self:
        if self.px is not None and self.robots != "fit":
            raise ValueError("px says how far apart as many as fit are")
        return self


class Swap(_Edit):
    """Two robots take each other's place."""

    kind: Literal["swap"] = "swap"
    a: Number
    b: Number


class SideOnly(_GroupEdit):
    """All to one side of the target, as near as they are."""

    kind: Literal["side"] = "side"
    side: SideName


class Skip(_Edit):
    """Robots leave and their places stay empty."""

    kind: Literal["skip"] = "skip"
    robots: Numbers


class Sides(_GroupEdit):
    """The ring on some parts of the way round only, or leaving some free."""

    ONE_OF = ("only", "without")
    kind: Literal["sides"] = "sides"
    only: tuple[RingPart, ...] | None = Field(default=None, min_length=1)
    without: tuple[RingPart, ...] | None = Field(default=None, min_length=1)


class Opening(_GroupEdit):
    """A gap in the ring; what is left out stays as it is. A factor is of the gap that is there."""

    kind: Literal["opening"] = "opening"
    towards: str | Angle | None = None
    px: Length | None = None
    factor: Annotated[float, Field(gt=0, le=1000)] | None = None


class Closure(_GroupEdit):
    """A closed ring all round, one with no such demand, or one that nothing gets out of."""

    kind: Literal["close", "open", "escape-proof"]


class Arrange(_GroupEdit):
    """Another arrangement of the same robots, as fields of a Group; targets left out stay."""

    kind: Literal["arrange"] = "arrange"
    demands: dict[str, Any]


class Target(_GroupEdit):
    """The same around another thing; for some robots, by count or number, where those are given.

    The others close up unless they are to stay as they stand.
    """

    kind: Literal["target"] = "target"
    to: str
    robots: Number | Numbers | None = None
    stay: bool = False


class Merge(_Edit):
    """Groups of one relation back into one: around the first one's target, or another."""

    kind: Literal["merge"] = "merge"
    to: str | None = None


class Place(_Edit):
    """One robot to a point, by so much, or beside a thing; nobody else moves.

    Attributes:
        stays: in its group, whose demands still hold for it; `near` takes it to the nearest place
            that the group's clearance allows. Left out, it stands by itself. For hands that drag
            a robot: models are not offered it.
    """

    ONE_OF = ("to", "by", "target")
    kind: Literal["place"] = "place"
    robot: Number
    to: Pair | None = None
    by: Pair | None = None
    target: str | None = None
    stays: Literal["there", "near"] | None = None


class Heading(_GroupEdit):
    """Which way to look: towards or away from the target, at a thing, degrees; null: any."""

    kind: Literal["heading"] = "heading"
    to: str | Angle | None = None


class KeepOff(_Edit):
    """Further things that no robot may stand on or drive over, nor come nearer to than px."""

    kind: Literal["keep-out"] = "keep-out"
    ids: tuple[str, ...] = Field(min_length=1)
    px: Positive | None = None


_NAMES = (
    *("group", "n", "a", "b", "robot", "robots", "px", "factor", "degrees", "dx", "dy", "axis"),
    *("side", "only", "without", "towards", "demands", "to", "by", "target", "stay", "ids"),
)
EDIT_SCHEMA: dict[str, Any] = {
    "type": "object",
    "description": (
        "Kinds: out, in: px or factor. distance: px from the outline. spacing: px or factor. "
        "rotate: degrees clockwise. mirror: axis left-right or top-bottom. shift: dx, dy. scale: "
        "factor. add: n, to an id. remove: n or robots (numbers); others close up. count: robots, "
        "a number, needed (to close the ring), held (escape-proof) or fit (px apart). swap: a, b. "
        "skip: robots; places stay empty. side: all to it. sides: only or without, lists. opening: "
        "towards, px wide or factor. close, open, escape-proof. arrange: demands, fields of a "
        "group. target: to an id; only robots (a count or numbers), the rest stay. merge. place: "
        "robot to [x, y], by [dx, dy] or target. heading: to. keep-out: ids, px. group: else all."
    ),
    "properties": {"kind": {"type": "string"}, **{name: {} for name in _NAMES}},
    "required": ["kind"],
}
"""The short form of the union that models are offered; the union itself reports what is invalid."""

Edit = Annotated[
    Offset
    | Distance
    | Spacing
    | Rotate
    | Mirror
    | Shift
    | Scale
    | Add
    | Remove
    | Count
    | Swap
    | SideOnly
    | Skip
    | Sides
    | Opening
    | Closure
    | Arrange
    | Target
    | Merge
    | Place
    | Heading
    | KeepOff,
    Field(discriminator="kind"),
    WithJsonSchema(EDIT_SCHEMA),
]
