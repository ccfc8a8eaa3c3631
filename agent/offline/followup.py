"""The value that words about an existing plan are read into."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .followup_edits import Effect

Kind = Literal["edits", "undo", "go", "hold", "query", "talk", "ask", "refuse", "instruction"]


@dataclass(frozen=True)
class Followup:
    """What is to be done in a turn.

    Attributes:
        kind: what it mainly is.
        undo: steps to take back first; below 0 to redo.
        to: the plan to go back to instead, "first".
        edits: then, in order, as edit_formation takes them. An id that begins with "?" is words
            for a thing that has to be found; `by` may be {"out": px} or {"in": px}.
        stay: robots that do not move meanwhile.
        go, hold: whether robots move then, or not before "go".
        query: a question about the plan: about, and robots or a thing.
        about: the topic of talk, such as thanks, hello, help, did, why, status, already; or tied,
            where a robot's place does not settle which one is meant.
        text: a question or a refusal; the words of a whole new instruction.
        options: commands that answer the question.
        rest: what is to be done after that, once it is confirmed.
        background: words that only state something and change nothing.
    """

    kind: Kind
    undo: int = 0
    to: str = ""
    edits: tuple[Effect, ...] = ()
    stay: tuple[int, ...] = ()
    go: bool = False
    hold: bool = False
    query: Effect | None = None
    about: str = ""
    text: str = ""
    options: tuple[str, ...] = ()
    rest: str = ""
    background: tuple[str, ...] = ()

    @property
    def things(self) -> list[str]:
        """Words for things that have to be found, without repeats."""
        named = re.findall(r"'\?([^']*)'", repr([*self.edits, self.query]))
        return list(dict.fromkeys(named))


def robot_fields(edit: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the fields of an edit in which single robots are named."""
    return ("a", "b") if edit["kind"] == "swap" else ("robot",)


def main_topic(talk: Sequence[str]) -> str:
    """Return the main topic of talk: thanks and greetings come last."""
    weighty = (about for about in talk if about not in ("thanks", "hello"))
    return next(weighty, talk[0] if talk else "")
