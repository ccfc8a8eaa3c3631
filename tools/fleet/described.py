"""Fleets that a file describes: YAML, a mapping whose `fleet` names the fleet it is for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast

import yaml
from pydantic import ValidationError

from ..errors import InputError
from .physics import Physics
from .protocol import Fleet, FleetFactory, FleetRequest
from .registry import FLEETS

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
        try:
            return Physics.model_validate({**usual, **self.given})
        except ValidationError as error:
            wrong = "; ".join(
                f"{'.'.join(map(str, e['loc']))}: no such key"
                if e["type"] == "extra_forbidden"
                else f"{'.'.join(map(str, e['loc']))}: {e['msg'].lower()}, got {e['input']!r}"
                for e in error.errors()
            )
            raise InputError(f"{self.path} does not describe a fleet: {wrong}.") from None


def fleet_named(name: str) -> FleetFactory:
    """What opens the fleet of a name, or the one that a file describes.

    Raises:
        InputError: there is none, or the file does not describe one.
    """
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES:
        return FLEETS.load(name)
    kind = _content(path).get("fleet")
    if not isinstance(kind, str):
        raise InputError(f"{path} does not say `fleet`: one of {', '.join(FLEETS.names())}.")
    load: Callable[[FleetRequest], Fleet] = FLEETS.load(kind)
    if kind == "simulated":
        described(path).physics({"speed": 1.0, "acceleration": 1.0})
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
