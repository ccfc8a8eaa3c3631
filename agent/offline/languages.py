"""Recognises languages that the offline planner does not read, so that it can name them."""

import unicodedata
from collections.abc import Sequence
from functools import cache
from importlib import resources
from typing import Any

import yaml

from .lexicon import fillers

SCRIPTS = {
    "CJK": "Chinese or Japanese",
    "HIRAGANA": "Japanese",
    "KATAKANA": "Japanese",
    "HANGUL": "Korean",
    "CYRILLIC": "a language in Cyrillic letters",
    "ARABIC": "Arabic",
    "GREEK": "Greek",
    "HEBREW": "Hebrew",
    "DEVANAGARI": "Hindi",
    "THAI": "Thai",
}
"""First word of a letter's Unicode name, and the language written with it."""
LEAST_WORDS = 2
"""Least number of words that identify a language; they also have to outnumber the English."""


def foreign_language(words: Sequence[str]) -> str | None:
    """Return the language of an instruction that is not in English; None where it may be English.

    Args:
        words: of the instruction, lower case.
    """
    letters = [unicodedata.name(c, "").split(" ")[0] for w in words for c in w if c.isalpha()]
    script = next((SCRIPTS[name] for name in letters if name in SCRIPTS), None)
    if script is not None and 2 * sum(name in SCRIPTS for name in letters) > len(letters):
        return script
    english = sum(word in fillers() for word in words)
    found = {name: _spoken(words, entry) for name, entry in _languages().items()}
    likeliest = max(found, key=lambda name: found[name])
    return likeliest if found[likeliest] >= max(LEAST_WORDS, english + 1) else None


def _spoken(words: Sequence[str], entry: dict[str, Any]) -> int:
    starts = tuple(entry.get("starts", ()))
    return sum(
        word in entry["words"] or (bool(starts) and word.startswith(starts)) for word in words
    )


@cache
def _languages() -> dict[str, dict[str, Any]]:
    text = resources.files(__package__ or "").joinpath("languages.yaml").read_text("utf-8")
    return yaml.load(text, yaml.BaseLoader)
