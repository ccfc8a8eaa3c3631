"""The words of things.yaml, and the phrases of theirs that occur in a sentence."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import yaml

Words = Sequence[str]
HEADS = ("noun", "shapes")
"""Kinds of phrases that can be a noun."""
STOPS = ",.;:!?"


@dataclass(frozen=True)
class Phrase:
    """A phrase of things.yaml: its kind and value, its length in words, and its last word's ending.

    It is `plural`, or a possessive that `owns` what follows: "the boat's".
    """

    kind: str
    value: str
    length: int
    plural: bool = False
    owns: bool = False


@cache
def table() -> dict[str, Any]:
    """Return things.yaml with every value as text: YAML would read "on" and "no" as booleans."""
    text = resources.files(__package__ or "").joinpath("things.yaml").read_text("utf-8")
    return yaml.load(text, yaml.BaseLoader)


def several(words: Words, at: int) -> bool:
    """Return whether a choice among things follows: "of the two", "among these crates"."""
    opening = phrase(words, at)
    if opening is None or opening.kind != "partitive":
        return False
    after = at + opening.length
    for k in range(after, min(after + 4, len(words))):
        if words[k] in table()["counts"]:
            return True
        found = phrase(words, k)
        if found is not None and found.kind in HEADS:
            return found.plural
    return False


def phrase(words: Words, at: int) -> Phrase | None:
    """Return the longest phrase that begins at a word; None if there is none."""
    for length in range(min(_longest_phrase(), len(words) - at), 0, -1):
        *first, last = words[at : at + length]
        owns = last.endswith("'s")
        whole = _phrases().get((*first, last))
        if whole:
            return Phrase(*whole, length)
        for ending, plural in _endings(last.removesuffix("'s") if owns else last):
            found = _phrases().get((*first, ending))
            if found and (not (plural or owns) or found[0] in HEADS):
                return Phrase(*found, length, plural, owns)
    if words[at : at + 1] and words[at] in table()["modifiers"]:
        found = phrase(words, at + 1)
        if found is not None and found.kind == "relations":
            return Phrase(found.kind, found.value, found.length + 1)
    return None


@cache
def _phrases() -> dict[tuple[str, ...], tuple[str, str]]:
    """Return every phrase of the tables, with its kind and value."""
    words = table()
    found: dict[tuple[str, ...], tuple[str, str]] = {}
    for kind in ("relations", "picks", "traits", "shades", "colours", "shapes"):
        for value, phrases in words[kind].items():
            found |= {tuple(phrase.split()): (kind, value) for phrase in phrases}
    for value, entry in words["nouns"].items():
        found |= {tuple(phrase.split()): ("noun", value) for phrase in entry["words"]}
    found |= {(word,): ("ordinal", str(place)) for word, place in words["ordinals"].items()}
    for kind in ("skip", "partitive"):
        found |= {tuple(phrase.split()): (kind, "") for phrase in words[kind]}
    return found


@cache
def _longest_phrase() -> int:
    return max(map(len, _phrases()))


def _endings(word: str) -> list[tuple[str, bool]]:
    """Return the word and the words that it may be the plural of; true for the latter."""
    found = [(word, False)]
    if word.endswith("ies"):
        found.append((word[:-3] + "y", True))
    if word.endswith("es"):
        found.append((word[:-2], True))
    if word.endswith("s"):
        found.append((word[:-1], True))
    return found
