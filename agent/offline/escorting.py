"""Words that make robots follow a moving thing: "and keep up with it for a minute"."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ...tools.formation.number_words import numbers_in
from ..first_message import Task
from ..messages import History, Reply, Result
from .standing import Standing

NOT_FOLLOWED = 'Nothing is followed yet: say "follow it" when the robots may move.'

LEAD = (
    r"(?:^|[,;.!]|\band\b|\bthen\b)[\s,]{0,3}(?:(?:and|then|no|yes|ok|okay|now|so|please|just|also|go|"
    r"after that|afterwards|(?:can|could|would|will) you|(?:have|let|make) (?:them|the robots))"
    r"\b[\s,]{0,3}){0,6}"
)
VERB = (
    r"(?:follow|escort|accompany|shadow|"
    r"(?:keep up|keep pace|go along|move along|come along|travel|stay|stick|move|go) with)"
)
WHAT = r"(?P<what>it|them|him|her|this|that|t[0-9]+|(?:the|this|that) (?:[\w-]+ ){0,3}?[\w-]+?)"
COUNTED = r"(?:[0-9]+(?:[.,][0-9]+)? ?|(?:[a-z]+[ -]){1,4}?)"
MOST = r"(?:no|not) (?:more|faster) than|at most|up to|a maximum of"
MOVING = r"(?:moves?|goes|go|drives?|travels?|walks?)(?: around| along| on| off)?"
TAIL = (
    r"(?:[\s,]{0,3}(?:around|along|please|then|for a (?:while|bit|moment)|"
    rf"(?:while|as|when|if|whenever|wherever|where) (?:it|they|he|she) {MOVING}|"
    rf"(?:and )?for (?P<time>{COUNTED})(?P<unit>s|secs?|seconds?|min|minutes?|h|hours?)|"
    rf"(?:and )?(?:(?:at|with|{MOST}) )+(?P<speed>{COUNTED})(?P<length>px|pixels?|m|met(?:re|er)s?)"
    r" ?(?:/|per|an?) ?s(?:ec(?:ond)?)?(?: at most)?)(?!\w))"
)
END = r"(?=\s?(?:[,;.!?]|$|\band\b))"
CLAUSE = re.compile(
    rf"(?:{LEAD}{VERB} {WHAT}(?P<tail>{TAIL}{{0,6}})|"
    rf"\b(?:while|as) it (?:moves|drives)(?: around| along)?){END}",
    re.IGNORECASE,
)
SECONDS = {"s": 1.0, "m": 60.0, "h": 3600.0}


def following(task: Task, turn: History, step: Callable[[Task], Reply]) -> Reply:
    """Return the next step for a task, with permission to follow where its words give it.

    Args:
        task: with the person's own words.
        turn: messages of the turn so far.
        step: returns the next step for the task without the words about following.
    """
    about = Standing.of(task.standing).stood_about if task.standing else ""
    words, follow = without_follow(task.instruction, about, task.metres_per_pixel)
    reply = step(replace(task, instruction=words))
    if follow is None:
        return reply
    driven = any(isinstance(m, Result) and m.name == "deploy" for m in turn)
    calls = [
        call.model_copy(update={"arguments": call.arguments | {"follow": follow}})
        if call.name == "deploy"
        else call
        for call in reply.calls
    ]
    text = reply.text if calls or driven else f"{reply.text} {NOT_FOLLOWED}"
    return reply.model_copy(update={"calls": tuple(calls), "text": text})


def without_follow(
    words: str, things: str, scale: float | None
) -> tuple[str, dict[str, float] | None]:
    """Return the words without those about following, and what these permit.

    Args:
        things: words for what robots stand about, if there is a plan; if nothing else is left of
            the words, they then become "go".
        scale: metres per pixel, None where unknown.

    Returns:
        The rest, and the value of `deploy`'s argument `follow`; None where nothing is to be
        followed, or a thing other than the one that robots stand about.
    """
    found = CLAUSE.search(words)
    if found is None:
        return words, None
    rest = f"{words[: found.start()]} {words[found.end() :]}"
    rest = re.sub(r"^(?:(?:and|then)\b\W*)+", "", rest.strip(" ,;.!?"))
    meant, leave = (found["what"] or "it").lower().split(), _leave(found["tail"] or "", scale)
    known = set(re.findall(r"[\w-]+", f"{rest} {things}".lower()))
    named = (meant[0] != "the" and len(meant) == 1) or meant[-1] in known
    if leave is None or not named or not (rest or things):
        return words, None
    return rest or "go", leave


def _leave(tail: str, scale: float | None) -> dict[str, float] | None:
    """Return for how long, s, and how fast, px/s, as far as given; None if either is not clear."""
    leave: dict[str, Any] = {}
    for part in re.finditer(TAIL, tail, re.IGNORECASE):
        if part["time"]:
            seconds = _number_said(part["time"])
            leave["seconds"] = seconds and seconds * SECONDS[part["unit"][0].lower()]
        if part["speed"]:
            metres, speed = part["length"][0].lower() == "m", _number_said(part["speed"])
            px = 1.0 if not metres else None if scale is None else scale
            leave["speed"] = speed and px and round(speed / px, 2)
    return None if None in leave.values() else leave


def _number_said(text: str) -> float | None:
    """Return a number above 0 in digits or words; None if there is not exactly one."""
    if text.strip().lower() in ("a", "an"):
        return 1.0
    found = numbers_in(text)
    return found[0].least if len(found) == 1 and found[0].least > 0 else None
