"""Rules over the trained labels for where phrases for things begin and end.

The model labels word by word; a purpose, a side or a preposition that it includes in a phrase for
a thing would be lost there, because such a phrase only says which thing is meant.
"""

import re
from collections.abc import Sequence
from functools import cache
from importlib import resources
from itertools import pairwise

import yaml

from ...tools.formation.number_words import numbers_in

SIDE = "(?:left|right|top|bottom|upper|lower)(?: - hand| hand)?"
ONLY_SIDE = re.compile(f"it|(?:(?:the|its) )?{SIDE}(?: side| end| edge)?")
"""A phrase that says where at a thing, not which thing."""
SIDE_OF = re.compile(
    f"(?:the |its )?(?:{SIDE}|(?:two |both )?(?:long|short)(?:er)?)"
    "(?: sides?| edges?| end| flanks?)? of "
    r"(?=it|this|that|the (?!two|three|four|\w+[^\Wsu]s\b))"
)
FURTHER = re.compile(
    r"(?:(?:,|;|and|plus|with|then|also|put|another|a further|the other) )+"
    r"(?:(?:a|half a) )?(?:\w+(?: - \w+)? )"
    r"(?:(?:more|others?|further|extra|robots?|bots?|drones?|units?|ones?|of them|go|stand) )*"
    r"(?:on|at|to|along|in|above|below|over|under|beneath|underneath|left|right|by|around)\b"
)
"""Beginning of words about further robots elsewhere: "and another two on the left"."""
LONGEST_LEAD = 12
"""Number of words of the longest such beginning."""
COUNTED = re.compile(
    r"(?:the (?:exact |very )?middle(?= between )|"
    r"(?!one)(\w+) (?:to|at|on|in|around|round|along|inside)(?= ))"
)
"""Words before a thing that is named last: "five to the lid", "the middle between"."""
MIDDLE = re.compile("(?:the |its )(?:very |exact )?(?:centre|center|middle)")
PURPOSE = frozenset(
    (("such", "that"), ("so", "that"), ("so", "they"), ("so", "it"), ("such", "a"), ("in", "order"))
)
"""Two words that begin a purpose."""
OWNED_SIDE = re.compile(f"'s ({SIDE} (?:side|edge)|corners)$")


def trimmed(words: Sequence[str], labels: Sequence[str]) -> tuple[str, ...]:
    """Return the labels with phrases for things corrected to what only says which thing."""
    found = list(labels)
    for start, end in _runs(found, "thing"):
        began = start
        start = min(_behind_number(words, start, end), end)
        while start < end and (words[start] in _lists()["leading"] or _is_verb(words, start)):
            start += 1
        found[began:start] = ["command"] * (start - began)
        if words[start : start + 1] == ["its"] and numbers_in(
            " ".join(words[max(start - 2, 0) : start])
        ):
            found[start:end], start = ["demand"] * (end - start), end  # "and one at its centre"
        headed = _after_verb(words, start, end)
        found[start:headed], start = ["command"] * (headed - start), headed
        while end > start and words[end - 1] in _lists()["trailing"]:
            found[end - 1], end = "demand", end - 1
        cut = min(_passive(words, start, end), _purpose(words, start, end))
        found[cut:end] = ["command"] * (end - cut)
        found[start:cut] = _thing_labels(words, start, cut) if cut > start else []
    for start, end in _runs(found, "demand"):
        for k in range(max(start, 4), end):
            lead = words[k - 4 : k]
            avoids = {*_lists()["avoiding"]} & {*lead} and not numbers_in(" ".join(lead))
            sided = lead[-1] == "of" and lead[-2] in _lists()["sides"]
            before = {*words[max(k - 5, 0) : k]}
            bounded = lead[-1] == "to" and not before.isdisjoint(("closer", "nearer"))
            led = lead[-1] in _lists()["avoided_by"] and (avoids or sided)
            if words[k] in _lists()["determiners"] and (led or bounded):
                stop = next((n for n in range(k, end) if _ends_thing(words[n])), end)
                if not {*_lists()["picture"]} & {*words[k:stop]}:
                    found[k:stop] = ["thing"] * (stop - k)
    _mark_beside(words, found)
    return tuple(found)


def _mark_beside(words: Sequence[str], found: list[str]) -> None:
    """Label as a thing what follows a determiner behind "above", "corner of" and the like."""
    after = _lists()["after"]
    for k in range(1, len(words) - 1):
        led = words[k - 1] in _lists()["beside"]
        led |= words[k - 1] == "of" and words[max(k - 2, 0)] in _lists()["parts"]
        if not led or words[k] not in _lists()["determiners"]:
            continue
        rest = range(k + 1, len(words))
        stop = next((n for n in rest if _ends_thing(words[n]) or words[n] in after), len(words))
        if k + 1 < stop and "thing" not in found[k:stop]:
            found[k:stop] = ["thing"] * (stop - k)


def _further(words: Sequence[str], at: int) -> int:
    """Return past-the-last index of words that begin further robots at a word; 0 if none do."""
    more = FURTHER.match(" ".join(words[at : at + LONGEST_LEAD]))
    return at + len(more[0].split()) if more is not None and numbers_in(more[0]) else 0


