"""Reads a run's folder for looking at: its suite, its rows, and what was kept of each trial.

Nothing of what was kept is trusted to be whole: what cannot be read is said to be missing.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from ...agent.store.folder import read_events
from ...tools.errors import InputError
from ..experiments.journal import Arm
from ..experiments.methods import kept_as
from ..experiments.trials import TrialRow
from ..tasks.stored_suite import ATTEMPTS, KeptSuite, Point, read_suite

LONGEST = 4_000
"""Characters shown of one text of a transcript."""


class _Verdict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    right: tuple[bool, ...] = ()


class Kept(BaseModel):
    """What was kept of a trial.

    Attributes:
        planned, observed: positions, px; None for none.
        found: outlines robots were placed about, px.
        said: what the person was told.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    said: str = ""
    planned: tuple[Point, ...] | None = None
    observed: tuple[Point, ...] | None = None
    found: tuple[tuple[Point, ...], ...] = ()
    graded: _Verdict = Field(default_factory=_Verdict)

    @property
    def right(self) -> tuple[bool, ...]:
        """Whether each robot observed stands right; where nobody was to move, none does."""
        count = len(self.observed or ())
        return self.graded.right if len(self.graded.right) == count else (False,) * count


@dataclass(frozen=True)
class Said:
    """A text of a transcript: who, perhaps about which tool, what."""

    who: str
    tool: str
    text: str
    left_out: int = 0


@dataclass(frozen=True)
class Side:
    """The rows of a run that are shown, and its folder.

    Attributes:
        called: A or B where two are compared, else nothing.
    """

    folder: Path
    suite: KeptSuite
    rows: tuple[TrialRow, ...]
    called: str = ""

    @property
    def arms(self) -> list[Arm]:
        """In order of their names."""
        arms = {arm.name: arm for arm in map(Arm.of, self.rows)}
        return [arms[name] for name in sorted(arms)]

    def of(self, arm: Arm) -> list[TrialRow]:
        """The rows of an arm."""
        return [row for row in self.rows if Arm.of(row) == arm]

    def kept(self, row: TrialRow) -> Kept | None:
        """What was kept of a trial; None for nothing that can be read."""
        try:
            content = json.loads(self._file(row, "json").read_bytes())
            # A model may have written half of a surrogate pair, which is no text.
            whole = json.dumps(content, ensure_ascii=False).encode("utf-8", "replace")
            return Kept.model_validate_json(whole)
        except (OSError, ValueError, RecursionError):
            return None

    def transcript(self, row: TrialRow) -> list[Said] | None:
        """What was said in a trial, texts and calls alone; None where no trace was kept."""
        path = self._file(row, "jsonl")
        if not path.exists():
            return None
        try:
            lines = [e.data for e in read_events(path) if e.kind == "message"]
        except InputError:
            return [Said("", "", "The trace cannot be read.")]
        return [said for line in lines for said in _said(line)]

    def _file(self, row: TrialRow, suffix: str) -> Path:
        return self.folder / ATTEMPTS / f"{kept_as(row)}.{suffix}"


def side(folder: Path, rows: Sequence[TrialRow], called: str = "") -> Side:
    """A run to be shown.

    Raises:
        InputError: the folder keeps nothing of its suite.
    """
    return Side(folder, read_suite(folder), tuple(rows), called)


def _said(line: Mapping[str, Any]) -> list[Said]:
    """A message of a trace as texts."""
    if line["role"] == "user":
        return [_cut("person", "", line.get("text", ""))]
    if line["role"] == "tool":
        error = f"{line['error']}: " if line.get("error") else ""
        return [_cut("result", line["name"], error + line.get("text", ""))]
    texts = [_cut("model", "", line["text"])] if line.get("text") else []
    calls = [
        (c["name"], json.dumps(c["arguments"], ensure_ascii=False)) for c in line.get("calls", ())
    ]
    return texts + [_cut("call", *call) for call in calls]


def _cut(who: str, tool: str, text: str) -> Said:
    return Said(who, tool, text[:LONGEST], max(0, len(text) - LONGEST))
