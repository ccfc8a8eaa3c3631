"""`formup prompts`: shows, renders, checks, drafts, releases and promotes prompts."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import date, datetime
from typing import Any

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text
from rich.tree import Tree

from ..evals.experiments.promotion import passed, verdict_of
from ..evals.experiments.tool_versions import retooled, tool_hashes
from ..evals.tasks.prompt_leaks import leaks
from ..prompts import Prompt, PromptError, PromptLibrary
from ..prompts.history import diff, lineage, log
from ..prompts.lint import Finding, lint
from ..prompts.release import new_draft, promote, release
from ..tools.errors import InputError
from . import arguments as inputs
from . import options as o
from .terminal import say, styled

ADDED, REMOVED, PLACE = "green", "red", "cyan"
app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.command("list")
def list_prompts(prompts: o.PromptsFolder = None, as_json: o.Json = False) -> None:
    """List all prompts; an asterisk marks the current version of an ID."""
    rows = _rows(PromptLibrary(prompts))
    if as_json:
        say(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    table = Table(box=None, header_style="cyan", padding=(0, 2), pad_edge=False)
    for title in ("", "prompt", "text", "summary"):
        table.add_column(title, no_wrap=title != "summary")
    for row in rows:
        said = styled(row["error"], style="red") if row["error"] else styled(row["summary"])
        mark = "*" if row["current"] else ""
        table.add_row(mark, row["name"], (row["sha256"] or "")[:12], said)
    _console().print(table)


@app.command()
def show(name: o.PromptArgument, prompts: o.PromptsFolder = None) -> None:
    """Print a prompt's file, below its name and hashes."""
    prompt = PromptLibrary(prompts).load(name)
    say(f"{prompt.name}\ntext {prompt.sha256}\nfile {prompt.file_sha256}\n")
    say(prompt.source, end="")


@app.command()
def render(
    name: o.PromptArgument, var: o.Variables = None, prompts: o.PromptsFolder = None
) -> None:
    """Print a prompt as the model gets it, with its inputs filled in."""
    prompt = PromptLibrary(prompts).load(name)
    say(prompt.render(inputs.variables(var, prompt.front.inputs)), end="")


@app.command()
def new(name: o.DraftName, parent: o.ParentName = None, prompts: o.PromptsFolder = None) -> None:
    """Start a draft from the current version or another one."""
    say(new_draft(PromptLibrary(prompts), name, parent))


@app.command("diff")
def show_diff(
    old: o.PromptArgument, new: o.PromptArgument, prompts: o.PromptsFolder = None
) -> None:
    """Show how two prompts differ, in front matter and text."""
    library = PromptLibrary(prompts)
    styles = {"+": ADDED, "-": REMOVED, "@": PLACE}
    for line in diff(library.load(old), library.load(new)):
        head = "bold" if line.startswith(("+++ ", "--- ")) else None
        _console().print(styled((line, head or styles.get(line[:1], ""))), soft_wrap=True)


@app.command("lint")
def lint_prompts(
    names: o.PromptNames = None, prompts: o.PromptsFolder = None, as_json: o.Json = False
) -> None:
    """List all problems of prompts; exit code 1 if any is an error."""
    found = _findings(PromptLibrary(prompts), names)
    if as_json:
        say(json.dumps([asdict(f) for f in found], indent=2, ensure_ascii=False))
    for finding in () if as_json else found:
        style = "red" if finding.severity == "error" else "yellow"
        where = f"{finding.prompt}: {finding.sentence}"
        line = styled((f"{finding.severity:>7}  ", style), where)
        _console().print(line, soft_wrap=True)
    errors = sum(f.severity == "error" for f in found)
    if not as_json:
        say(f"{errors} errors, {len(found) - errors} warnings")
    raise typer.Exit(1 if errors else 0)


@app.command("log")
def show_log(id: o.PromptId, prompts: o.PromptsFolder = None) -> None:
    """Show when and why versions were released and promoted."""
    for entry in log(PromptLibrary(prompts), id):
        line = styled((f"{entry.on}  {entry.name} ", "cyan"), f"{entry.what}: {entry.why}")
        _console().print(line, soft_wrap=True)


