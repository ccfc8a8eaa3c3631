"""What is said while a question is open but does not answer it, and questions that are dropped."""

import re

from ..answers import says_yes
from ..first_message import Task, read_task
from ..messages import Call, History, Message, Reply, Result, User
from .answering import talk
from .conversing import told_beside
from .followups import ASKING, read_followup
from .options import option_chosen
from .restated import is_question

NOTHING_YET = "Nothing stands yet, so there is nothing to tell of it."
DROPPED = "The question before is dropped."
OFFERING = re.compile(r"\W*(?:how|what) (?:about|if)\b", re.IGNORECASE)
"""A question that is an answer: "what about the red one?"."""


def without_besides(turn: History, before: History) -> tuple[History, str] | Reply:
    """Return the turn without questions answered by one of the person's own, or by "help".

    With it is what the last of them is told, "" if nothing came after the question; or the call
    that has to come first.
    """
    first = turn[0]
    assert isinstance(first, User)
    kept, told, task = list[Message](), "", read_task(first.text)
    for k, message in enumerate(turn):
        if told and not _asks(message):
            continue  # it led to what was told
        told = ""
        asked = _asks(kept[-1]) if kept and isinstance(message, Result) else None
        later = next((n for n, m in enumerate(turn[k:], k) if _asks(m)), len(turn))
        said = _told(task, asked, message.text, turn[k + 1 : later], before) if asked else ""
        if isinstance(said, Reply):
            return said
        if said:
            kept.pop()
            told = said
        else:
            kept.append(message)
    return tuple(kept), told


def saying(told: str, reply: Reply) -> Reply:
    """Return a reply that ends a turn or asks, with what is told first; others unchanged."""
    if not told:
        return reply
    begins = {"ask_user": "question", "report_impossible": "reason"}
    calls = tuple(
        c.model_copy(update={"arguments": c.arguments | {key: f"{told} {c.arguments[key]}"}})
        if (key := begins.get(c.name))
        else c
        for c in reply.calls
    )
    text = f"{told} {reply.text}" if reply.text and not reply.calls else reply.text
    return reply.model_copy(update={"calls": calls, "text": text})


def dropped(turn: History, before: History) -> str:
    """Return a sentence that the open question of the turn before is dropped, or ""."""
    last, first = before[-1] if before else None, turn[0]
    if not (isinstance(last, Result) and last.name == "ask_user" and last.error):
        return ""
    assert isinstance(first, User)
    said = next(m for m in reversed(before) if isinstance(m, User))
    goes_on = read_task(first.text).instruction.startswith(read_task(said.text).instruction)
    return "" if goes_on or any(_asks(m) for m in turn) else DROPPED


def _asks(message: Message) -> Call | None:
    """Return the question that a message asks, or None."""
    calls = message.calls if isinstance(message, Reply) else ()
    return next((c for c in calls if c.name == "ask_user"), None)


def _told(task: Task, asked: Call, words: str, after: History, before: History) -> str | Reply:
    """Return what words are told that do not answer a question, "" if they do; or a call first."""
    options: list[str] = asked.arguments.get("options", [])
    chooses = option_chosen(words, options) is not None or OFFERING.match(words)
    if chooses or says_yes(words):
        return ""
    if task.standing is not None:
        reply = told_beside(task, words, after, before)
        return "" if reply is None else reply if reply.calls else reply.text
    followup = read_followup(words, None)
    if followup.kind == "talk":
        return talk(followup, None, before)
    asks = next(iter(re.findall(r"[a-z']+", words.lower())), "") in ASKING
    return NOTHING_YET if asks or is_question(words, task.metres_per_pixel) else ""
