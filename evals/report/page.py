"""The page: matrix, tasks, pictures, its own style and script, and a policy that allows no others.

The policy (CSP) names style and script by their hashes: text that slipped through as HTML could
still load nothing and run nothing.
"""

import base64
import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ...prompts import PromptLibrary
from ...tools.visible import visible
from ..experiments.compare import compare
from ..experiments.journal import read_manifest
from .matrix import Matrix, interval_points, matrix, signed_points
from .pictures import pictures
from .prompt_diff import prompt_diff
from .run_folder import Side
from .task_cards import cards

HERE = Path(__file__).parent
TRIALS_OPEN = 4
"""Trials of a task that are shown at first; the reader opens the others."""


def page(
    sides: Sequence[Side],
    library: PromptLibrary,
    table: Matrix | None = None,
    title: str = "",
    notes: Sequence[str] = (),
) -> str:
    """Return the whole HTML file.

    Args:
        sides: one run, or A and B of one arm each.
        library: where the prompts of A and B are looked up.
        table: shown instead of the matrix of the rows.
        title, notes: of that table; the notes are remarks shown with it.

    Raises:
        InputError: A and B cannot be compared.
    """
    suite, style, script = sides[0].suite, _file("report.css"), _file("report.js")
    comparison = compare(sides[0].rows, sides[1].rows) if len(sides) == 2 else None
    version = f"suite {suite.sha256[:12]}, formup {read_manifest(sides[0].folder).formup}"
    shown = {} if suite.held_out else pictures(sides[0].folder, suite)
    template = _environment().get_template("page.html")
    return template.render(
        sides=sides,
        suite=suite,
        style=style,
        script=script,
        policy=(
            f"default-src 'none'; img-src data:; style-src '{_sha(style)}'; "
            f"script-src '{_sha(script)}'; base-uri 'none'; form-action 'none'"
        ),
        folders=[side.folder.resolve().name for side in sides],
        facts=f"Split {suite.split}, {version}; {_tasks_and_trials(sides)}.",
        comparison=comparison,
        prompts=prompt_diff(comparison.a, comparison.b, library) if comparison else [],
        matrix=table or matrix(sides, comparison),
        title=title or suite.name,
        notes=notes,
        categories=list(dict.fromkeys(task.category for task in suite.tasks)),
        cards=[] if suite.held_out else cards(sides, shown),
        pictures=shown.values(),
        trials_open=TRIALS_OPEN,
    )


@cache
def _environment() -> Environment:
    """Return the environment; it escapes all that is not HTML yet, so forgetting it is harmless."""
    made = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_clean,
    )
    made.filters |= {"points": signed_points, "interval": interval_points}
    made.filters["px"] = lambda value: f"{round(float(value), 2):g}"
    return made


def _clean(value: Any) -> Any:
    """Return text with its control characters made visible; anything else, and HTML, as it is."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return visible(value.replace("\r\n", "\n"))


def _tasks_and_trials(sides: Sequence[Side]) -> str:
    """Say how many tasks and trials there are."""
    rows = [row for side in sides for row in side.rows]
    lost = sum(not row.scored for row in rows)
    counts = f"{len({row.task for row in rows}):,} tasks, {len(rows):,} trials"
    return f"{counts}, {lost:,} of them lost" if lost else counts


def _sha(content: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}"


def _file(name: str) -> Markup:
    return Markup((HERE / name).read_text(encoding="utf-8"))
