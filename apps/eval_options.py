"""Options of `formup eval run`, `add`, `descriptors` and `report`, each declared once."""

from pathlib import Path
from typing import Annotated

import typer

SuiteName = Annotated[
    str, typer.Argument(help="A suite's name (formup eval suites), YAML file or folder.")
]
MethodName = Annotated[
    str,
    typer.Option(
        "--method",
        help="rules, agent, alone, zerocap, segment-only, rl, pile, scatter, boundary, circle or "
        "line.",
    ),
]
ModeName = Annotated[
    str, typer.Option("--mode", help="How to point: truth, outline, drawn, box, point or words.")
]
Seeds = Annotated[
    str | None, typer.Option("--seeds", help="First and last seed of drawn scenes: 0-199.")
]
TaskList = Annotated[list[str] | None, typer.Option("--task", help="Only this task; repeatable.")]
ModelList = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        help="Of agent, alone and zerocap, as in formup run, or replay:FOLDER; of segment-only a "
        "segmenter; of rl a folder of formup eval train-rl; repeatable.",
    ),
]
PromptList = Annotated[
    list[str] | None, typer.Option("--prompt", help="ID@VERSION; repeatable, side by side.")
]
DescriptorList = Annotated[
    list[str] | None,
    typer.Option("--descriptor", help="edges, edges+vertices or matrix; repeatable."),
]
Trials = Annotated[
    str | None,
    typer.Option("--trials", help="Tries of every task; 3 where --mode jitters it, else 1."),
]
Split = Annotated[str, typer.Option("--split", help="train, dev or test (scores only).")]
RunFolder = Annotated[
    Path | None,
    typer.Option("--out", help="The folder of the run; one that is there is gone on with."),
]
Shard = Annotated[str | None, typer.Option("--shard", help="i/n: the i-th of n parts.")]
Budget = Annotated[str | None, typer.Option("--budget", help="Most to spend, USD.")]
RateList = Annotated[
    list[str] | None,
    typer.Option("--rate", help="MODEL=N: requests a minute at most, over all jobs; repeatable."),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Run nothing; say what it would cost.")]
Jobs = Annotated[str, typer.Option("--jobs", help="Processes at once.")]
DescribedSuite = Annotated[str, typer.Argument(metavar="[SUITE]", help="Whose things.")]
NewFolder = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Pictures with an annotations.json.")
]
Name = Annotated[
    str | None, typer.Option("--name", help="Of the suite; the folder's name by default.")
]
ReportedRun = Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder.")]
Against = Annotated[
    Path | None, typer.Option("--against", help="Another run's folder, or the same: B beside A.")
]
PageFile = Annotated[
    Path | None, typer.Option("--out", help="The HTML file; report.html in RUN by default.")
]
