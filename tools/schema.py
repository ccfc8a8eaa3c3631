"""Makes JSON Schemas as short as they can be: models read, and people pay for, every word of them.

Titles repeat names, a null only says that something may be left out, and a definition that is used
once may as well be inlined.
"""

import json
from collections.abc import Mapping
from typing import Any, cast

from pydantic import BaseModel

BOUNDS = frozenset(
    f"{which}{what}" for which in ("min", "max") for what in ("imum", "Items", "Length")
) | {"exclusiveMinimum", "additionalProperties", "pattern", "default"}
"""What a schema says of values that a model need not be told, since errors say what is wrong."""


def compact_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return a schema (draft 2020-12) that accepts what the model's own does, except for nulls."""
    whole = model.model_json_schema()
    kinds = cast("dict[str, Any]", whole.pop("$defs", {}))
    written = json.dumps([whole, kinds])
    shared = {name for name in kinds if written.count(f'"#/$defs/{name}"') > 1}
    once = {name: kind for name, kind in kinds.items() if name not in shared}
    schema = _compact(whole, once)
    if shared:
        schema["$defs"] = {name: _compact(kinds[name], once) for name in sorted(shared)}
    return schema


def _compact(node: Any, once: Mapping[str, Any]) -> Any:
    if isinstance(node, list):
        return [_compact(item, once) for item in cast("list[Any]", node)]
    if not isinstance(node, dict):
        return node
    fields = cast("dict[str, Any]", node)
    name = str(fields.get("$ref", "")).removeprefix("#/$defs/")
    if name in once:
        return _compact({**once[name], **{k: v for k, v in fields.items() if k != "$ref"}}, once)
    made: dict[str, Any] = {}
    for key, value in fields.items():
        if key == "properties":  # here keys are names of properties
            made[key] = {name: _compact(kind, once) for name, kind in value.items()}
        elif key == "anyOf" and {"type": "null"} in value:
            given = [_compact(choice, once) for choice in value if choice != {"type": "null"}]
            made = given[0] | made if len(given) == 1 else made | {"anyOf": given}
        elif key == "description":
            made[key] = " ".join(value.split())
        elif not (key == "title" or (key == "default" and value in (None, [], ""))):
            made[key] = _compact(value, once)
    return made


def without_bounds(node: Any) -> Any:
    """Return a schema as offered to models: with every name, kind and choice, without BOUNDS."""
    if isinstance(node, list):
        return [without_bounds(item) for item in cast("list[Any]", node)]
    if not isinstance(node, dict):
        return node
    made: dict[str, Any] = {}
    for key, value in cast("dict[str, Any]", node).items():
        if key in ("properties", "$defs"):  # here keys are names of properties or definitions
            made[key] = {name: without_bounds(kind) for name, kind in value.items()}
        elif key not in BOUNDS:
            made[key] = without_bounds(value)
    return made
