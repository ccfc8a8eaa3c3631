"""What came of a table: each cell as k of n with its interval and the paper's figure beside it.

What was not run says so, and about what it would cost. Nothing in it depends on the time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from ...agent.providers.prices import UNKNOWN, price_of
from ..experiments.recordings import REPLAY
from ..experiments.simulated_model import SIMULATED
from ..experiments.trials import USUAL, Trial, TrialRow
from ..statistics.intervals import Interval, wilson
from .definition import Entry, Figure, Table, usual_tokens

UNTRAINED = "run, but figures of weights too few to be trained are not shown"


@dataclass(frozen=True)
class Result:
    """A cell.

    Attributes:
        passed, scored: k of n trials.
        planned: trials there are to be.
        interval: of the success rate at 95 %, of these tasks; None without trials.
        gcr: mean; None without trials.
        paper: its figure; None where it has none.
    """

    passed: int
    scored: int
    planned: int
    interval: Interval | None
    gcr: float | None
    paper: Figure | None


@dataclass(frozen=True)
class ResultRow:
    """A row.

    Attributes:
        head: of the row.
        model: that filled it, or nothing.
        results: by column.
        missing: why trials are, and what they would cost; or nothing.
        left: how many are.
        left_usd: what they would cost; None where the price is not known.
        tokens: of a trial in the median, in and out; None where none were counted.
        beyond: input tokens beyond those of the same model with edges, as a share; None where
            that is the row itself, or there is none.
        paper_beyond: what the paper says of that.
        cost_usd: of its trials so far.
        invalid: trials whose output could not be used.
        lost: trials a provider failed in.
        part: of how many tasks it is, where it is not of all; or nothing.
        once: nothing is left to chance, so that each task is tried once.
    """

    head: str
    model: str
    results: Mapping[str, Result]
    missing: str
    left: int
    left_usd: float | None
    tokens: tuple[int, int] | None
    beyond: float | None
    paper_beyond: float | None
    cost_usd: float
    invalid: int
    lost: int
    part: str
    once: bool


@dataclass(frozen=True)
class Planned:
    """A row of a table with its trials; none where nobody fills it, but the tasks it would have."""

    entry: Entry
    trials: Sequence[Trial]
    tasks: int


@dataclass(frozen=True)
class Tabled:
    """A table with what came of it."""

    name: str
    table: Table
    suite: str
    rows: Sequence[ResultRow]
    trials: Sequence[TrialRow]

    @property
    def left_usd(self) -> float:
        """What the trials that are missing would cost, as far as prices are known."""
        return sum(row.left_usd or 0.0 for row in self.rows)

    @property
    def cost_usd(self) -> float:
        """Of all trials so far."""
        return sum(row.cost_usd for row in self.rows)


def tabled(
    name: str, table: Table, planned: Sequence[Planned], rows: Sequence[TrialRow], tasks: int
) -> Tabled:
    """The table of these rows.

    Args:
        name: of the table.
        table: its definition.
        planned: its rows, in order.
        rows: of the run's folder.
        tasks: how many the suite has.
    """
    by_key = {row.key: row for row in rows}
    own = [by_key[t.key] for plan in planned for t in plan.trials if t.key in by_key]
    made = [_row(table, plan, by_key, tasks) for plan in planned]
    edges = {
        (plan.entry.row.method, row.model): row.tokens[0]
        for plan, row in zip(planned, made, strict=True)
        if row.tokens and plan.entry.row.descriptor == USUAL
    }
    made = [_compared(plan, row, edges) for plan, row in zip(planned, made, strict=True)]
    return Tabled(name, table, min((row.suite for row in own), default=""), made, own)


def _row(table: Table, plan: Planned, by_key: Mapping[str, TrialRow], tasks: int) -> ResultRow:
    entry = plan.entry
    rows = [by_key[trial.key] for trial in plan.trials if trial.key in by_key]
    scored = [row for row in rows if row.scored]
    shown = [] if entry.untrained else rows
    results = {
        column: _result(
            [row for row in shown if table.within(column, row)],
            sum(table.within(column, trial) for trial in plan.trials),
            entry.row.paper.get(column),
        )
        for column in table.columns
    }
    counted = [(row.input_tokens, row.output_tokens) for row in scored if row.input_tokens]
    tokens = _medians(counted) if counted else None
    left = 0 if entry.row.missing else plan.tasks * entry.trials - len(scored)
    each = tokens or usual_tokens(entry.row.method)
    cost = _cost_usd(_model(plan), left, each)
    return ResultRow(
        head=entry.row.row,
        model=_model(plan),
        results=results,
        missing=entry.row.missing
        or (_missing(entry, left, each, cost) if left else UNTRAINED if entry.untrained else ""),
        left=left,
        left_usd=cost,
        tokens=tokens,
        beyond=None,
        paper_beyond=entry.row.paper_tokens,
        cost_usd=sum(row.cost_usd for row in rows),
        invalid=sum(row.status == "model_invalid" for row in scored),
        lost=len(rows) - len(scored),
        part=f"{plan.tasks} of {tasks} tasks" if plan.tasks < tasks else "",
        once=entry.trials == 1,
    )


def _compared(plan: Planned, row: ResultRow, edges: Mapping[tuple[str, str], int]) -> ResultRow:
    """The row with its tokens beyond those of the same model with edges."""
    who = plan.entry.row.method, row.model
    if plan.entry.row.descriptor == USUAL or row.tokens is None or who not in edges:
        return row
    return replace(row, beyond=row.tokens[0] / edges[who] - 1)


def _model(plan: Planned) -> str:
    """The model that was chosen for a row, or is to be."""
    entry = plan.entry
    if entry.arm is None or entry.row.models is None:
        return ""
    names = (entry.arm.model, entry.arm.planner)
    return plan.trials[0].arm.model if plan.trials else "+".join(filter(None, names))


def _result(rows: Sequence[TrialRow], planned: int, paper: Figure | None) -> Result:
    scored = [row for row in rows if row.scored]
    n, passed = len(scored), sum(bool(row.sr) for row in scored)
    return Result(
        passed=passed,
        scored=n,
        planned=planned,
        interval=wilson(passed, n) if n else None,
        gcr=sum(row.gcr or 0.0 for row in scored) / n if n else None,
        paper=paper,
    )


def _missing(entry: Entry, left: int, each: tuple[int, int], cost: float | None) -> str:
    """How much is missing, and what it would take."""
    what = f"not run: {left:,} trial{'s' if left > 1 else ''}"
    tokens = f"about {left * each[0]:,} tokens in and {left * each[1]:,} out"
    if entry.arm is None:
        return f"{what} for want of {entry.wants}{f'; {tokens}' if any(each) else ''}"
    if cost is None:
        return f"{what}; {tokens}, at a price that is not known"
    return f"{what}; about {cost:.2f} USD" if cost else what


def _cost_usd(model: str, trials: int, tokens: tuple[int, int]) -> float | None:
    """What trials of a model would cost, of two the dearer; None where a price is not known."""
    if not any(tokens) or model == SIMULATED or model.startswith(REPLAY):
        return 0.0
    prices = [price_of(*name.partition(":")[::2]) for name in model.split("+")]
    if UNKNOWN in prices:
        return None
    return trials * max(p.cost(fresh=tokens[0], cached=0, output=tokens[1]) for p in prices)


def _medians(counted: Sequence[tuple[int, int]]) -> tuple[int, int]:
    sent, got = zip(*counted, strict=True)
    return round(median(sent)), round(median(got))
