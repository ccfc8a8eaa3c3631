"""`formup eval`: the group of its commands."""

import typer

from . import (
    eval_compare,
    eval_perception,
    eval_report,
    eval_run,
    eval_suites,
    eval_table,
    eval_train,
)

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def group() -> None:
    """Evaluate formup on tasks with known answers."""


app.command(name="suites")(eval_suites.suites)
app.command(name="add")(eval_suites.add)
app.command(name="run")(eval_run.run_suite)
app.command(name="table")(eval_table.table)
app.command(name="train-rl")(eval_train.train_rl)
app.command(name="compare")(eval_compare.compare)
app.command(name="gate")(eval_compare.gate)
app.command(name="merge")(eval_compare.merge_shards)
app.command(name="report")(eval_report.report)
app.command(name="descriptors")(eval_suites.descriptors)
app.command(name="perception")(eval_perception.perception)
