"""Words to a drawn form, or to a side that faces another thing: "a star around it", "spell A".

Only plain wordings are read, and taken out of the instruction; what is left says where and how
many. What is not read stays in, and the planner says that it does not carry it out.
"""

import re
from dataclasses import dataclass
from typing import Any

from .arrangements import number_words, whole_number

MAKE = r"\b(?:form|make|draw|build)(?:ing)?\s+"
STAND = (
    r"(?P<kept>^\s*|\b(?:robots?|bots?|drones?|rovers?|agents?|units?|stand|arranged?|them|line up"
    r"|placed?)\s+)(?:in|into|as)\s+(?:the (?:shape|form) of\s+)?"
)
CORNERED = {"triangle": 3, "square": 4, "pentagon": 5, "hexagon": 6, "octagon": 8}
SIDES = {"left": "left", "right": "right", "top": "above", "bottom": "below"}
BESIDE = ("right", "left", "below", "above")
"""Where a form beside a thing is tried, one place after another."""
ENCLOSING = frozenset({"star", "polygon"})
READING = "The robots draw the form that the words name."
"""Said to the tool, which knows such words as those for other arrangements too."""


@dataclass(frozen=True)
class Form:
    """What robots draw.

    Attributes:
        shape: of the contract, without its place.
        said: the words for it.
        robots: how many it takes, where it says so.
    """

    shape: dict[str, Any]
    wording: str
    robots: int | None = None

    def where(self, relations: tuple[str, ...], side: str | None, attempt: int) -> str | None:
        """Its place by the target as the other words have it; None where they have none for it.

        Args:
            relations, side: of the instruction without the form.
            attempt: how many places beside the target had no room.
        """
        if relations == ("along",):
            if side is None:
                return BESIDE[attempt] if attempt < len(BESIDE) else None
            return SIDES.get(side)
        if relations == ("around",) and self.shape["kind"] in ENCLOSING:
            return "around"
        return "inside" if relations == ("inside",) else None


def form_in(instruction: str) -> tuple[Form | None, str]:
    """The form that an instruction names, and the instruction without it."""
    for read in (_letters, _grid, _figure):
        found = read(instruction)
        if found is not None:
            form, match = found
            kept = match.groupdict().get("kept") or ""
            rest = f"{instruction[: match.start()]}{kept} {instruction[match.end() :]}"
            return form, rest
    return None, instruction


def faced_in(instruction: str) -> tuple[str, str | None]:
    """An instruction without what a side is to face, and that: "the blue car with 5 robots"."""
    found = re.match(
        r"(?is)(?P<main>.+?),?\s+(?:and\s+)?(?:all\s+)?(?:(?:that|which)\s+)?(?:facing|faces)\s+"
        r"(?P<faced>(?:the|it|that|this)\b.*)$",
        instruction,
    )
    return (instruction, None) if found is None else (found["main"], found["faced"])


Found = tuple[Form, re.Match[str]] | None


def _letters(text: str) -> Found:
    """Letters that are quoted, in capitals or alone, so that no other words are drawn.

    They are a pen's strokes, or a font's outlines where the words say outlined.
    """
    more = r"(?: [A-Z0-9]{2,}(?! ?(?:px|pixels?|c?m)\b))*"
    written = rf"(?P<q>[\"'])(?P<quoted>[ !#-&(-~]+)(?P=q)|(?P<plain>[A-Z0-9]+{more})"
    signs = r"(?:outlined? )?(?:word|letter|number|digit)s?"
    lead = (
        rf"(?i:\b(?:spell|write)(?: out)?(?: the)?(?: {signs})?\s+|"
        rf"{MAKE}(?:the|an?) {signs}\s+|{STAND}(?:the|an?) {signs}\s+)"
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
    number = rf"(?:[0-9]{{1,4}}|{number_words()})"
    size = rf"(?P<rows>{number})\s*(?:by|x|\u00d7)\s*(?P<columns>{number})"
    grid = rf"an?\s+(?:{size}\s+grid|grid\s+of\s+{size.replace('P<', 'P<of_')}|grid)(?![\w-])"
    found = re.search(rf"(?i)(?:{MAKE}|{STAND}){grid}", text)
    if found is None:
        return None
    wording = [
        found[f"{of}{n}"] for of in ("", "of_") for n in ("rows", "columns") if found[f"{of}{n}"]
    ]
    counts = [whole_number(word.lower()) for word in wording]
    if not counts:
        return Form({"kind": "grid"}, "a grid"), found
    rows, columns = counts
    if not rows or not columns:
        return None
    return Form(
        {"kind": "grid", "rows": rows}, f"a grid of {rows} by {columns}", rows * columns
    ), found


def _figure(text: str) -> Found:
    names = "|".join(CORNERED)
    tips = rf"(?:(?P<tips>[0-9]{{1,2}}|{number_words()})[- ]pointed\s+)?"
    figure = (
        rf"an?\s+(?:regular\s+)?(?:{tips}(?P<star>star)|(?P<name>{names}))(?![\w-]|\s+of\s+the)"
    )
    found = re.search(rf"(?i)(?:{MAKE}|{STAND}){figure}", text)
    if found is None:
        return None
    if found["name"]:
        name = found["name"].lower()
        return Form({"kind": "polygon", "corners": CORNERED[name]}, f"the {name}"), found
    tips = None if found["tips"] is None else whole_number(found["tips"].lower())
    return Form({"kind": "star"} | ({"corners": tips} if tips else {}), "a star"), found
