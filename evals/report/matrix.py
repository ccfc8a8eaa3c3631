"""The matrix: arms (method, prompt, model) by slices of the tasks, as counts with intervals.

Intervals of counts are Wilson's, on these tasks; those of a difference are on tasks like these.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

from ...tools.errors import InputError
from ..experiments.compare import compare
from ..experiments.comparison import Comparison, Difference
from ..experiments.trials import USUAL, Arm, TrialRow
from ..statistics.cells import TOTAL, Cell, cell_names, cells
from .run_folder import Side

SPENT = ("tokens a trial", "USD", "median s")
COLUMNS = 11
"""Columns beside the headings of the rows; so many fit 1,280 px."""
STEPS = 5
"""Number of the darkest shade of a cell; shades go by the share of successes."""


@dataclass(frozen=True)
class MatrixCell:
    """A cell: text, a smaller one below it, notes, and the class of its style."""

    upper: str
    lower: str = ""
    notes: tuple[str, ...] = ()
    kind: str = ""


@dataclass(frozen=True)
class MatrixRow:
    """A heading with facts below it, and the cells: the total, what was spent, the other slices."""

    head: str
    facts: Sequence[str]
    cells: Sequence[MatrixCell]
    kind: str = ""


@dataclass(frozen=True)
class Matrix:
    """The titles of the columns, and the rows."""

    titles: Sequence[str]
    rows: Sequence[MatrixRow]

    @property
    def parts(self) -> list["Matrix"]:
        """Tables that are narrow enough for a page, each with the headings of the rows."""
        return [
            Matrix(
                (self.titles[0], *self.titles[first + 1 : first + 1 + COLUMNS]),
                [replace(row, cells=row.cells[first : first + COLUMNS]) for row in self.rows],
            )
            for first in range(0, len(self.titles) - 1, COLUMNS)
        ]


def matrix(sides: Sequence[Side], comparison: Comparison | None = None) -> Matrix:
    """Return a table of all arms, with the difference if two sides are compared.

    Args:
        sides: one run, or A and B, each of one arm.
        comparison: of A and B.
    """
    levels = sides[0].suite.chance
    arms = [(side, arm, side.of(arm)) for side in sides for arm in side.arms]
    found = [{cell.name: cell for cell in cells(rows, levels)} for _, _, rows in arms]
    there = {name for named in found for name in named}
    names = sorted(
        (name for name in levels if name in there),
        key=lambda name: (name != TOTAL, name.count(" ")),
    )  # the total first, then single slices, then cells of two
    rows = [
        MatrixRow(
            f"{side.label}: {arm.method}" if side.label else arm.method,
            _arm_facts(arm),
            _cells_in_order([_success(named.get(name)) for name in names], _spent_figures(own)),
        )
        for (side, arm, own), named in zip(arms, found, strict=True)
    ]
    if comparison is not None:
        rows.append(_difference_row(sides[0].rows, sides[1].rows, comparison, names))
    chance = [MatrixCell(f"{levels[name].sr:.2f}") for name in names]
    rows.append(MatrixRow("chance", (), _cells_in_order(chance, ("", "", "")), "chance"))
    return Matrix(("who", names[0], *SPENT, *names[1:]), rows)


def _arm_facts(arm: Arm) -> list[str]:
    """Return what is shown below the heading of an arm's row."""
    facts = [f"{arm.prompt}#{(arm.sha256 or '')[:12]}"] if arm.prompt else []
    facts += [] if arm.model in ("none", arm.method) else [arm.model]
    facts += [arm.descriptor] if arm.descriptor not in (None, USUAL) else []
    return [*facts, *([] if arm.mode == "words" else [arm.mode])]


def _cells_in_order(slices: Sequence[MatrixCell], spent: Sequence[str]) -> list[MatrixCell]:
    return [slices[0], *map(MatrixCell, spent), *slices[1:]]


def _spent_figures(rows: Sequence[TrialRow]) -> tuple[str, str, str]:
    scored = [row for row in rows if row.scored]
    tokens = sum(row.input_tokens + row.output_tokens for row in scored) / max(len(scored), 1)
    seconds = median(row.seconds for row in scored) if scored else 0.0
    cost = sum(row.cost_usd for row in rows)
    return f"{tokens:,.0f}", f"{cost:.4f}" if cost else "0", f"{seconds:.1f}"


def _success(cell: Cell | None) -> MatrixCell:
    if cell is None or not cell.scored:
        return MatrixCell(f"{cell.lost} lost" if cell is not None and cell.lost else "–")
    low, high = cell.interval
    counts = (("invalid", cell.invalid), ("lost", cell.lost))
    return MatrixCell(
        f"{cell.passed}/{cell.scored}",
        f"{low:.2f}–{high:.2f}",
        tuple(f"{count} {what}" for what, count in counts if count),
        f"h{round(STEPS * cell.passed / cell.scored)}",
    )


def _difference_row(
    a: Sequence[TrialRow], b: Sequence[TrialRow], made: Comparison, names: Sequence[str]
) -> MatrixRow:
    """Return the row of B minus A by slice; only the total and single slices have an outcome."""
    known = {name: d for slices in made.slices.values() for name, d in slices.items()}
    known[TOTAL] = made.overall
    cells = list[MatrixCell]()
    for name in names:
        found = known.get(name) or _difference_in(a, b, name)
        kind = found.outcome if found and name in known else "inconclusive"
        cells.append(
            MatrixCell(signed_points(found.estimate), interval_points(found), (), kind)
            if found
            else MatrixCell("–")
        )
    tokens = "" if made.tokens is None else f"{100 * made.tokens:+.0f} %"
    cost = sum(row.cost_usd for row in b) - sum(row.cost_usd for row in a)
    spent = (tokens, f"{cost:+.4f}" if cost else "", "")
    return MatrixRow("B − A", ("points",), _cells_in_order(cells, spent), "gap")


def _difference_in(a: Sequence[TrialRow], b: Sequence[TrialRow], name: str) -> Difference | None:
    """Return the difference in a cell; None if the two share no trial of it."""
    old, new = ([row for row in rows if name in cell_names(row)] for rows in (a, b))
    try:
        return compare(old, new).overall
    except InputError:
        return None


def signed_points(share: float) -> str:
    """Return a share in points, with its sign."""
    return f"{round(100 * share, 1) + 0.0:+.1f}".replace("-", "−")


def interval_points(found: Difference) -> str:
    """Return the interval of a difference, in points."""
    ends = (found.interval.low, found.interval.high)
    return " to ".join(f"{100 * end:+.0f}".replace("-", "−") for end in ends)
