"""Results of a table: each cell as k of n with its interval, beside the paper's figure.

Rows say which trials were not run, and about what they would cost. Nothing depends on the time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from ...agent.providers.prices import UNKNOWN, price_of
from ..experiments.compare import compare
from ..experiments.comparison import Difference
from ..experiments.recordings import REPLAY
from ..experiments.simulated_model import SIMULATED
from ..experiments.trials import USUAL, Trial, TrialRow
from ..statistics.intervals import Interval, wilson
from .definition import Entry, Figure, Table, usual_tokens

UNTRAINED = "run, but figures of weights too few to be trained are not shown"


@dataclass(frozen=True)
class Result:
    """A cell: `passed` of `scored` of `planned` trials, their mean GCR, and the paper's figure.

    Attributes:
        difference: of an ablation from the whole, over the trials that both have.
    """

    passed: int
    scored: int
    planned: int
    gcr: float
    paper: Figure | None
    difference: Difference | None = None

    @property
    def interval(self) -> Interval | None:
        """95 % interval of the success rate on these tasks; None without trials."""
        return wilson(self.passed, self.scored) if self.scored else None


@dataclass(frozen=True)
class ResultRow:
    """A row of results.

    Attributes:
        model: the model that filled it, or an empty string.
        results: by column.
        remarks: notes printed beside the figures, such as why trials are missing.
        left_usd: what the missing trials would cost; None if the price is not known.
    """

    head: str
    model: str
    results: Mapping[str, Result]
    remarks: tuple[str, ...]
    cost_usd: float
    left_usd: float | None


@dataclass(frozen=True)
class Planned:
    """A row with its trials, none if no method fills it, and the number of tasks it has."""

    entry: Entry
    trials: Sequence[Trial]
    tasks: int

    @property
    def model(self) -> str:
        """The model that fills it or is to fill it; empty if it needs none."""
        arm = self.entry.arm
        if arm is None or self.entry.row.models is None:
            return ""
        named = "+".join(filter(None, (arm.model, arm.planner)))
        return self.trials[0].arm.model if self.trials else named


@dataclass(frozen=True)
class Tabled:
    """A table, its suite's hash (empty without trials), the results of its rows, and the trials."""

    name: str
    table: Table
    suite: str
    rows: Sequence[ResultRow]
    trials: Sequence[TrialRow]


def tabled(
    name: str, table: Table, planned: Sequence[Planned], rows: Sequence[TrialRow], tasks: int
) -> Tabled:
    """Return a table with the results of these rows.

    Args:
        name: of the table.
        table: its definition.
        planned: its rows, in order.
        rows: of the run's folder.
        tasks: the number of tasks in the suite.
    """
    by_key = {row.key: row for row in rows}
    own = [[by_key[t.key] for t in plan.trials if t.key in by_key] for plan in planned]
    of_arms = {plan.entry.arm: trials for plan, trials in zip(planned, own, strict=True)}
    edges: dict[tuple[str, str], tuple[int, int]] = {}
    made = list[ResultRow]()
    for plan, trials in zip(planned, own, strict=True):
        who, tokens = (plan.entry.row.method, plan.model), _tokens(trials)
        if tokens and plan.entry.row.descriptor == USUAL:
            edges[who] = tokens
        others = (of_arms[arm] for arm in plan.entry.whole if arm in of_arms)
        whole = next((rows for rows in others if _tried_alike(rows, trials)), list[TrialRow]())
        made.append(_row(table, plan, trials, tasks, edges.get(who), whole))
    known = [row for trials in own for row in trials]
    return Tabled(name, table, known[0].suite if known else "", made, known)


