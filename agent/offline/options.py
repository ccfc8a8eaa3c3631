"""Answers to a question: which of its alternatives they choose, and plain yes and no."""

import re
from collections.abc import Sequence
from typing import Any

from .phrases import table

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
NUMBER = re.compile(r"(?:(?:option|number|no|nr|choice) ?)?([0-9]{1,4})(?:st|nd|rd|th)?")
SAYS_NOTHING = re.compile(
    r"\b(?:yes|yeah|yep|ok|okay|oh|well|um|sorry|please|thanks|thank you|i mean(?:t)?|i think|"
    r"i guess|i would say|i'd say|take|use|pick|choose|make it|that is|it'?s|let'?s say|say|"
    r"the|a|an|one|ones|option of|of them|of those|then|just)\b"
)
AGREEING = {"yes", "yep", "yeah", "ok", "okay", "sure", "right", "correct", "exactly", "go", "do"}
SMALL = {"the", "one", "on", "at", "in", "of", "to", "them", "it", "please", "i", "mean", "is"} | {
    "that", "a", "most", "and", "two", "ahead", "then"
}  # fmt: skip
NUMBERING = {"number", "numbers", "no", "nr", "num", "candidate", "option", "choice", "thing"} | {
    "meant", "take", "pick", "choose", "think", "would", "say", "be", "was", "for", "with", "thanks"
}  # fmt: skip
EXTREMES: dict[str, tuple[str, int]] = {
    **dict.fromkeys(("left", "leftmost", "western"), ("x", -1)),
    **dict.fromkeys(("right", "rightmost", "eastern"), ("x", 1)),
    **dict.fromkeys(("top", "upper", "topmost", "above", "highest", "northern"), ("y", -1)),
    **dict.fromkeys(("bottom", "lower", "lowest", "below", "southern"), ("y", 1)),
    **dict.fromkeys(("big", "bigger", "biggest", "large", "larger", "largest"), ("area", 1)),
    **dict.fromkeys(("small", "smaller", "smallest", "little", "littlest"), ("area", -1)),
}
"""Words of an answer that choose by place or size: a measure, and 1 for most or -1 for least."""
DECLINED = ("no", "nope", "nothing", "none", "no thanks", "never mind", "leave it")


def declines(answer: str) -> bool:
    """Return whether an answer is a plain no."""
    return answer.lower().strip(" .!") in DECLINED


def agrees(answer: str) -> bool:
    """Return whether an answer is a plain yes."""
    words = re.findall(r"[a-z']+", answer.lower())
    return bool(words) and set(words) <= AGREEING | SMALL and bool(set(words) & AGREEING)


def numbered(question: str, options: Sequence[str]) -> str:
    """Return a question with its alternatives numbered from 1."""
    return f"{question} {'; '.join(f'{k}: {o}' for k, o in enumerate(options, 1))}."


def option_chosen(answer: str, options: Sequence[str]) -> str | None:
    """Return the option that an answer chooses by number or rank, or by its words, else None."""
    at = option_at(answer, len(options))
    at = option_named(answer, options) if at is None else at
    return None if at is None else options[at]


def option_at(answer: str, count: int) -> int | None:
    """Return the index that a number from 1 or a rank chooses of `count` options, else None."""
    number = NUMBER.fullmatch(_plain(answer))
    if number is None:
        return ranked(answer, count)
    return int(number[1]) - 1 if 1 <= int(number[1]) <= count else None


def ranked(answer: str, count: int) -> int | None:
    """Return the index that "the second one" or "the last" chooses of `count`, else None."""
    said, two = _plain(answer), {"former": 0, "latter": 1} if count == 2 else {}
    at = ORDINALS.index(said) if said in ORDINALS else two.get(said)
    at = count - 1 if said == "last" else at
    return at if at is not None and 0 <= at < count else None


def option_named(answer: str, options: Sequence[str]) -> int | None:
    """Return the index of the only option that has all words of an answer, else None."""
    said, words = _plain(answer), [_plain(option) for option in options]
    if not said or {*said.split()} & {*table()["differences"]["negation"]}:
        return None
    alike = [k for k, option in enumerate(words) if option == said]
    fitting = alike or [k for k, o in enumerate(words) if {*said.split()} <= {*o.split()}]
    return fitting[0] if len(fitting) == 1 else None


def _plain(text: str) -> str:
    """Return words in lower case without what says nothing of which is meant."""
    return " ".join(re.findall(r"[\w'-]+", SAYS_NOTHING.sub(" ", text.lower())))


def picked(answer: str, offered: Sequence[dict[str, Any]]) -> list[str]:
    """Return the one that "the left one", "the second" or "the blue circle" chooses, as a list.

    Args:
        answer: in lower case.
        offered: the candidates as locate_object gave them, in the order of the question.
    """
    if len(offered) == 1 and agrees(answer):
        return [str(offered[0]["id"])]
    at = ranked(answer, len(offered))
    at = option_named(answer, [str(c.get("label", "")) for c in offered]) if at is None else at
    if at is not None:
        return [str(offered[at]["id"])]
    words = [w for w in re.findall(r"[a-z0-9']+", answer) if w not in SMALL]
    if len(words) != 1 or words[0] not in EXTREMES or not offered:
        return []
    measure, sign = EXTREMES[words[0]]
    return [str(max(offered, key=lambda c: sign * _measure(c, measure))["id"])]


def _measure(candidate: dict[str, Any], name: str) -> float:
    x0, y0, x1, y1 = candidate["box"]
    return {"x": x0 + x1, "y": y0 + y1}.get(name, candidate["area_px"])