@app.command()
def tree(prompts: o.PromptsFolder = None, baselines: o.Baselines = None) -> None:
    """Show which version was made from which, with any scores."""
    library, scores = PromptLibrary(prompts), inputs.scores(baselines)
    rows = [row for row in _rows(library) if not row["error"]]
    children = lineage([library.load(row["name"]) for row in rows])
    labels = {row["name"]: _label(row, scores.get(row["name"], {})) for row in rows}
    root = Tree("prompts", hide_root=True)
    waiting = [(root, name) for name in reversed(children.get(None, []))]
    while waiting:
        above, name = waiting.pop()
        branch = above.add(labels[name])
        waiting += [(branch, child) for child in reversed(children.get(name, []))]
    _console().print(root)


@app.command("release")
def release_draft(
    name: o.DraftName,
    why: o.Why = "",
    report: o.ComparisonFile = None,
    prompts: o.PromptsFolder = None,
) -> None:
    """Freeze a draft as the next version; lint must find no error in it.

    With --report, the result of the comparison goes into the changelog.
    """
    library = PromptLibrary(prompts)
    errors = [f for f in _findings(library, [name]) if f.severity == "error"]
    if errors:
        found = " ".join(f.sentence for f in errors)
        raise InputError(f"{name} is not released, because lint found errors: {found}")
    draft, verdict, sentence = library.load(name), "pass", ""
    if report is not None:
        verdict, sentence = verdict_of(report, draft)
        why = f"{why} ({sentence})" if why.strip() else ""
    released = release(library, name, why, _today(), tool_hashes(draft))
    say(released)
    if verdict != "pass":
        say(f"formup: {released} is released, but has not passed: {sentence}.", error=True)


@app.command("promote")
def promote_version(
    name: o.PromptArgument,
    report: o.ComparisonFile = None,
    force: o.Force = False,
    why: o.Why = "",
    prompts: o.PromptsFolder = None,
) -> None:
    """Make a version the current one, after a comparison that it passed."""
    library = PromptLibrary(prompts)
    prompt = library.load(name)
    if force == (report is not None):
        raise InputError(
            "A promotion needs either a comparison that passed, --report FILE, or --force "
            "--why TEXT."
        )
    if report is None:
        if not why.strip():
            raise InputError('--force needs a reason for the changelog: --why "...".')
        promote(library, prompt.name, f"forced: {why}", _today(), None)
    else:
        current = library.load(prompt.id)
        because = "; ".join(filter(None, [passed(report, current, prompt), why]))
        promote(library, prompt.name, because, _today(), current.name)
    say(f"{prompt.id} is now {prompt.name}")


def _rows(library: PromptLibrary) -> list[dict[str, Any]]:
    """Return all prompts as data, with the error of each that cannot be used."""
    current: set[str] = set()
    for id in library.ids():
        try:
            current.add(library.current(id))
        except PromptError:
            continue  # an id that has only drafts
    rows: list[dict[str, Any]] = []
    for name in library.names():
        row = {"name": name, "current": name in current, "path": str(library.path(name))}
        try:
            rows.append(row | _facts(library.load(name)))
        except PromptError as error:
            rows.append(row | {"sha256": None, "summary": None, "error": str(error)})
    return rows


def _facts(prompt: Prompt) -> dict[str, Any]:
    front = prompt.front.model_dump(mode="json", exclude={"id", "version"})
    return {**prompt.facts, **front, "error": None}


def _findings(library: PromptLibrary, names: Sequence[str] | None) -> list[Finding]:
    """Return the findings of lint, texts copied from a suite, and tools changed since a release."""
    found = lint(library, names or None)
    broken = {f.prompt for f in found if f.rule == "unusable"}
    chosen = [n if "@" in n else library.current(n) for n in names or library.names()]
    for prompt in (library.load(name) for name in chosen if name not in broken):
        found += [*leaks(prompt), *retooled(library, prompt)]
    return found


def _label(row: dict[str, Any], scores: dict[str, float]) -> Text:
    mark = " *" if row["current"] else ""
    known = "".join(f"  {suite} {score:.3f}" for suite, score in scores.items())
    return styled(
        (f"{row['name']}{mark}", "bold" if mark else ""), f"  {row['summary']}", (known, "cyan")
    )


def _console() -> Console:
    return Console(highlight=False)


def _today() -> date:
    return datetime.now().astimezone().date()
