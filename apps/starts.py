"""`--starts FILE`: starting positions, in the formats that spreadsheets and programs write."""

import json
import re
from pathlib import Path

import numpy as np

from ..tools.errors import InputError
from ..tools.geometry.outline import FARTHEST
from ..tools.perception.target_prompt import Point
from ..tools.store import read_text

ACROSS = ("x", "col", "column")
COLUMN = re.compile(r"(x|y|col|column|row)[ _]*[\[(]?(?:px|pixels?)?[\])]?", re.IGNORECASE)
FORM = "give one x,y per line (x;y with decimal commas), or JSON [[x, y], ...], in pixels"


def starts(path: Path | None) -> tuple[Point, ...] | None:
    """Read starting positions (x, y), px, from JSON [[x, y], ...] or a table of two columns.

    A table may have comment lines (#), a header line that names its columns, in either order, and
    semicolons, tabs or blanks in place of commas; with semicolons or tabs, a comma is a decimal
    point.

    Raises:
        InputError: the file cannot be read, or holds anything but pairs of numbers in range.
    """
    if path is None:
        return None
    text = read_text(path)
    try:
        rows = (
            json.loads(text) if text.lstrip().startswith("[") else _table(text, f"--starts {path}")
        )
        values = np.asarray(rows, dtype=float)
    except (ValueError, TypeError, OverflowError, RecursionError):
        values = np.empty(0)
    pairs = values.ndim == 2 and values.shape[1:] == (2,)
    if not pairs or not (np.abs(values) <= FARTHEST).all():
        raise InputError(f"--starts {path} holds no usable positions; {FORM}.")
    return tuple(zip(values[:, 0].tolist(), values[:, 1].tolist(), strict=True))


def _table(text: str, name: str) -> list[list[float]]:
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1)]
    lines = [(n, line) for n, line in lines if line and not line.startswith("#")]
    between = next((mark for mark in ";\t," if any(mark in line for _, line in lines)), None)
    turned, rows = False, list[list[float]]()
    for n, line in lines:
        cells = [cell.strip(" \t\"'") for cell in line.rstrip(between).split(between)]
        columns = [found[1].lower() for cell in cells if (found := COLUMN.fullmatch(cell))]
        if not rows and len(columns) == len(cells) == 2:
            turned = columns[0] not in ACROSS
            continue
        if between in (";", "\t"):
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            x, y = map(float, cells)
        except ValueError:
            raise InputError(
                f"{name}, line {n}: {line[:60]!r} is not a position; {FORM}."
            ) from None
        rows.append([y, x] if turned else [x, y])
    return rows
