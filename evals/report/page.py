"""The page: matrix, tasks, pictures, our own style and script, and a policy that allows no others.

The policy (CSP) names style and script by their hashes: text that slipped through as HTML could
still load nothing and run nothing.
"""

import base64
import hashlib
from collections.abc import Sequence
from pathlib import Path

from ..experiments.journal import read_manifest
from .markup import Html, joined, tag
from .matrix import compared, counted, matrix, verdict
from .pictures import pictures, sprite
from .read import Side
from .task_cards import cards
from .trial_overlay import robot

HERE = Path(__file__).parent


def page(sides: Sequence[Side]) -> str:
    """The whole file.

    Args:
        sides: one run, or A and B of one arm each.

    Raises:
        InputError: A and B cannot be compared.
    """
    style, script = _file("report.css"), _file("report.js")
    suite = sides[0].suite
    head = joined(
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_policy(style, script)),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", f"{suite.name}: {', '.join(side.folder.resolve().name for side in sides)}"),
        tag("style", style),
    )
    held_out = any(side.suite.held_out for side in sides)
    below = _held_out() if held_out else _tasks(sides)
    main = tag("main", _intro(sides), _results(sides), below)
    body = tag("body", main, tag("script", script))
    return f"<!doctype html>\n{tag('html', tag('head', head), body, lang='en')}\n"


def _intro(sides: Sequence[Side]) -> Html:
    suite = sides[0].suite
    runs = [
        tag(
            "li", f"{side.called}: " if side.called else "", tag("code", side.folder.resolve().name)
        )
        for side in sides
    ]
    version = read_manifest(sides[0].folder).formup
    facts = f"Split {suite.split}, suite {suite.sha256[:12]}, formup {version}; {counted(sides)}."
    return tag(
        "header",
        tag("h1", suite.name),
        tag("p", suite.description),
        tag("p", facts, class_="note"),
        tag("ul", runs, class_="runs"),
    )


def _results(sides: Sequence[Side]) -> Html:
    told = verdict(compared(sides)) if len(sides) == 2 else None
    notes = (
        "Cells: successes of trials, and the interval at 95 % (Wilson's), which speaks of these "
        "tasks alone. Chance is the best of five policies that know where the thing is and nothing "
        "else. Invalid output is the model's failure and counts as one; lost trials are those a "
        "provider failed in and are not scored."
    )
    return tag("section", tag("h2", "Results"), told, matrix(sides), tag("p", notes, class_="note"))


def _held_out() -> Html:
    text = (
        "These tasks are held out: scores are all that is shown of them, no pictures, no "
        "positions and nothing of what was said."
    )
    return tag("p", text, class_="note")


def _tasks(sides: Sequence[Side]) -> Html:
    shown = pictures(sides[0].folder, sides[0].suite)
    return tag(
        "section",
        tag("h2", "Tasks"),
        _filter(sides[0]),
        _legend(),
        tag("div", cards(sides, shown), class_="cards", id="cards"),
        sprite(shown),
    )


def _filter(side: Side) -> Html:
    """Shown by the script, which it takes."""
    categories = list(dict.fromkeys(task.category for task in side.suite.tasks))
    choices = [tag("option", "all", value="")] + [
        tag("option", category, value=category) for category in categories
    ]
    return tag(
        "form",
        tag("label", tag("input", type="checkbox", id="failed"), " failed only"),
        tag("label", "category ", tag("select", choices, id="category")),
        tag("output", id="count", for_="failed category"),
        id="filter",
        hidden=True,
    )


def _legend() -> Html:
    slot = {"cx": 12, "cy": 8, "r": 6}
    cross, line = "M9 5L15 11M9 11L15 5", {"x1": 2, "y1": 8, "x2": 22, "y2": 8}
    marks = {
        "robot, right": robot((12, 8), 6, "right"),
        "robot, wrong": robot((12, 8), 6, "wrong"),
        "planned": tag("circle", cx=12, cy=8, r=4, class_="planned"),
        "true outline": tag("line", **line, class_="truth"),
        "outline it worked with": tag("line", **line, class_="found"),
        "where robots may stand": tag("line", **line, class_="band"),
        "slot": tag("circle", **slot, class_="slot"),
        "slot without a robot": joined(
            tag("circle", **slot, class_="slot empty"), tag("path", d=cross, class_="slot empty")
        ),
    }
    items = [
        tag("li", tag("svg", drawn, viewBox="0 0 24 16", aria_hidden="true", class_="key"), text)
        for text, drawn in marks.items()
    ]
    return tag("ul", items, class_="legend")


def _policy(style: str, script: str) -> str:
    return (
        f"default-src 'none'; img-src data:; style-src '{_sha(style)}'; "
        f"script-src '{_sha(script)}'; base-uri 'none'; form-action 'none'"
    )


def _sha(content: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}"


def _file(name: str) -> Html:
    return Html((HERE / name).read_text(encoding="utf-8"))
