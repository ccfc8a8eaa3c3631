"""What a file says of robots whose poses were recorded, and the recording."""

import csv
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from ..errors import InputError
from ..formation.value import Value
from .moving import Above0
from .physics import RobotId
from .wire.frame import RobotFrame

MOST_BYTES = 50_000_000


class RecordedSettings(Value):
    """Robots whose poses were recorded; lengths are in the robots' frame.

    Attributes:
        file: .csv whose first line names its columns, or .jsonl: time (s), robot, x, y and, where
            it is known, heading (radians, about x towards y). Its path is from the fleet's file.
        radius: of a robot.
        frame: how the robots' frame lies in the picture.
        pace: real, or fast: each look sees the next moment.
    """

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    radius: Above0
    frame: RobotFrame = RobotFrame(y="down")
    pace: Literal["real", "fast"] = "real"


class Row(Value):
    """A robot at a moment."""

    time: float = Field(ge=0, le=1e10)
    robot: RobotId
    x: float = Field(ge=-1e6, le=1e6)
    y: float = Field(ge=-1e6, le=1e6)
    heading: float | None = Field(default=None, allow_inf_nan=False)


def recorded_rows(path: Path) -> list[Row]:
    """The rows of a recording, by their time.

    Raises:
        InputError: it cannot be read, or a line of it is no row; names the line.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path} is larger than {MOST_BYTES:,} bytes; cut it.")
        with path.open(encoding="utf-8", newline="") as lines:
            found = _checked_rows(path, csv.DictReader(lines) if path.suffix == ".csv" else lines)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path} cannot be read: {why}.") from None
    if not found:
        raise InputError(f"{path} has no poses; record some.")
    return sorted(found, key=lambda row: row.time)


def _checked_rows(path: Path, lines: Iterable[str | dict[str | Any, str | Any]]) -> list[Row]:
    rows: list[Row] = []
    for number, line in enumerate(lines, start=1 if path.suffix != ".csv" else 2):
        try:
            row: Any = json.loads(line) if isinstance(line, str) else line
            if isinstance(line, dict):
                row = {name: value for name, value in line.items() if value != ""}
            rows.append(Row.model_validate(row))
        except (ValidationError, ValueError, RecursionError) as error:
            raise InputError(f"{path}, line {number}, is no pose: {_why(error)}.") from None
    return rows


def _why(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg'].lower()}"
    return str(error)
