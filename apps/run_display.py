"""The report of a run on the terminal: things found, contract, certificate, arrival table."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ..agent.report import Report
from ..tools.formation.checking.verdict import Measure
from ..tools.formation.contract import MIN_SPACING, Group
from ..tools.formation.units import length_text
from ..tools.motion.checking import MotionVerdict
from .terminal import say, styled, under

LONGEST = 600
"""Most characters of an error message to show; a value it quotes may be vast."""
MAX_ROWS = 16
"""Most robots in the arrival table, the rest being summed up; and most findings listed."""
COLUMN = 14
"""The column where texts begin; only labels that formup itself writes stand before it."""
PLACES = {
    "around": "around",
    "cage": "caging",
    "corners": "at the corners of",
    "along": "along",
    "inside": "inside",
    "between": "between",
    "centre": "at the centre of",
    "shape": "in a form by",
    "at": "at points by",
}
GOING_ON = {
    "question": " --answer TEXT",
    "needs_approval": " --approve, or --refuse",
    "stopped": "",
    "failed": "",
}
STATUS_STYLE = {
    "deployed": "bold green",
    "planned": "bold green",
    "answered": "bold green",
    "question": "bold yellow",
    "needs_approval": "bold yellow",
    "impossible": "bold red",
    "stopped": "bold red",
    "failed": "bold red",
}


def show_report(console: Console, report: Report, folder: str, again: str | None = None) -> None:
    """Print a report for a person.

    Args:
        again: the command that goes on where `formup resume` would not, as the turn is over.
    """
    console.print(styled(report.instruction, style="bold"))
    for note in (report.image or {}).get("notes", ()):
        _line(console, "picture", note)
    for target in report.targets:
        _show_target(console, target)
    if report.contract is not None and not (report.files or {}).get("contract"):
        for group in report.contract.groups:
            _line(console, "contract", group_words(group, _scale(report)))
        if report.contract.keep_out:
            _line(console, "", f"keep out of {', '.join(report.contract.keep_out)}")
    if report.verdict is not None:
        for name, text in certificate_lines(report):
            _line(console, name, text)
    if report.arrival is not None:
        _arrival(console, report)
    console.print(
        styled((f"{report.status}: ", STATUS_STYLE[report.status]), under(report.message, COLUMN))
    )
    if report.candidates:
        _choices(console, report.candidates)
    _files(console, report, folder, again)


def deploy_command(plan: Path, fleet: str) -> str:
    """Return the command that sends a fleet's robots to a plan."""
    words = ["formup", "deploy", str(plan)]
    return shlex.join(words if fleet == "simulated" else [*words, "--fleet", fleet])


def _show_target(console: Console, target: Mapping[str, Any]) -> None:
    parts = ", ".join(f"{k.replace('_', ' ')} {v:.2f}" for k, v in target["parts"].items())
    box = ", ".join(f"{v:g}" for v in target["box"])
    _line(
        console,
        "found",
        f"{target['id']}: {target['label']}, box ({box}), "
        f"confidence {target['confidence']:.2f}{f' ({parts})' if parts else ''}",
    )
    if note := target.get("note"):
        _line(console, "", note)


def _files(console: Console, report: Report, folder: str, again: str | None) -> None:
    """Print which files were written, and how to go on from there."""
    files = {name: file for name, file in (report.files or {}).items() if file}
    if report.contract is not None and "contract" in files:
        written = report.contract.model_dump_json(exclude_defaults=True)
        console.print(styled((f"{'would do':>12}  ", "cyan"), written), soft_wrap=True)
        _line(console, "", f"to use it, run again with --contract {folder}/{files['contract']}")
    film = files.pop("film", None)
    if film:
        _line(console, "film", film)
    if files:
        _line(console, "files", f"{folder}/ {', '.join(files.values())}")
    if (files or again) and report.status in GOING_ON:
        resume = f"formup resume {folder}{GOING_ON[report.status]}"
        _line(console, "continue", again or resume)


def at_terminal() -> bool:
    """Return whether a person reads the output and can answer."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def ask(what: str) -> str:
    """Ask for the answer to the question just shown; return it, empty to leave it open."""
    say(f"{what} (Enter to leave it open): ", end="")
    line = sys.stdin.buffer.readline()  # not input(): it fails on bytes that are not text
    if not line.endswith(b"\n"):
        say("")
    return line.decode(errors="replace").strip()


def say_failed(message: str) -> None:
    """Say on stderr what was wrong; with --json, also as the one object on stdout."""
    message = " ".join(message.split())  # a path may hold a line break
    if len(message) > LONGEST:
        message = f"{message[: LONGEST // 2]} ... {message[-LONGEST // 2 :]}"
    say(f"formup: {message}", error=True)
    if "--json" in sys.argv and sys.argv[1] in ("run", "resume", "deploy", "chat"):
        report = Report(status="failed", message=message, instruction="", model="offline")
        say(report.model_dump_json(indent=None if sys.argv[1] == "chat" else 2))


def _line(console: Console, name: str, text: str) -> None:
    console.print(styled((f"{name:>12}  ", "cyan"), under(text, COLUMN)))


def choice_words(choice: Mapping[str, Any]) -> str:
    """Return a line on a choice of a question, beginning with its number in the picture."""
    box = ", ".join(f"{v:.0f}" for v in choice["box"])
    return f"{choice['id'].removeprefix('c')}: {choice['label']}, box ({box})"


def _choices(console: Console, candidates: Sequence[Mapping[str, Any]]) -> None:
    """Print a table of a question's choices, by their numbers in the picture."""
    table = Table(box=None, padding=(0, 2), pad_edge=False, header_style="cyan")
    for title in ("number", "looks like", "box"):
        table.add_column(title, justify="right" if title == "number" else "left")
    for choice in candidates:
        box = ", ".join(f"{v:.0f}" for v in choice["box"])
        table.add_row(styled(choice["id"].removeprefix("c")), styled(choice["label"]), box)
    console.print(table)


