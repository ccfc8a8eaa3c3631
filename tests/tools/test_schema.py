"""The schemas models read: short, and true to what the tools accept."""

import json
from typing import Any

import jsonschema
import pytest
from formup.tools.builtin import TOOLS
from formup.tools.errors import ArgumentsError
from formup.tools.tool import Tool

GROUP: dict[str, Any] = {"relation": "around", "targets": ["t1"], "robots": 6}
ACCEPTED: list[tuple[str, dict[str, Any]]] = [
    ("look", {}),
    ("look", {"region": [1, 2, 3, 4], "candidates": True}),
    ("locate_object", {"query": {"colours": ["red"], "picks": [{"by": "largest"}]}}),
    (
        "locate_object",
        {"query": {"relations": [{"kind": "between", "things": ["c3", {"shapes": ["circle"]}]}]}},
    ),
    ("segment", {"outline": [[1, 2], [3, 4], [5, 2.5]], "negative": [[3, 3]]}),
    ("measure", {"a": "t1", "b": [3, 4]}),
    ("propose_formation", {"contract": {"groups": [GROUP]}}),
    (
        "propose_formation",
        {
            "contract": {"groups": [GROUP | {"clearance": [1, 2]}], "keep_out": ["t2"]},
            "targets": [{"id": "t1", "box": [1, 2, 3, 4]}],
            "positions": [[1, 2]] * 6,
        },
    ),
    ("deploy", {}),
    ("deploy", {"plan_id": "p-1", "tell": "done"}),
]
REFUSED: list[tuple[str, dict[str, Any]]] = [
    ("look", {"region": [1, 2, 3]}),
    ("locate_object", {"query": {"colours": ["reddish"]}}),
    ("locate_object", {"query": {"relations": [{"kind": "above", "things": [{"size": 3}]}]}}),
    ("segment", {"outline": [[1, 2, 3]]}),
    ("measure", {"b": "t1"}),
    ("propose_formation", {"contract": {"groups": []}}),
    ("propose_formation", {"contract": {"groups": [GROUP | {"relation": "near"}]}}),
    ("propose_formation", {"contract": {"groups": [GROUP | {"robots": 0}]}}),
    ("propose_formation", {"contract": {"groups": [GROUP | {"distance": 3}]}}),
    ("deploy", {"plan": "p-1"}),
]


def tool(name: str) -> Tool:
    return next(t for t in TOOLS if t.name == name)


@pytest.mark.parametrize(("name", "arguments"), ACCEPTED)
def test_what_the_schema_allows_the_tool_takes(name: str, arguments: dict[str, Any]) -> None:
    jsonschema.validate(arguments, tool(name).schema)
    tool(name).parse(arguments)


@pytest.mark.parametrize(("name", "arguments"), REFUSED)
def test_what_the_schema_forbids_the_tool_refuses(name: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(arguments, tool(name).schema)
    with pytest.raises(ArgumentsError):
        tool(name).parse(arguments)


@pytest.mark.parametrize("chosen", TOOLS, ids=lambda t: t.name)
def test_schemas_are_valid_and_say_nothing_twice(chosen: Tool) -> None:
    schema = chosen.schema
    jsonschema.Draft202012Validator.check_schema(schema)
    written = json.dumps(schema)
    assert '"title"' not in written
    assert '"null"' not in written
    for name in schema.get("$defs", {}):
        assert written.count(f'"#/$defs/{name}"') > 1
    assert len(written) < 0.9 * len(json.dumps(chosen.arguments.model_json_schema()))


def test_a_null_is_taken_where_something_may_be_left_out() -> None:
    parsed = tool("deploy").parse({"plan_id": None, "tell": None})
    assert parsed == tool("deploy").parse({})
