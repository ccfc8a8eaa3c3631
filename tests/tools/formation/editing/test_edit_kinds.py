"""The union of edits and the flat schema that models are offered say the same."""

from typing import Any, get_args

import pytest
from formup.tools.formation.editing.edit_kinds import EDIT_SCHEMA, Edit
from formup.tools.formation.editing.edit_rules import RULES
from formup.tools.formation.editing.ring_rules import RING_RULES
from formup.tools.formation.editing.team_rules import TEAM_RULES
from pydantic import TypeAdapter, ValidationError

ADAPTER: TypeAdapter[Any] = TypeAdapter(Edit)
KINDS = list(get_args(get_args(Edit)[0]))


def kinds_of(model: Any) -> list[str]:
    return list(get_args(model.model_fields["kind"].annotation))


FOR_HANDS = {"stays"}
"""What a page gives with a robot that is dragged, and models are not offered."""


def test_the_schema_offered_names_every_field_and_kind() -> None:
    assert ADAPTER.json_schema() == EDIT_SCHEMA
    fields = {name for model in KINDS for name in model.model_fields}
    assert set(EDIT_SCHEMA["properties"]) == fields - FOR_HANDS
    for model in KINDS:
        for kind in kinds_of(model):
            assert kind in EDIT_SCHEMA["description"]


def test_every_kind_has_a_rule() -> None:
    kinds = {kind for model in KINDS for kind in kinds_of(model)}
    assert kinds == {*RULES, *RING_RULES, *TEAM_RULES}


@pytest.mark.parametrize(
    "edit",
    [
        {"kind": "spacing"},
        {"kind": "sides", "only": ["left"], "without": ["top"]},
        {"kind": "sides", "only": []},
        {"kind": "place", "robot": 1},
        {"kind": "place", "robot": 1, "to": [3, 4], "stays": "far"},
        {"kind": "place", "robot": 1, "to": [3, 4], "by": [1, 1]},
        {"kind": "place", "robot": 0, "to": [3, 4]},
        {"kind": "count", "robots": "many"},
        {"kind": "target", "to": "t2", "robots": []},
        {"kind": "keep-out", "ids": []},
        {"kind": "distance", "px": -1},
        {"kind": "merge", "group": 1},
    ],
    ids=str,
)
def test_what_is_no_edit_is_refused(edit: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ADAPTER.validate_python(edit)


@pytest.mark.parametrize(
    "edit",
    [
        {"kind": "out"},
        {"kind": "in", "px": 3, "factor": 2},
        {"kind": "out", "px": -1},
        {"kind": "remove"},
        {"kind": "remove", "n": 1, "robots": [2]},
        {"kind": "skip", "robots": []},
        {"kind": "rotate", "degrees": float("nan")},
        {"kind": "scale", "factor": 0},
        {"kind": "wiggle"},
    ],
    ids=str,
)
def test_what_is_no_edit_is_refused_where_it_comes_in(edit: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        ADAPTER.validate_python(edit)
