"""A first instruction together with the answers to questions about it: what is finally meant.

An answer replaces words that were not understood if it says all that they can have meant; other
such words are asked about again, and those left out for the answer are reported.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...tools.formation.number_words import numbers_in
from ..first_message import Task
from .accounting import read_instruction
from .amending import with_last_count
from .counting import LEFT_TO_YOU
from .reading import Reading
from .several import shares
from .spelling import normalized_instruction

SIDE = re.compile(
    r"\b(?:left|right|top|bottom|upper|lower|above|below|north|south|east|west)\b", re.I
)
CORRECTING = re.compile(
    r"^\W*(?:(?:no|oh|sorry|wait|actually|rather|now|and|then|but|ok|okay|please|i mean|i meant|"
    r"i said|i want|i would like|i'd like|do it|make it|put (?:it|them)|have (?:it|them))\b[ ,.]*)+"
    r"|[ ,]+(?:instead|rather|please|then)(?=\W*$)",
    re.IGNORECASE,
)
"""Words of an answer that only mark it as a correction."""
RATHER = re.compile(
    r"(?:the |on |at )*(?P<new>[\w -]+?) (?:rather than|instead of|and not|not) (?:the |on |at )*"
    r"(?P<old>[\w -]+?)\W*$",
    re.IGNORECASE,
)
LEFT_OUT = re.compile(
    r"\W*(?:(?:ok|okay|yes|then|just|please|you can|you may)\W+)*"
    r"(?:leave|skip|drop|ignore|forget|omit|disregard)(?: about)? (?:it|that|this|them|those)"
    r"(?: part| bit| word| words)?(?: out| away| then| please)*\W*",
    re.IGNORECASE,
)
"""An answer that agrees to leave out what was not understood, as the question offers."""


def is_question(answer: str, scale: float | None) -> bool:
    """Return whether an answer is a question of the person's own."""
    return any(kind == "a question" for kind, _ in read_instruction(answer, scale).stops)


@dataclass(frozen=True)
class Restated:
    """A first instruction with the answers to questions about it.

    Attributes:
        text: the text to read.
        open: words beside it that are still to be asked about.
        left_out: words that were not understood and that an answer replaces.
    """

    text: str
    open: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def restated(task: Task, answers: Sequence[str]) -> Restated:
    """Return a task's instruction as restated by answers, in their order."""
    said, scale = Restated(normalized_instruction(task.instruction)), task.metres_per_pixel
    for answer in answers:
        if not answer.isdecimal() and not is_question(answer, scale):
            said = _with_answer(said, answer, scale)
    return said


def _with_answer(said: Restated, answer: str, scale: float | None) -> Restated:
    """Return the instruction with one more answer."""
    if LEFT_TO_YOU.fullmatch(answer):
        return replace(said, text=f"{said.text} with as many robots as needed")
    corrected = _corrected(said.text, answer)
    if corrected is not None:
        return replace(said, text=corrected)
    alone = read_instruction(answer, scale)
    if alone.unread:
        plain = CORRECTING.sub("", answer)
        cleared = read_instruction(plain, scale)
        answer, alone = (answer, alone) if cleared.unread else (plain, cleared)
    if shares(said.text):
        return replace(said, text=f"{said.text} . {answer}")
    unread, text = [*said.open, *read_instruction(said.text, scale).unread], said.text
    clear = not (alone.unread or alone.unscaled) and _is_informative(alone)
    counts = [quote for quote in unread if clear and _fact_kinds(quote) <= _fact_kinds(answer)]
    for quote in unread:
        text = text.replace(quote, " ", 1)
    return Restated(
        f"{text} . {answer}",
        tuple(quote for quote in unread if quote not in counts),
        (*said.left_out, *counts),
    )


def _corrected(text: str, answer: str) -> str | None:
    """Return the instruction corrected by an answer that only replaces a word, else None."""
    recounted = with_last_count(f"{text}, {answer}")
    if recounted != f"{text}, {answer}":
        return recounted
    plain = CORRECTING.sub("", answer)
    rather = RATHER.fullmatch(plain)
    if rather and len(re.findall(rf"\b{re.escape(rather['old'])}\b", text, re.I)) == 1:
        return re.sub(rf"\b{re.escape(rather['old'])}\b", rather["new"], text, flags=re.I)
    said, before = SIDE.findall(plain), SIDE.findall(text)
    alone = read_instruction(plain)
    only = {*alone.group} <= {"side", "sides"} and alone.robots is None and not alone.unread
    if only and len(said) == len(before) == 1 and plain != answer:
        return SIDE.sub(said[0], text)
    return None


def _is_informative(reading: Reading) -> bool:
    return bool(reading.robots or reading.group or reading.things or reading.sure)


def _fact_kinds(words: str) -> set[str]:
    """Return the kinds of facts that words contain: "number", "side"."""
    said = {"number": numbers_in(words), "side": SIDE.findall(words)}
    return {kind for kind, found in said.items() if found}
