"""Options of `formup eval run`, `add`, `descriptors` and `report`, each declared once."""

from pathlib import Path
from typing import Annotated

import typer

SuiteName = Annotated[
    str, typer.Argument(help="Name of a suite (see formup eval suites), YAML file or folder.")
]
MethodName = Annotated[
    str,
    typer.Option(
        "--method",
        help="Method to evaluate: rules, agent, alone, zerocap, segment-only, rl, pile, scatter, "
        "boundary, circle or line.",
    ),
]
ModeName = Annotated[
    str,
    typer.Option(
        "--mode", help="How targets are pointed at: truth, outline, drawn, box, point or words."
    ),
]
Seeds = Annotated[
    str | None,
    typer.Option("--seeds", help="First and last seed of generated scenes, such as 0-199."),
]
TaskList = Annotated[
    list[str] | None, typer.Option("--task", help="Run only this task; repeatable.")
]
ModelList = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        help="For agent, alone and zerocap a model as in formup run, or replay:FOLDER; for "
        "segment-only a segmenter; for rl a folder of formup eval train-rl; repeatable.",
    ),
]
PromptList = Annotated[
    list[str] | None,
    typer.Option("--prompt", help="Prompt, ID@VERSION; repeatable, run side by side."),
]
DescriptorList = Annotated[
    list[str] | None,
    typer.Option(
        "--descriptor",
        help="How shapes are described: edges, edges+vertices or matrix; repeatable.",
    ),
]
Trials = Annotated[
    str | None,
    typer.Option("--trials", help="Trials of each task; default: 3 if --mode adds jitter, else 1."),
]
Split = Annotated[
    str, typer.Option("--split", help="Split to run: train, dev or test (scores only).")
]
RunFolder = Annotated[
    Path | None,
    typer.Option("--out", help="Folder of the run; if it exists, the run in it is continued."),
]
Shard = Annotated[
    str | None, typer.Option("--shard", help="Run only the i-th of n parts, given as i/n.")
]
Budget = Annotated[str | None, typer.Option("--budget", help="Maximum to spend, in USD.")]
RateList = Annotated[
    list[str] | None,
    typer.Option(
        "--rate", help="MODEL=N: at most N requests per minute, over all jobs; repeatable."
    ),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Run nothing; estimate the cost.")]
Jobs = Annotated[str, typer.Option("--jobs", help="Number of parallel processes.")]
DescribedSuite = Annotated[
    str, typer.Argument(metavar="[SUITE]", help="Suite whose things are described.")
]
NewFolder = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder of pictures with an annotations.json.")
]
Name = Annotated[
    str | None, typer.Option("--name", help="Name of the suite; default: the folder's name.")
]
ReportedRun = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of the run.")]
Against = Annotated[
    Path | None,
    typer.Option("--against", help="Folder of a run to show beside it as B; may be the same one."),
]
PageFile = Annotated[
    Path | None, typer.Option("--out", help="HTML file to write; default: report.html in RUN.")
]
