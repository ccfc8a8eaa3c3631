"""`formup eval compare`, `gate` and `merge`: two versions side by side, over folders of trials."""

from collections.abc import Callable
from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table

from ..evals.experiments.compare import compare as compared
from ..evals.experiments.comparison import Comparison, Metric, Range, in_points
from ..evals.experiments.gate import MARGIN, Rise
from ..evals.experiments.journal import merge, read_rows
from ..evals.experiments.trials import Arm, TrialRow
from ..evals.tasks.stored_suite import join_stored
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import arguments as inputs
from . import options as o
from .terminal import say, styled

EXIT = {"pass": 0, "block": 1, "inconclusive": 3}
STYLE = {
    "pass": "bold green",
    "better": "bold green",
    "block": "bold red",
    "worse": "bold red",
    "inconclusive": "bold yellow",
}


def _command(concluded: Callable[[Comparison], int]) -> Callable[..., None]:
    """Make a command that compares two runs and exits with the code that `concluded` returns."""

    def command(
        a: o.OldRun,
        b: o.NewRun,
        arm_a: o.OldArm = None,
        arm_b: o.NewArm = None,
        metric: o.MetricName = "sr",
        margin: o.Margin = f"{MARGIN:g}",
        as_json: o.Json = False,
        out: o.ReportFile = None,
    ) -> None:
        made = _made((a, arm_a), (b, arm_b), metric, margin, out)
        console = Console(highlight=False, soft_wrap=True, quiet=as_json)
        if as_json:
            say(made.model_dump_json(indent=2))
        _print_comparison(console, made)
        _print_conclusion(console, made)
        raise typer.Exit(concluded(made))

    command.__doc__ = concluded.__doc__
    return command


@_command
def compare(made: Comparison) -> int:
    """Compare two versions: is B better or worse, may it replace A?

    Where that is open, says how many tasks or trials would settle it.
    """
    return 0


@_command
def gate(made: Comparison) -> int:
    """Compare two versions, with the verdict as the exit code.

    0: pass, B may replace A; 1: block; 3: inconclusive.
    """
    return EXIT[made.verdict]


def merge_shards(shards: o.Shards, out: o.MergedFolder) -> None:
    """Merge the trials of several shards into a new folder."""
    count = merge(shards, out)
    join_stored(shards, out)
    say(f"{count:,} trials in {out}")


def _made(
    old: tuple[Path, str | None],
    new: tuple[Path, str | None],
    metric: str,
    margin: str,
    out: Path | None,
) -> Comparison:
    measured, tolerated = _metric_named(metric), inputs.share("--margin", margin)
    if not tolerated:
        raise InputError("--margin 0 can never be passed; give a fraction above 0, such as 0.05.")
    made = compared(arm_rows(*old, "--arm-a"), arm_rows(*new, "--arm-b"), measured, tolerated)
    if out is not None:
        write_whole(out, f"{made.model_dump_json(indent=1)}\n".encode())
    return made


def _metric_named(text: str) -> Metric:
    for known in ("sr", "strict", "gcr"):
        if text == known:
            return known
    raise InputError(f"Unknown metric {text!r}. There are: sr, strict, gcr.")


def arm_rows(folder: Path, named: str | None, option: str) -> list[TrialRow]:
    """Return the rows of one arm of a folder.

    Args:
        named: words that all fit the arm: words of its name, its prompt, or the beginning of
            PROMPT#SHA256. An arm whose name has no further words goes first. None for the only
            arm there is.
        option: named in the error.

    Raises:
        InputError: the folder has rows, but not exactly one arm fits.
    """
    rows = read_rows(folder)
    words = named.split() if named else []
    arms = {arm.name: arm for arm in (row.arm for row in rows)}
    chosen = {name for name, arm in arms.items() if all(_says(name, arm, word) for word in words)}
    chosen = {name for name in chosen if len(name.split()) == len(words)} or chosen
    if rows and len(chosen) != 1:
        fits = f"; {option} {named!r} fits {len(chosen)} of them" if named else ""
        raise InputError(
            f"{folder} holds {len(arms)} arms{fits}; choose one by its words with {option}: "
            f"{'; '.join(sorted(arms))}."
        )
    return [row for row in rows if row.arm.name in chosen]


