"""The typed inputs of a prompt: which values are allowed and how they are written in the text."""

import json
import math
from typing import Annotated, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    StringConstraints,
    model_validator,
)


def _quoted_name(name: object) -> object:
    if isinstance(name, bool):
        raise ValueError("YAML reads on, yes, off and no as true and false; put a name in quotes")
    return name


Value = StrictStr | StrictBool | StrictInt | StrictFloat
InputName = Annotated[
    str, BeforeValidator(_quoted_name), StringConstraints(pattern=r"^[a-z_][a-z0-9_]*$")
]
LARGEST = 2**63
"""The magnitude of an integer must be less than this."""


class Input(BaseModel):
    """One input of a prompt.

    Attributes:
        min: smallest number allowed; `max` is the largest.
        max_chars: largest length of a string.
        enum: the only values allowed; if empty, any.
        example: a sample value for trying the prompt out.
        default: used if no value is given; a run gives none.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    type: Literal["string", "integer", "number", "boolean"]
    description: str = ""
    min: StrictInt | StrictFloat | None = None
    max: StrictInt | StrictFloat | None = None
    max_chars: Annotated[int, Field(strict=True, ge=1)] | None = None
    enum: tuple[Value, ...] = ()
    example: Value | None = None
    default: Value | None = None

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        """Check that the bounds suit the type, and that example, default and enum suit both."""
        if self.type not in ("integer", "number") and (self.min, self.max) != (None, None):
            raise ValueError(f"min and max are for numbers, not for a {self.type}")
        if self.type != "string" and self.max_chars is not None:
            raise ValueError(f"max_chars is for strings, not for {self.type}s")
        named = {"example": self.example, "default": self.default}
        for key, value in [*((k, v) for k, v in named.items()), *(("enum", v) for v in self.enum)]:
            problem = None if value is None else self.problem(value)
            if problem is not None:
                raise ValueError(f"{key} {problem}")
        return self

    def problem(self, value: object) -> str | None:
        """Return what is wrong with a value, as the rest of a sentence; None if it is valid."""
        shown = _short_repr(value)
        if not self._is_of_type(value):
            return f"{shown} is no {self.type}"
        if isinstance(value, str) and len(value) > (self.max_chars or math.inf):
            return f"has {len(value)} characters; {self.max_chars} are allowed"
        if isinstance(value, int | float) and not isinstance(value, bool):
            if self.min is not None and value < self.min:
                return f"{shown} is below {self.min}"
            if self.max is not None and value > self.max:
                return f"{shown} is above {self.max}"
        if self.enum and value not in self.enum:
            return f"{shown} is none of {', '.join(map(self.written, self.enum))}"
        return None

    def written(self, value: object) -> str:
        """Return a value as it is written in the text: a string as it is, others as JSON."""
        return value if isinstance(value, str) else json.dumps(value)

    def read(self, text: str) -> object:
        """Parse what a person typed: a string as it is, others as JSON; the text if that fails."""
        try:
            return text if self.type == "string" else json.loads(text)
        except (ValueError, RecursionError):
            return text

    def _is_of_type(self, value: object) -> bool:
        if self.type == "string":
            return isinstance(value, str)
        if self.type == "boolean" or isinstance(value, bool):
            return self.type == "boolean" and isinstance(value, bool)
        if isinstance(value, int):
            return abs(value) < LARGEST
        return self.type == "number" and isinstance(value, float) and math.isfinite(value)


def _short_repr(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a vast number"
    return text if len(text) < 60 else f"{text[:57]}..."
