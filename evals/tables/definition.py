"""A table as data: columns, rows, the paper's figures, and who fills a row; see tables.yaml."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

import yaml
from pydantic import BaseModel, ConfigDict

from ...tools.context import Descriptor
from ...tools.errors import InputError
from ..experiments.methods import Method, check_method
from ..experiments.pointing import Mode
from ..experiments.recordings import REPLAY
from ..experiments.segment_only import SEGMENT_ONLY
from ..experiments.simulated_model import SIMULATED
from ..experiments.trials import USUAL_SEGMENTER, Trial
from ..statistics.cells import cell_names

_FILE = Path(__file__).with_name("tables.yaml")
TRAINED = 5_000_000
"""Bytes of weights under which no network was trained to see: a test's, written at random."""
Figure = tuple[float, float | None]
"""SR and GCR as the paper prints them; Tables II and III have no GCR."""


class Row(BaseModel):
    """A row of a table.

    Attributes:
        row: its head.
        method: who decides; nothing where nobody can here, and `missing` says why.
        models: a word in the names of the models that fill it, "" for those that no other row of
            the method takes; None where the method needs none, or has its own.
        model: the method's own, where that is to be chosen.
        trials: tries of each task; the table's by default.
        paper: its figures by column.
        paper_tokens: the tokens it says are needed beyond those of edges, as a share.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    row: str
    method: str = ""
    missing: str = ""
    models: str | None = None
    model: str = ""
    mode: Mode = "words"
    descriptor: Descriptor = "edges"
    segmenter: str = USUAL_SEGMENTER
    trials: int | None = None
    paper: dict[str, Figure] = {}
    paper_tokens: float | None = None


class Table(BaseModel):
    """A table.

    Attributes:
        columns: title, and the name of a cell or a pattern of tasks' ids.
        notes: what has to be said beside it.
        stand_ins: which task of the paper each of ours stands for.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str
    suite: str
    trials: int
    columns: dict[str, str]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    stand_ins: dict[str, str] = {}

    def within(self, column: str, trial: Trial) -> bool:
        """Whether a trial counts in a column."""
        wanted = self.columns[column]
        return wanted in cell_names(trial) or fnmatchcase(trial.task, wanted)


@dataclass(frozen=True)
class Entry:
    """A row with who fills it.

    Attributes:
        arm: None where nobody can, or has been named.
        trials: tries of each task.
        wants: what has to be named for it, such as an option; nothing where there is an arm.
    """

    row: Row
    arm: Method | None
    trials: int
    wants: str = ""

    @property
    def untrained(self) -> bool:
        """Whether its network's weights are too few to have been trained: it says nothing."""
        arm = self.arm
        name = "" if arm is None else arm.model if arm.name == SEGMENT_ONLY else arm.segmenter
        folders = [Path(part) for part in name.partition(":")[2].split(",") if part]
        files = [file for folder in folders for file in folder.glob("*.safetensors")]
        return bool(files) and sum(file.stat().st_size for file in files) < TRAINED


class _Tables(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    tokens: dict[str, tuple[int, int]]
    tables: dict[str, Table]


@cache
def _tables() -> _Tables:
    return _Tables.model_validate(yaml.safe_load(_FILE.read_text(encoding="utf-8")))


def table_named(name: str) -> Table:
    """The table of a name.

    Raises:
        InputError: there is none.
    """
    tables = _tables().tables
    if name not in tables:
        raise InputError(f"Unknown table {name!r}. There are: {', '.join(tables)}.")
    return tables[name]


def usual_tokens(method: str) -> tuple[int, int]:
    """Tokens in and out of a trial, before any has been counted; none where no model is asked."""
    return _tables().tokens.get(method, (0, 0))


def entries(
    table: Table,
    models: Sequence[str],
    base: Method,
    *,
    segmenters: Sequence[str] = (),
    trials: int | None = None,
) -> list[Entry]:
    """The rows of a table with who fills them: a row stands for each of its models.

    Args:
        table: whose rows.
        models: as Agent takes them, `simulated`, or replay:FOLDER; A+B where B plans for A.
        base: what all methods share, such as where prompts are.
        segmenters: NAME or NAME:CHECKPOINT of the networks there are.
        trials: tries of each task, in place of the table's own.

    Raises:
        InputError: a model or segmenter that no row takes, or that cannot be used.
    """
    found, taken = list[Entry](), set[str]()
    cut = {name.partition(":")[0]: name for name in segmenters} | {USUAL_SEGMENTER: USUAL_SEGMENTER}
    for row in table.rows:
        count, chosen = trials or row.trials or table.trials, [row.model] if row.method else []
        taken |= {cut[row.segmenter]} if row.segmenter in cut else set()
        if row.models is not None:
            chosen = [m for m in models if _takes(table, row, m)]
            taken.update(chosen)
        if row.segmenter not in cut:
            found.append(Entry(row, None, count, f"--segmenter {row.segmenter}"))
        elif not chosen:
            kind = f"whose name holds {row.models}" if row.models else "of yours"
            found.append(Entry(row, None, count, f"--models {kind}"))
        else:
            found += [Entry(row, _arm(row, m, base, cut[row.segmenter]), count) for m in chosen]
    for option, names in (("model", models), ("segmenter", segmenters)):
        lost = sorted(set(names) - taken)
        if lost:
            raise InputError(f"No row of this table is for the {option} {lost[0]!r}; leave it out.")
    return found


def _takes(table: Table, row: Row, model: str) -> bool:
    """Whether a row is for a model, by its name."""
    if row.models is None:
        return False
    others = [r.models for r in table.rows if r.method == row.method and r.models]
    named = [word for word in others if word in model.lower().rpartition("+")[2]]
    if model == SIMULATED or model.startswith(REPLAY):
        return row.method == "agent" and row.models == (REPLAY if REPLAY in named else "")
    if "+" in model and row.method == "alone":
        return False
    return row.models in named if named else row.models == ""


def _arm(row: Row, model: str, base: Method, segmenter: str) -> Method:
    if row.method == SEGMENT_ONLY:
        return check_method(Method(row.method, model=segmenter))
    url = base.base_url if row.models is not None else None
    looker, _, planner = model.partition("+")
    return check_method(
        Method(
            row.method,
            model=looker,
            planner=planner or None,
            descriptor=row.descriptor,
            mode=row.mode,
            segmenter=segmenter,
            library=base.library,
            base_url=url,
            rate=base.rate,
        )
    )
