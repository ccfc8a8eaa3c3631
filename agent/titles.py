"""What a turn is called: the person's first words, and what they answered to its questions."""

import re
from collections.abc import Sequence
from textwrap import shorten

from .answers import says_yes
from .messages import Call, Message, Reply, Result
from .offline.options import option_chosen

MOST = 80
"""Most characters of answers in a title."""
NUMBER = re.compile(r"c?(\d+)")


def title_of(words: str, turn: Sequence[Message]) -> str:
    """Return what was asked in the end, such as "Surround the coin (the left one, 6)".

    Args:
        words: which the turn began with.
        turn: its messages.
    """
    asked = {c.id: c for m in turn if isinstance(m, Reply) for c in m.calls if c.name == "ask_user"}
    calls = list(asked.values())
    answers: list[str] = []
    for message in turn:
        if isinstance(message, Result) and message.call_id in asked and not message.error:
            call = asked[message.call_id]
            later = calls[calls.index(call) + 1 :]
            if not (later and _question(later[0]).endswith(_question(call))):  # it was not answered
                answers += _said(call, message.text)
    told = shorten(", ".join(answers), MOST, placeholder=" ...")
    return f"{words} ({told})" if told else words


def _question(call: Call) -> str:
    return str(call.arguments.get("question", ""))


def _said(call: Call, answer: str) -> list[str]:
    """Return an answer as it reads without its question; none for a plain yes."""
    number = NUMBER.fullmatch(answer.strip())
    if number is not None and call.arguments.get("candidates"):
        return [f"number {number[1]}"]
    chosen = option_chosen(answer, [str(o) for o in call.arguments.get("options", ())])
    return [] if says_yes(answer) else [chosen or answer.strip(" .!")]
