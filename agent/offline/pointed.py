"""Chooses which of several pointed things an instruction is about: "the upper coin", "t1"."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..first_message import Task, read_task
from ..messages import History, User
from .accounting import read_instruction
from .choosing import Step
from .finding import one_at
from .followup import Followup
from .followup_chunks import Chunk
from .followup_things import UNNAMED, resolved
from .followup_words import chunks_of
from .references import Reference, described
from .standing import Standing

ONE_SHOWN = re.compile(
    r"\b(?:the|this|that) (?:one|thing) (?:right )?(?:over|up|down|in)? ?here\b", re.IGNORECASE
)
SHOWING = re.compile(r"(?<=\w) (?:right )?(?:over|up|down) here\b", re.IGNORECASE)
"""Words that mean what is pointed at."""
OFF = re.compile(
    r"(?:(?:[,;.] ?)?(?:and |but |please |so )*)?\b"
    r"(?:(?:stay|keep|steer|keeping|staying|stays|kept) (?:\w+ )?(?:off|clear of|away from|out of)|"
    r"off|avoid(?:ing)?|mind|clear of|"
    r"(?:but |and )?not (?:on|over|touching)|(?:do not|don'?t|never) (?:touch|stand on|drive over)|"
    r"(?:no robots?|no one|nobody|none)(?: of them)?(?: (?:may|must|should|is to|can|shall))?"
    r"(?: (?:be|stand|go))? (?:on|over|near))(?: the)?\s+$",
    re.IGNORECASE,
)
"""Words before a thing to keep clear of."""
NOT = re.compile(
    r"[,;]?\s*(?:(?:and|but)\s+)?(?:not|rather than|instead of)\s+"
    r"(?:(?:a?round|about|at)\s+)?(?:the\s+)?$",
    re.IGNORECASE,
)
"""Words before a thing that is explicitly not meant."""
SEVERAL = re.compile(
    r"\b(?:each|every|both|all)\b(?: of)?(?: the| these| those)?\s*$", re.IGNORECASE
)
"""Words before a thing where more than one is meant."""
BARE = re.compile(r"left|right|upper|lower|top|bottom|first|second|third|last", re.IGNORECASE)
"""An answer that says which one but not what it is."""
POLITE = re.compile(r"[ ,]*(?:please|thanks|thank you)?[ .!]*$", re.IGNORECASE)
THE_THING = "the thing"
"""Stands in the instruction for the thing that is chosen."""


def shown_now(task: Task, before: History) -> tuple[dict[str, Any], ...]:
    """Return what this turn points at; what earlier turns pointed at is in their messages."""
    old = {p["id"] for m in before if isinstance(m, User) for p in read_task(m.text).pointed}
    return tuple(p for p in task.pointed if p["id"] not in {*old, *task.targets})


def using_pointed(task: Task, followup: Followup) -> Followup:
    """Return the follow-up if its edits use what is newly pointed at, else a new instruction.

    It is a refusal if the words are not an instruction.
    """
    named = json.dumps(followup.edits)
    used = any(json.dumps(p["id"]) in named or _places_at(p, followup) for p in task.pointed)
    if used or not followup.edits:
        return followup
    reading = read_instruction(task.instruction, task.metres_per_pixel)
    if reading.sure and reading.relation != "ask" and not (reading.stops or reading.unread):
        return Followup("instruction", text=task.instruction)
    text = (
        f'Nothing was changed: "{task.instruction}" does not say what to do about what was pointed '
        "at with it. Say that, or say it again without pointing."
    )
    return Followup("refuse", text=text)


def _places_at(prompt: Mapping[str, Any], followup: Followup) -> bool:
    """Return whether an edit puts a robot at the point that was pointed at."""
    points = prompt.get("points") or ()
    return len(points) == 1 and any(
        isinstance(at := edit.get("to"), (list, tuple)) and [*at] == [*points[0]]
        for edit in followup.edits
    )


def labelled(prompts: list[dict[str, Any]], things: Sequence[str]) -> list[dict[str, Any]]:
    """Return what was pointed at, labelled with the words for it if these name one thing."""
    label = re.sub(r"^(?:the|this|that) ", "", things[0]) if len(things) == 1 else ""
    named = set(label.lower().split()) - {"thing", "one", "object", "target"}
    return [{"label": label[:100], **prompts[0]}] if named and len(prompts) == 1 else prompts


def narrowed(task: Task, history: History) -> Task | Step:
    """Return the task about the pointed thing that its words name, or the call needed first.

    The task is about all things as before where the words do not single one out.
    """
    if task.pointed:
        task = replace(
            task, instruction=SHOWING.sub("", ONE_SHOWN.sub("this one", task.instruction))
        )
    centres = {str(p["id"]): _centre(p) for p in task.pointed}
    task, named = _things_named(task, centres)
    if not named:
        return task
    if len(task.pointed) == 1 and _shows(task.instruction, named[0][0]):
        named = [(named[0][0], str(task.pointed[0]["id"]))]
    if len(task.pointed) < 2 and named[0][1] not in centres:
        return task
    kept_off = _clear_of(task, named, centres)
    if kept_off is not None or len({name for _, name in named}) > 1:
        return kept_off or task
    chunk, name = named[0]
    if SEVERAL.search(task.instruction[: chunk.start]) or SEVERAL.match(_quantity(task, chunk)):
        return task
    if name not in centres:
        things = described([name.removeprefix("?")])
        looked = _looked(things, centres, history)
        if isinstance(looked, Step):
            return looked
        name = looked or name
    if name not in centres:
        return task
    text = task.instruction
    article = re.search(r"\b(?:the|this|that)\s+$", text[: chunk.start], re.IGNORECASE)
    start = article.start() if article else chunk.start
    words = f"{text[:start]}{THE_THING}{text[chunk.end :]}"
    chosen = tuple(p for p in task.pointed if p["id"] == name)
    return replace(task, instruction=words, pointed=chosen)


def chosen_by_answer(task: Task, answer: str, history: History) -> Task | None:
    """Return the task about the one of several pointed things that an answer names, such as "t1".

    None where the answer names none or more than one, or says more than that.
    """
    alone = POLITE.sub("", answer)
    spoken = f"the {alone} one" if BARE.fullmatch(alone) else alone
    found = narrowed(replace(task, instruction=f"surround {spoken}"), history)
    if not isinstance(found, Task) or len(found.pointed) != 1:
        return None
    whole = found.instruction.strip(" .!") == f"surround {THE_THING}"
    return replace(task, pointed=found.pointed) if whole else None


def _things_named(
    task: Task, centres: dict[str, tuple[float, float]]
) -> tuple[Task, list[tuple[Chunk, str]]]:
    """Return the task and its phrases for things with ids or words, without those denied."""
    things = tuple((str(p["id"]), str(p.get("label") or UNNAMED[0])) for p in task.pointed)
    contract: dict[str, Any] = {"groups": [{"relation": "around", "targets": [], "robots": 0}]}
    standing = Standing("", contract, (), things=things, centre=centres)
    found = [resolved(c, task.instruction, standing) for c in chunks_of(task.instruction, standing)]
    named = [(c, str(c.kinds["thing"])) for c in found if "thing" in c.kinds]
    for chunk, name in named[1:] if len(centres) > 1 else ():
        denied = NOT.search(task.instruction[: chunk.start])
        if denied and name != named[0][1]:  # "t1, not t2"
            text = f"{task.instruction[: denied.start()]}{task.instruction[chunk.end :]}"
            return _things_named(replace(task, instruction=text), centres)
    return task, named


def _looked(
    things: Sequence[Reference], centres: dict[str, tuple[float, float]], history: History
) -> str | Step | None:
    """Return the one a description fits, by looks alone if none is of its noun; or a call first."""
    found: str | Step | None = None
    for thing in things if len(things) == 1 else ():
        found = one_at(thing.whole_query, centres, history)
        if found is None and thing.query and thing.query != thing.whole_query:
            found = one_at(thing.query, centres, history)
    return found


def _quantity(task: Task, chunk: Chunk) -> str:
    """Return the first word of a phrase."""
    return (task.instruction[chunk.start : chunk.end].split() or [""])[0]


def _clear_of(
    task: Task, named: Sequence[tuple[Chunk, str]], centres: dict[str, tuple[float, float]]
) -> Task | None:
    """Return the task about one pointed thing, clear of others; None if it does not say so."""
    text, off = task.instruction, dict[str, tuple[int, int]]()
    about: list[tuple[Chunk, str]] = []
    for chunk, name in named:
        before = OFF.search(text[: chunk.start])
        if before is not None:
            off[name] = (before.start(), chunk.end)
        else:
            about.append((chunk, name))
    left = [name for name in centres if name not in off]
    if not off or len(left) != 1 or any(name != left[0] for _, name in about):
        return None
    if not {*off} <= {*centres}:
        return None
    cuts = [(*span, ", stay off the other thing") for span in off.values()]
    for chunk, _ in about:
        article = re.search(r"\b(?:the|this|that)\s+$", text[: chunk.start], re.IGNORECASE)
        cuts.append((article.start() if article else chunk.start, chunk.end, THE_THING))
    for start, end, words in sorted(cuts, reverse=True):
        text = f"{text[:start]}{words}{text[end:]}"
    shown = {str(p["id"]): p for p in task.pointed}
    return replace(task, instruction=text, pointed=tuple(shown[n] for n in (*left, *off)))


def _shows(text: str, chunk: Chunk) -> bool:
    """Return whether a phrase means what is pointed at: "this bench"."""
    return text[chunk.start : chunk.end].lower().startswith(("this ", "that "))


def _centre(prompt: dict[str, Any]) -> tuple[float, float]:
    """Return the centre of the box around a pointed thing, px."""
    box: Sequence[float] | None = prompt.get("box")
    corners = None if box is None else [box[:2], box[2:]]
    points = np.asarray(prompt.get("outline") or corners or prompt.get("points") or [(0, 0)])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return float(middle[0]), float(middle[1])
