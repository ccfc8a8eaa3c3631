"""`formup eval perception`: how accurate outlines are, and how well confidence predicts it."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from ..evals.perception.finding import finding_table, searches
from ..evals.perception.samples import MODES, Mode, measured, peak_memory
from ..evals.perception.tables import Row, markdown, row
from ..tools.errors import InputError
from ..tools.perception.segmenters.protocol import Segmenter
from ..tools.perception.segmenters.registry import segmenter_named
from .terminal import say

Suites = Annotated[
    list[str] | None,
    typer.Argument(help="Suites of pictures to measure.", show_default="photos photos-added"),
]
Modes = Annotated[
    list[str] | None,
    typer.Option(
        "--mode",
        help="How things are pointed at: outline, box or point; repeatable.",
        show_default="all, and by colour",
    ),
]
Named = Annotated[str, typer.Option("--segmenter", help="Segmenter to measure, as in formup run.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def perception(
    suites: Suites = None, mode: Modes = None, segmenter: Named = "grabcut", json_: AsJson = False
) -> None:
    """Measure how accurate outlines are, on suites of pictures.

    Points three times at each thing. IoU is the overlap with the true outline; e95 the distance
    within which 95 % of the boundaries lie, divided by the square root of the area; placed the
    share of outlines whose confidence reaches the threshold. Without --mode it also asks for
    things by their colour, every fourth time for a colour that the picture has nowhere.
    """
    chosen = segmenter_named(segmenter)
    rows: list[Row] = []
    pictures = suites or ["photos", "photos-added"]
    for way in _modes(mode, chosen, segmenter):
        for suite in pictures:
            rows.append(row(segmenter, way, suite, list(measured(suite, way, chosen))))
    sought = {} if mode else {suite: list(searches(suite)) for suite in pictures}
    if json_:
        data = {"rows": [asdict(r) for r in rows], "peak_memory_mib": round(peak_memory())}
        data |= {"searches": {suite: [asdict(s) for s in made] for suite, made in sought.items()}}
        say(json.dumps(data, indent=1))
    else:
        say(markdown(rows))
        say(f"\n{finding_table(sought)}" if sought else "")
        say(f"\nPeak memory: {peak_memory():.0f} MiB.")


def _modes(given: list[str] | None, segmenter: Segmenter, name: str) -> list[Mode]:
    """Return the modes asked for, or all that a segmenter takes.

    Raises:
        InputError: one is unknown, or the segmenter does not take it.
    """
    wrong = set(given or ()) - set(MODES)
    if wrong:
        raise InputError(f"Unknown mode {min(wrong)!r}. There are: {', '.join(MODES)}.")
    fit: list[Mode] = [m for m in MODES if {m, f"{m}s"} & segmenter.takes]
    refused = set(given or ()) - set(fit)
    if refused or not fit:
        can = f"only {' and '.join(fit)}" if fit else "neither outlines, boxes nor points"
        raise InputError(
            f"The segmenter {name} takes {can}: leave --mode out, or name one of these."
        )
    return [m for m in fit if given is None or m in given]
