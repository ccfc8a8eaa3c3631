"""Fleets that a file describes: YAML, a mapping whose `fleet` names the fleet it is for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from ..errors import InputError
from ..formation.value import Value
from .mqtt.settings import MqttSettings
from .physics import Physics
from .protocol import Fleet, FleetFactory, FleetRequest
from .recording import RecordedSettings
from .registry import FLEETS
from .ros.settings import RosSettings

Model = TypeVar("Model", bound=Value)
KINDS: Mapping[str, type[Value]] = {
    "mqtt": MqttSettings,
    "recorded": RecordedSettings,
    "ros": RosSettings,
}
"""What a file says of robots that are not simulated, by its `fleet`."""
SUFFIXES = (".yaml", ".yml")
MOST_BYTES = 1_000_000


@dataclass(frozen=True)
class Described:
    """A simulated fleet as its file has it.

    Attributes:
        given: of `Physics`, what the file says.
        pace: how fast simulated time passes.
    """

    path: Path
    given: Mapping[str, Any]
    pace: Literal["fast", "real"]

    def physics(self, usual: Mapping[str, Any]) -> Physics:
        """What robots can do where the file is silent about what is usual.

        Raises:
            InputError: the file says what cannot be; names every mistake.
        """
        return _validated(self.path, Physics, {**usual, **self.given})


def fleet_named(name: str) -> FleetFactory:
    """What opens the fleet of a name, or the one that a file describes.

    Raises:
        InputError: there is none, or the file does not describe one.
    """
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES:
        if name in KINDS:
            raise InputError(f"The fleet {name!r} is described by a file: --fleet FILE.yaml.")
        return FLEETS.load(name)
    kind = _content(path).get("fleet")
    if not isinstance(kind, str):
        raise InputError(f"{path} does not say `fleet`: one of {', '.join(FLEETS.names())}.")
    load: Callable[[FleetRequest], Fleet] = FLEETS.load(kind)
    if kind == "simulated":
        described(path).physics({"speed": 1.0, "acceleration": 1.0})
    if kind in KINDS:
        described_as(KINDS[kind], path)
    return lambda request: load(replace(request, config=path))


def described(path: Path) -> Described:
    """The simulated fleet of a file.

    Raises:
        InputError: it cannot be read, or has another pace than there is.
    """
    content = _content(path)
    content.pop("fleet", None)
    pace = content.pop("pace", "fast")
    if pace not in ("fast", "real"):
        raise InputError(f"{path}: pace is fast or real, got {pace!r}.")
    return Described(path, content, pace)


def described_as(kind: type[Model], path: Path) -> Model:
    """What a file says of robots of a kind, which may be `WireSettings`: all that are elsewhere.

    Raises:
        InputError: it cannot be read, or does not describe such; names every mistake.
    """
    content = _content(path)
    found = KINDS.get(str(content.pop("fleet", None)))
    if found is None or not issubclass(found, kind):
        kinds = (f"`fleet: {name}`" for name, model in KINDS.items() if issubclass(model, kind))
        raise InputError(f"{path} describes other robots; begin it with {' or '.join(kinds)}.")
    return _validated(path, found, content)


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a fleet's file."""
    pace = {"pace": {"enum": ["fast", "real"], "default": "fast"}}
    usual = "speed", "acceleration"  # depend on the picture where a file leaves them out
    simulated = _file_of("simulated", Physics, pace, usual)
    files = [simulated, *(_file_of(kind, model) for kind, model in KINDS.items())]
    shared = {name: value for file in files for name, value in file.pop("$defs").items()}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A fleet",
        "oneOf": files,
        "$defs": shared,
    }


def _file_of(
    kind: str, model: type[Value], more: dict[str, Any] | None = None, optional: Sequence[str] = ()
) -> dict[str, Any]:
    made = model.model_json_schema()
    fields: dict[str, Any] = made["properties"]
    made["properties"] = {"fleet": {"const": kind}, **(more or {}), **fields}
    made["required"] = ["fleet", *(name for name in made["required"] if name not in optional)]
    return made


def _validated(path: Path, model: type[Model], given: Mapping[str, Any]) -> Model:
    try:
        return model.model_validate(given)
    except ValidationError as error:
        wrong = "; ".join(_mistake(found) for found in error.errors())
        raise InputError(f"{path} does not describe a fleet: {wrong}.") from None


def _mistake(found: ErrorDetails) -> str:
    where = ".".join(map(str, found["loc"]))
    if found["type"] == "extra_forbidden":
        return f"{where}: no such key"
    if found["type"] == "value_error":  # a sentence of ours, which says what was given if it may
        return f"{where}: {found.get('ctx', {})['error']}".removeprefix(": ")
    return f"{where}: {found['msg'].lower()}, got {found['input']!r}"


def _content(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path} is larger than {MOST_BYTES:,} bytes; describe one fleet.")
        content: Any = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        where = " ".join(str(error).split())
        raise InputError(f"{path} is not YAML: {where}.") from None
    if not isinstance(content, dict):
        raise InputError(f"{path} describes no fleet; begin it with a line `fleet: simulated`.")
    return {str(key): value for key, value in cast("dict[Any, Any]", content).items()}


class _Loader(yaml.SafeLoader):
    """YAML in which nothing is said twice, as one of the two would go unheard."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [key.value for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.YAMLError(f"{key!r} is said more than once")
        return super().construct_mapping(node, deep)
