"""Finds the drawn form that an instruction names: "a star around it", "spell A".

Only plain wordings are read, and taken out of the instruction; the rest says where and how many.
What is not read stays in, and the planner says that it does not carry it out.
"""

import re
from dataclasses import dataclass
from typing import Any

from ...tools.formation.number_words import SMALL, TENS, numbers_in

MAKE = (
    r"\b(?:form|make|draw|build|be|want|trace|lay out|outline|like|do|turn|change)(?:ing)?\s+"
    r"(?:(?:it|them|this|that|everyone)\s+)?(?:up\s+)?(?:in(?:to)?\s+|to\s+)?"
)
STAND = (
    r"(?P<kept>^\s*|[,.;:]\s*|\b(?:robots?|bots?|drones?|rovers?|agents?|units?|stand|arranged?|them"
    r"|line up|placed?|up|be|it|this|that|around)\s+)(?:in|into|as|be|like)\s+"
    r"(?:the (?:shape|form) of\s+)?"
)
SIZES = r"(?:(?:big|large|giant|huge|small|little|neat|proper|capital|block) )?"
CARDINALS = "|".join((*SMALL, *TENS))
COUNT = rf"(?:[0-9]{{1,4}}|\b(?:{CARDINALS})(?:[- ](?:{CARDINALS}))?\b)"
CORNERED = {"triangle": 3, "square": 4, "pentagon": 5, "hexagon": 6, "octagon": 8}
SIDES = {"left": "left", "right": "right", "top": "above", "bottom": "below"}
BESIDE = ("right", "left", "below", "above")
"""Places beside a thing at which a form is tried, in order."""
ENCLOSING = frozenset({"arc", "polygon", "star", "u", "v"})


@dataclass(frozen=True)
class Form:
    """A form that robots draw.

    Attributes:
        shape: of the contract, without its place.
        wording: its name in sentences to the person.
        robots: how many robots it takes; None where any number will do.
    """

    shape: dict[str, Any]
    wording: str
    robots: int | None = None


def form_in(instruction: str) -> tuple[Form | None, tuple[int, int]]:
    """Return the form of an instruction, or None, and its words' start and end in characters."""
    for read in (_letters, _grid, _figure):
        found = read(instruction)
        if found is not None:
            form, match = found
            kept = match.groupdict().get("kept") or ""
            return form, (match.start() + len(kept), match.end())
    return None, (0, 0)


Found = tuple[Form, re.Match[str]] | None


def _letters(text: str) -> Found:
    """Return letters that are quoted, in capitals or alone, so that no other words are drawn.

    They are pen strokes, or a font's outlines where the words say outlined.
    """
    more = r"(?: [A-Z0-9]{2,}(?! ?(?:px|pixels?|c?m)\b))*"
    written = rf"(?P<q>[\"'])(?P<quoted>[ !#-&(-~]+)(?P=q)|(?P<plain>[A-Z0-9]+{more})"
    signs = rf"{SIZES}(?:outlined? )?(?:word|letter|number|digit)s?"
    lead = (
        rf"(?i:\b(?:spell|write)(?: out)?(?: the)?(?: {signs})?\s+|"
        rf"{MAKE}(?:the|an?) {signs}\s+|{STAND}(?:the|an?) {signs}\s+|"
        rf"(?:shape|form) of (?:an?|the) (?:{signs}\s+)?|(?:^|[.,:]\s+)(?:an?|the) {signs}\s+)"
    )
    tail = r"(?i:\s+in (?:outline|outlined (?:letters|digits))(?![\w-]))?"
    found = re.search(rf"{lead}(?:{written})(?![\w'-]){tail}", text)
    if found is None:
        return None
    wording = found["quoted"] or found["plain"]
    if "outline" in found[0].replace(wording, "", 1).lower():
        form = Form(
            {"kind": "outlined_letters", "text": wording}, f"the outlined letters {wording}"
        )
        return form, found
    if re.search("[^A-Za-z0-9 ]", wording):
        return None
    return Form(
        {"kind": "letters", "text": wording.upper()}, f"the letters {wording.upper()}"
    ), found


def _grid(text: str) -> Found:
    size = rf"(?P<rows>{COUNT})\s*(?:by|x|\u00d7)\s*(?P<columns>{COUNT})"
    other = size.replace("P<", "P<of_")
    grid = rf"an?\s+{SIZES}(?:{size}\s+grid|grid\s+of\s+{other}|grid)(?![\w-])"
    found = re.search(rf"(?i)(?:{MAKE}|{STAND}){grid}", text)
    if found is None:
        return None
    wording = [
        found[f"{of}{n}"] for of in ("", "of_") for n in ("rows", "columns") if found[f"{of}{n}"]
    ]
    counts = [_whole(word) for word in wording]
    if not counts:
        return Form({"kind": "grid"}, "a grid"), found
    rows, columns = counts
    if not rows or not columns:
        return None
    return Form(
        {"kind": "grid", "rows": rows}, f"a {rows} by {columns} grid", rows * columns
    ), found


def _figure(text: str) -> Found:
    names = "|".join(CORNERED)
    tips = rf"(?:(?P<tips>{COUNT})[- ]pointed\s+)?"
    figure = (
        rf"{SIZES}(?:(?:regular|equilateral|perfect|hollow)\s+)?"
        rf"(?:{tips}(?P<star>star)|(?P<name>{names})(?:\s+(?:formation|shape))?)"
        r"(?![\w-]|\s+of\s+the)"
    )
    led, begun = rf"(?i)(?:{MAKE}|{STAND})(?:an?\s+)?{figure}", r"(?i)(?P<kept>^\s*)(?:an?\s+)?"
    by = r"(?=\s+(?:a?round|about|with|left of|right of|above|below)\b)"
    found = re.search(led, text) or re.search(f"{begun}{figure}{by}", text)
    if found is None:
        return None
    if found["name"]:
        name = found["name"].lower()
        return Form({"kind": "polygon", "corners": CORNERED[name]}, f"a {name}"), found
    tips = None if found["tips"] is None else _whole(found["tips"])
    return Form({"kind": "star"} | ({"corners": tips} if tips else {}), "a star"), found


def _whole(words: str) -> int | None:
    return next((n.whole for n in numbers_in(words)), None)
