"""Tables as data: columns, rows, the paper's figures, and what fills a row; see tables.yaml."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal, get_args

import yaml
from pydantic import BaseModel

from ...tools.context import Descriptor
from ...tools.errors import InputError
from ..experiments.ablation import Part
from ..experiments.methods import Method, check_method
from ..experiments.pointing import Mode
from ..experiments.recordings import REPLAY, recordings
from ..experiments.segment_only import SEGMENT_ONLY
from ..experiments.simulated_model import SIMULATED
from ..experiments.trials import USUAL_SEGMENTER, Trial
from ..rl.policy import RL, TRAIN, trained
from ..statistics.cells import cell_names

_FILE = Path(__file__).with_name("tables.yaml")
TRAINED = 5_000_000
"""Least size in bytes of trained weights; smaller files are random ones, written by tests."""
Figure = tuple[float, float | None]
"""(SR, GCR) as the paper prints them; Tables II and III have no GCR."""
Factor = Literal["stages", "prompt"] | Part
"""What an ablation changes: the number of stages (one or two), the prompt, or a part left out."""


class Row(BaseModel, frozen=True, extra="forbid"):
    """A row of a table.

    Attributes:
        row: its heading.
        method: the method that decides; empty if none can here, and `missing` says why.
        models: a word in the names of the models that fill it; "" for the models that no other
            row of the method takes; None if the method needs no model, or has its own.
        trials: tries of each task; the table's by default.
        paper: the paper's figures by column.
        paper_tokens: the tokens that the paper needed beyond those of edges, as a share.
    """

    row: str
    method: str = ""
    missing: str = ""
    models: str | None = None
    mode: Mode = "words"
    descriptor: Descriptor = "edges"
    segmenter: str = USUAL_SEGMENTER
    trials: int | None = None
    paper: dict[str, Figure] = {}
    paper_tokens: float | None = None


class Table(BaseModel, frozen=True, extra="forbid"):
    """The definition of a table.

    Attributes:
        columns: the cell (category, setup or style) that each column shows, by the column's title.
        factors: the heading of rows that differ from the one above in this factor alone.
        notes: remarks that are printed with it.
        stand_ins: which task of the paper each of ours stands for.
    """

    title: str
    suite: str
    trials: int
    columns: dict[str, str]
    rows: tuple[Row, ...]
    factors: dict[Factor, str] = {}
    notes: tuple[str, ...] = ()
    stand_ins: dict[str, str] = {}

    def within(self, column: str, trial: Trial) -> bool:
        """Return whether a trial counts in a column."""
        return self.columns[column] in cell_names(trial)


@dataclass(frozen=True)
class Entry:
    """A row and the method that fills it.

    Attributes:
        arm: the method; None if none can fill the row, or none has been named.
        trials: tries of each task.
        wants: what has to be given to fill it, such as an option; empty if there is an arm.
        whole: methods that an ablation may be compared with; the first with trials in common is.
    """

    row: Row
    arm: Method | None
    trials: int
    wants: str = ""
    whole: tuple[Method, ...] = ()

    @property
    def untrained(self) -> bool:
        """Whether its network's weights are too small to be trained: its figures mean nothing."""
        arm = self.arm
        name = "" if arm is None else arm.model if arm.name == SEGMENT_ONLY else arm.segmenter
        folders = [Path(part) for part in name.partition(":")[2].split(",") if part]
        files = [file for folder in folders for file in folder.glob("*.safetensors")]
        return bool(files) and sum(file.stat().st_size for file in files) < TRAINED


class _Tables(BaseModel, frozen=True, extra="forbid"):
    tokens: dict[str, tuple[int, int]]
    tables: dict[str, Table]


@cache
def _tables() -> _Tables:
    return _Tables.model_validate(yaml.safe_load(_FILE.read_text(encoding="utf-8")))


def table_named(name: str) -> Table:
    """Return the table of this name.

    Raises:
        InputError: there is no such table.
    """
    tables = _tables().tables
    if name not in tables:
        raise InputError(f"Unknown table {name!r}. There are: {', '.join(tables)}.")
    return tables[name]


def usual_tokens(method: str) -> tuple[int, int]:
    """Return the tokens (in, out) to expect of a trial before any is counted; 0 without a model."""
    return _tables().tokens.get(method, (0, 0))


