"""JSON Schemas as Markdown tables: a row for each key, with its type, default and meaning."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

Schema = Mapping[str, Any]
LIMITS = {
    "minimum": "≥\u00a0{}",
    "exclusiveMinimum": ">\u00a0{}",
    "maximum": "≤\u00a0{}",
    "exclusiveMaximum": "<\u00a0{}",
    "minItems": "items\u00a0≥\u00a0{}",
    "maxItems": "items\u00a0≤\u00a0{}",
    "minLength": "length\u00a0≥\u00a0{}",
    "maxLength": "length\u00a0≤\u00a0{}",
    "pattern": "matches\u00a0`{}`",
}


def prose(text: object) -> str:
    """Text on one line that Markdown shows as it stands, but for `code`."""
    parts = re.split(r"(`[^`]*`)", " ".join(str(text).split()))
    parts[::2] = [re.sub(r"([\\*_<>\[\]#$~])", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def code(text: object) -> str:
    """A code span."""
    return f"`{text}`"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table, or nothing if it has no rows."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    if not lines:
        return ""
    return "\n".join([f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *lines]) + "\n"


def described(schema: Schema) -> tuple[str, dict[str, str]]:
    """What a schema's description says of the whole, and of each key under `Attributes:`."""
    whole, _, listed = schema.get("description", "").partition("\n\nAttributes:\n")
    found = re.findall(r"^ {4}(\w+): (.*(?:\n {5,}.*)*)", listed, re.MULTILINE)
    return prose(whole), {name: prose(text) for name, text in found}


def type_of(schema: Schema, page: str) -> str:
    """A type in words; types with a name link to their section of the page."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{title_of(name)}](#{page}-{name})"
    for key in ("anyOf", "oneOf"):
        if key in schema:
            kinds = [kind for kind in schema[key] if kind != {"type": "null"}]
            return " or ".join(dict.fromkeys(type_of(kind, page) for kind in kinds))
    if "const" in schema:
        return code(schema["const"])
    if "enum" in schema:
        return ", ".join(code(value) for value in schema["enum"])
    if schema.get("type") == "array":
        items = [*schema.get("prefixItems", ()), *([schema["items"]] if "items" in schema else [])]
        inside = ", ".join(dict.fromkeys(type_of(item, page) for item in items if item))
        kind = f"list of {inside}" if inside else "list"
    else:
        kind = str(schema.get("type", "any"))
    return ", ".join([kind, *limits(schema)])


def limits(schema: Schema) -> Iterator[str]:
    """What a schema demands of a value beside its type."""
    hidden = {"minimum"} if "exclusiveMinimum" in schema else set[str]()
    if "minItems" in schema and schema["minItems"] == schema.get("maxItems"):
        hidden |= {"minItems", "maxItems"}
        yield f"{schema['minItems']}\u00a0items"
    for key, text in LIMITS.items():
        if key in schema and key not in hidden:
            value = schema[key]
            yield prose(text.format(value if isinstance(value, str) else f"{value:,.10g}"))


def title_of(name: str) -> str:
    """The name of a type without the module that two of one name are told apart by."""
    return name.rpartition("__")[2]


def rows(schema: Schema, page: str, before: str = "") -> Iterator[list[str]]:
    """A row for each key; keys of an object without a name of its own follow it, with a dot."""
    _, meanings = described(schema)
    for name, kind in schema.get("properties", {}).items():
        needed = name in schema.get("required", ())
        default = kind.get("default")
        shown = "" if default in (None, "", [], {}) else code(json.dumps(default).strip('"'))
        inner = kind.get("items", kind) if kind.get("type") == "array" else kind
        meaning = " ".join(filter(None, dict.fromkeys(described(k)[0] for k in (kind, inner))))
        cells = ["required" if needed else shown, meanings.get(name, meaning)]
        yield [code(before + name), type_of(kind, page), *cells]
        if "properties" in inner:
            dots = f"{before}{name}[]." if inner is not kind else f"{before}{name}."
            yield from rows(inner, page, dots)


def fields(schema: Schema, page: str) -> str:
    """The keys of an object as a table."""
    return table(("key", "type", "default", "meaning"), rows(schema, page))


def types(schemas: Mapping[str, Schema], page: str, level: str = "##") -> Iterator[str]:
    """A section for each type with a name, which links of the page lead to."""
    for name, schema in schemas.items():
        whole, _ = described(schema)
        yield f"({page}-{name})=\n{level} {title_of(name)}\n"
        yield whole + "\n"
        yield fields(schema, page) or type_of(schema, page) + "\n"
