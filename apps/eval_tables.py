"""The results of a run on the terminal: scores, what was placed, turns, tokens and misses."""

from collections.abc import Sequence
from statistics import median

from rich.console import Console
from rich.table import Table

from ..evals.experiments.trials import TrialRow
from ..evals.statistics.cells import Cell
from .terminal import styled

SCORES = ("success", "95 %", "GCR", "strict", "chance SR", "chance GCR")
PLACED = (
    *("trials", "placed", "success", "strict"),
    *("right,\nif placed", "success,\nif placed", "mean\nIoU", "e95"),
)
MISSES = 200
"""Most misses to list; the report shows all of them."""
LONGEST = 150


def print_scores(title: str, found: Sequence[Cell]) -> None:
    """Print successes by cell, with intervals and the chance level."""
    extra = [n for n in ("invalid", "lost") if any(getattr(cell, n) for cell in found)]
    table = _number_table(title, *SCORES, *extra)
    for cell in found:
        low, high = cell.interval
        table.add_row(
            styled(cell.name),
            f"{cell.passed}/{cell.scored}",
            f"{low:.2f}-{high:.2f}",
            f"{cell.gcr:.2f}",
            f"{cell.strict}/{cell.scored}",
            f"{cell.chance.sr:.2f}",
            f"{cell.chance.gcr:.2f}",
            *(str(getattr(cell, name)) for name in extra),
        )
    Console(highlight=False).print(table)


def print_placed(found: Sequence[Cell]) -> None:
    """Print shares of all trials and of those that placed robots, by category, setup and style."""
    table = _number_table(None, *PLACED)
    for cell in (cell for cell in found if " " not in cell.name):
        right, known = cell.right_thing
        table.add_row(
            styled(cell.name),
            str(cell.scored),
            _share(cell.placed, cell.scored),
            _share(cell.passed, cell.scored),
            _share(cell.strict, cell.scored),
            _share(right, known),
            _share(cell.placed_passed, cell.placed),
            *("-" if mean is None else f"{mean:.3f}" for mean in (cell.iou, cell.e95)),
        )
    Console(highlight=False).print(table)


def print_turns(rows: Sequence[TrialRow]) -> None:
    """Print how many turns of dialogues were right, and how many rightly changed nothing."""
    turns = [row.turns for row in rows if row.turns is not None]
    if not turns:
        return
    right, total = sum(t.right for t in turns), sum(t.total for t in turns)
    kept, still = sum(t.kept for t in turns), sum(t.still for t in turns)
    Console(highlight=False, soft_wrap=True).print(
        f"Turns right: {right}/{total} ({_share(right, total)}). Turns that were only to ask, "
        f"answer or refuse and changed nothing: {kept}/{still}."
    )


def print_spent(rows: Sequence[TrialRow]) -> None:
    """Print the median requests and tokens of a trial, if a language model was used."""
    scored = [row for row in rows if row.scored]
    if not any(row.input_tokens for row in scored):
        return
    spent = [(r.requests, r.input_tokens, r.cached_tokens, r.output_tokens) for r in scored]
    requests, sent, cached, got = (f"{median(counts):,.0f}" for counts in zip(*spent, strict=True))
    Console(highlight=False, soft_wrap=True).print(
        f"Median of a trial: {requests} requests, {sent} input tokens ({cached} where the prompt "
        f"is cached), {got} output tokens."
    )


def print_misses(rows: Sequence[TrialRow]) -> None:
    """Print the trials that were not strictly right, and why."""
    console = Console(highlight=False, soft_wrap=True)
    misses = [row for row in rows if not row.strict and row.feedback]
    for row in misses[:MISSES]:
        kind = "not strict: " if row.sr else ""
        text = row.feedback[:LONGEST] if row.turns is None else row.feedback
        console.print(styled(f"{row.task} trial {row.trial}: {kind}{text}"))
    if len(misses) > MISSES:
        console.print(f"and {len(misses) - MISSES} more")


def _number_table(title: str | None, *names: str) -> Table:
    table = Table(title=title and styled(title), header_style="cyan", box=None)
    for name in ("", *names):
        table.add_column(name, justify="right" if name else "left", no_wrap=True)
    return table


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else "-"
