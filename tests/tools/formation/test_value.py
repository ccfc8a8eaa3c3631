"""The base of all values: they neither change nor take what they do not know."""

import pytest
from formup.tools.formation.value import Value
from pydantic import ValidationError


class Named(Value):
    name: str


def test_a_value_does_not_change_and_takes_nothing_it_does_not_know() -> None:
    value = Named(name="a")
    with pytest.raises(ValidationError, match="frozen"):
        value.name = "b"  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(ValidationError, match="Extra inputs"):
        Named.model_validate({"name": "a", "walls": True})
