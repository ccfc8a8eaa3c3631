"""The matrix: who (method, prompt, model) by which slice of the tasks, counts with intervals.

Intervals of counts are Wilson's, of these tasks; those of a difference are of tasks like these.
"""

from collections.abc import Sequence
from statistics import median

from ...tools.errors import InputError
from ..experiments.compare import compare
from ..experiments.comparison import Comparison, Difference
from ..experiments.journal import USUAL, Arm
from ..experiments.trials import TrialRow
from ..statistics.cells import TOTAL, Cell, cells
from .markup import Content, Html, joined, tag
from .read import Side

SPENT = ("tokens a trial", "USD", "median s")
STEPS = 5
"""Shades of a cell, by the share of successes."""


def matrix(sides: Sequence[Side]) -> Html:
    """A table of all arms; where two sides are compared, with the difference.

    Args:
        sides: one run, or A and B, each of one arm.
    """
    levels = sides[0].suite.levels
    arms = [(side, arm, side.of(arm)) for side in sides for arm in side.arms]
    found = [{cell.name: cell for cell in cells(rows, levels)} for _, _, rows in arms]
    there = {name for named in found for name in named}
    names = _columns([name for name in levels if name in there])
    body = [
        _row(side.called, arm, rows, [named.get(name) for name in names])
        for (side, arm, rows), named in zip(arms, found, strict=True)
    ]
    if len(sides) == 2:
        body.append(_difference(sides[0].rows, sides[1].rows, names))
    chance = [tag("td", f"{levels[name].sr:.2f}") for name in names]
    blank = ["", "", ""]
    body.append(tag("tr", tag("th", "chance", scope="row"), _with(chance, blank), class_="chance"))
    titles = ("who", names[0], *SPENT, *names[1:])
    head = [tag("th", title, scope="col") for title in titles]
    return tag(
        "div",
        tag(
            "table",
            tag("thead", tag("tr", head)),
            tag("tbody", body),
        ),
        class_="scroller",
        tabindex="0",
        role="region",
        aria_label="Matrix of results",
    )


def verdict(made: Comparison) -> Html:
    """What the comparison comes to, in a sentence."""
    overall = made.overall
    word = {"better": "B is better", "worse": "B is worse"}.get(made.outcome, "Inconclusive")
    told = (
        f": B − A is {_points(overall)} ({_bounds(overall)}, at 95 %, of tasks like these), over "
        f"{overall.pairs} pairs of trials of {overall.tasks} tasks."
    )
    return tag("p", tag("strong", word, class_=made.outcome), told, class_="verdict")


def compared(sides: Sequence[Side]) -> Comparison:
    """A and B, compared.

    Raises:
        InputError: they have nothing in common, or are of two suites.
    """
    a, b = sides
    return compare(a.rows, b.rows)


def _columns(names: list[str]) -> list[str]:
    """The total first, then single slices, then cells of two."""
    return sorted(names, key=lambda name: (name != TOTAL, name.count(" ")))


def _row(called: str, arm: Arm, rows: Sequence[TrialRow], found: Sequence[Cell | None]) -> Html:
    scored = [row for row in rows if row.scored]
    tokens = sum(row.input_tokens + row.output_tokens for row in scored) / max(len(scored), 1)
    seconds = median(row.seconds for row in scored) if scored else 0.0
    cost = sum(row.cost_usd for row in rows)
    spent = [f"{tokens:,.0f}", f"{cost:.4f}" if cost else "0", f"{seconds:.1f}"]
    return tag("tr", named(called, arm), _with([_cell(c) for c in found], spent))


def named(called: str, arm: Arm) -> Html:
    """The head of an arm's row."""
    facts = [f"{arm.prompt}#{(arm.sha256 or '')[:12]}"] if arm.prompt else []
    facts += [] if arm.model in ("none", arm.method) else [arm.model]
    facts += [arm.descriptor] if arm.descriptor not in (None, USUAL) else []
    return tag(
        "th",
        tag("b", f"{called}: {arm.method}" if called else arm.method),
        [tag("span", fact) for fact in facts],
        scope="row",
    )


def _with(slices: Sequence[Html], spent: Sequence[str]) -> Html:
    """The cells of a row: the total, what was spent, the other slices."""
    return joined(slices[0], [tag("td", text) for text in spent], slices[1:])


def _cell(cell: Cell | None) -> Html:
    if cell is None or not cell.scored:
        lost = f"{cell.lost} lost" if cell is not None and cell.lost else "–"
        return tag("td", lost)
    low, high = cell.interval
    notes = [
        f"{count} {what}"
        for what, count in (("invalid", cell.invalid), ("lost", cell.lost))
        if count
    ]
    return _two(
        f"{cell.passed}/{cell.scored}",
        f"{low:.2f}–{high:.2f}",
        [tag("small", note) for note in notes],
        f"h{round(STEPS * cell.passed / cell.scored)}",
    )


def _two(upper: str, lower: str, notes: Content, kind: str) -> Html:
    return tag("td", tag("b", upper), tag("small", lower), notes, class_=kind)


def _difference(a: Sequence[TrialRow], b: Sequence[TrialRow], names: Sequence[str]) -> Html:
    """B minus A by slice; whether it could be chance is said of single slices alone."""
    made = compare(a, b)
    told = {name: d for slices in made.slices.values() for name, d in slices.items()}
    told[TOTAL] = made.overall
    found = [told[name] if name in told else _within(a, b, name) for name in names]
    tokens = "" if made.tokens is None else f"{100 * made.tokens:+.0f} %"
    cost = sum(row.cost_usd for row in b) - sum(row.cost_usd for row in a)
    spent = [tokens, f"{cost:+.4f}" if cost else "", ""]
    return tag(
        "tr",
        tag("th", tag("b", "B − A"), tag("span", "points"), scope="row"),
        _with([_gap(d, name in told) for name, d in zip(names, found, strict=True)], spent),
        class_="gap",
    )


def _within(a: Sequence[TrialRow], b: Sequence[TrialRow], name: str) -> Difference | None:
    """The difference in a cell of category and setup; None where the two share no trial."""
    try:
        return compare(
            [row for row in a if f"{row.category} {row.setup}" == name],
            [row for row in b if f"{row.category} {row.setup}" == name],
        ).overall
    except InputError:
        return None


def _gap(found: Difference | None, told: bool) -> Html:
    if found is None:
        return tag("td", "–")
    return _two(_points(found), _bounds(found), None, found.outcome if told else "inconclusive")


def _points(found: Difference) -> str:
    return f"{round(100 * found.estimate, 1) + 0.0:+.1f}".replace("-", "−")


def _bounds(found: Difference) -> str:
    low, high = (
        f"{100 * end:+.0f}".replace("-", "−") for end in (found.interval.low, found.interval.high)
    )
    return f"{low} to {high}"


def counted(sides: Sequence[Side]) -> str:
    """How many tasks and trials there are."""
    rows = [row for side in sides for row in side.rows]
    lost = sum(not row.scored for row in rows)
    told = f"{len({row.task for row in rows}):,} tasks, {len(rows):,} trials"
    return f"{told}, {lost:,} of them lost" if lost else told
