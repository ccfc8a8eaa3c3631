"""What words do while a question is open: they answer it, drop it, or are held back.

No robots move on words alone before it is settled: what it is about would be lost.
"""

import re
from typing import Any

from ..tools.errors import InputError
from .messages import Call
from .offline.accounting import read_instruction
from .offline.answering import talk
from .offline.drafting import things_needed
from .offline.followups import read_followup
from .offline.standing import Standing
from .outcomes import Outcome, Paused

LED = r"\W*(?:(?:oh|ok|okay|no|well|ah|actually|please|then|just)\b\W*)*"
ENDS = r"(?:\W+(?:please|then|thanks|thank you))*\W*"
CALLED_OFF = re.compile(
    rf"{LED}(?:(?:cancel|never ?mind|forget)(?: (?:about )?(?:it|that|this|the question))?"
    rf"|(?:drop|skip) (?:the|that|this) question){ENDS}"
)
"""A sentence that drops an open question; it takes back a change only right after it was made."""
UNDONE = re.compile(
    rf"{LED}(?:undo|(?:take|scrap)(?= (?:it|that|this))|go back|abort|reset|"
    r"(?:let'?s |let me |i want to )?(?:start|begin) (?:over|again|afresh|anew)|restart)"
    rf"(?: (?:it|that|this|all|everything))?(?: back)?{ENDS}"
)
"""A sentence that drops an open question where there is nothing to take back."""
INSTEAD = re.compile(
    r"^\W*(?:(?:no|oh|ok|okay|wait|sorry|actually|rather|instead|never ?mind|"
    r"(?:forget|cancel|scrap|skip) (?:it|that|this)|(?:let'?s )?start (?:over|again)|then|but|and)"
    r"\b[\s,.:;]*)+|[\s,]+instead(?=\W*$)",
    re.IGNORECASE,
)
"""Words of a new instruction that only put it in the place of another."""
DROPS = frozenset({"undo", "hold", "go"})
"""Kinds of follow-ups that do not answer an open question but drop it."""
ASIDE = frozenset({"query", "talk"})
"""Kinds that drop what waits for approval; a question stays open."""


def calls_off(words: str, *, undoing: bool = False) -> bool:
    """Return whether words call off an open question.

    Args:
        undoing: whether words that take back or start over do so too.
    """
    said = words.lower()
    return bool(CALLED_OFF.fullmatch(said) or (undoing and UNDONE.fullmatch(said)))


def asks(outcome: Outcome | None) -> bool:
    """Return whether a turn waits for the answer to a question."""
    return isinstance(outcome, Paused) and outcome.call.name == "ask_user"


def drops(outcome: Paused, kind: str) -> bool:
    """Return whether words of a kind, as in `Followup`, drop what a turn waits for."""
    return kind in DROPS or (kind in ASIDE and outcome.call.name != "ask_user")


def asked_again(call: Call, words: str, standing: Standing | None) -> dict[str, Any]:
    """Return the arguments that ask a question again after help; {} if words ask for no help.

    Args:
        call: of `ask_user`, which asked the question.
        words: said while it is open.
        standing: the current plan.
    """
    said = read_followup(words, standing)
    if (said.kind, said.about) != ("talk", "help"):
        return {}
    told = talk(said, standing, ())
    question = str(call.arguments["question"]).removeprefix(told).strip()
    return {**call.arguments, "question": f"{told} {question}"}


def whole_instruction(words: str, metres_per_pixel: float | None, kind: str) -> str:
    """Return the new instruction that words are by themselves, "" if they may be an answer.

    It names the arrangement, the things and the number of robots, and nothing is left open.

    Args:
        words: said while a question is open.
        kind: what they are, as in `Followup`.
    """
    for text in (words, INSTEAD.sub("", words)) if kind == "instruction" else ():
        reading = read_instruction(text, metres_per_pixel)
        left = (reading.stops, reading.unread, reading.unscaled, reading.language)
        named = len(reading.things) == things_needed(reading)
        sure = reading.sure and reading.relation not in ("ask", "several")
        if sure and reading.robots and named and not any(left):
            return text
    return ""


def check_settled(outcome: Paused, kind: str) -> None:
    """Refuse to move robots while a question is open.

    Args:
        outcome: of the turn that waits.
        kind: what the next words are, as in `Followup`.

    Raises:
        InputError: they are a go, and what was asked about would be dropped (`asked`).
    """
    if kind == "go" and outcome.call.name == "ask_user":
        raise InputError(
            "A question is open, so nothing moves. Answer it, or say never mind to drop it; then "
            f"say go. It was: {outcome.call.arguments['question']}",
            "asked",
        )