def _behind_number(words: Sequence[str], start: int, end: int) -> int:
    """Return where a phrase for a thing begins after a number of robots or "the middle" between."""
    more = _further(words, start) or _further(words, max(start - 1, 0))
    counted = COUNTED.match(" ".join(words[start:end]))
    if counted is not None and (counted[1] is None or numbers_in(counted[1])):
        more = start + len(counted[0].split())
    return more or start


def _is_verb(words: Sequence[str], at: int) -> bool:
    """Return whether a word before a determiner is a verb: "circle the" at the very beginning."""
    return at == 0 and len(words) > 1 and not may_open(words[0]) and may_open(words[1])


def _after_verb(words: Sequence[str], start: int, end: int) -> int:
    """Return where a thing begins after an unknown verb: "desired around" the court."""
    opens = (k for k in range(start, end) if words[k] in _lists()["determiners"])
    first = next(opens, start)
    if first == start:
        return start
    verb = words[start].endswith(("ed", "ing")) or words[start - 1] in _lists()["before_verbs"]
    leads = words[first - 1] in _lists()["leading"]
    return first if verb and leads else start


def may_open(word: str) -> bool:
    """Return whether a further phrase for a thing may begin with a word."""
    return word in _lists()["opening"]


def _ends_thing(word: str) -> bool:
    """Return whether a word or sign ends the words for a thing inside a demand."""
    return not word[0].isalnum() or word in (*_lists()["turned"], "that", "which", "and", "but")


def _thing_labels(words: Sequence[str], start: int, end: int) -> list[str]:
    """Return the labels of a phrase for a thing, up to a purpose or a further number."""
    phrase, count = " ".join(words[start:end]), end - start
    none = (*_lists()["no_thing"], *_lists()["begin_demand"])
    if phrase.startswith(none) or ONLY_SIDE.fullmatch(phrase):
        return ["demand"] * count
    found = ["thing"] * count
    if count > 2 and words[end - 2] == "and" and numbers_in(words[end - 1]):
        found[-2:] = ["command"] * 2
    side = SIDE_OF.match(phrase)
    if side is not None:
        found[: len(side[0].split())] = ["demand"] * len(side[0].split())
    owned = OWNED_SIDE.search(phrase)
    if owned is not None:
        tail = len(owned[1].split())
        found[-tail:] = ["command" if owned[1] == "corners" else "demand"] * tail
    if words[start - 1 : start] == ["of"] and words[start - 2] in _lists()["sides"]:
        turned = next((k for k in range(start + 1, end) if words[k] in _lists()["turned"]), end)
        last = end if ONLY_SIDE.fullmatch(" ".join(words[turned + 1 : end])) else turned + 1
        for k in range(turned - (words[turned - 1] in ("that", "which")), min(last, end)):
            found[k - start] = "demand"
    return _up_to_next(words, start, end, found)


def _up_to_next(words: Sequence[str], start: int, end: int, found: list[str]) -> list[str]:
    """Return the labels of a phrase for a thing, changed from where something else begins."""
    count = end - start
    for k in range(1, count):
        rest = " ".join(words[start + k : end])
        more = min(_further(words, start + k), end)
        if more:
            between = ["command"] * (more - start - k)
            return [*_thing_labels(words, start, start + k), *between, *_place(words, more, end)]
        for label in ("background", "demand"):
            if rest.startswith(tuple(_lists()[f"begin_{label}"])):
                k -= not words[start + k - 1][0].isalnum()
                return found[:k] + [label] * (count - k)
    return found


def _place(words: Sequence[str], start: int, end: int) -> list[str]:
    """Return the labels of words that say where further robots stand."""
    if start == end or MIDDLE.match(" ".join(words[start:end])) is not None:
        return ["demand"] * (end - start)
    if words[start] in _lists()["leading"]:
        return ["command", *_place(words, start + 1, end)]
    return _thing_labels(words, start, end)


def _purpose(words: Sequence[str], start: int, end: int) -> int:
    """Where a purpose begins that is no part of the words for a thing: "such that they hug it"."""
    pairs = (k for k in range(start + 1, end - 1) if (words[k], words[k + 1]) in PURPOSE)
    return next(pairs, end)


def _passive(words: Sequence[str], start: int, end: int) -> int:
    """Return where "encircled by nine drones" begins in a phrase for a thing, else its end."""
    verbs = (k for k in range(start + 1, end - 2) if words[k].endswith("ed"))
    by = (k for k in verbs if words[k + 1] == "by" and numbers_in(" ".join(words[k + 2 : k + 4])))
    return next(by, end)


def _runs(labels: Sequence[str], label: str) -> list[tuple[int, int]]:
    """Return the runs of words with a label, as first and past-the-last index."""
    bounds = [i for i in range(len(labels) + 1) if labels[i - 1 : i] != labels[i : i + 1] or i == 0]
    return [(a, b) for a, b in pairwise(bounds) if labels[a] == label]


@cache
def _lists() -> dict[str, list[str]]:
    text = resources.files(__package__ or "").joinpath("spans.yaml").read_text("utf-8")
    return yaml.safe_load(text)