def _row(
    table: Table,
    plan: Planned,
    rows: Sequence[TrialRow],
    tasks: int,
    edges: tuple[int, int] | None,
    whole: Sequence[TrialRow],
) -> ResultRow:
    entry, scored = plan.entry, [row for row in rows if row.scored]
    left = 0 if entry.row.missing else plan.tasks * entry.trials - len(scored)
    tokens = _tokens(rows)
    each = tokens or usual_tokens(entry.row.method)
    arm = entry.arm
    cost = expected_usd(plan.model, left, each, base_url=arm and arm.base_url)
    said = [plan.model, f"{plan.tasks} of {tasks} tasks" if plan.tasks < tasks else ""]
    said += ["one try"] if entry.trials == 1 and scored else []
    said += [f"{tokens[0]:,} + {tokens[1]:,} tokens a trial"] if tokens else []
    if tokens and edges and entry.row.descriptor != USUAL:
        said.append(f"{tokens[0] / edges[0] - 1:+.0%} tokens beyond edges")
    beyond = entry.row.paper_tokens
    said += [] if beyond is None else [f"paper {beyond:+.0%} tokens"]
    invalid = sum(row.status == "model_invalid" for row in scored)
    lost = len(rows) - len(scored)
    said += [f"{n} {what}" for n, what in ((invalid, "invalid"), (lost, "lost")) if n]
    if table.factors and scored:
        said.append(f"{sum(row.placed and not row.sr for row in scored)} sent to wrong places")
    said += [entry.row.missing, _missing(entry, left, each, cost) if left else ""]
    said += [UNTRAINED] if entry.untrained and not left else []
    shown = [] if entry.untrained else scored
    results = {
        column: _result(
            [row for row in shown if table.within(column, row)],
            sum(table.within(column, trial) for trial in plan.trials),
            entry.row.paper.get(column),
            [row for row in whole if table.within(column, row)],
        )
        for column in table.columns
    }
    spent = sum(row.cost_usd for row in rows)
    return ResultRow(entry.row.row, plan.model, results, tuple(filter(None, said)), spent, cost)


def _result(
    scored: Sequence[TrialRow], planned: int, paper: Figure | None, whole: Sequence[TrialRow]
) -> Result:
    gcr = sum(row.gcr or 0.0 for row in scored) / max(len(scored), 1)
    difference = compare(whole, scored).overall if _tried_alike(whole, scored) else None
    passed = sum(bool(row.sr) for row in scored)
    return Result(passed, len(scored), planned, gcr, paper, difference)


def _tried_alike(whole: Sequence[TrialRow], rows: Sequence[TrialRow]) -> bool:
    """Return whether the two have a scored trial (task and number) in common."""
    tried = {(row.task, row.trial) for row in whole if row.scored}
    return any(row.scored and (row.task, row.trial) in tried for row in rows)


def _tokens(rows: Sequence[TrialRow]) -> tuple[int, int] | None:
    """Return the median tokens of a trial, (in, out); None if none were counted."""
    counted = [(row.input_tokens, row.output_tokens) for row in rows if row.input_tokens]
    if not counted:
        return None
    sent, got = zip(*counted, strict=True)
    return round(median(sent)), round(median(got))


def _missing(entry: Entry, left: int, each: tuple[int, int], cost: float | None) -> str:
    """Say how many trials are missing, and what it would take to run them."""
    if entry.arm is not None:
        return f"not run: {expected(left, each, cost)}"
    return f"not run: {_of_trials(left)} for want of {entry.wants}{_in_tokens(left, each)}"


def expected(trials: int, each: tuple[int, int], cost: float | None) -> str:
    """Say how many trials there are, and about how many dollars, else tokens, they will take.

    Args:
        trials: how many.
        each: tokens of each, (in, out).
        cost: of all, USD; None if the price is not known.
    """
    if cost is None:
        return f"{_of_trials(trials)}{_in_tokens(trials, each)}, at a price that is not known"
    return f"{_of_trials(trials)}; about {cost:.2f} USD" if cost else _of_trials(trials)


def _of_trials(trials: int) -> str:
    return f"{trials:,} trial{'s' if trials > 1 else ''}"


def _in_tokens(trials: int, each: tuple[int, int]) -> str:
    told = f"; about {trials * each[0]:,} tokens in and {trials * each[1]:,} out"
    return told if any(each) else ""


def expected_usd(
    model: str, trials: int, tokens: tuple[int, int], *, base_url: str | None = None
) -> float | None:
    """Return what trials of a model would cost, in USD; None if a price is not known.

    Args:
        model: as Agent takes it, or A+B, of which the dearer counts.
        trials: how many.
        tokens: of each, (in, out).
        base_url: of a private server, whose prices are not known.
    """
    if not any(tokens) or model == SIMULATED or model.startswith(REPLAY):
        return 0.0
    prices = [price_of(*name.partition(":")[::2]) for name in model.split("+")]
    if UNKNOWN in prices or base_url:
        return None
    return trials * max(p.cost(fresh=tokens[0], cached=0, output=tokens[1]) for p in prices)
