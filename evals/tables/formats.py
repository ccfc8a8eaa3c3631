"""A table in the forms it is printed in: Markdown, CSV, JSON, LaTeX, and the report's matrix."""

import csv
import io
import json
from collections.abc import Callable, Iterator
from typing import Any

from ..report.matrix import STEPS, Matrix, MatrixCell, MatrixRow
from .results import Result, ResultRow, Tabled

ONCE = "one try"


def share(value: float) -> str:
    """A share with two digits, as the paper writes it."""
    return f"{value:.2f}".removeprefix("0")


def count(result: Result) -> str:
    """Successes of trials, and of how many there are to be where some are missing."""
    of = f" of {result.planned}" if result.scored < result.planned else ""
    return f"{result.passed}/{result.scored}{of}" if result.scored else "–"


def interval(result: Result) -> str:
    """Its ends; nothing without trials."""
    ends = result.interval or ()
    return "–".join(share(end) for end in ends)


def recall(result: Result) -> str:
    """The mean GCR; nothing without trials."""
    return "" if result.gcr is None else f"GCR {share(result.gcr)}"


def here(result: Result) -> str:
    """What came of a cell in one line: k/n, interval, GCR."""
    ends = f"[{interval(result)}]" if result.interval else ""
    return " ".join(filter(None, (count(result), ends, recall(result))))


def paper(result: Result) -> str:
    """The paper's figure, or nothing."""
    if result.paper is None:
        return ""
    return " / ".join(share(value) for value in result.paper if value is not None)


def remarks(row: ResultRow) -> list[str]:
    """What is to be said of a row beside its figures."""
    said = [row.model, row.part]
    said += [ONCE] if row.once and any(r.scored for r in row.results.values()) else []
    said += [f"{row.tokens[0]:,} + {row.tokens[1]:,} tokens a trial"] if row.tokens else []
    said += [f"{row.beyond:+.0%} tokens beyond edges"] if row.beyond is not None else []
    said += [f"paper {row.paper_beyond:+.0%} tokens"] if row.paper_beyond is not None else []
    said += [f"{row.invalid} invalid"] if row.invalid else []
    said += [f"{row.lost} lost to the provider"] if row.lost else []
    return [*filter(None, (*said, row.missing))]


def markdown(made: Tabled) -> str:
    """A page of Markdown: the table, notes, stand-ins."""
    titles = ["", *made.table.columns]
    lines = [f"# {made.table.title}", "", _line(titles), _line(["---"] * len(titles))]
    for row in made.rows:
        head = "<br>".join([f"**{row.head}**", *remarks(row)])
        lines.append(_line([head, *(_marked_down(r) for r in row.results.values())]))
    lines += ["", *(f"- {note}" for note in notes(made))]
    return "\n".join(lines) + "\n"


def notes(made: Tabled) -> list[str]:
    """What has to be said beside a table, with the stand-ins."""
    stand_ins = [f"{task}: {of}" for task, of in made.table.stand_ins.items()]
    said = [" ".join(note.split()) for note in made.table.notes]
    said += [f"Stand-ins: {'; '.join(stand_ins)}."] if stand_ins else []
    suite = f"{made.table.suite}, {made.suite[:12]}" if made.suite else made.table.suite
    left = f", about {made.left_usd:.2f} USD more for what is not run" if made.left_usd else ""
    return [*said, f"Suite {suite}; {made.cost_usd:.4f} USD spent{left}."]


def records(made: Tabled) -> Iterator[dict[str, Any]]:
    """One record a cell, for CSV and JSON."""
    for row in made.rows:
        for column, r in row.results.items():
            yield {
                "table": made.name,
                "row": row.head,
                "model": row.model,
                "column": column,
                "passed": r.passed,
                "scored": r.scored,
                "planned": r.planned,
                "low": None if r.interval is None else round(r.interval.low, 4),
                "high": None if r.interval is None else round(r.interval.high, 4),
                "gcr": None if r.gcr is None else round(r.gcr, 4),
                "paper_sr": None if r.paper is None else r.paper[0],
                "paper_gcr": None if r.paper is None else r.paper[1],
                "tokens_in": row.tokens and row.tokens[0],
                "tokens_out": row.tokens and row.tokens[1],
                "beyond_edges": row.beyond,
                "invalid": row.invalid,
                "lost": row.lost,
                "missing": row.missing,
                "left_usd": row.left_usd,
            }


def comma_separated(made: Tabled) -> str:
    """A line a cell, under a header."""
    cells, file = list(records(made)), io.StringIO()
    writer = csv.DictWriter(file, cells[0].keys(), lineterminator="\n")
    writer.writeheader()
    writer.writerows(cells)
    return file.getvalue()


def as_json(made: Tabled) -> str:
    """The cells, and what has to be said beside them."""
    content = {"title": made.table.title, "suite": made.suite, "notes": notes(made)}
    return json.dumps(content | {"cells": list(records(made))}, indent=1) + "\n"


def latex(made: Tabled) -> str:
    """A tabular of plain LaTeX, the paper's figures in a second line of each row."""
    count = len(made.table.columns)
    lines = [rf"\begin{{tabular}}{{l{'c' * count}}}", r"\hline"]
    lines += [_tex(["method", *made.table.columns]), r"\hline"]
    for row in made.rows:
        head = f"{row.head} ({row.model})" if row.model else row.head
        lines.append(_tex([head, *(here(r) for r in row.results.values())]))
        if any(r.paper for r in row.results.values()):
            lines.append(_tex(["  paper", *(paper(r) for r in row.results.values())]))
    lines += [r"\hline", r"\end{tabular}", *(f"% {note}" for note in notes(made))]
    return "\n".join(lines) + "\n"


def as_matrix(made: Tabled) -> Matrix:
    """The matrix of the report's page."""
    rows = [
        MatrixRow(row.head, remarks(row), [_matrix_cell(r) for r in row.results.values()])
        for row in made.rows
    ]
    return Matrix(("who", *made.table.columns), rows)


def _matrix_cell(result: Result) -> MatrixCell:
    told = (f"paper {paper(result)}",) if result.paper else ()
    if not result.scored:
        return MatrixCell("–", " ", told)
    shade = f"h{round(STEPS * result.passed / result.scored)}"
    return MatrixCell(count(result), interval(result), (recall(result), *told), shade)


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _marked_down(result: Result) -> str:
    told = f"<br>*paper {paper(result)}*" if result.paper else ""
    return f"{here(result)}{told}"


_ESCAPES = {c: f"\\{c}" for c in "&%$#_{}"} | {"–": "--", "~": r"\textasciitilde{}"}


def _tex(cells: list[str]) -> str:
    escaped = ("".join(_ESCAPES.get(c, c) for c in cell) for cell in cells)
    return f"{' & '.join(escaped)} \\\\"


FORMATS: dict[str, tuple[str, Callable[[Tabled], str]]] = {
    "markdown": ("md", markdown),
    "csv": ("csv", comma_separated),
    "json": ("json", as_json),
    "latex": ("tex", latex),
}
"""How a table's files end, and what writes them."""
