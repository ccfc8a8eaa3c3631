"""Fleets that a file describes: YAML, a mapping whose `fleet` names the fleet it is for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

from ..errors import InputError
from ..formation.value import Value
from ..yaml_files import content_of, validated
from .mqtt.settings import MqttSettings
from .physics import Physics
from .protocol import Fleet, FleetFactory, FleetRequest
from .recording import RecordedSettings
from .registry import FLEETS
from .ros.settings import RosSettings
from .vda5050.settings import Vda5050Settings
from .wire.settings import WireSettings

KINDS: Mapping[str, type[Value]] = {
    "mqtt": MqttSettings,
    "recorded": RecordedSettings,
    "ros": RosSettings,
    "vda5050": Vda5050Settings,
}
"""What a file says of robots that are not simulated, by its `fleet`."""
Model = TypeVar("Model", bound=Value)
Wire = TypeVar("Wire", bound=WireSettings)
SUFFIXES = (".yaml", ".yml")
BEGIN = "fleet: simulated"


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
        return validated(self.path, "a fleet", Physics, {**usual, **self.given})


def fleet_named(name: str) -> FleetFactory:
    """What opens the fleet of a name, or the one that a file describes.

    Raises:
        InputError: there is none, or the file does not describe one.
    """
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES:
        if name in KINDS:
            raise InputError(
                f"The fleet {name!r} is described by a file; give FILE.yaml as the fleet."
            )
        return FLEETS.load(name)
    kind = content_of(path, BEGIN).get("fleet")
    if not isinstance(kind, str):
        raise InputError(f"{path} does not say `fleet`: one of {', '.join(FLEETS.names())}.")
    load: Callable[[FleetRequest], Fleet] = FLEETS.load(kind)
    if kind == "simulated":
        described(path).physics({"speed": 1.0, "acceleration": 1.0})
    if kind in KINDS:
        described_as(KINDS[kind], path)
    return lambda request: load(replace(request, config=path))


def stated_radius(name: str) -> float | None:
    """The radius of a robot that a fleet's file states, px of the picture; None where none does.

    Raises:
        InputError: the file does not describe a fleet.
    """
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES:
        return None
    content = content_of(path, BEGIN)
    if content.get("fleet") in KINDS:
        settings = described_as(KINDS[content["fleet"]], path)
        return settings.pixels(settings.radius) if isinstance(settings, WireSettings) else None
    radius = content.get("radius")
    return float(radius) if isinstance(radius, int | float) else None


def described(path: Path) -> Described:
    """The simulated fleet of a file.

    Raises:
        InputError: it cannot be read, or has another pace than there is.
    """
    content = content_of(path, BEGIN)
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
    if not path.suffix and not path.exists():
        raise InputError(f"{path} is no file; give the YAML file of a fleet (docs/fleets.md).")
    content = content_of(path, BEGIN)
    found = KINDS.get(str(content.pop("fleet", None)))
    if found is None or not issubclass(found, kind):
        kinds = (f"`fleet: {name}`" for name, model in KINDS.items() if issubclass(model, kind))
        raise InputError(f"{path} describes other robots; begin it with {' or '.join(kinds)}.")
    settings = validated(path, "a fleet", found, content)
    if isinstance(settings, WireSettings) and settings.camera is not None:
        camera, frame = settings.camera.beside(path.parent)
        settings = settings.model_copy(update={"camera": camera, "frame": frame})
    return settings


def described_for(kind: type[Wire], request: FleetRequest) -> Wire:
    """What the file of a request says of robots of a kind that are elsewhere.

    Raises:
        InputError: as of `described_as`; or the file's camera has not seen the request's picture.
    """
    assert request.config is not None  # see `fleet_named`
    settings = described_as(kind, request.config)
    if settings.camera is not None:
        settings.camera.check_seen(request.size)
    return settings


def to_be_stopped(path: Path) -> WireSettings:
    """What a file says of robots that can be stopped by another process than the one that drives.

    Raises:
        InputError: it cannot be read, or does not describe such; names every mistake.
    """
    kind = content_of(path, BEGIN).get("fleet")
    if kind == "simulated":
        raise InputError(
            f"{path} describes simulated robots: they are in the program that drives them, so "
            "there is nothing to be stopped from outside; stop them there, with Ctrl-C."
        )
    if kind == "recorded":
        raise InputError(
            f"{path} describes recorded robots: they are never driven, so there is nothing to be "
            "stopped."
        )
    return described_as(WireSettings, path)


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