def _says(name: str, arm: Arm, word: str) -> bool:
    return word in (*name.split(), arm.prompt) or (
        arm.prompt is not None and "#" in word and f"{arm.prompt}#{arm.sha256}".startswith(word)
    )


def _print_comparison(console: Console, made: Comparison) -> None:
    for name, arm in (("A", made.a), ("B", made.b)):
        console.print(styled((f"{name} ", "cyan"), arm.name))
    console.print()
    console.print(_scores(made))
    console.print()
    console.print(_differences(made))
    tokens = "" if made.tokens is None else f"; tokens {100 * made.tokens:+.1f} %"
    console.print(
        f"one-sided bounds: {_interval_points(made.success)} points, of invalid output "
        f"{_interval_points(made.invalid)} points{tokens}"
    )
    if any(made.unpaired):
        a, b = made.unpaired
        console.print(f"left out, as unpaired: {a} trials of A, {b} of B")


def _scores(made: Comparison) -> Table:
    """Return a table of each version's scores; intervals at 95 %."""
    table = _plain_table(made.metric, "", "new tasks", "these tasks")
    for k in made.overall.a.pass_k:
        table.add_column(f"pass^{k}", justify="right", no_wrap=True)
    for name, score in (("A", made.overall.a), ("B", made.overall.b)):
        counted = "" if score.successes is None else f"{score.successes}/{score.trials}"
        again = [f"{value:.2f}" for value in score.pass_k.values()]
        intervals = [_shares(score.new_tasks), _shares(score.fixed_tasks)]
        table.add_row(f"{name}  {score.mean:.3f}", counted, *intervals, *again)
    return table


def _differences(made: Comparison) -> Table:
    """Return a table of B minus A over all tasks and by slice, in points; intervals at 95 %."""
    table = _plain_table("B - A", "tasks", "points", "new tasks", "p", "these tasks", "p", "")
    slices = ((n, d) for values in made.slices.values() for n, d in values.items())
    for name, found in (("all", made.overall), *slices):
        table.add_row(
            styled(name),
            str(found.tasks),
            in_points(found.estimate),
            _interval_points(found.interval),
            _p(found.p_holm),
            "-" if found.fixed_tasks is None else _interval_points(found.fixed_tasks),
            _p(found.fixed_p),
            styled(found.outcome, style=STYLE[found.outcome]),
        )
    if made.slices:
        table.caption, table.caption_justify = "p of slices on new tasks: Holm's", "left"
    return table


def _plain_table(first: str, *titles: str) -> Table:
    table = Table(box=None, header_style="cyan", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column(first, no_wrap=True)
    for title in titles:
        table.add_column(title, justify="right" if title else "left", no_wrap=True)
    return table


def _print_conclusion(console: Console, made: Comparison) -> None:
    """Print whether there is a difference, whether B may replace A, and what would settle each."""
    outcome, verdict, reasons = made.outcome, made.verdict, "; ".join(made.reasons)
    console.print(styled("difference: ", (outcome, STYLE[outcome])))
    console.print(
        styled("gate: ", (verdict, STYLE[verdict]), f": {reasons}" if made.reasons else "")
    )
    overall = made.overall
    for what, settled in (("difference", overall.settled_by), ("gate", made.settled_by)):
        if settled is None:
            continue
        each = round(overall.pairs / overall.tasks)
        ways = [
            f"{settled.trials:,} trials of each of these {overall.tasks} tasks"
            if settled.trials
            else "",
            f"{settled.tasks:,} tasks with {each} trials of each" if settled.tasks else "",
        ]
        text = " or ".join(filter(None, ways)) or "more tasks and trials than can be run"
        points = f"{100 * settled.difference:.1f} points (power .8)"
        console.print(f"to settle the {what}, detecting {points}: {text}")


def _shares(found: Range | None) -> str:
    return "-" if found is None else f"{found.low:.3f} to {found.high:.3f}"


def _interval_points(found: Range | Rise) -> str:
    return f"{in_points(found.low)} to {in_points(found.high)}"


def _p(value: float) -> str:
    return f"{value:.3f}" if value >= 0.001 else "<.001"
