"""The query language in which a language model describes the thing it means.

Apart from nouns, it has only enumerations and numbers, so that every word has one measured meaning.
"""

from collections.abc import Callable
from typing import Annotated, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from .attributes import ColourName, ShapeName

Shade = Literal["light", "dark"]
Trait = Literal["round", "long", "solid", "hollow", "whole"]
Ranking = Literal[
    "largest",
    "smallest",
    "longest",
    "roundest",
    "lightest",
    "darkest",
    "leftmost",
    "rightmost",
    "topmost",
    "bottommost",
    "upper_left",
    "upper_right",
    "lower_left",
    "lower_right",
    "middle",
    "farthest_from_border",
    "nearest_to_border",
]
"""Picks that order things, so that there is a second and a third."""
Oddness = Literal["odd", "odd_colour", "odd_size", "odd_shape", "askew"]
"""Picks of the one thing that differs from others that are alike."""
RelationKind = Literal[
    "left_of", "right_of", "above", "below", "nearest", "inside", "between", "beside"
]
CandidateId = Annotated[
    str, Field(pattern=r"^c[0-9]{1,4}$", description="Id of a candidate that was shown: c4")
]
SINGLE: tuple[str, ...] = ("alone", "odd", "odd_colour", "odd_size", "odd_shape", "askew")
"""Picks that at most one thing can win, so that there is no second place."""


class Pick(BaseModel):
    """A superlative, decided among the things that fit the rest of the description."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    by: Ranking | Literal["alone"] | Oddness = Field(
        description="upper_left and the like: nearest to that corner of the picture; middle: "
        "nearest to its centre; alone: farthest from its nearest neighbour; odd: unlike the "
        "others in any way; askew: turned unlike the others"
    )
    place: int = Field(
        default=1, ge=1, le=50, description="2 for the second largest, second from the left ..."
    )

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if self.place > 1 and self.by in SINGLE:
            raise ValueError(f"{self.by} has no place {self.place}; leave place out")
        return self


class Description(BaseModel):
    """Which thing is meant, by how it looks; all that is given must hold."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    noun: str = Field(default="", max_length=60, description="What it is, bare: car")
    colours: tuple[ColourName, ...] = Field(
        default=(), max_length=11, description="Its main colour is one of these"
    )
    shade: Shade | None = Field(default=None, description="Light or dark in its colour")
    shapes: tuple[ShapeName, ...] = Field(
        default=(), max_length=14, description="Its shape is one of these"
    )
    traits: tuple[Trait, ...] = Field(
        default=(),
        max_length=5,
        description="All of these hold; solid: no dents or holes; hollow: has a hole; whole: not "
        "cut by the picture's border",
    )
    picks: tuple[Pick, ...] = Field(
        default=(), max_length=4, description="Superlatives, in the order of their weight"
    )


class Relation(BaseModel):
    """Where the thing is, seen from another thing or between two others."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: RelationKind = Field(
        description="The thing is left_of, above ... the other; nearest: of all the nearest to it; "
        "beside: next to it, not on it"
    )
    things: tuple[CandidateId | Description, ...] = Field(
        min_length=1,
        max_length=2,
        description="The other thing: a candidate's id or a description; two for between",
    )

    @model_validator(mode="after")
    def _enough_things(self) -> Self:
        wanted = 2 if self.kind == "between" else 1
        if len(self.things) != wanted:
            other = "two other things" if wanted == 2 else "one other thing"
            raise ValueError(f"{self.kind} needs {other}; got {len(self.things)}")
        return self


class Query(Description):
    """Which thing is meant, by how it looks and where it is."""

    relations: tuple[Relation, ...] = Field(
        default=(), max_length=4, description="Where it is, seen from other things"
    )
    count: int | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="How many things fit it without the picks, where the words say: 2 for 'the "
        "larger of the two orange sweets'",
    )

    @property
    def nouns(self) -> tuple[str, ...]:
        """Every noun in it, including those of other things, once each."""
        others = (t for r in self.relations for t in r.things if isinstance(t, Description))
        return tuple(dict.fromkeys(t.noun for t in (self, *others) if t.noun))

    def with_nouns(self, change: Callable[[str], str]) -> "Query":
        """Return the query with every noun replaced by what `change` makes of it."""
        relations = tuple(
            r.model_copy(update={"things": tuple(_with_noun(t, change) for t in r.things)})
            for r in self.relations
        )
        return _with_noun(self.model_copy(update={"relations": relations}), change)


T = TypeVar("T")


def _with_noun(thing: T, change: Callable[[str], str]) -> T:
    if isinstance(thing, Description):
        return thing.model_copy(update={"noun": change(thing.noun)})
    return thing


def wording(description: Description) -> str:
    """Return the description in words, for use in a sentence: "the largest dark red one"."""
    picks = [
        f"{p.by} (place {p.place})" if p.place > 1 else p.by.replace("_", " ")
        for p in description.picks
    ]
    words = [*picks, *((description.shade,) if description.shade else ()), *description.traits]
    if description.colours:
        words.append(" or ".join(description.colours))
    shapes = " or ".join(description.shapes)
    words.append(" ".join(filter(None, (shapes, description.noun))) or "one")
    return " ".join(["the", *words])
