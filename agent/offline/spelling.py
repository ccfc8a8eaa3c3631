"""Rewrites typed text as the vocabularies know it: typos, and variant ways to write something.

A typo is fixed where only one known word can be meant.
"""

import re
from functools import cache
from importlib import resources

from ...tools.formation.number_words import SMALL, TENS
from .followup_words import known_words, lexicon, rules
from .lexicon import fillers
from .phrases import HEADS, phrase, table

KEYS = ("qwertyuiop", "asdfghjkl", "zxcvbnm")
LEAST_CORRECTED = 4
"""Letters of the shortest word that is checked for a typo."""
LEAST_ANY = 6
"""Letters of the shortest word in which any letter may be mistyped, not only as a near key."""
SHORT = {
    slip: word
    for word in ("the", "and", "you", "all", "out", "one", "two", "six", "ten", "far", "bit", "gap")
    for slip in (word[0] + word[2] + word[1], word[1] + word[0] + word[2])
    if slip not in ("net", "owt", "wto")
}
"""Words of three letters with two swapped, unless that is another word."""
NAMING = re.compile(r"(?i)\b(?:(?:an?|the|another|my|your) |(?:the|another|my|your) ([a-z]+) )\Z")
NOUNS = frozenset(
    {"side", "flank", "gap", "quantity", "distanceword", "steps", "team", "much", "lone"}
    | {"robotword", "other", "rest", "portion", "it", "same", "opposite", "nearest", "first"}
)
"""Kinds of phrases that may follow "the" as a name; other kinds, such as verbs, may not."""
NUMBER = rf"(?:[0-9]+|{'|'.join((*SMALL, *TENS))})"
"""Replaces `<n>` in the patterns of followups.yaml."""
UNITS = ("degrees", "pixels", "metres", "meters")


def spelled(text: str) -> str:
    """Return the text as the vocabularies know it, with words one typo off a known one fixed."""
    for pattern, put in _rewritten():
        text = pattern.sub(put, text)
    return re.sub(r"[^\W\d_]+", lambda m: _meant(m[0].lower(), _names(m)) or m[0], text)


def _names(word: re.Match[str]) -> bool:
    """Return whether a word stands where a thing is named: "the fork", "the red one"."""
    before = NAMING.search(word.string, 0, word.start())
    found = phrase([(before[1] or "").lower()], 0) if before else None
    return before is not None and (not before[1] or (found is not None and found.kind not in HEADS))


def normalized_instruction(text: str) -> str:
    """Return a first instruction with short forms expanded and typos in arranging words fixed."""
    for pattern, put in _short_forms():
        text = pattern.sub(put, text)
    return re.sub(r"[^\W\d_]+", lambda m: _arranging(m[0].lower()) or m[0], text)


@cache
def _short_forms() -> list[tuple[re.Pattern[str], str]]:
    """Return the short forms of first instructions in followups.yaml, and their replacements."""
    return [(re.compile(p.replace("<n>", NUMBER)), put) for p, put in rules()["short_forms"]]


@cache
def _arranging(word: str) -> str | None:
    """Return the one word of `arranging` in followups.yaml that is one typo away, else None."""
    known = rules()["arranging"]
    if len(word) < LEAST_ANY or word in known or word in known_words():
        return None
    near = [w for w in known if _is_slip(word, w)]
    return near[0] if len(near) == 1 else None


@cache
def _rewritten() -> list[tuple[re.Pattern[str], str]]:
    """Return patterns of followups.yaml, and the replacement of each."""
    turn = r"(?: of)?(?: an?| the)? (?:turn|way|rotation|revolution)\b(?: a?round)?"
    parts = [
        [rf"(?i)\b(?:(?:an?|one) )?{part}{turn}", f"turn {degrees} degrees"]
        for part, degrees in rules()["parts"].items()
    ]
    return [
        (re.compile(p.replace("<n>", NUMBER)), put)
        for p, put in [*rules()["short_forms"], *rules()["rewritten"], *parts]
    ]


@cache
def _everyday() -> frozenset[str]:
    """Return the everyday English words of everyday.txt that are one typo off another word."""
    text = resources.files(__package__ or "").joinpath("everyday.txt").read_text("utf-8")
    return frozenset(text.split())


@cache
def _meant(word: str, names: bool = False) -> str | None:
    """Return the one meaningful word that is one typo away, unless this is a known word itself.

    Args:
        names: whether the word stands where a thing is named, which may have any name.
    """
    if word in SHORT:
        return SHORT[word]
    known = known_words() | fillers() | {*table()["follow"], *UNITS}
    drawn = [re.sub(r"(.)\1{2,}", put, word) for put in (r"\1", r"\1\1")]  # "sooo"
    if word not in drawn:
        return next((w for w in drawn if w in known), None)
    if len(word) < LEAST_CORRECTED or word in known | _everyday() or phrase([word], 0) is not None:
        return None
    near = [w for w in _meaningful_words() if len(w) >= LEAST_CORRECTED and _is_slip(word, w)]
    if len(near) != 1 or (names and not _may_be_named(word, near[0])):
        return None
    return near[0]


def _may_be_named(typed: str, meant: str) -> bool:
    """Return whether a typo is likelier than another name: "the sied", but not "the fork"."""
    long = max(len(typed), len(meant)) >= LEAST_ANY
    named = any(words[-1] == meant and NOUNS & set(kinds) for words, kinds in lexicon().items())
    replaced = len(typed) == len(meant) and sorted(typed) != sorted(meant)
    return (long and named) if replaced else (long or named)


@cache
def _meaningful_words() -> frozenset[str]:
    """Return the words of phrases that are not fillers, and units."""
    idle = {"filler", "thanks", "hello"}
    phrases = [words for words, kinds in lexicon().items() if not idle & set(kinds)]
    return frozenset(w for words in phrases for w in words if w.isalpha()) - fillers() | {*UNITS}


def _is_slip(typed: str, meant: str) -> bool:
    """Return whether a letter is left out, added, swapped with the next, or mistyped."""
    if typed[0] != meant[0] or abs(len(typed) - len(meant)) > 1:
        return False
    if typed[:-1] == meant:
        return typed[-1] == meant[-1]  # otherwise likelier another form of it: "nicer"
    if len(typed) != len(meant):
        short, long = sorted((typed, meant), key=len)
        return any(long[:k] + long[k + 1 :] == short for k in range(len(long)))
    off = [k for k in range(len(typed)) if typed[k] != meant[k]]
    if len(off) == 2:
        a, b = off
        return b == a + 1 and (typed[a], typed[b]) == (meant[b], meant[a])
    any_letter = len(typed) >= LEAST_ANY
    return len(off) == 1 and (any_letter or _are_near(typed[off[0]], meant[off[0]]))


def _are_near(a: str, b: str) -> bool:
    """Return whether two keys touch."""
    rows = {letter: (y, x) for y, row in enumerate(KEYS) for x, letter in enumerate(row)}
    if a not in rows or b not in rows:
        return False
    return max(abs(p - q) for p, q in zip(rows[a], rows[b], strict=True)) <= 1
