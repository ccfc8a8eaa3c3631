"""A table in the forms it is printed in: Markdown, CSV, JSON, LaTeX, and the report's matrix."""

import csv
import io
import json
from collections.abc import Callable, Sequence
from typing import Any

from ..experiments.comparison import in_points
from ..report.matrix import STEPS, Matrix, MatrixCell, MatrixRow
from .results import Result, Tabled

_ESCAPES = {c: f"\\{c}" for c in "&%$#_{}"} | {"–": "--", "~": r"\textasciitilde{}"}


def parts(result: Result) -> list[str]:
    """Return the texts of a cell: k/n (and the number planned if some are missing), interval, GCR.

    For an ablation also the difference from the whole, in points, and its interval.
    """
    if result.interval is None:
        return ["–"]
    of = f" of {result.planned}" if result.scored < result.planned else ""
    ends = "–".join(_two_digits(end) for end in result.interval)
    told = [f"{result.passed}/{result.scored}{of}", ends, f"GCR {_two_digits(result.gcr)}"]
    if (found := result.difference) is None:
        return told
    low, high = (in_points(end) for end in (found.interval.low, found.interval.high))
    return [*told, f"{in_points(found.estimate)} points", f"{low} to {high}"]


def paper(result: Result) -> str:
    """Return the paper's figures, or an empty string."""
    figure = result.paper or ()
    return " / ".join(_two_digits(value) for value in figure if value is not None)


def notes(made: Tabled) -> list[str]:
    """Return the remarks printed with a table: its notes, stand-ins, suite and cost."""
    said = [" ".join(note.split()) for note in made.table.notes]
    stand_ins = [f"{task}: {of}" for task, of in made.table.stand_ins.items()]
    said += [f"Stand-ins: {'; '.join(stand_ins)}."] if stand_ins else []
    suite = " ".join(filter(None, (made.table.suite, made.suite[:12])))
    left = sum(row.left_usd or 0.0 for row in made.rows)
    more = f", about {left:.2f} USD more for what is not run" if left else ""
    return [*said, f"Suite {suite}; {sum(r.cost_usd for r in made.rows):.4f} USD spent{more}."]


def as_matrix(made: Tabled) -> Matrix:
    """Return a table as the matrix of the report's page."""
    rows = [
        MatrixRow(row.head, row.remarks, [_matrix_cell(r) for r in row.results.values()])
        for row in made.rows
    ]
    return Matrix(("who", *made.table.columns), rows)


def _matrix_cell(result: Result) -> MatrixCell:
    upper, lower, *more = parts(result) if result.scored else ["–", " "]
    told = [f"paper {paper(result)}"] if result.paper else []
    shade = f"h{round(STEPS * result.passed / result.scored)}" if result.scored else ""
    return MatrixCell(upper, lower, (*more, *told), shade)


def _two_digits(value: float) -> str:
    """Format a share with two decimals and no leading zero, as the paper does."""
    return f"{value:.2f}".removeprefix("0")


def _markdown(made: Tabled) -> str:
    lines = [["", *made.table.columns], ["---"] * (len(made.table.columns) + 1)]
    for row in made.rows:
        cells = (
            [*parts(r), f"*paper {paper(r)}*"] if r.paper else parts(r)
            for r in row.results.values()
        )
        heads = [f"**{row.head}**", *row.remarks]
        lines.append(["<br>".join(said).replace("|", "/") for said in (heads, *cells)])
    table = [f"| {' | '.join(cells)} |" for cells in lines]
    told = [f"- {note}" for note in notes(made)]
    return "\n".join([f"# {made.table.title}", "", *table, "", *told, ""])


def _records(made: Tabled) -> list[dict[str, Any]]:
    """Return one record per cell."""
    return [
        {
            "table": made.name,
            "row": row.head,
            "model": row.model,
            "column": column,
            "passed": r.passed,
            "scored": r.scored,
            "planned": r.planned,
            "low": r.interval and round(r.interval.low, 4),
            "high": r.interval and round(r.interval.high, 4),
            "gcr": round(r.gcr, 4) if r.scored else None,
            "difference": r.difference and round(r.difference.estimate, 4),
            "difference_low": r.difference and round(r.difference.interval.low, 4),
            "difference_high": r.difference and round(r.difference.interval.high, 4),
            "paper_sr": r.paper and r.paper[0],
            "paper_gcr": r.paper and r.paper[1],
            "left_usd": row.left_usd,
            "remarks": "; ".join(row.remarks),
        }
        for row in made.rows
        for column, r in row.results.items()
    ]


def _csv(made: Tabled) -> str:
    cells, file = _records(made), io.StringIO()
    writer = csv.DictWriter(file, cells[0].keys() if cells else (), lineterminator="\n")
    writer.writeheader()
    writer.writerows(cells)
    return file.getvalue()


def _as_json(made: Tabled) -> str:
    content = {"title": made.table.title, "suite": made.suite, "notes": notes(made)}
    return json.dumps(content | {"cells": _records(made)}, indent=1) + "\n"


def _latex(made: Tabled) -> str:
    """Return a tabular in plain LaTeX, with the paper's figures in a second line of each row."""
    lines = [rf"\begin{{tabular}}{{l{'c' * len(made.table.columns)}}}", r"\hline"]
    lines += [_tex(["", *made.table.columns]), r"\hline"]
    for row in made.rows:
        found = row.results.values()
        head = f"{row.head} ({row.model})" if row.model else row.head
        lines.append(_tex([head, *(" ".join(parts(r)) for r in found)]))
        if any(r.paper for r in found):
            lines.append(_tex(["paper", *(paper(r) for r in found)]))
    return "\n".join([*lines, r"\hline", r"\end{tabular}", *(f"% {n}" for n in notes(made)), ""])


def _tex(cells: Sequence[str]) -> str:
    escaped = ("".join(_ESCAPES.get(c, c) for c in cell) for cell in cells)
    return f"{' & '.join(escaped)} \\\\"


FORMATS: dict[str, tuple[str, Callable[[Tabled], str]]] = {
    "markdown": ("md", _markdown),
    "csv": ("csv", _csv),
    "json": ("json", _as_json),
    "latex": ("tex", _latex),
}
"""File extension and writer of each format."""
