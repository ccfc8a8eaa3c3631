"""Reader of a run's folder for display: its suite, its rows, and the result of each trial.

Nothing in it is trusted to be intact: what cannot be read counts as missing.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from ...agent.store.folder import read_events
from ...tools.errors import InputError
from ..experiments.suite_work import attempt_name
from ..experiments.trials import Arm, TrialRow
from ..tasks.stored_suite import ATTEMPTS, StoredSuite, read_suite

Point = tuple[float, float]
LONGEST = 4_000
"""Most characters shown of one text of a transcript."""


class _Grade(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    right: tuple[bool, ...] = ()


class StoredAttempt(BaseModel):
    """The stored result of a trial.

    Attributes:
        message: the text the run ended with.
        planned, observed: positions, px; None if there are none.
        found: outlines that robots were placed about, px.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    message: str = ""
    planned: tuple[Point, ...] | None = None
    observed: tuple[Point, ...] | None = None
    found: tuple[tuple[Point, ...], ...] = ()
    graded: _Grade = Field(default_factory=_Grade)

    @property
    def right(self) -> tuple[bool, ...]:
        """Whether each robot observed stands right; if none was to move, none does."""
        count = len(self.observed or ())
        return self.graded.right if len(self.graded.right) == count else (False,) * count


@dataclass(frozen=True)
class Utterance:
    """A text of a transcript: who wrote it, for which tool if any, and how much was cut off."""

    who: str
    tool: str
    text: str
    left_out: int = 0


@dataclass(frozen=True)
class Side:
    """The rows of a run that are shown, and its folder.

    Attributes:
        label: A or B if two are compared, else empty.
    """

    folder: Path
    suite: StoredSuite
    rows: tuple[TrialRow, ...]
    label: str = ""

    @property
    def arms(self) -> list[Arm]:
        """The arms in order of their names."""
        arms = {arm.name: arm for arm in (row.arm for row in self.rows)}
        return [arms[name] for name in sorted(arms)]

    def of(self, arm: Arm) -> list[TrialRow]:
        """Return the rows of an arm."""
        return [row for row in self.rows if row.arm == arm]

    def attempt(self, row: TrialRow) -> StoredAttempt | None:
        """Return the stored result of a trial; None if it cannot be read."""
        try:
            content = json.loads(self._file(row, "json").read_bytes())
            # A model may have written half of a surrogate pair, which is no text.
            whole = json.dumps(content, ensure_ascii=False).encode("utf-8", "replace")
            return StoredAttempt.model_validate_json(whole)
        except (OSError, ValueError, RecursionError):
            return None

    def transcript(self, row: TrialRow) -> list[Utterance] | None:
        """Return the texts and calls of a trial; None if there is no trace."""
        path = self._file(row, "jsonl")
        if not path.exists():
            return None
        try:
            lines = [e.data for e in read_events(path) if e.kind == "message"]
            return [utterance for line in lines for utterance in _utterances(line)]
        except (InputError, AttributeError, KeyError, TypeError):
            return [Utterance("", "", "The trace cannot be read.")]

    def _file(self, row: TrialRow, suffix: str) -> Path:
        return self.folder / ATTEMPTS / f"{attempt_name(row)}.{suffix}"


def side(folder: Path, rows: Sequence[TrialRow], label: str = "") -> Side:
    """Return the side of a run to be shown.

    Raises:
        InputError: the folder does not hold its suite.
    """
    return Side(folder, read_suite(folder), tuple(rows), label)


def _utterances(line: Mapping[str, Any]) -> list[Utterance]:
    """Return a message of a trace as texts."""
    text = line.get("text", "")
    if line["role"] == "user":
        return [_shortened("person", "", text)]
    if line["role"] == "tool":
        error = f"{line['error']}: " if line.get("error") else ""
        return [_shortened("result", line["name"], error + text)]
    texts = [_shortened("model", "", text)] if text else []
    calls = line.get("calls", ())
    shown = [(c["name"], json.dumps(c["arguments"], ensure_ascii=False)) for c in calls]
    return texts + [_shortened("call", *call) for call in shown]


def _shortened(who: str, tool: str, text: str) -> Utterance:
    return Utterance(who, tool, text[:LONGEST], max(0, len(text) - LONGEST))
