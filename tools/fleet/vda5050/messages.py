"""Messages of VDA 5050: what goes out and what comes in is held against the official schemas.

These let any field pass that they do not name, and so every mistyped one; here none goes out.
"""

import json
from collections import Counter
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

from .settings import Vda5050Settings
from .spec import Version

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

SCHEMAS = Path(__file__).parents[3] / "vendor/vda5050"


def mistake(
    version: Version, kind: str, message: Mapping[str, Any], *, strict: bool = True
) -> str | None:
    """What is wrong with a message, and where; None for nothing.

    Args:
        kind: the last level of its topic.
        strict: whether fields that the schema does not name are wrong.
    """
    found = next(_validator(version, kind, strict).iter_errors(message), None)
    return None if found is None else f"{found.json_path}: {found.message[:150]}"


def read(version: Version, kind: str, payload: bytes) -> dict[str, Any] | None:
    """A message that came; None where it is none of the kind."""
    try:
        message: Any = json.loads(payload, parse_constant=_no_number)
    except (ValueError, RecursionError):
        return None
    return None if mistake(version, kind, message, strict=False) else message


class Writer:
    """Puts headers on messages, each of which counts for its topic."""

    def __init__(self, settings: Vda5050Settings) -> None:
        self._settings = settings
        self._counts = Counter[tuple[str, str]]()

    def message(self, robot: str, kind: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """A message that is valid.

        Raises:
            RuntimeError: it would not be; none such goes out.
        """
        maker, serial = self._settings.named(robot)
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        message = {
            "headerId": self._counts[robot, kind],
            "timestamp": now.replace("+00:00", "Z"),
            "version": self._settings.dialect.number,
            "manufacturer": maker,
            "serialNumber": serial,
            **body,
        }
        self._counts[robot, kind] += 1
        if wrong := mistake(self._settings.version, kind, message):
            raise RuntimeError(f"a message of the kind {kind} is not valid: {wrong}")
        return message

    def last(self, robot: str, kind: str) -> int:
        """The number of the last message of a kind."""
        return self._counts[robot, kind] - 1


def action(kind: str, name: str) -> dict[str, Any]:
    """An action to be done at once.

    Args:
        kind: as `cancelOrder`.
        name: which tells it from all others.
    """
    return {"actionType": kind, "actionId": name, "blockingType": "NONE"}


@cache
def _validator(version: Version, kind: str, strict: bool) -> "Draft202012Validator":
    from jsonschema import Draft202012Validator

    schema = json.loads((SCHEMAS / version / f"{kind}.schema").read_bytes())
    return Draft202012Validator(_nothing_else(schema) if strict else schema)


def _nothing_else(schema: Any) -> Any:
    """A schema that takes no fields that it does not name."""
    if isinstance(schema, list):
        return [_nothing_else(part) for part in cast("list[Any]", schema)]
    if not isinstance(schema, dict):
        return schema
    parts = cast("dict[str, Any]", schema)
    closed = {key: _nothing_else(part) for key, part in parts.items()}
    named = isinstance(parts.get("properties"), dict) and "type" in parts
    return closed | {"additionalProperties": False} if named else closed


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")