def group_words(group: Group, scale: float | None) -> str:
    """Return what a group demands, in one line."""
    noun = "robot" if group.robots == 1 else "robots"
    words = [
        f"{group.robots} {noun} {PLACES.get(group.relation, group.relation)}",
        " and ".join(group.targets),
    ]
    if group.side:
        words.append(f"({group.side} side)")
    if group.clearance is not None and group.relation == "inside":
        words.append(f"at least {length_text(group.clearance[0], scale)} from its edge")
    elif group.clearance is not None and group.relation != "corners":
        words.append(f"{length_text(group.clearance, scale)} away")
    escape_proof = group.closure == "escape-proof"
    if (
        group.spacing == "even"
        and group.relation not in ("corners", "centre", "at")
        and not escape_proof
    ):
        words.append("evenly spaced")
    if group.closure:
        words.append("escape-proof" if escape_proof else f"in a closed {group.closure}")
    words += _demands(group, scale)
    return " ".join(word for word in words if word).replace(" , ", ", ")


def _demands(group: Group, scale: float | None) -> list[str]:
    """Return what a group demands besides its arrangement and distance, as at most one clause."""
    said: list[str] = []
    if group.shape is not None:
        said.append(f"forming {group.shape.name} ({group.shape.where or 'where it says'})")
    if group.radius is not None:
        said.append(f"on a circle of radius {length_text(group.radius, scale)}")
    if group.pitch is not None:
        said.append(f"neighbours {length_text(group.pitch, scale)} apart")
    elif group.min_spacing is not None and group.min_spacing > MIN_SPACING:
        said.append(f"at least {length_text(group.min_spacing, scale)} apart")
    if group.max_gap is not None:
        said.append(f"gaps of at most {length_text(group.max_gap, scale)}")
    if group.opens:
        width = f" of at least {length_text(group.opening, scale)}" if group.opening else ""
        said.append(f"an opening{width} towards {group.opening_towards or 'bottom'}")
    if group.sides is not None:
        said.append(f"on its {', '.join(group.sides)} only")
    if group.facing is not None:
        said.append(f"on the side that faces {group.facing}")
    if group.heading is not None:
        named = isinstance(group.heading, str)
        said.append(f"heading {group.heading if named else f'{group.heading:g} degrees'}")
    return [f", {', '.join(said)}"] if said else []


def _scale(report: Report) -> float | None:
    return report.metric["metres_per_pixel"] if report.metric else None


def _measures(measures: dict[str, Measure], scale: float | None) -> str:
    """Return measures as text."""
    words: list[str] = []
    for name, value in measures.items():
        if not isinstance(value, str):
            value = length_text(value, scale, "g") if name.endswith("_px") else f"{value:g}"
        words.append(f"{name.removesuffix('_px').replace('_', ' ')} {value}")
    return ", ".join(words)


def certificate_lines(report: Report) -> list[tuple[str, str]]:
    """Return a certificate as pairs of a label and a text."""
    verdict = report.verdict
    assert verdict is not None
    lines = [] if report.partial is None else [("partial", report.partial.sentence)]
    head = "certified" if verdict.certified else "NOT CERTIFIED"
    measures = _measures(verdict.measures, _scale(report))
    lines.append((head, f"plan {report.plan_id}: {measures}"))
    lines += [("finding", finding.sentence) for finding in verdict.findings[:MAX_ROWS]]
    if len(verdict.findings) > MAX_ROWS:
        lines.append(("", f"and {len(verdict.findings) - MAX_ROWS} more findings"))
    if report.motion is not None:
        lines.append(("motion", _motion(report.motion, _scale(report))))
    return lines + [("note", note) for note in verdict.notes if note not in report.message]


def _motion(motion: MotionVerdict, scale: float | None) -> str:
    """Return the certificate of a motion as text."""
    if not motion.certified:
        return f"not certified: {motion.findings[0].sentence}"
    words = [f"{motion.makespan_s:.1f} s, longest path {length_text(motion.longest_px, scale)}"]
    if motion.separation_px is not None:
        words.append(f"robots at least {length_text(motion.separation_px, scale)} apart")
        words.append(f"{length_text(motion.demanded_px, scale)} required")
    if motion.clearance_px is not None:
        words.append(f"{length_text(motion.clearance_px, scale)} from obstacles")
    return ", ".join(words)


def _arrival(console: Console, report: Report) -> None:
    arrival, positions = report.arrival, report.positions
    assert arrival is not None and positions is not None
    table = Table(box=None, padding=(0, 2), pad_edge=False, header_style="cyan")
    for title in ("robot", "requested", "observed", "off by"):
        table.add_column(title, justify="right")
    rows = zip(arrival.robots, positions, arrival.observed, arrival.residual_px, strict=True)
    for robot, wanted, seen, off in islice(rows, MAX_ROWS):
        table.add_row(
            styled(robot),
            f"{wanted[0]:.1f}, {wanted[1]:.1f}",
            f"{seen[0]:.1f}, {seen[1]:.1f}",
            f"{off:.2f} px",
        )
    console.print(table)
    if len(positions) > MAX_ROWS:
        _line(
            console,
            "",
            f"and {len(positions) - MAX_ROWS} more robots, the furthest "
            f"{max(arrival.residual_px):.2f} px off",
        )