def entries(
    table: Table,
    base: Method,
    models: Sequence[str],
    segmenters: Sequence[str],
    trials: int | None = None,
    checkpoints: Path | None = None,
    prompts: Sequence[str] = (),
) -> list[Entry]:
    """Return the rows of a table with the methods that fill them, one for each model of a row.

    Args:
        table: whose rows.
        base: what all methods share, such as where prompts are.
        models: as Agent takes them, `simulated`, or replay:FOLDER; A+B if B plans for A.
        segmenters: NAME or NAME:CHECKPOINT of the networks there are.
        trials: tries of each task, instead of the table's own.
        checkpoints: the folder of the policies of reinforcement learning.
        prompts: ID@VERSION where prompts are a factor; by default the one before the current.

    Raises:
        InputError: no row takes a model, segmenter, folder or prompt, or it cannot be used.
    """
    found, taken = list[Entry](), set[str]()
    cut = {name.partition(":")[0]: name for name in segmenters} | {USUAL_SEGMENTER: USUAL_SEGMENTER}
    for row in table.rows:
        count = trials or row.trials or table.trials
        if row.method == RL:
            found += _policy_rows(row, checkpoints, count)
            taken.add(str(checkpoints))
            continue
        chosen = [""] if row.models is None else [m for m in models if _is_for_model(table, row, m)]
        taken |= {*chosen, cut.get(row.segmenter, "")}
        wants = ""
        if row.segmenter not in cut:
            wants = f"--segmenter {row.segmenter}"
        elif not chosen:
            wants = f"--models {f'whose name holds {row.models}' if row.models else 'of yours'}"
        arms = [None] if row.missing or wants else [_arm(row, m, base, cut) for m in chosen]
        found += [Entry(row, arm, count, wants) for arm in arms]
    given = [] if checkpoints is None else [str(checkpoints)]
    for option, names in (("model", models), ("segmenter", segmenters), ("checkpoints", given)):
        lost = sorted(set(names) - taken)
        if lost:
            raise InputError(f"No row of this table is for the {option} {lost[0]!r}; leave it out.")
    if prompts and "prompt" not in table.factors:
        raise InputError(f"No row of this table is for the prompt {prompts[0]!r}; leave it out.")
    return list(_with_ablations(table, found, prompts)) if table.factors else found


def _with_ablations(
    table: Table, found: Sequence[Entry], prompts: Sequence[str]
) -> Iterator[Entry]:
    """Yield the rows, each followed by those that differ from it in one factor.

    A recording made in two stages is compared with those made in one.
    """
    recorded = {e.arm: recordings(e.arm.model) for e in found if e.arm is not None}
    whole = tuple(arm for arm, kept in recorded.items() if kept and not kept.staged)
    for entry in found:
        arm = entry.arm
        if arm is None:
            yield entry
        elif (kept := recorded[arm]) and kept.staged:
            yield _ablation_of(entry, table.factors["stages"], arm, whole)
        else:
            yield entry
            for factor, head in table.factors.items():
                for other in _ablated_methods(factor, arm, prompts):
                    yield _ablation_of(entry, head, other, (arm,))


def _ablation_of(entry: Entry, head: str, arm: Method, whole: tuple[Method, ...]) -> Entry:
    row = entry.row.model_copy(update={"row": f"{head} {arm.prompt or ''}".strip()})
    return replace(entry, row=row, arm=arm, whole=whole)


def _ablated_methods(factor: Factor, arm: Method, prompts: Sequence[str]) -> list[Method]:
    """Return the methods that differ from an arm in this factor alone, if there can be any."""
    if factor in get_args(Part):
        return [replace(arm, without=factor)]
    if arm.name != "agent" or arm.model.startswith(REPLAY):
        return []
    if factor == "stages":
        other = None if arm.planner else arm.model
        return [] if arm.model == SIMULATED else [replace(arm, planner=other)]
    current = arm.library.load("planner" if arm.planner else "former")
    before = [current.front.parent] if current.front.parent else []
    return [replace(arm, prompt=name) for name in prompts or before]


def _is_for_model(table: Table, row: Row, model: str) -> bool:
    """Return whether a row is for a model, judged by its name, of A+B by the planner's."""
    if model == SIMULATED or model.startswith(REPLAY):
        words = REPLAY if model.startswith(REPLAY) else ""
        return row.method == "agent" and row.models == words
    if "+" in model and row.method == "alone":
        return False
    others = [r.models for r in table.rows if r.method == row.method and r.models]
    own = model.lower().rpartition("+")[2].partition(":")[2]
    named = [word for word in others if word in own]
    return row.models in (named or [""])


def _policy_rows(row: Row, folder: Path | None, trials: int) -> list[Entry]:
    """Return the row of trained policies; unconverged ones get one without the paper's figures."""
    if folder is None:
        return [Entry(row, None, trials, f"--checkpoints DIR, which {TRAIN} --out DIR writes")]
    policies = trained(folder)
    arm = check_method(Method(RL, str(folder)))
    own = row.model_copy(update={"row": f"{row.row}: {policies.description}"})
    if not policies.unconverged:
        return [Entry(own, arm, trials)]
    missing = f"not run: what was trained is unconverged; {TRAIN} with more --steps trains it anew"
    return [
        Entry(row.model_copy(update={"missing": missing}), None, trials),
        Entry(own.model_copy(update={"paper": {}}), arm, trials),
    ]


def _arm(row: Row, model: str, base: Method, cut: Mapping[str, str]) -> Method:
    if row.method == SEGMENT_ONLY:
        return check_method(Method(row.method, cut[row.segmenter]))
    looker, _, planner = model.partition("+")
    base = base if model else Method("")
    return check_method(
        replace(
            base,
            name=row.method,
            model=looker,
            planner=planner or None,
            descriptor=row.descriptor,
            mode=row.mode,
            segmenter=cut[row.segmenter],
        )
    )
