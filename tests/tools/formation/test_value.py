"""Fields that came later leave what was written before them as it was."""

import pytest
from formup.tools.formation.value import Value
from pydantic import Field, ValidationError


class Before(Value):
    name: str


class After(Value):
    later = frozenset({"walls", "seen"})
    name: str
    walls: bool | None = None
    seen: dict[str, int] = Field(default_factory=dict)


def test_what_says_nothing_is_not_written() -> None:
    assert After(name="a").model_dump_json() == Before(name="a").model_dump_json()
    assert After(name="a", seen={"b": 1}).model_dump() == {"name": "a", "seen": {"b": 1}}


def test_what_differs_from_its_default_is_written_though_it_is_false() -> None:
    written = After(name="a", walls=False)
    assert written.model_dump() == {"name": "a", "walls": False}
    assert After.model_validate(written.model_dump()) == written


def test_a_value_does_not_change_and_takes_nothing_it_does_not_know() -> None:
    value = Before(name="a")
    with pytest.raises(ValidationError, match="frozen"):
        value.name = "b"  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(ValidationError, match="Extra inputs"):
        Before.model_validate({"name": "a", "walls": True})
